"""MOGO's quantizer (systems.md C1) against slow formulas in float64 numpy."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from playground.tokenizers.affine import OUTER, Affine, Penalties, cross_covariance
from playground.tokenizers.quantizers import MultiScaleQuantizer
from playground.training.configs import TOKENIZERS

LEVELS, WIDTH, LENGTHS = 3, 4, (6, 3)


def affine_quantizer(seed: int = 0, **options) -> MultiScaleQuantizer:
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        quantizer = MultiScaleQuantizer(
            (6,) * LEVELS, (9,) * LEVELS, WIDTH, metric="euclidean", phi="identity", divisors=(1,) * LEVELS,
            **({"affine": True, "penalties": Penalties(0.03, 0.004, 0.05)} | options),
        )  # fmt: skip
        for book in quantizer.codebooks:
            book.vectors.normal_()
        for affine in quantizer.affines:
            torch.nn.init.normal_(affine.log_scale, std=0.5)
            torch.nn.init.normal_(affine.bias, std=0.5)
    quantizer.started.fill_(True)
    return quantizer


def latents(seed: int = 1) -> torch.Tensor:
    """Rows of 6 and 3 latents; what is beyond them is not zero, to be caught if it counts."""
    return torch.randn(2, 6, WIDTH, generator=torch.Generator().manual_seed(seed))


def slow_levels(quantizer: MultiScaleQuantizer, z: torch.Tensor):
    """ids and (r, phi, u) [n, D] of every level over the real vectors, one vector at a time."""
    rows = np.concatenate([z[b, :n].detach().double().numpy() for b, n in enumerate(LENGTHS)])
    levels = []
    for level, book in enumerate(quantizer.codebooks):
        affine = quantizer.affines[level] if quantizer.affines else Affine(WIDTH)
        scale, bias = np.exp(affine.log_scale.detach().double().numpy()), affine.bias.detach().double().numpy()
        codes = book.vectors.double().numpy()
        ids, shares, sought = [], [], []
        for r in rows:
            u = scale * r + bias
            ids.append(int(np.argmin([((u - q) ** 2).sum() for q in codes])))
            shares.append((codes[ids[-1]] - bias) / scale)
            sought.append(u)
        levels.append((ids, rows, np.array(shares), np.array(sought)))
        rows = rows - np.array(shares)
    return levels


def test_ids_and_shares_equal_the_loop():
    quantizer, z = affine_quantizer().eval(), latents()
    with torch.no_grad():
        quantized = quantizer.encode(z, torch.tensor(LENGTHS))
    for level, (ids, _, shares, _) in enumerate(slow_levels(quantizer, z)):
        found = quantized.tokens.ids[level]
        assert [*found[0].tolist(), *found[1, :3].tolist()] == ids and not found[1, 3:].any()
        share = torch.cat([quantized.per_level[level, 0], quantized.per_level[level, 1, :3]])
        np.testing.assert_allclose(share.double().numpy(), shares, atol=1e-5)
        assert not quantized.per_level[level, 1, 3:].any()


@settings(max_examples=50, deadline=None)
@given(st.floats(-6, 6), st.floats(-50, 50), st.integers(0, 10**6))
def test_affine_inverts_exactly(log_scale, bias, seed):
    affine = Affine(5).double()
    with torch.no_grad():
        affine.log_scale.fill_(log_scale)
        affine.bias.fill_(bias)
    rows = torch.randn(7, 5, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))
    tolerance = 1e-13 * (1 + abs(bias)) * np.exp(abs(log_scale))
    torch.testing.assert_close(affine.inverse(affine(rows)), rows, atol=tolerance, rtol=1e-12)
    assert bool((affine.log_scale.exp() > 0).all())


def test_affine_starts_as_nothing():
    affine, rows = Affine(5), torch.randn(3, 5)
    assert torch.equal(affine(rows), rows) and torch.equal(affine.inverse(rows), rows)
    assert float(affine.distance().detach()) == 0.0


def test_cross_covariance_equals_numpys():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(30, 4)) + 5, rng.normal(size=(30, 4)) * 3
    expected = np.cov(a.T, b.T, bias=True)[:4, 4:]
    np.testing.assert_allclose(cross_covariance(torch.from_numpy(a), torch.from_numpy(b)).numpy(), expected)


@pytest.mark.parametrize("affine", [True, False])
@pytest.mark.parametrize("decorrelation", [0.0, 0.05])
def test_commitment_holds_all_three_terms(affine, decorrelation):
    weights = Penalties(0.03, 0.004, decorrelation)
    quantizer, z = affine_quantizer(affine=affine, penalties=weights).eval(), latents()
    expected = 0.0
    levels = slow_levels(quantizer, z)
    for level, (_, before, shares, _) in enumerate(levels):
        expected += 0.03 * ((before - shares) ** 2).mean()
        if affine:
            scale = quantizer.affines[level].log_scale.detach().double().exp().numpy()
            expected += 0.004 * (((scale - 1) ** 2).sum() + (quantizer.affines[level].bias.double() ** 2).sum().item())
        if level < LEVELS - 1:
            after = before - shares
            covariance = (shares - shares.mean(0)).T @ (after - after.mean(0)) / len(after)
            expected += decorrelation * (covariance**2).sum()
    got = OUTER * float(quantizer(z, torch.tensor(LENGTHS)).commitment.detach())
    assert got == pytest.approx(expected, rel=1e-5)


def test_outer_weight_is_the_trainers():
    assert all(training.commitment == OUTER for training in TOKENIZERS.values())


def test_gradient_reaches_scale_and_bias_from_every_side():
    z = latents().requires_grad_()
    for penalties, use in (
        (Penalties(0.0, 0.0, 0.0), "embedding"),
        (Penalties(0.02, 0.0, 0.0), "commitment"),
        (Penalties(0.0, 1e-3, 0.0), "commitment"),
        (Penalties(0.0, 0.0, 1e-2), "commitment"),
    ):
        quantizer = affine_quantizer(penalties=penalties)
        out = quantizer(z, torch.tensor(LENGTHS))
        (out.embedding.square().sum() if use == "embedding" else out.commitment).backward()
        for affine in quantizer.affines[: 1 if use == "commitment" else LEVELS]:
            assert affine.log_scale.grad.abs().sum() > 0 and affine.bias.grad.abs().sum() > 0


def test_embedding_is_straight_through():
    quantizer, z = affine_quantizer().eval(), latents().requires_grad_()
    lengths = torch.tensor(LENGTHS)
    out = quantizer(z, lengths)
    out.embedding.sum().backward()
    assert torch.equal(z.grad[0], torch.ones(6, WIDTH)) and torch.equal(z.grad[1, :3], torch.ones(3, WIDTH))
    assert not z.grad[1, 3:].any()
    with torch.no_grad():
        torch.testing.assert_close(out.embedding, quantizer.encode(z, lengths).embedding)


def test_codebooks_learn_from_what_is_looked_up():
    quantizer, z = affine_quantizer().train(), latents()
    for book in quantizer.codebooks:  # counts that keep every code alive
        book.counts.fill_(50.0)
        book.sums.copy_(book.vectors * 50)
    levels = slow_levels(quantizer, z)
    before = [book.vectors.double().numpy() for book in quantizer.codebooks]
    quantizer(z, torch.tensor(LENGTHS))
    for book, old, (ids, _, _, sought) in zip(quantizer.codebooks, before, levels, strict=True):
        for v in range(len(old)):
            mine = sought[[n for n, code in enumerate(ids) if code == v]]
            expected = (0.99 * 50 * old[v] + 0.01 * mine.sum(0)) / (0.99 * 50 + 0.01 * len(mine))
            np.testing.assert_allclose(book.vectors[v].double().numpy(), expected, atol=1e-5)
