from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.nn import functional as F

from playground.data.batches import synthetic_samples
from playground.motion.representation import Normaliser
from playground.motion.synthetic import corpus
from playground.tokenizers.base import Tokens, level_masks
from playground.tokenizers.convolutional import CONV_PRESETS, ConvTokenizer, build_conv

SYSTEMS = ("t2mgpt", "momask", "momaskpp", "mosa", "mogo")
COUNTED = tuple(name for name in SYSTEMS if name != "mosa")


@cache
def tiny(name: str, seed: int = 0, **changes) -> ConvTokenizer:
    """A system's tokenizer with a few thousand weights, codebooks and affine levels filled, in evaluation mode."""
    config = CONV_PRESETS[name]
    few = (7,) * len(config.codes)
    config = replace(config, width=8, code_width=6, heads=2, codes=few, dropout=0.0, **changes)
    if config.fixed_scales and "fixed_scales" not in changes:
        config = replace(config, max_frames=48, fixed_scales=(1, 3, 12), codes=few[:3])
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        model = build_conv(config).eval().requires_grad_(False)
        for book in model.quantizer.codebooks:
            book.vectors.normal_()
        for affine in model.quantizer.affines:
            affine.log_scale.normal_(std=0.3)
            affine.bias.normal_(std=0.3)
    return model


def motions(lengths: list[int], seed: int = 0, noise: float = 0.0) -> torch.Tensor:
    """Random features, zero (or noise) beyond each length."""
    rng = torch.Generator().manual_seed(seed)
    x = torch.randn(len(lengths), max(lengths), 67, generator=rng)
    for row, length in enumerate(lengths):
        x[row, length:] *= noise
    return x


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("lengths", [[48, 20, 36], [46, 17, 5]])
def test_a_row_of_a_batch_equals_the_row_alone(name, lengths):
    model = tiny(name)
    x, sizes = motions(lengths, noise=3.0), torch.tensor(lengths)
    together = model.encode(x, sizes, None)
    decoded = model.decode(together.embedding, sizes, None)
    assert together.tokens.sizes == model.sizes(max(lengths)) and decoded.shape == (3, max(lengths), 67)
    for row, length in enumerate(lengths):
        only, one = slice(row, row + 1), torch.tensor([length])
        alone = model.encode(x[only, :length], one, None)
        count = alone.embedding.shape[1]
        for ids, own, size in zip(together.tokens.ids, alone.tokens.ids, model.sizes(length), strict=True):
            assert own.shape == (1, size) and torch.equal(ids[only, :size], own)
            assert not ids[only, size:].any()
        torch.testing.assert_close(together.embedding[only, :count], alone.embedding, atol=1e-5, rtol=1e-4)
        torch.testing.assert_close(together.residual_norm[:, only], alone.residual_norm, atol=1e-5, rtol=1e-4)
        assert not together.embedding[row, count:].any() and not decoded[row, length:].any()
        torch.testing.assert_close(
            decoded[only, :length], model.decode(alone.embedding, one, None), atol=1e-4, rtol=1e-4
        )


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(SYSTEMS), st.integers(1, 48), st.integers(0, 48), st.integers(0, 10**6))
def test_padded_frames_never_change_tokens(name, length, padding, seed):
    model = tiny(name)
    x, lengths = motions([length], seed), torch.tensor([length])
    junk = torch.cat([x, torch.randn(1, padding, 67) * 100], dim=1)
    plain, padded = model.encode(x, lengths, None), model.encode(junk, lengths, None)
    assert plain.tokens == padded.tokens and plain.tokens.sizes == model.sizes(length)
    torch.testing.assert_close(padded.embedding, plain.embedding, atol=1e-4, rtol=1e-4)


@pytest.mark.parametrize("name", SYSTEMS)
def test_embed_gives_back_what_encode_saw(name):
    model, lengths = tiny(name), torch.tensor([48, 20])
    quantized = model.encode(motions([48, 20]), lengths, None)
    torch.testing.assert_close(model.embed(quantized.tokens, lengths=lengths), quantized.embedding)
    first = model.embed(quantized.tokens, 1, lengths)
    torch.testing.assert_close(first, quantized.per_level[0])
    row = Tokens(tuple(ids[1:] for ids in quantized.tokens.ids), quantized.tokens.codes)  # still padded
    only = model.embed(row, lengths=lengths[1:])
    torch.testing.assert_close(only, quantized.embedding[1:, : only.shape[1]], atol=1e-5, rtol=1e-4)
    whole = model.encode(motions([48]), lengths[:1], None)
    torch.testing.assert_close(model.embed(whole.tokens), whole.embedding)


