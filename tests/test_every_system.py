"""The whole table of systems through the engine: motions of several lengths to tokens and back, text to motion."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.motion.motion import Motion
from playground.motion.representation import Normaliser
from playground.systems import SYSTEMS, describe
from playground.tokenizers.token_file import TokenFile
from tests.conftest import drifting
from tests.tiny_systems import TRAINED, tiny_system

PROMPT = "a person steps over a log"
SAME = ("lgtok-mid", "lgtok-mini", "lgtok-nodrop", "lgtok-lite")  # lgtok in other sizes
KINDS = tuple(name for name in TRAINED if name not in SAME)
TOKENIZERS = tuple(name for name in KINDS if SYSTEMS[name].tokenizer is not None)
GENERATORS = tuple(name for name in KINDS if SYSTEMS[name].generator is not None)
DRAWERS = tuple(name for name in GENERATORS if name in TOKENIZERS)
TOKENLESS = tuple(name for name in GENERATORS if name not in TOKENIZERS)


@pytest.fixture(scope="module")
def engine(tmp_path_factory) -> Engine:
    """An engine on tiny checkpoints of every system."""
    folder = tmp_path_factory.mktemp("assets")
    normaliser = Normaliser(np.zeros(67, np.float32), np.full(67, 0.05, np.float32))
    for name in TRAINED:
        tiny_system(folder, name, normaliser)
    return Engine(folder)


def ids_of(levels) -> list[list[int]]:
    return [level.ids.tolist() for level in levels]


@pytest.mark.parametrize("name", TRAINED)
def test_the_table_says_what_a_system_has(engine, name):
    row, info = SYSTEMS[name], describe(engine.assets, SYSTEMS[name])
    assert info.checkpoint == "shipped" and info.parameters > 0 and info.data == "tiny"
    assert (info.tokenizer, info.generator) == (row.tokenizer, row.generator)
    full, short = engine.sizes(name, 196), engine.sizes(name, 60)
    assert full == tuple(size for size, _ in engine.scales(name))
    assert len(full) == len(short) == len(engine.codebooks(name))
    if row.latents_are_frames:
        assert short[-1] == 15 and full[-1] == 49


@pytest.mark.parametrize("name", TOKENIZERS)
def test_motions_of_any_length_become_tokens_and_come_back(engine, name):
    for poses in (61, 240):
        motion = Motion(drifting(poses, seed=poses), caption=PROMPT)
        tokenized = engine.tokenize(motion, PROMPT, name)
        frames = min(poses - 1, 196) // 4 * 4
        sizes = tuple(level.size for level in tokenized.levels)
        assert sizes == engine.sizes(name, frames) and tokenized.motion.frames == frames
        assert tokenized.embedding.shape[0] == sizes[-1] == tokenized.per_level.shape[1]
        np.testing.assert_allclose(tokenized.per_level.sum(axis=0), tokenized.embedding, atol=1e-4)
        assert np.isfinite(tokenized.residual_energy).all() and tokenized.residual_energy[0] == pytest.approx(1.0)
        decoded = engine.reconstruct(tokenized)
        assert decoded.motion.joints.shape == (frames, 22, 3) and np.isfinite(decoded.motion.joints).all()
        again = engine.decode(TokenFile.from_json(tokenized.token_file().to_json()))
        np.testing.assert_array_equal(again.features, decoded.features)


@pytest.mark.parametrize("name", TOKENIZERS)
def test_two_threads_give_the_same_tokens(engine, name):
    motion = Motion(drifting(100, seed=4))
    with ThreadPoolExecutor(2) as pool:
        found = [job.result() for job in [pool.submit(engine.tokenize, motion, PROMPT, name) for _ in range(3)]]
    assert all(ids_of(one.levels) == ids_of(found[0].levels) for one in found)
    assert all((one.embedding == found[0].embedding).all() for one in found)


@pytest.mark.parametrize("name", TOKENIZERS)
def test_studies_of_a_short_motion(engine, name):
    tokenized = engine.tokenize(Motion(drifting(61, seed=2)), PROMPT, name)
    study = engine.scale_study(tokenized)
    assert len(study.mpjpe_mm) == len(tokenized.levels) and np.isfinite(study.mpjpe_mm).all()
    scale = len(tokenized.levels)
    last = tokenized.levels[-1]
    assert engine.governed(tokenized, 1).shape == (tokenized.levels[0].size, 2)
    swapped = engine.swap(tokenized, scale, last.size - 1, "opposite")
    assert swapped.levels[-1].ids[-1] != last.ids[-1] and swapped.difference.shape == (60, 22)
    assert engine.prototype(name, scale, 3).motion.frames == 40
    with pytest.raises(PlaygroundError, match="the position"):
        engine.swap(tokenized, scale, last.size, 0)


@pytest.mark.parametrize("name", TOKENIZERS)
def test_tokens_of_another_length_are_refused(engine, name):
    file = engine.tokenize(Motion(drifting(61)), "", name).token_file()
    longer = TokenFile(file.system, file.checkpoint, file.caption, 196, file.levels)
    if engine.sizes(name, 196) == engine.sizes(name, 60):
        assert engine.decode(longer).motion.frames == 196
    else:
        with pytest.raises(PlaygroundError, match="do not fit"):
            engine.decode(longer)


@pytest.mark.parametrize("name", GENERATORS)
def test_text_becomes_a_motion_and_the_seed_decides(engine, name):
    wild = {"cfg": 1.0, "temperature": 2.0, "top_k": 1.0}
    steps = list(engine.generate_steps(PROMPT, 1.2, name, seed=5, **wild))
    assert steps[-1].last and not any(step.last for step in steps[:-1])
    made, other = (engine.generate(PROMPT, 1.2, name, seed=seed, **wild) for seed in (5, 6))
    assert made.motion.frames == 24 and np.isfinite(made.motion.joints).all()
    np.testing.assert_array_equal(made.features, steps[-1].features)
    assert not np.array_equal(made.features, other.features)
    assert [level.size for level in made.levels] == list(engine.sizes(name, 24))
    assert [len(row) for row in made.entropy] == [level.size for level in made.levels]
    free = engine.generate(None, 1.2, name, seed=5)
    assert free.motion.frames == 24 and free.prompt == ""


@pytest.mark.parametrize("name", GENERATORS)
def test_several_seeds_together_are_what_each_is_alone(engine, name):
    together = engine.generate_many(PROMPT, 1.2, name, (3, 8))
    for seed, one in zip((3, 8), together, strict=True):
        alone = engine.generate(PROMPT, 1.2, name, seed=seed)
        assert ids_of(one.levels) == ids_of(alone.levels)
        np.testing.assert_allclose(one.features, alone.features, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("name", DRAWERS)
def test_edits_keep_and_alternatives_are_chances(engine, name):
    edited = engine.edit(Motion(drifting(49, seed=3)), (16, 32), PROMPT, seed=1, system=name)
    np.testing.assert_array_equal(edited.motion.joints[edited.kept], edited.source.joints[edited.kept])
    source = engine.tokenize(Motion(drifting(49, seed=3)), "", name)
    for new, old, redrawn in zip(edited.levels, source.levels, edited.redrawn, strict=True):
        np.testing.assert_array_equal(new.ids[~redrawn], old.ids[~redrawn])
    made = engine.generate(PROMPT, 1.2, name, seed=2)
    for scale in (1, len(made.levels)):
        found = engine.alternatives(made, scale, 1 if made.levels[scale - 1].size > 1 else 0, count=4)
        assert (np.diff(found.probabilities) <= 0).all() and 0 < found.probabilities.sum() <= 1 + 1e-5
    again = engine.regenerate(made, len(made.levels), 0, 4, seed=9)
    assert again.levels[-1].ids[0] == 4
    assert ids_of(again.levels[:-1]) == ids_of(made.levels[:-1])


@pytest.mark.parametrize("name", TOKENLESS)
def test_a_system_without_tokens_says_so(engine, name):
    made = engine.generate(PROMPT, 1.2, name)
    assert (made.levels, made.entropy, engine.scales(name)) == ((), (), [])
    motion = Motion(drifting(61))
    for refused in (
        lambda: engine.tokenize(motion, "", name),
        lambda: engine.edit(motion, (8, 30), PROMPT, system=name),
        lambda: engine.guidance_pair(made),
        lambda: engine.neighbours(name, 1, 0),
        lambda: engine.alternatives(made, 1, 0),
        made.token_file,
    ):
        with pytest.raises(PlaygroundError, match=f"the system {name} has no tokenizer"):
            refused()


def test_a_lent_tokenizer_alone_is_no_system(tmp_path):
    tiny_system(tmp_path, "momaskpp", Normaliser(np.zeros(67, np.float32), np.ones(67, np.float32)))
    assert describe(tmp_path, SYSTEMS["momaskpp"]).checkpoint == "shipped"
    assert describe(tmp_path, SYSTEMS["momaskpp-cross"]).checkpoint == "absent"
    with pytest.raises(PlaygroundError, match=r"momaskpp-cross .*no checkpoint here"):
        Engine(tmp_path).runtime("momaskpp-cross")
