"""MoMask's forward passes against slow formulas; drawing and editing by all masked generators."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.nn import functional as F

from playground.errors import PlaygroundError
from playground.generators.base import Edit
from playground.generators.masked import MaskedGenerator
from playground.nn.sampling import Sampling
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Tokens, level_masks
from tests.tiny import text_features
from tests.tiny_masked import KINDS, one_text, slow_trunk, text_rows, tiny

LENGTHS = torch.tensor([40, 20])


def test_masked_transformer_equals_the_slow_formula():
    net = tiny("momask").network.masked
    text, ids = text_features((4, 2)), torch.tensor([[3, 9, 0, 9, 8], [1, 9, 10, 10, 10]])
    real = torch.tensor([[True] * 5, [True, True, False, False, False]])
    logits = net(ids, real, text.pooled)
    for row, count in enumerate((5, 2)):
        prefix = text_rows(net.trunk, text.pooled[row : row + 1])
        expected = slow_trunk(net.trunk, net.tokens.weight[ids[row, :count]], range(count), prefix)
        net.trunk.head.float()
        torch.testing.assert_close(logits[row, :count].double(), expected, atol=1e-4, rtol=1e-4)


def test_residual_transformer_equals_the_slow_formula():
    net = tiny("momask").network.residual
    text, rng = text_features((4, 2)), torch.Generator().manual_seed(2)
    ids = tuple(torch.randint(9, (2, 5), generator=rng) for _ in range(3))
    real = torch.tensor([[True] * 5, [True, True, True, False, False]])
    level = torch.tensor([1, 2])
    logits = net(ids, level, real, text.pooled)
    for row, count in enumerate((5, 3)):
        known = int(level[row])
        vectors = sum(net.tables[below][ids[below][row, :count]] for below in range(known))
        prefix = torch.cat([text_rows(net.trunk, text.pooled[row : row + 1]), net.level.weight[known].double()[None]])
        out = slow_trunk(net.trunk, vectors, range(count), prefix)
        net.trunk.head.float()
        torch.testing.assert_close(
            logits[row, :count].double(), out @ net.tables[known].double().T, atol=1e-4, rtol=1e-4
        )


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=12, deadline=None)
@given(data=st.data())
def test_kept_tokens_never_change(kind, data):
    generator, text = tiny(kind), text_features((4, 2))
    masks = level_masks(generator.tokenizer, LENGTHS)
    rng = torch.Generator().manual_seed(data.draw(st.integers(0, 2**31)))
    source = Tokens(tuple(torch.randint(9, mask.shape, generator=rng) * mask for mask in masks), (9,) * 3)
    share = data.draw(st.sampled_from([0.0, 0.1, 0.5, 1.0]))
    redraw = tuple(torch.rand(mask.shape, generator=rng) < share for mask in masks)
    sampling = Sampling(seed=data.draw(st.integers(0, 2**31)), cfg=2.0, temperature=2.0, top_k=1.0)
    seen = []
    for step in generator.steps(text, LENGTHS, sampling, Edit(source, redraw)):
        seen.append(step.level)
        for mine, old, again, mask in zip(step.tokens.ids, source.ids, redraw, masks, strict=False):
            assert torch.equal(mine[~again], old[~again])
            assert bool((mine[~mask] == 0).all())
    assert seen == ([1, 2, 3] if isinstance(generator, MaskedGenerator) else [3])
    if share == 0.0:
        assert step.tokens == source


@pytest.mark.parametrize("kind", KINDS)
def test_editing_redraws_the_latents_that_are_not_kept(kind):
    generator, text = tiny(kind), text_features((4, 2))
    sampling = Sampling(seed=3, temperature=2.0, top_k=1.0)
    source = generator.generate(text, LENGTHS, sampling).tokens
    latents = source.ids[-1].shape[1]
    keep = torch.arange(latents) < latents // 2
    edited = generator.edit(source, keep, text, LENGTHS, replace(sampling, seed=5))
    assert not torch.equal(edited.ids[-1], source.ids[-1])
    for row, frames in enumerate(LENGTHS.tolist()):
        sizes = generator.tokenizer.sizes(frames)
        own = (~keep)[: sizes[-1]].float()[None, None]
        for level, size in enumerate(sizes):
            again = F.interpolate(own, size, mode="linear")[0, 0] > 0.5
            assert torch.equal(edited.ids[level][row, :size][~again], source.ids[level][row, :size][~again])
    everything = torch.ones(latents, dtype=torch.bool)
    assert generator.edit(source, everything, text, LENGTHS, sampling) == source


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("with_text", [True, False])
def test_same_seed_same_tokens_also_with_eight_at_once(kind, with_text):
    generator, text = tiny(kind), text_features((4, 2)) if with_text else None

    def drawn(seed):
        return generator.generate(text, LENGTHS, Sampling(seed=seed, cfg=2.0)).tokens

    first = drawn(7)
    with ThreadPoolExecutor(8) as pool:
        results = list(pool.map(drawn, (7, 1, 7, 2, 7, 3, 7, 4)))
    assert all(tokens == first for tokens in results[::2]) and first not in results[1::2]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("with_text", [True, False])
def test_a_row_of_a_batch_equals_the_row_alone(kind, with_text):
    generator, text = tiny(kind), text_features((4, 2))
    batch = list(generator.steps(text if with_text else None, LENGTHS, Sampling(seeds=(3, 9))))
    latents = batch[-1].tokens.ids[-1].shape[1]
    keep = torch.arange(latents) % 3 > 0
    edited = generator.edit(batch[-1].tokens, keep, text, LENGTHS, Sampling(seeds=(4, 4), temperature=2.0))
    for row, seed in enumerate((3, 9)):
        length, words = LENGTHS[row : row + 1], one_text(text, row)
        alone = list(generator.steps(words if with_text else None, length, Sampling(seed=seed)))
        for step, own in zip(batch, alone, strict=True):
            for ids, expected in zip(step.tokens.ids, own.tokens.ids, strict=True):
                assert (
                    torch.equal(ids[row, : expected.shape[1]], expected[0]) and not ids[row, expected.shape[1] :].any()
                )
            size = own.embedding.shape[1]
            torch.testing.assert_close(step.embedding[row, :size], own.embedding[0], atol=1e-5, rtol=1e-5)
        again = generator.edit(alone[-1].tokens, keep, words, length, Sampling(seed=4, temperature=2.0))
        for ids, expected in zip(edited.ids, again.ids, strict=True):
            assert torch.equal(ids[row, : expected.shape[1]], expected[0])


@pytest.mark.parametrize("kind", KINDS)
def test_guidance_of_one_reads_the_text_alone_and_of_zero_no_text(kind):
    generator, text = tiny(kind, iterations=1), text_features((4, 4))
    empty = TextFeatures(text.tokens * 0, text.mask, text.pooled * 0, text.words)

    def first(words, cfg):
        return next(iter(generator.steps(words, LENGTHS, Sampling(cfg=cfg)))).logits

    plain, null, more = first(text, 1.0), first(text, 0.0), first(text, 3.0)
    torch.testing.assert_close(null, first(empty, 1.0), atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(more, null + 3 * (plain - null), atol=1e-4, rtol=1e-4)
    assert (plain - null).abs().max() > 1e-2


def test_free_form_reads_a_text_of_zeros():
    for kind, words in (("momask", 1), ("momask++", 3), ("momask++-cross", 3)):
        generator = tiny(kind)
        zeros = torch.zeros(2, words, 20)
        empty = TextFeatures(zeros, torch.ones(2, words, dtype=torch.bool), zeros[:, 0], [[], []])
        free = generator.generate(None, LENGTHS, Sampling(seed=2))
        assert free.tokens == generator.generate(empty, LENGTHS, Sampling(seed=2, cfg=1.0)).tokens


@pytest.mark.parametrize("kind", ["momask", "momask-lgtok"])
@pytest.mark.parametrize("cfg", [5.0, 2.0])  # while drawing and while editing, where the masked half has 4 (B3)
def test_residual_levels_are_drawn_from_what_the_transformer_says(kind, cfg):
    generator, text = tiny(kind), text_features((4, 2))
    net, real = generator.network.residual, level_masks(generator.tokenizer, LENGTHS)[0]
    edit = Edit(Tokens((real.long(),) * 3, (9,) * 3), (real,) * 3) if cfg == 2.0 else None
    steps = list(generator.steps(text, LENGTHS, Sampling(seed=1, cfg=4.0, top_k=0.1), edit))
    for level in (1, 2):
        ids, which = steps[-1].tokens.ids[:level], torch.full((2,), level)
        plain, null = (net(ids, which, real, text.pooled * on) for on in (1, 0))
        expected = null + cfg * (plain - null)
        torch.testing.assert_close(steps[level].logits, expected, atol=1e-3, rtol=1e-4)
        top = expected.topk(1, dim=-1).indices[..., 0]  # a tenth of nine codes is one
        assert torch.equal(steps[level].tokens.ids[level][real], top[real])
        chance = steps[level].logits.double().softmax(-1)
        entropy = -(chance * chance.clamp(min=1e-300).log2()).sum(-1)
        torch.testing.assert_close(steps[level].entropy.double(), entropy, atol=1e-4, rtol=1e-4)
        assert steps[level].level == level + 1 and len(steps[level].tokens) == level + 1


@pytest.mark.parametrize("kind", KINDS)
def test_the_embedding_is_that_of_the_tokens_and_shapes_are_those_of_the_step(kind):
    generator = tiny(kind)
    *_, last = generator.steps(text_features((4, 2)), LENGTHS, Sampling())
    torch.testing.assert_close(last.embedding, generator.tokenizer.embed(last.tokens, None, LENGTHS))
    new = sum(last.tokens.sizes) if kind.startswith("momask++") else last.tokens.sizes[-1]
    assert last.logits.shape == (2, new, 9) and last.entropy.shape == (2, new)
    assert generator.quantizer is generator.tokenizer.quantizer and not generator.likelihood


@pytest.mark.parametrize(("kind", "passes"), [("momask", 4 + 2), ("momask++", 6), ("momask++-cross", 6)])
def test_check_is_called_in_every_pass_and_may_stop_each(kind, passes):
    generator, calls = tiny(kind), []
    generator.generate(None, LENGTHS, Sampling(check=lambda: calls.append(1)))
    assert len(calls) == passes
    for stop in range(1, passes + 1):
        left = iter(range(stop - 1))

        def check(left=left):
            if next(left, None) is None:
                raise PlaygroundError("stop")

        with pytest.raises(PlaygroundError, match="stop"):
            list(generator.steps(None, LENGTHS, Sampling(check=check)))


def test_length_estimates_are_probabilities_of_the_text():
    generator, text = tiny("momask"), text_features((4, 2))
    chance = generator.estimate_length(text)
    assert chance.shape == (2, 50)
    torch.testing.assert_close(chance.sum(dim=1), torch.ones(2))
    assert (chance[0] - chance[1]).abs().max() > 1e-4
    assert generator.network.length_class(torch.tensor([16, 40, 43, 196, 900])).tolist() == [4, 10, 10, 49, 49]
    with pytest.raises(PlaygroundError, match="without an estimator"):
        tiny("momask", length_classes=0).estimate_length(text)
