from concurrent.futures import ThreadPoolExecutor

import pytest
import torch
from torch.nn import functional as F

from playground.errors import PlaygroundError
from playground.generators.base import Edit, redraw_masks
from playground.generators.scalewise import running_sums
from playground.nn.sampling import Sampling
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Tokens
from tests.tiny import text_features, tiny_generator

LENGTHS = torch.tensor([40, 20])


def drawn(generator, seed=0, text=None, **options):
    *_, last = generator.steps(text, LENGTHS, Sampling(seed=seed, **options))
    return last.tokens


@pytest.mark.parametrize("cfg", [0.0, 4.0])
@pytest.mark.parametrize("with_text", [True, False])
def test_cached_sampling_equals_uncached_logits(cfg, with_text):
    generator = tiny_generator()
    text = text_features((4, 2)) if with_text else None
    steps = list(generator.steps(text, LENGTHS, Sampling(seed=3, cfg=cfg)))
    net, sums = generator.transformer, running_sums(generator.quantizer, steps[-1].tokens)
    plain = net(sums, net.remember(text, LENGTHS))
    null = net(sums, net.remember(None, LENGTHS))
    for level, step in enumerate(steps):
        ramp = cfg * level / 2 if with_text else 0.0
        expected = (1 + ramp) * plain[level] - ramp * null[level]
        torch.testing.assert_close(step.logits, expected, atol=1e-4, rtol=1e-4)
        assert step.level == level + 1 and len(step.tokens) == level + 1
    assert (plain[0] - null[0]).abs().max() > (1e-2 if with_text else -1)


def test_null_branch_equals_text_states_multiplied_by_zero():
    net = tiny_generator().transformer
    text = text_features((4, 2))
    empty = TextFeatures(text.tokens * 0, text.mask, text.pooled, text.words)
    sums = [torch.randn(2, 6, 12) for _ in range(2)]
    for zero, null in zip(net(sums, net.remember(empty, LENGTHS)), net(sums, net.remember(None, LENGTHS)), strict=True):
        torch.testing.assert_close(zero, null, atol=1e-5, rtol=1e-4)


def test_dropped_rows_equal_the_null_branch():
    net, sums = tiny_generator().transformer, [torch.randn(2, 6, 12) for _ in range(2)]
    dropped = net(sums, net.remember(text_features((4, 2)), LENGTHS, dropped=torch.tensor([True, False])))
    null = net(sums, net.remember(None, LENGTHS))
    torch.testing.assert_close(dropped[2][0], null[2][0], atol=1e-5, rtol=1e-4)
    assert (dropped[2][1] - null[2][1]).abs().max() > 1e-3


def test_a_scale_sees_coarser_scales_and_never_a_finer_one():
    net = tiny_generator().transformer
    memory = net.remember(text_features((4, 2)), LENGTHS)
    sums = [torch.randn(2, 6, 12) for _ in range(2)]
    before = net(sums, memory)
    for changed in (0, 1):
        moved = [total + (3.0 if n == changed else 0.0) for n, total in enumerate(sums)]
        after = net(moved, memory)
        for level in range(3):
            same = torch.equal(before[level], after[level])
            assert same == (level < changed + 1), f"scale {level + 1} when the input of scale {changed + 2} changes"


def test_running_sums_equal_a_slow_loop():
    generator = tiny_generator()
    tokens = drawn(generator)
    total, expected = torch.zeros(2, 6, 12), []
    for level in range(2):
        vectors = generator.quantizer.codebooks[level].vectors[tokens.ids[level]]
        up = (
            vectors
            if vectors.shape[1] == 6
            else F.interpolate(vectors.transpose(1, 2), 6, mode="linear").transpose(1, 2)
        )
        total = total + generator.quantizer.phis[level](up)
        expected.append(total)
    for ours, slow in zip(running_sums(generator.quantizer, tokens), expected, strict=True):
        torch.testing.assert_close(ours, slow)


def test_same_seed_same_tokens_also_with_eight_at_once():
    generator, text = tiny_generator(), text_features((4, 2))
    first = drawn(generator, 7, text)
    assert first == drawn(generator, 7, text) and first != drawn(generator, 8, text)
    with ThreadPoolExecutor(8) as pool:
        seeds = [7, 1, 7, 2, 7, 3, 7, 4]
        results = list(pool.map(lambda s: drawn(generator, s, text), seeds))
    assert all(tokens == first for seed, tokens in zip(seeds, results, strict=True) if seed == 7)


def test_temperature_zero_is_deterministic():
    generator, text = tiny_generator(), text_features((4, 2))
    assert drawn(generator, 1, text, temperature=0.0) == drawn(generator, 2, text, temperature=0.0)


