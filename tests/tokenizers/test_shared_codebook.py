"""MoMask++'s multi-scale quantizer with one codebook (systems.md E3) and masks, against slow loops in numpy."""

import numpy as np
import pytest
import torch

from playground.tokenizers.base import Tokens
from playground.tokenizers.quantizers import Codebook, MultiScaleQuantizer, SharedCodebook
from tests.tokenizers.test_grids import slow_down, slow_up

DIVISORS, LENGTHS, CODES = (4, 2, 1), (8, 5), 7


def quantizer(seed: int = 0, **options) -> MultiScaleQuantizer:
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        made = MultiScaleQuantizer(
            (2, 4, 8), (CODES,) * 3, 3, metric="euclidean", phi="identity", divisors=DIVISORS,
            **({"shared": True} | options),
        )  # fmt: skip
        for book in made.codebooks:
            book.vectors.normal_()
    made.started.fill_(True)
    return made


def latents(seed: int = 1) -> torch.Tensor:
    return torch.randn(2, 8, 3, generator=torch.Generator().manual_seed(seed))


def slow_row(z: torch.Tensor, books: list[torch.Tensor]):
    """One row [T, D] -> ids, pooled vectors and shares of every level."""
    residual, out = z.double(), []
    for divisor, book in zip(DIVISORS, books, strict=True):
        pooled = slow_down(residual, max(1, len(z) // divisor))
        ids = [int(np.argmin([float((row - code).square().sum()) for code in book.double()])) for row in pooled]
        share = slow_up([book[i].double() for i in ids], len(z))
        out.append((ids, pooled, share))
        residual = residual - share
    return out


@pytest.mark.parametrize("shared", [True, False])
def test_encode_equals_a_float64_loop(shared):
    model, z = quantizer(shared=shared).eval(), latents()
    quantized = model.encode(z, torch.tensor(LENGTHS))
    books = [book.vectors for book in model.codebooks]
    for row, length in enumerate(LENGTHS):
        for level, (ids, _, share) in enumerate(slow_row(z[row, :length], books)):
            found = quantized.tokens.ids[level][row]
            assert found[: len(ids)].tolist() == ids and not found[len(ids) :].any()
            torch.testing.assert_close(quantized.per_level[level, row, :length], share.float(), atol=1e-5, rtol=1e-5)
    assert torch.equal(quantized.embedding[1, 5:], torch.zeros(3, 3))
    torch.testing.assert_close(model.embed(quantized.tokens, lengths=torch.tensor(LENGTHS)), quantized.embedding)
    running = list(model.accumulate(quantized.tokens.ids, torch.tensor(LENGTHS)))
    torch.testing.assert_close(torch.stack(running), quantized.per_level.cumsum(0))
    last = model.codebooks[2].vectors[quantized.tokens.ids[2]]
    torch.testing.assert_close(
        model.share_of_vectors(2, last, torch.tensor(LENGTHS)), quantized.per_level[2], atol=1e-5, rtol=1e-5
    )


def test_one_ema_step_takes_the_tokens_of_all_levels_together():
    model, z = quantizer().train(), latents()
    book = model.codebooks[0]
    book.counts.fill_(30.0)
    book.sums.copy_(book.vectors * 30)
    old = book.vectors.double()
    counts, sums = np.zeros(CODES), np.zeros((CODES, 3))
    for row, length in enumerate(LENGTHS):
        for ids, pooled, _ in slow_row(z[row, :length], [old] * 3):
            for code, vector in zip(ids, pooled, strict=True):
                counts[code] += 1
                sums[code] += vector.numpy()
    model(z, torch.tensor(LENGTHS))
    np.testing.assert_allclose(book.counts.numpy(), 0.99 * 30 + 0.01 * counts, rtol=1e-5)
    expected = (0.99 * 30 * old.numpy() + 0.01 * sums) / (0.99 * 30 + 0.01 * counts)[:, None]
    np.testing.assert_allclose(book.vectors.numpy(), expected, atol=1e-5)


def test_commitment_is_the_mean_over_real_latents():
    model, z = quantizer().eval(), latents()
    expected, weight = 0.0, sum(LENGTHS) * 3
    for row, length in enumerate(LENGTHS):
        total = torch.zeros(length, 3, dtype=torch.float64)
        for _, _, share in slow_row(z[row, :length], [model.codebooks[0].vectors] * 3):
            total = total + share
            expected += 2 * float((z[row, :length].double() - total).square().sum()) / weight / 3
    leaf = z.clone().requires_grad_()
    out = model(leaf, torch.tensor(LENGTHS)).commitment
    assert float(out.detach()) == pytest.approx(expected, rel=1e-5)
    out.backward()
    assert not leaf.grad[1, 5:].any() and leaf.grad[1, :5].all()


def test_noise_and_codes_do_not_depend_on_padding():
    """Gumbel noise is drawn for real vectors only, so more padding changes no draw and no codebook."""
    states, drawn = [], []
    for spare in (0, 6):
        model = quantizer(shared=False, draw=0.5).train()
        padded = torch.cat([latents(), torch.full((2, spare, 3), 99.0)], dim=1)
        with torch.random.fork_rng():
            torch.manual_seed(5)
            out = model(padded, torch.tensor(LENGTHS))
        drawn.append([ids[0, : len(latents()[0]) // divisor] for ids, divisor in zip(out.ids, DIVISORS, strict=True)])
        states.append([book.sums for book in model.codebooks])
    for a, b in zip(*drawn, strict=True):
        assert torch.equal(a, b)
    for a, b in zip(*states, strict=True):
        torch.testing.assert_close(a, b)


@pytest.mark.parametrize(("vectors", "restarts"), [(10, False), (11, True)])
def test_codes_restart_only_from_more_than_five_vectors_a_code(vectors, restarts):
    book = Codebook(2, 3, metric="euclidean", enough=5)
    book.start(torch.tensor([[0.0, 0.0, 0.0], [9.0, 9.0, 9.0]]))
    rows = torch.randn(vectors, 3, generator=torch.Generator().manual_seed(0)) * 0.1
    book.learn(rows, book.lookup(rows))
    assert float(book.counts[1]) < 1
    expected = rows[1] if restarts else torch.tensor([9.0, 9.0, 9.0])
    torch.testing.assert_close(book.vectors[1], expected)
    for _ in range(2000):  # a code that nothing chooses for long keeps its place
        book.learn(rows[:3], book.lookup(rows[:3]))
    assert bool(book.vectors.isfinite().all()) and (restarts or float(book.vectors[1].mean()) > 5)


def test_a_shared_codebook_is_one_codebook():
    model = quantizer()
    assert isinstance(model.codebooks, SharedCodebook) and len(model.codebooks) == 3
    assert model.codes == (CODES,) * 3 and len({id(book) for book in model.codebooks}) == 1
    names = [name for name in model.state_dict() if name.endswith("vectors")]
    assert names == ["codebooks.0.vectors"]
    with pytest.raises(IndexError):
        model.codebooks[3]
    again = quantizer(seed=3)
    again.load_state_dict(model.state_dict())
    assert torch.equal(again.codebooks[2].vectors, model.codebooks[0].vectors)


def test_coarse_tokens_alone_need_their_lengths():
    model = quantizer().eval()
    ids = model.encode(latents(), torch.tensor(LENGTHS)).tokens.ids
    with pytest.raises(ValueError, match="numbers of latents"):
        model.embed(Tokens(ids[:2], (CODES,) * 2))
    assert model.embed(Tokens(ids[:2], (CODES,) * 2), lengths=torch.tensor(LENGTHS)).shape == (2, 8, 3)
    with pytest.raises(ValueError, match="divisors"):
        MultiScaleQuantizer((2, 4), (3, 3), 2, divisors=(1,))
