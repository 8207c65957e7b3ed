"""MoMask++'s forward pass against a slow formula; sizes and training of all masked generators."""

import math
from dataclasses import replace

import pytest
import torch

from playground.generators.base import TokenBatch
from playground.generators.masked import MASKED_PRESETS, MaskedConfig, MaskedResidual
from playground.generators.masked_scales import MASKED_SCALES_PRESETS, MaskedScales, MaskedScalesConfig
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import level_masks
from tests.tiny import text_features
from tests.tiny_masked import KINDS, slow_sinusoid, slow_trunk, text_rows, tiny

LENGTHS = torch.tensor([40, 20])


@pytest.mark.parametrize("kind", ["momask++", "momask++-cross"])
def test_all_scales_at_once_equal_the_slow_formula(kind):
    generator = tiny(kind)
    net, text = generator.network, text_features((4, 2))
    masks = level_masks(generator.tokenizer, LENGTHS)  # 2, 5, 10 tokens and 1, 2, 5
    real, sizes = torch.cat(masks, dim=1), tuple(mask.shape[1] for mask in masks)
    ids = torch.randint(11, real.shape, generator=torch.Generator().manual_seed(4))
    logits = net(ids, real, net.positions(sizes), text.tokens, text.mask)
    for row, own in enumerate(((2, 5, 10), (1, 2, 5))):
        places = [start + i for start, count in zip((0, 3, 9), own, strict=True) for i in range(count)]
        words = text_rows(net.trunk, text.tokens[row, : (4, 2)[row]])
        words = torch.stack([w + slow_sinusoid(p, 16) for p, w in enumerate(words)])
        crossed = kind.endswith("cross")
        vectors = net.tokens.weight[ids[row, real[row]]]
        expected = slow_trunk(net.trunk, vectors, places, None if crossed else words, memory=words if crossed else None)
        net.trunk.head.float()
        torch.testing.assert_close(logits[row, real[row]].double(), expected, atol=1e-4, rtol=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_padded_tokens_never_influence_real_ones(kind):
    generator = tiny(kind)
    net, text, rng = generator.network, text_features((4, 2)), torch.Generator().manual_seed(5)
    masks = level_masks(generator.tokenizer, LENGTHS)
    first, other = (tuple(torch.randint(9, mask.shape, generator=rng) for mask in masks) for _ in range(2))
    changed = tuple(torch.where(mask, a, b) for mask, a, b in zip(masks, first, other, strict=True))
    outs = []
    for ids in (first, changed):
        if isinstance(net, MaskedResidual):
            level = torch.tensor([2, 1])
            outs.append([net.masked(ids[0], masks[0], text.pooled), net.residual(ids, level, masks[0], text.pooled)])
        else:
            joined, real = torch.cat(ids, dim=1), torch.cat(masks, dim=1)
            places = net.positions(tuple(mask.shape[1] for mask in masks))
            outs.append([net(joined, real, places, text.tokens, text.mask)])
    real = masks[0] if isinstance(net, MaskedResidual) else torch.cat(masks, dim=1)
    for before, after in zip(*outs, strict=True):
        assert torch.equal(before[real], after[real])
    assert bool(real.all()) == (kind == "momask-lgtok")


def count(module) -> float:
    return round(sum(p.numel() for p in module.parameters()) / 1e6, 2)


def test_the_full_presets_are_as_large_as_the_published_models():
    with torch.device("meta"):
        net = MaskedResidual(MASKED_PRESETS["full"])
        assert (count(net.masked), count(net.residual)) == (12.05, 13.36)
        snap = replace(MASKED_SCALES_PRESETS["full"], scales=(40, 80), codes=(2048,) * 2)
        assert round(count(MaskedScales(snap)), 1) == 13.5
        assert round(count(MaskedScales(replace(snap, variant="cross"))), 1) == 18.3


def test_unequal_levels_and_codebooks_are_refused():
    for scales, codes in (((6, 6), (9, 8)), ((3, 6), (9, 9)), ((6,), (9,))):
        with pytest.raises(ValueError):
            MaskedConfig(scales=scales, codes=codes)
    with pytest.raises(ValueError):
        MaskedScalesConfig(scales=(3, 6), codes=(9,))


def toy_batch(generator, rows=8):
    """Tokens that the text says: text number k stands for code k everywhere; also for a length."""
    lengths = torch.tensor([24 + 4 * (row % 4) for row in range(rows)])
    masks = level_masks(generator.tokenizer, lengths)
    words = torch.eye(20)[torch.arange(rows) % 4].repeat(1, 2).view(rows, 2, 20) * 3
    text = TextFeatures(words, torch.ones(rows, 2, dtype=torch.bool), words[:, 0], [[] for _ in range(rows)])
    ids = tuple(((torch.arange(rows)[:, None] % 4 + level) % 9) * mask for level, mask in enumerate(masks))
    return TokenBatch(ids, masks, lengths, text, torch.zeros(rows, dtype=torch.bool))


@pytest.mark.parametrize("kind", KINDS)
def test_training_loss_falls_on_a_toy_problem(kind):
    generator = tiny(kind)
    with torch.random.fork_rng():
        torch.manual_seed(0)
        small = kind in ("momask", "momask++-cross")  # either way to begin is trained twice
        network = type(generator.network)(replace(generator.network.config, small_init=small))
    batch, rng = toy_batch(generator), torch.Generator().manual_seed(0)
    optimiser = torch.optim.AdamW(network.parameters(), lr=1e-2)
    losses, rights = [], []
    for _ in range(40):
        loss, right = network.training_loss(batch, generator.quantizer, rng)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(float(loss.detach()))
        rights.append(float(right))
    assert sum(losses[-5:]) < 0.5 * sum(losses[:5])
    assert min(rights) >= 0 and max(rights) <= 1 and sum(rights[-5:]) > 2 * sum(rights[:5])
    missing = [name for name, p in network.named_parameters() if p.grad is None]
    assert not missing


@pytest.mark.parametrize("kind", KINDS)
def test_training_draws_come_from_the_given_source(kind):
    generator = tiny(kind)
    batch = toy_batch(generator)

    def loss(seed):
        return float(generator.network.training_loss(batch, None, torch.Generator().manual_seed(seed))[0])

    assert loss(1) == loss(1) != loss(2)


@pytest.mark.parametrize("kind", ["momask", "momask++", "momask++-cross"])
def test_dropped_rows_do_not_see_their_text(kind):
    generator = tiny(kind, **({"length_classes": 0} if kind == "momask" else {}))
    batch = replace(toy_batch(generator), dropped=torch.ones(8, dtype=torch.bool))
    other = replace(batch, text=TextFeatures(batch.text.tokens + 1, batch.text.mask, batch.text.pooled + 1, []))
    losses = [generator.network.training_loss(b, None, torch.Generator().manual_seed(1))[0] for b in (batch, other)]
    assert torch.equal(*losses)
    seen = replace(other, dropped=~batch.dropped)
    assert generator.network.training_loss(seen, None, torch.Generator().manual_seed(1))[0] != losses[0]


def test_the_residual_half_learns_low_levels_more_often(monkeypatch):
    network = tiny("momask", scales=(12,) * 6, codes=(9,) * 6).network
    levels = []
    forward = network.residual.forward

    def watched(ids, level, real, pooled):
        levels.extend(level.tolist())
        return forward(ids, level, real, pooled)

    monkeypatch.setattr(network.residual, "forward", watched)
    ids = tuple(torch.zeros(600, 1, dtype=torch.long) for _ in range(6))
    masks = tuple(torch.ones(600, 1, dtype=torch.bool) for _ in range(6))
    text = TextFeatures(torch.zeros(600, 1, 20), torch.ones(600, 1, dtype=torch.bool), torch.zeros(600, 20), [])
    batch = TokenBatch(ids, masks, torch.full((600,), 40), text, torch.zeros(600, dtype=torch.bool))
    network.training_loss(batch, None, torch.Generator().manual_seed(3))
    for level in range(1, 6):  # round((1 - cos(pi u / 2)) * 4) + 1 == level for u between these
        low, high = (2 / math.pi * math.acos(1 - min(max((level - 1 + x) / 4, 0), 1)) for x in (-0.5, 0.5))
        assert levels.count(level) / 600 == pytest.approx(high - low, abs=0.06)


def test_the_residual_half_loses_more_texts_while_it_trains(monkeypatch):
    network, seen = tiny("momask", residual_drop=1.0).network, []
    forward = network.residual.forward
    monkeypatch.setattr(network.residual, "forward", lambda *inputs: (seen.append(inputs[3]), forward(*inputs))[1])
    batch = toy_batch(tiny("momask"))
    for training in (True, False):
        network.train(training).training_loss(batch, None, torch.Generator().manual_seed(1))
    assert not seen[0].any() and torch.equal(seen[1], batch.text.pooled)
