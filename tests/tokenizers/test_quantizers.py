import itertools
import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.nn import functional as F

from playground.errors import PlaygroundError
from playground.tokenizers.base import Tokens
from playground.tokenizers.quantizers import Codebook, MultiScaleQuantizer, Phi, nearest_code


def slow_nearest(vector, codebook, metric):
    best, chosen = -math.inf, 0
    for v, code in enumerate(codebook.double()):
        x = vector.double()
        score = float(x @ code / code.norm()) if metric == "cosine" else -float((x - code).square().sum())
        if score > best + 1e-12:
            best, chosen = score, v
    return chosen


def slow_area(rows, size):
    """Area pooling: output i averages rows floor(i T / s) .. ceil((i + 1) T / s) - 1."""
    total = len(rows)
    return [
        sum(rows[j] for j in range(i * total // size, -(-(i + 1) * total // size)))
        / (-(-(i + 1) * total // size) - i * total // size)
        for i in range(size)
    ]


def slow_linear(rows, size):
    """Linear interpolation with half-pixel centres, clamped at the borders."""
    out = []
    for i in range(size):
        at = min(max((i + 0.5) * len(rows) / size - 0.5, 0.0), len(rows) - 1)
        low = min(int(at), len(rows) - 1)
        high = min(low + 1, len(rows) - 1)
        out.append(rows[low] * (1 - (at - low)) + rows[high] * (at - low))
    return out


def filled(scales=(1, 2, 5), codes=(4, 6, 8), width=4, phi="conv", metric="cosine", seed=0) -> MultiScaleQuantizer:
    torch.manual_seed(seed)
    quantizer = MultiScaleQuantizer(scales, codes, width, metric=metric, phi=phi).eval()
    for book in quantizer.codebooks:
        book.vectors.normal_()
    return quantizer


@pytest.mark.parametrize("phi", ["conv", "residual", "identity"])
@pytest.mark.parametrize("metric", ["cosine", "euclidean"])
def test_encode_equals_a_float64_loop(phi, metric):
    quantizer = filled(phi=phi, metric=metric)
    z = torch.randn(2, 5, 4, generator=torch.Generator().manual_seed(1))
    given_back = quantizer.encode(z)
    for b in range(2):
        residual = [row.double() for row in z[b]]
        for level, size in enumerate(quantizer.scales):
            book = quantizer.codebooks[level].vectors
            ids = [slow_nearest(row, book, metric) for row in slow_area(residual, size)]
            assert given_back.tokens.ids[level][b].tolist() == ids
            up = torch.stack(slow_linear([book[i].double() for i in ids], 5))
            share = quantizer.phis[level].double()(up[None])[0]
            quantizer.phis[level].float()
            torch.testing.assert_close(given_back.per_level[level, b], share.float(), atol=1e-5, rtol=1e-5)
            residual = [r - s for r, s in zip(residual, share, strict=True)]
            energy = torch.stack(residual).square().mean()
            torch.testing.assert_close(given_back.residual_norm[level + 1, b], energy.float(), atol=1e-5, rtol=1e-5)


def test_embedding_is_the_sum_of_its_levels_and_what_embed_returns():
    quantizer = filled()
    quantized = quantizer.encode(torch.randn(3, 5, 4))
    torch.testing.assert_close(quantized.embedding, quantized.per_level.sum(dim=0))
    torch.testing.assert_close(quantizer.embed(quantized.tokens), quantized.embedding)
    torch.testing.assert_close(quantizer.embed(quantized.tokens, 2), quantized.per_level[:2].sum(dim=0))
    assert torch.equal(quantizer.embed(quantized.tokens, 0), torch.zeros(3, 5, 4))


def test_released_phi_never_adds_a_negative_share():
    quantizer = filled(phi="conv")
    assert (quantizer.encode(torch.randn(3, 5, 4)).per_level >= 0).all()


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 9), st.integers(1, 9), st.floats(1e-3, 1e3), st.sampled_from(["cosine", "euclidean"]))
def test_lookup_returns_a_code_for_itself(codes, width, size, metric):
    rng = torch.Generator().manual_seed(codes * 10 + width)
    book = torch.randn(codes, width, generator=rng) * size
    found = nearest_code(book, book, metric)
    assert all(slow_nearest(book[i], book, metric) == found[i] or width == 1 for i in range(codes))


def test_ema_step_equals_the_formula():
    torch.manual_seed(0)
    book = Codebook(3, 2, metric="euclidean")
    book.start(torch.tensor([[0.0, 0.0], [10.0, 0.0], [0.0, 10.0]]))
    book.counts.fill_(2.0)
    book.sums.copy_(book.vectors * 2)
    vectors = torch.tensor([[1.0, 1.0], [11.0, 0.0], [12.0, 0.0]])
    book.learn(vectors, book.lookup(vectors))
    counts = [0.99 * 2 + 0.01 * 1, 0.99 * 2 + 0.01 * 2, 0.99 * 2]
    sums = [[0.01, 0.01], [0.99 * 20 + 0.01 * 23, 0.0], [0.0, 0.99 * 20]]
    torch.testing.assert_close(book.counts, torch.tensor(counts))
    torch.testing.assert_close(book.vectors, torch.tensor(sums) / torch.tensor(counts)[:, None])


def test_a_code_counted_below_one_restarts_from_the_batch():
    book = Codebook(2, 2, metric="euclidean")
    book.start(torch.tensor([[0.0, 0.0], [5.0, 5.0]]))
    vectors = torch.tensor([[0.1, 0.0], [0.2, 0.0], [0.3, 0.0]])
    book.learn(vectors, book.lookup(vectors))
    assert book.counts[1] < 1
    assert torch.equal(book.vectors[1], vectors[1])  # leading rows of the batch, in the place of the code


def test_training_pass_is_straight_through_and_trains_phi_alone():
    quantizer = filled().train()
    quantizer.started.fill_(True)
    z = torch.randn(4, 5, 4, requires_grad=True)
    before = [book.vectors.clone() for book in quantizer.codebooks]
    out = quantizer(z)
    out.embedding.sum().backward(retain_graph=True)
    assert torch.equal(z.grad, torch.ones_like(z))
    out.commitment.backward()
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in quantizer.phis[0].parameters())
    assert all(not b.vectors.requires_grad for b in quantizer.codebooks)
    assert any(not torch.equal(a, b.vectors) for a, b in zip(before, quantizer.codebooks, strict=True))


def test_commitment_equals_the_loop():
    quantizer = filled()
    z = torch.randn(2, 5, 4)
    sums = quantizer.encode(z).per_level.cumsum(dim=0)
    expected = sum(2 * F.mse_loss(total, z) for total in sums) / len(sums)
    torch.testing.assert_close(quantizer(z).commitment, expected)


def test_first_training_batch_fills_every_codebook():
    quantizer = MultiScaleQuantizer((1, 5), (3, 40), 4).train()
    z = torch.randn(2, 5, 4)
    quantizer(z)
    assert bool(quantizer.started) and all(bool((b.vectors.abs().sum(-1) > 0).all()) for b in quantizer.codebooks)


# ---- the plain residual quantizer (A11, B1) -----------------------------------------------------------------------


def plain(levels: int = 3, seed: int = 0, **options) -> MultiScaleQuantizer:
    torch.manual_seed(seed)
    quantizer = MultiScaleQuantizer((5,) * levels, (6,) * levels, 4, metric="euclidean", phi="identity", **options)
    for book in quantizer.codebooks:
        book.vectors.normal_()
    quantizer.started.fill_(True)
    return quantizer


def test_equal_scales_without_phi_are_a_plain_residual_quantizer():
    quantizer, z = plain(draw=0.5, level_drop=0.2).eval(), torch.randn(2, 5, 4)
    quantized = quantizer.encode(z)
    for b, t in itertools.product(range(2), range(5)):
        residual = z[b, t].double()
        for level, book in enumerate(quantizer.codebooks):
            chosen = slow_nearest(residual, book.vectors, "euclidean")
            assert int(quantized.tokens.ids[level][b, t]) == chosen
            residual = residual - book.vectors[chosen].double()
        torch.testing.assert_close(z[b, t] - quantized.embedding[b, t], residual.float(), atol=1e-5, rtol=1e-5)


def test_plain_commitment_pulls_z_as_momasks_does():
    """B1: mean over layers of MSE(residual, stop(code)); our sum adds a term without gradient."""
    quantizer, z = plain().eval(), torch.randn(2, 5, 4, requires_grad=True)
    quantizer(z).commitment.backward()
    ours = z.grad.clone()
    leaf = z.detach().clone().requires_grad_()
    residual, losses = leaf, []
    for level, ids in enumerate(quantizer.encode(leaf.detach()).tokens.ids):
        codes = quantizer.codebooks[level].vectors[ids]
        losses.append(F.mse_loss(residual, codes))
        residual = residual - codes
    torch.stack(losses).mean().backward()
    torch.testing.assert_close(ours, leaf.grad)


@pytest.mark.parametrize("metric", ["cosine", "euclidean"])
def test_noisy_lookup_draws_from_the_softmax_of_closeness(metric):
    torch.manual_seed(3)
    book, vector = torch.randn(4, 3), torch.randn(3)
    close = book @ vector / book.norm(dim=1) / vector.norm()
    close = close if metric == "cosine" else -(book - vector).square().sum(dim=1)
    drawn = nearest_code(vector.expand(20_000, 3), book, metric, temperature=0.5)
    shares = torch.bincount(drawn, minlength=4) / len(drawn)
    torch.testing.assert_close(shares, (close / 0.5).softmax(dim=0), atol=0.015, rtol=0.0)
    assert nearest_code(vector, book, metric, temperature=1e-6) == nearest_code(vector, book, metric)


def test_dropped_levels_are_a_prefix_and_every_length_occurs():
    quantizer = plain(levels=4, level_drop=1.0).train()
    z, seen = torch.randn(2, 5, 4), set()
    for _ in range(60):
        before = [book.counts.clone() for book in quantizer.codebooks]
        out = quantizer(z)
        seen.add(len(out.ids))
        moved = [not torch.equal(a, b.counts) for a, b in zip(before, quantizer.codebooks, strict=True)]
        assert moved == [level < len(out.ids) for level in range(4)]
    assert seen == {1, 2, 3, 4}
    assert len(quantizer.eval()(z).ids) == 4
    assert all(len(plain(levels=4, level_drop=0.0).train()(z).ids) == 4 for _ in range(20))


def test_tokens_compare_print_and_survive_json():
    tokens = Tokens((torch.tensor([[1]]), torch.tensor([[0, 3]])), (4, 6))
    assert Tokens.from_json(tokens.to_json()) == tokens
    assert tokens != Tokens((torch.tensor([[2]]), torch.tensor([[0, 3]])), (4, 6))
    assert "level 2 (6 codes)" in str(tokens)
    with pytest.raises(PlaygroundError, match=r"0\.\.3"):
        Tokens((torch.tensor([[4]]),), (4,))


def test_wrong_names_are_refused():
    with pytest.raises(ValueError, match="unknown phi"):
        Phi(4, "none")
    with pytest.raises(ValueError, match="unknown metric"):
        nearest_code(torch.zeros(1, 2), torch.zeros(3, 2), "taxi")
