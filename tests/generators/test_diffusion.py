import math
from dataclasses import replace

import pytest
import torch

from playground.errors import PlaygroundError
from playground.generators.base import FeatureBatch
from playground.generators.diffusion import (
    PRESETS,
    DiffusionConfig,
    DiffusionGenerator,
    build_denoiser,
    cosine_schedule,
    diffuse,
    step_back,
)
from playground.nn.positions import sinusoid
from playground.nn.sampling import Sampling
from playground.text.encoders import TextFeatures
from tests.tiny import text_features

TINY = DiffusionConfig(
    columns=5, max_frames=48, width=16, depth=2, heads=2, hidden=24, dropout=0.0, text_width=20, steps=20, visited=6,
    noise=0.0,
)  # fmt: skip
LENGTHS = torch.tensor([16, 8])
KINDS = ("none", "encoder", "decoder")


def tiny(seed=0, loud=4.0, **changes):
    """A generator with random weights, larger than at the start, so that inputs matter."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        network = build_denoiser(replace(TINY, **changes)).eval().requires_grad_(False)
        for parameter in network.parameters():
            if parameter.ndim > 1:
                parameter.mul_(loud)
    return DiffusionGenerator(network)


def one(text, row):
    return TextFeatures(text.tokens[[row]], text.mask[[row]], text.pooled[[row]], [text.words[row]])


@pytest.mark.parametrize("steps", [1, 2, 10, 50, 1000])
def test_schedule_is_the_cosine_with_capped_steps(steps):
    shares = cosine_schedule(steps).tolist()
    wave = [math.cos((t / steps + 0.008) / 1.008 * math.pi / 2) ** 2 for t in range(steps + 1)]
    kept = 1.0
    for t in range(steps + 1):
        if t:
            kept *= 1 - min(1 - wave[t] / wave[t - 1], 0.999)
        assert shares[t] == pytest.approx(kept, rel=1e-9)
    assert shares[0] == 1 and 0 < shares[-1] < 0.01 and all(a > b for a, b in zip(shares, shares[1:], strict=False))


def test_noisy_rows_have_the_moments_of_the_forward_process():
    clean = torch.tensor([1.5, -0.5]).repeat_interleave(40_000).reshape(2, -1, 1)
    shares = cosine_schedule(50)[[10, 40]].float()
    noisy = diffuse(clean, shares, torch.randn(clean.shape, generator=torch.Generator().manual_seed(0)))
    for row, share in enumerate(shares.tolist()):
        assert float(noisy[row].mean()) == pytest.approx(share**0.5 * float(clean[row, 0]), abs=0.02)
        assert float(noisy[row].var()) == pytest.approx(1 - share, rel=0.03)


@pytest.mark.parametrize("step", [1, 2, 17, 50])
def test_a_step_back_with_fresh_noise_is_the_posterior(step):
    shares = cosine_schedule(50).tolist()
    before, share = shares[step - 1], shares[step]
    beta = 1 - share / before
    noisy, clean = torch.tensor([[[0.7]]], dtype=torch.float64), torch.tensor([[[-0.4]]], dtype=torch.float64)
    mean, size = step_back(noisy, clean, share, before, 1.0)
    expected = before**0.5 * beta / (1 - share) * -0.4 + (share / before) ** 0.5 * (1 - before) / (1 - share) * 0.7
    assert float(mean) == pytest.approx(expected, abs=1e-9)
    assert size**2 == pytest.approx(beta * (1 - before) / (1 - share), abs=1e-12)


def test_a_step_back_without_noise_keeps_the_noise_that_is_there():
    shares = cosine_schedule(50).tolist()
    clean, noise = torch.randn(1, 4, 3, dtype=torch.float64), torch.randn(1, 4, 3, dtype=torch.float64)
    noisy = diffuse(clean, torch.tensor([shares[40]], dtype=torch.float64), noise)
    mean, size = step_back(noisy, clean, shares[40], shares[8], 0.0)
    torch.testing.assert_close(mean, diffuse(clean, torch.tensor([shares[8]], dtype=torch.float64), noise))
    assert size == 0


@pytest.mark.parametrize(("noise", "visited"), [(0.0, 6), (1.0, 20), (1.0, 6), (0.0, 1)])
def test_an_oracle_is_sampled_exactly(noise, visited):
    generator = tiny(noise=noise, visited=visited)
    truth = torch.randn(2, 16, 5) * (torch.arange(16) < LENGTHS[:, None])[..., None]
    seen = []

    def oracle(noisy, lengths, steps, text, dropped, record):
        seen.append(int(steps[0]))
        return truth

    object.__setattr__(generator, "network", type("Oracle", (), {"__call__": staticmethod(oracle)})())
    generator.network.config = replace(TINY, noise=noise, visited=visited)
    generator.network.shares = cosine_schedule(20)
    assert torch.equal(generator.sample(None, LENGTHS, Sampling()), truth)
    assert seen == generator.visits() and len(seen) == visited and seen[0] == 20 and seen[-1] in (1, 20)


@pytest.mark.parametrize("casim", KINDS)
@pytest.mark.parametrize("patch", [1, 4, 3])
def test_padding_changes_nothing(casim, patch):
    network = tiny(casim=casim, patch=patch).network
    text, padded = text_features((4, 2)), text_features((4, 2), padded=3)
    rows, steps = torch.randn(2, 16, 5), torch.tensor([3, 17])
    plain = network(rows, LENGTHS, steps, text)
    wild = torch.cat([rows, torch.full((2, 8, 5), 50.0)], dim=1)
    wild[1, 8:] = -70.0
    longer = network(wild, LENGTHS, steps, padded)
    torch.testing.assert_close(longer[:, :16], plain, atol=1e-4, rtol=1e-4)
    assert not longer[:, 16:].any() and not longer[1, 8:].any()
    for row, length in enumerate(LENGTHS.tolist()):
        alone = network(rows[[row], :length], LENGTHS[[row]], steps[[row]], one(text, row))
        torch.testing.assert_close(plain[[row], :length], alone, atol=1e-4, rtol=1e-4)


@pytest.mark.parametrize("casim", KINDS)
def test_step_text_order_and_rows_matter(casim):
    network = tiny(casim=casim).network
    text, rows = text_features((4, 2)), torch.randn(2, 16, 5)
    plain = network(rows, LENGTHS, torch.tensor([3, 3]), text)
    assert (plain - network(rows, LENGTHS, torch.tensor([4, 4]), text)).abs().max() > 1e-3
    assert (plain - network(rows + 1.0, LENGTHS, torch.tensor([3, 3]), text)).abs().max() > 1e-3
    assert (plain - network(rows, LENGTHS, torch.tensor([3, 3]), text_features((4, 2), seed=1))).abs().max() > 1e-3
    swapped = TextFeatures(text.tokens.flip(1), text.mask.flip(1), text.pooled, text.words)
    moved = (plain - network(rows, LENGTHS, torch.tensor([3, 3]), swapped)).abs().max()
    # The layers of the decoder see a set of words; what orders them are the word states themselves.
    assert (moved > 1e-3) == (casim == "encoder")


@pytest.mark.parametrize("casim", KINDS)
def test_dropped_rows_have_no_text(casim):
    network = tiny(casim=casim).network
    text, other, rows = text_features((4, 2)), text_features((4, 2), seed=1), torch.randn(2, 16, 5)
    steps, dropped = torch.tensor([3, 9]), torch.tensor([True, False])
    first, second = (network(rows, LENGTHS, steps, words, dropped) for words in (text, other))
    assert torch.equal(first[0], second[0]) and not torch.allclose(first[1], second[1])
    if casim != "encoder":  # its null text has as many positions as the text that was dropped
        none = network(rows, LENGTHS, steps, None)
        torch.testing.assert_close(first[0], none[0], atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("casim", KINDS)
@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_rows_with_their_own_seeds_do_not_depend_on_the_batch(casim, noise):
    generator, text = tiny(casim=casim, noise=noise, patch=4, loud=2.0), text_features((4, 2))
    batch = generator.sample(text, LENGTHS, Sampling(seeds=(3, 9), cfg=2.5))
    assert not batch[1, 8:].any()
    for row, seed in enumerate((3, 9)):
        alone = generator.sample(one(text, row), LENGTHS[[row]], Sampling(seed=seed, cfg=2.5))
        torch.testing.assert_close(batch[[row], : int(LENGTHS[row])], alone, atol=1e-3, rtol=1e-3)
    assert torch.equal(batch, generator.sample(text, LENGTHS, Sampling(seeds=(3, 9), cfg=2.5)))
    assert not torch.allclose(batch, generator.sample(text, LENGTHS, Sampling(seeds=(3, 8), cfg=2.5)))


def test_guidance_goes_from_the_null_text_through_the_text_and_beyond():
    generator, text = tiny(visited=1, casim="decoder"), text_features((4, 2))
    null, plain, guided = (generator.sample(text, LENGTHS, Sampling(cfg=s)) for s in (0.0, 1.0, 2.5))
    torch.testing.assert_close(guided, null + 2.5 * (plain - null), atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(null, generator.sample(None, LENGTHS, Sampling(cfg=7.0)), atol=1e-4, rtol=1e-4)


@pytest.mark.parametrize("cfg", [1.0, 2.5])
def test_alignment_is_the_attention_of_the_last_layer(cfg):
    generator, text = tiny(casim="decoder", patch=3), text_features((4,), padded=2)
    lengths = torch.tensor([8])
    weights = generator.alignment(text, lengths, Sampling(cfg=cfg))
    assert weights.shape == (6, 8, 6) and not weights[..., 4:].any()
    torch.testing.assert_close(weights.sum(-1), torch.ones(6, 8))
    network = generator.network
    seen: list[torch.Tensor] = []
    network.norm.register_forward_hook(lambda module, inputs, output: seen.append(output))
    network.blocks[-1].cross_attentions[0].query.register_forward_hook(lambda *call: seen.append(call[2]))
    noisy = torch.randn(1, 8, 5, generator=torch.Generator().manual_seed(0))
    network(noisy, lengths, torch.tensor([20]), text)
    query = seen[0][0].reshape(3, 2, 8)
    step = network.time(sinusoid(torch.tensor([19]), 16))
    key = network.blocks[-1].cross_attentions[0].key_value(network.text_proj(text.tokens[0, :4]) + step)[:, :16]
    key = key.reshape(4, 2, 8)
    for frame in range(8):
        heads = [(key[:, h] @ query[frame // 3, h] / 8**0.5).softmax(0) for h in range(2)]
        torch.testing.assert_close(weights[0, frame, :4], sum(heads) / 2, atol=1e-5, rtol=1e-4)


def test_alignment_needs_the_decoder_and_one_motion():
    with pytest.raises(ValueError, match="decoder"):
        tiny(casim="encoder").alignment(text_features((4,)), LENGTHS[:1], Sampling())
    with pytest.raises(ValueError, match="one motion"):
        tiny(casim="decoder").alignment(text_features((4, 2)), LENGTHS, Sampling())


@pytest.mark.parametrize("casim", KINDS)
def test_loss_is_over_real_frames_and_falls(casim):
    network = tiny(loud=1.0, casim=casim, patch=2).network.requires_grad_(True).train()
    text = text_features((4, 2))
    sign = torch.tensor([1.0, -1.0])[:, None, None]
    motion = sign * torch.sin(torch.arange(16) / 3.0)[None, :, None] * torch.linspace(0.5, 1.5, 5)
    motion = motion * (torch.arange(16) < LENGTHS[:, None])[..., None]
    batch = FeatureBatch(motion, LENGTHS, text, torch.zeros(2, dtype=torch.bool))
    optimizer = torch.optim.Adam(network.parameters(), lr=3e-3)
    losses = []
    for step in range(40):
        loss, figure = network.training_loss(batch, torch.Generator().manual_seed(step))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(float(figure))
    assert sum(losses[-8:]) < 0.5 * sum(losses[:8])
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in network.parameters())


def test_loss_equals_a_slow_loop():
    network, text = tiny(casim="decoder").network, text_features((4, 2))
    clean = torch.randn(2, 16, 5) * (torch.arange(16) < LENGTHS[:, None])[..., None]
    dropped = torch.tensor([False, True])
    loss, _ = network.training_loss(FeatureBatch(clean, LENGTHS, text, dropped), torch.Generator().manual_seed(4))
    rng = torch.Generator().manual_seed(4)
    steps, noise = torch.randint(1, 21, (2,), generator=rng), torch.randn(2, 16, 5, generator=rng)
    total, count = 0.0, 0
    for row in range(2):
        share = float(cosine_schedule(20)[steps[row]])
        noisy = share**0.5 * clean[row] + (1 - share) ** 0.5 * noise[row]
        words = None if dropped[row] else one(text, row)
        out = network(noisy[None], LENGTHS[[row]], steps[[row]], words)[0]
        for frame in range(int(LENGTHS[row])):
            total += float(((out[frame] - clean[row, frame]) ** 2).sum())
            count += 5
    assert float(loss) == pytest.approx(total / count, rel=1e-4)


def test_check_is_called_at_every_step_and_may_stop():
    calls = []

    def check():
        calls.append(len(calls))
        if len(calls) == 3:
            raise PlaygroundError("stop")

    done = []
    with pytest.raises(PlaygroundError, match="stop"):
        done.extend(step for step, _, _ in tiny().steps_of(None, LENGTHS, Sampling(check=check)))
    assert len(calls) == 3


def test_steps_say_how_far_they_are():
    steps = list(tiny().steps_of(None, LENGTHS, Sampling()))
    assert [(done, total) for done, total, _ in steps] == [(n, 6) for n in range(1, 7)]
    assert torch.equal(steps[-1][2], tiny().sample(None, LENGTHS, Sampling()))


def test_presets_and_refusals():
    assert PRESETS["lite"].visited < PRESETS["lite"].steps
    count = sum(p.numel() for p in build_denoiser(PRESETS["lite"]).parameters())
    assert 1e6 < count < 2e6
    with pytest.raises(ValueError, match="CASIM"):
        build_denoiser(replace(TINY, casim="both"))
