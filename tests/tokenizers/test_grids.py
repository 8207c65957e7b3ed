import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.nn import functional as F

from playground.tokenizers.grids import CountedGrid, FixedGrid


def slow_down(rows, size):
    """Area pooling: token i averages rows floor(i T / s) .. ceil((i + 1) T / s) - 1."""
    total, out = len(rows), []
    for i in range(size):
        part = rows[i * total // size : -(-(i + 1) * total // size)]
        out.append(sum(part) / len(part))
    return torch.stack(out)


def slow_up(rows, size):
    """Linear interpolation with half-pixel centres, held at the borders."""
    out = []
    for j in range(size):
        at = min(max((j + 0.5) * len(rows) / size - 0.5, 0.0), len(rows) - 1)
        low = int(at)
        out.append(rows[low] * (1 - (at - low)) + rows[min(low + 1, len(rows) - 1)] * (at - low))
    return torch.stack(out)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(1, 49), min_size=1, max_size=4), st.integers(1, 60), st.integers(0, 9), st.integers(0, 999))
def test_every_row_is_resampled_as_if_alone(lengths, divisor, spare, seed):
    rng = torch.Generator().manual_seed(seed)
    length = max(lengths) + spare
    grid = CountedGrid(torch.tensor(lengths), length, (divisor,))
    x = torch.randn(len(lengths), length, 3, generator=rng)
    down = grid.down(0, x)
    tokens = torch.randn(len(lengths), down.shape[1], 3, generator=rng)
    up = grid.up(tokens, 0)
    assert down.shape[1] == max(1, length // divisor) and up.shape[1] == length
    for row, count in enumerate(lengths):
        size = max(1, count // divisor)
        torch.testing.assert_close(down[row, :size], slow_down(x[row, :count], size), atol=1e-5, rtol=1e-5)
        torch.testing.assert_close(up[row, :count], slow_up(tokens[row, :size], count), atol=1e-5, rtol=1e-5)
        assert not down[row, size:].any() and not up[row, count:].any()
        assert grid.real(0)[row].tolist() == [n < size for n in range(down.shape[1])]
        assert grid.real(None)[row].tolist() == [n < count for n in range(length)]


@pytest.mark.parametrize("size", [1, 3, 6, 12])
def test_full_rows_are_resampled_as_fixed_scales_are(size):
    x = torch.randn(2, 12, 4, generator=torch.Generator().manual_seed(0))
    counted, fixed = CountedGrid(torch.tensor([12, 12]), 12, (12 // size,)), FixedGrid((size, 12))
    down = fixed.down(0, x)
    torch.testing.assert_close(counted.down(0, x), down)
    torch.testing.assert_close(counted.up(down, 0), fixed.up(down, 0))
    assert counted.whole(0) == fixed.whole(0) == (size == 12)


def test_means_run_over_what_is_real():
    lengths = [5, 2]
    grid = CountedGrid(torch.tensor(lengths), 6, (1,))
    a, b = torch.randn(2, 6, 3), torch.randn(2, 6, 3)
    parts = [(a[row, :n], b[row, :n]) for row, n in enumerate(lengths)]
    energies = torch.stack([x.square().mean() for x, _ in parts])
    torch.testing.assert_close(grid.energy(a), energies)
    torch.testing.assert_close(grid.mse(a, b), F.mse_loss(*(torch.cat(side) for side in zip(*parts, strict=True))))
    fixed = FixedGrid((6,))
    torch.testing.assert_close(fixed.energy(a), a.square().mean(dim=(1, 2)))
    torch.testing.assert_close(fixed.mse(a, b), F.mse_loss(a, b))