def test_editing_keeps_the_kept_tokens_and_changes_others():
    generator, text = tiny_generator(), text_features((4, 2))
    source = drawn(generator, 1, text)
    keep = torch.tensor([True, True, True, False, False, False])
    edited = generator.edit(source, keep, text, LENGTHS, Sampling(seed=5))
    for level, size in enumerate((1, 3, 6)):
        redraw = F.interpolate((~keep).float()[None, None], size, mode="linear")[0, 0] > 0.5
        assert torch.equal(edited.ids[level][:, ~redraw], source.ids[level][:, ~redraw])
    assert edited != source
    assert generator.edit(source, torch.ones(6, dtype=torch.bool), text, LENGTHS, Sampling(seed=5)) == source
    forced = generator.edit(source, torch.zeros(6, dtype=torch.bool), text, LENGTHS, Sampling(seed=5), forced=2)
    assert all(torch.equal(forced.ids[n], source.ids[n]) for n in range(2))


def test_score_is_the_log_softmax_of_the_given_token():
    generator, text = tiny_generator(), text_features((4, 2))
    tokens = drawn(generator, 1, text)
    net = generator.transformer
    logits = net(running_sums(generator.quantizer, tokens), net.remember(text, LENGTHS))
    for level, scores in enumerate(generator.score(tokens, text, LENGTHS)):
        for b in range(2):
            for position, id in enumerate(tokens.ids[level][b].tolist()):
                row = logits[level][b, position].double()
                expected = float(row[id] - row.exp().sum().log())
                assert float(scores[b, position]) == pytest.approx(expected, abs=1e-4)


def test_text_and_length_matter():
    generator, sums = tiny_generator(), [torch.zeros(2, 6, 12)] * 2
    net = generator.transformer
    one, other = (net(sums, net.remember(text_features((4, 2), seed=s), LENGTHS))[0] for s in (1, 2))
    assert (one - other).abs().max() > 1e-3
    longer = net(sums, net.remember(text_features((4, 2), seed=1), LENGTHS + 8))[0]
    assert (one - longer).abs().max() > 1e-4


def test_positions_of_all_scales_share_one_axis():
    net = tiny_generator().transformer
    assert net.positions(0).tolist() == [0.0]
    assert net.positions(1).tolist() == [0.0, 32.0, 64.0]
    assert net.positions(2)[-1] == 64.0


def test_check_is_called_at_every_scale_and_may_stop():
    calls = []

    def check():
        calls.append(len(calls))
        if len(calls) == 2:
            raise PlaygroundError("stop")

    with pytest.raises(PlaygroundError, match="stop"):
        list(tiny_generator().steps(None, LENGTHS, Sampling(check=check)))
    assert len(calls) == 2


def test_entropy_is_that_of_the_guided_distribution():
    step = next(iter(tiny_generator().steps(text_features((4, 2)), LENGTHS, Sampling())))
    chance = step.logits.double().softmax(-1)
    torch.testing.assert_close(step.entropy.double(), -(chance * chance.log2()).sum(-1), atol=1e-5, rtol=1e-5)


def test_tokens_stay_inside_their_codebooks():
    tokens = drawn(tiny_generator(), 0, text_features((4, 2)), top_k=1.0, top_p=1.0, temperature=2.0)
    assert isinstance(tokens, Tokens) and tokens.sizes == (1, 3, 6)


def test_rows_with_their_own_seeds_do_not_depend_on_the_batch():
    generator, text = tiny_generator(), text_features((4, 2))
    batch = generator.generate(text, LENGTHS, Sampling(seeds=(3, 9))).tokens
    for row, seed in enumerate((3, 9)):
        words = TextFeatures(text.tokens[row : row + 1], text.mask[row : row + 1], text.pooled[row : row + 1], [[]])
        alone = generator.generate(words, LENGTHS[row : row + 1], Sampling(seed=seed)).tokens
        assert all(torch.equal(a[row : row + 1], b) for a, b in zip(batch.ids, alone.ids, strict=True))


def test_masks_of_an_edit_choose_single_tokens():
    generator, text = tiny_generator(), text_features((4, 2))
    source = drawn(generator, 1, text)
    redraw = (torch.tensor([False]), torch.tensor([False, True, False]), torch.ones(6, dtype=torch.bool))
    *_, last = generator.steps(text, LENGTHS, Sampling(seed=9, top_k=1.0), Edit(source, redraw))
    for mine, old, mask in zip(last.tokens.ids, source.ids, redraw, strict=True):
        assert torch.equal(mine[:, ~mask], old[:, ~mask])
    assert last.tokens != source


@pytest.mark.parametrize("forced", [0, 1, 3])
def test_masks_are_resized_linearly_to_every_scale(forced):
    keep = torch.tensor([True, True, False, False, True, True])
    masks = redraw_masks(keep, (1, 3, 6), forced)
    for level, (mask, size) in enumerate(zip(masks, (1, 3, 6), strict=True)):
        for position in range(size):  # the middle of a token, on the axis of the latents
            at = (position + 0.5) * 6 / size - 0.5
            low = int(at // 1)
            share = (1 - at % 1) * float(not keep[low]) + (at % 1) * float(not keep[min(low + 1, 5)])
            assert bool(mask[position]) == (share > 0.5 and level >= forced)