@pytest.mark.parametrize(
    ("name", "full", "short"),
    [
        ("t2mgpt", (49,), (16,)),
        ("momask", (49,) * 6, (16,) * 6),
        ("momaskpp", (6, 12, 24, 49), (2, 4, 8, 16)),
        ("mosa", (3, 6, 10, 15, 20, 25, 30, 36, 42, 49), (3, 6, 10, 15, 20, 25, 30, 36, 42, 49)),
        ("mogo", (49,) * 6, (16,) * 6),
    ],
)
@pytest.mark.parametrize("kind", ["", "-lite"])
def test_tokens_a_level_are_the_papers(name, full, short, kind):
    config = CONV_PRESETS[name + kind]
    assert config.scales == full and config.latents == 49 and len(config.codes) == len(full)
    model = tiny(name, fixed_scales=config.fixed_scales)
    assert model.sizes(196) == full and model.sizes(64) == short
    assert all(size >= 1 for size in model.sizes(1))
    masks = level_masks(model, torch.tensor([196, 64]))
    assert [tuple(mask.sum(1).tolist()) for mask in masks] == list(zip(full, short, strict=True))


def test_parameters_of_momask_are_the_official_ones():
    """B1: encoder 9.59 M and decoder 9.85 M with 263 columns."""
    model = build_conv(replace(CONV_PRESETS["momask"], columns=263))
    encoder, decoder = (sum(p.numel() for p in part.parameters()) for part in (model.encoder, model.decoder))
    assert round(encoder / 1e6, 2) == 9.59 and round(decoder / 1e6, 2) == 9.85


@pytest.mark.parametrize("name", SYSTEMS)
def test_text_guidance_and_edit_mask_change_nothing(name):
    model, lengths = tiny(name), torch.tensor([48])
    embedding = model.encode(motions([48]), lengths, None).embedding
    plain = model.decode(embedding, lengths, None)
    assert torch.equal(model.decode(embedding, lengths, None, 3.0, torch.ones(1, 48, dtype=torch.bool)), plain)
    for branch in model.branches(embedding, lengths, None):
        assert torch.equal(branch, plain)
    if name in COUNTED:  # another process of a training may hold a longer motion
        longer = model.detokenize(embedding, lengths, None, None, 56)
        torch.testing.assert_close(longer[:, :48], plain, atol=1e-5, rtol=1e-4)
        assert longer.shape[1] == 56 and not longer[:, 48:].any()


@pytest.mark.parametrize("name", [*COUNTED, "mosa"])
def test_switches_build_and_run(name):
    switches = [{"reduction": 2}, {"reduction": 1}, {"metric": "cosine"}, {"attention": "stages"}, {"affine": True}]
    switches += [{"loss": "summed", "decorrelation": 0.0}, {"middle": True}, {"phi": "residual"}]
    for changes in switches[2 if name == "mosa" else 0 :]:
        model, lengths = tiny(name, **changes).train(), torch.tensor([24, 20])
        out = model(motions([24, 20]), lengths, None)
        assert out.features.shape == (2, 24, 67) and bool(out.commitment.isfinite())
        assert not out.features[1, 20:].any()
        if "reduction" in changes:
            assert model.sizes(24)[-1] == 24 // changes["reduction"]


def test_configs_that_do_not_fit_are_refused():
    momask = CONV_PRESETS["momask"]
    for changes, words in (
        ({"reduction": 8}, "cannot reduce"),
        ({"reduction": 3}, "cannot reduce"),
        ({"block": "normed"}, "fixed scales"),
        ({"block": "square"}, "unknown residual block"),
        ({"fixed_scales": (3, 48)}, "49 latents"),
        ({"divisors": (1, 1)}, "codebook sizes"),
        ({"shared": True, "codes": (5,) * 5 + (6,)}, "one size"),
    ):
        with pytest.raises(ValueError, match=words):
            build_conv(replace(momask, width=8, code_width=4, **changes))


@pytest.mark.parametrize("name", SYSTEMS)
def test_thirty_steps_lower_the_error(name):
    samples = synthetic_samples(corpus(6, seed=0))
    normaliser = Normaliser.fit([s.features for s in samples])
    lengths = torch.tensor([48, 48, 44, 40, 48, 24])
    x = torch.stack([torch.from_numpy(normaliser.apply(s.features[:48])).float() for s in samples])
    x *= torch.arange(48)[None, :, None] < lengths[:, None, None]
    config = tiny(name).config
    with torch.random.fork_rng():
        torch.manual_seed(0)
        model = build_conv(replace(config, width=32, code_width=32, codes=(64,) * len(config.codes)))
        optimiser = torch.optim.AdamW(model.parameters(), 2e-3)
        errors = []
        for _ in range(30):
            out = model(x, lengths, None)
            error = F.smooth_l1_loss(out.features, x)
            optimiser.zero_grad()
            (error + 0.02 * out.commitment).backward()
            optimiser.step()
            errors.append(float(error.detach()))
    assert np.mean(errors[-3:]) < 0.8 * errors[0]
    model.eval()
    decoded = model.decode(model.encode(x, lengths, None).embedding, lengths, None)
    assert float(F.smooth_l1_loss(decoded, x)) < 0.9 * errors[0]
