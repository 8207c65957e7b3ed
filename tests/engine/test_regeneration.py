"""Several seeds at once, alternatives of a token, and drawing anew from a scale on."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
import torch

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.nn.sampling import filter_logits
from playground.results import Generation
from playground.tokenizers.base import Tokens
from tests.engine.conftest import PROMPT


def same(first: Generation, second: Generation) -> list[bool]:
    return [np.array_equal(a.ids, b.ids) for a, b in zip(first.levels, second.levels, strict=True)]


def test_seeds_drawn_together_are_those_drawn_alone(engine):
    seeds = (4, 9, 0, 7)
    together = engine.generate_many(PROMPT, 3.0, seeds=seeds, cfg=2.0)
    for seed, one in zip(seeds, together, strict=True):
        alone = engine.generate(PROMPT, 3.0, seed=seed, cfg=2.0)
        assert all(same(one, alone)) and one.seed == seed and one.sampling == alone.sampling
        np.testing.assert_allclose(one.motion.joints, alone.motion.joints, atol=1e-4)
        for a, b in zip(one.entropy, alone.entropy, strict=True):
            np.testing.assert_allclose(a, b, atol=1e-4)
    assert not all(same(together[0], together[1]))
    steps = list(engine.generate_many_steps(PROMPT, 3.0, seeds=seeds, cfg=2.0))
    assert [len(step) for step in steps] == [4, 4, 4] and [step[0].level for step in steps] == [1, 2, 3]
    np.testing.assert_array_equal(steps[-1][2].motion.joints, together[2].motion.joints)


@pytest.mark.parametrize("seeds", [(), (1, 1), tuple(range(LIMITS.max_seeds + 1)), (-1,), (0, 2**40)])
def test_bad_seeds_are_one_sentence(engine, seeds):
    with pytest.raises(PlaygroundError, match="seed"):
        engine.generate_many(PROMPT, 3.0, seeds=seeds)
    with pytest.raises(PlaygroundError, match="are accepted"):
        engine.generate_many(PROMPT, 3.0, speed=3)


def slow_logits(engine, generation, level):
    """Guided logits [s, V] of one level of a generation, all coarser ones given: teacher forcing, no cache."""
    runtime = engine.runtime(generation.system)
    tokens = Tokens(tuple(torch.from_numpy(o.ids)[None] for o in generation.levels), (8, 10, 12))
    lengths = torch.tensor([generation.motion.frames])
    worded = runtime.generator.logits(tokens, runtime.text(generation.prompt), lengths)[level][0]
    bare = runtime.generator.logits(tokens, None, lengths)[level][0]
    ramp = generation.sampling.cfg * level / 2
    return (1 + ramp) * worded - ramp * bare


@pytest.mark.parametrize("scale", [1, 2, 3])
def test_alternatives_are_the_distribution_drawn_from(engine, generation, scale):
    logits = slow_logits(engine, generation, scale - 1)
    for position in range(generation.levels[scale - 1].size):
        found = engine.alternatives(generation, scale, position, count=64)
        chance = logits[position].double().softmax(-1).numpy()
        assert sorted(found.codes) == list(range((8, 10, 12)[scale - 1]))
        np.testing.assert_allclose(found.probabilities, chance[found.codes], atol=1e-4)
        assert (np.diff(found.probabilities) <= 0).all()
        kept = filter_logits(logits[position], generation.sampling.top_k, generation.sampling.top_p).softmax(-1).numpy()
        np.testing.assert_allclose(found.chances, kept[found.codes], atol=1e-4)
        assert found.chosen == generation.levels[scale - 1].ids[position]
        assert found.chances[found.codes.tolist().index(found.chosen)] > 0  # it was drawn
        assert found.chosen_probability == pytest.approx(chance[found.chosen], abs=1e-4)
        assert found.entropy == pytest.approx(-(chance * np.log2(chance)).sum(), abs=1e-3)
        assert found.entropy == pytest.approx(generation.entropy[scale - 1][position], abs=1e-4)


def test_alternatives_of_a_real_motion_and_of_free_form(engine, tokenized):
    found = engine.alternatives(tokenized, 2, 0, count=3)
    assert len(found.codes) == 3 and found.chosen == tokenized.levels[1].ids[0]
    free = engine.generate(None, 3.0, seed=2, temperature=0.0)
    sure = engine.alternatives(free, 3, 5)
    assert sure.codes[0] == sure.chosen and sure.chances.tolist() == [1.0] + [0.0] * 7


def test_the_same_seed_gives_the_same_motion_from_any_scale(engine, generation):
    for scale in (1, 2, 3):
        again = engine.regenerate(generation, scale)
        assert all(same(again, generation)) and again.seed == generation.seed
        np.testing.assert_array_equal(again.motion.joints, generation.motion.joints)


@pytest.mark.parametrize("scale", [1, 2, 3])
def test_earlier_scales_stay_and_later_ones_are_drawn(engine, generation, scale):
    made = [engine.regenerate(generation, scale, seed=seed) for seed in range(20, 26)]
    for one in made:
        assert all(same(one, generation)[: scale - 1])
    assert any(not same(one, generation)[scale - 1] for one in made)


def test_a_forced_token_stands_and_the_rest_of_its_scale_stays(engine, generation):
    position, before = 1, int(generation.levels[1].ids[1])
    code = (before + 4) % 10
    made = engine.regenerate(generation, 2, position, code)
    assert made.levels[1].ids[position] == code
    others = np.arange(3) != position
    np.testing.assert_array_equal(made.levels[1].ids[others], generation.levels[1].ids[others])
    assert same(made, generation) == [True, False, same(made, generation)[2]]
    kept = engine.regenerate(generation, 2, position, before)
    assert all(same(kept, generation))
    elsewhere = engine.regenerate(generation, 2, position, code, seed=77)
    assert elsewhere.levels[1].ids[position] == code and same(elsewhere, generation)[0]
    decoded = engine.decode(made.token_file(), guidance=made.sampling.guidance)
    np.testing.assert_allclose(decoded.motion.joints, made.motion.joints, atol=1e-5)


def test_finer_scales_follow_the_forced_token(engine):
    """What comes after is drawn given the forced token: at temperature 0 it is the arg max of those logits."""
    source = engine.generate(PROMPT, 3.0, temperature=0.0)
    made = engine.regenerate(source, 1, 0, (int(source.levels[0].ids[0]) + 1) % 8)
    for level in (1, 2):
        np.testing.assert_array_equal(made.levels[level].ids, slow_logits(engine, made, level).argmax(-1).numpy())


def test_steps_and_callers_at_once(engine, generation):
    steps = list(engine.regenerate_steps(generation, 2, 0, 3, seed=5))
    whole = engine.regenerate(generation, 2, 0, 3, seed=5)
    assert [step.level for step in steps] == [1, 2, 3] and len(steps[-1].entropy) == 3
    np.testing.assert_array_equal(steps[-1].motion.joints, whole.motion.joints)
    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(lambda _: engine.regenerate(generation, 2, 0, 3, seed=5), range(8)))
        asked = list(pool.map(lambda _: engine.alternatives(generation, 3, 2), range(8)))
    for one in made:
        np.testing.assert_array_equal(one.motion.joints, whole.motion.joints)
    for other in asked:
        np.testing.assert_array_equal(other.probabilities, asked[0].probabilities)


@pytest.mark.parametrize("wrong", [(0,), (4,), (2, 3, 0), (2, 0, 10), (2, 0, None), (2, None, 1), (2, 0, "x"), ("a",)])
def test_bad_requests_are_one_sentence(engine, generation, wrong):
    with pytest.raises(PlaygroundError, match=r"is accepted|whole number|give"):
        engine.regenerate(generation, *wrong)
    with pytest.raises(PlaygroundError, match="seed"):
        engine.regenerate(generation, 1, seed=-5)
    with pytest.raises(PlaygroundError, match="accepted"):
        engine.regenerate(replace(generation, sampling=replace(generation.sampling, cfg=99.0)), 1)
    for deadline in (engine.regenerate, engine.alternatives):
        with pytest.raises(PlaygroundError, match="took longer"):
            deadline(generation, 2, 0, 1, deadline=0.0)
