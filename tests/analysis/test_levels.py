"""Couplings of levels against slow formulas that never form a joint matrix."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from playground.analysis.levels import LevelMoments, coupling
from playground.errors import PlaygroundError

LEVELS, WIDTH = 3, 4


def slow_coupling(first: np.ndarray, second: np.ndarray) -> float:
    """Sum over all pairs of columns, one covariance at a time."""

    def cov(a: np.ndarray, b: np.ndarray) -> float:
        return float(sum((x - a.mean()) * (y - b.mean()) for x, y in zip(a, b, strict=True)) / len(a))

    cross = sum(cov(a, b) ** 2 for a in first.T for b in second.T) ** 0.5
    return cross / (sum(cov(a, a) for a in first.T) * sum(cov(b, b) for b in second.T)) ** 0.5


def invented(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    latent = rng.normal(size=(count, WIDTH)) + 3.0
    return latent, 0.4 * latent + rng.normal(size=(LEVELS, count, WIDTH))


@pytest.mark.parametrize("cuts", [(60,), (1, 20, 39)])
def test_couplings_are_those_of_the_vectors_however_they_come(cuts: tuple[int, ...]) -> None:
    latent, shares = invented(60)
    moments, start = LevelMoments(LEVELS, WIDTH), 0
    for cut in cuts:
        moments.add(latent[start : start + cut], shares[:, start : start + cut])
        start += cut
    assert moments.count_ == 60
    residuals = [latent - shares[: n + 1].sum(axis=0) for n in range(LEVELS)]
    left = [slow_coupling(share, rest) for share, rest in zip(shares, residuals, strict=True)]
    assert moments.left_coupling() == pytest.approx(left, rel=1e-9)
    between = [[slow_coupling(one, other) for other in shares] for one in shares]
    assert moments.between() == pytest.approx(np.array(between), rel=1e-9)


def test_the_ends_of_the_range() -> None:
    rng = np.random.default_rng(1)
    line = rng.normal(size=(50, 1)) @ np.array([[1.0, 2.0]])
    cross = np.cov(np.hstack([line, -3 * line]), rowvar=False, bias=True)
    assert coupling(cross[:2, 2:], np.trace(cross[:2, :2]), np.trace(cross[2:, 2:])) == pytest.approx(1.0)
    assert coupling(np.zeros((2, 2)), 1.0, 2.0) == 0.0 and np.isnan(coupling(np.zeros((2, 2)), 0.0, 2.0))


WHOLE = st.integers(-50, 50).map(float)


@settings(max_examples=40, deadline=None)
@given(arrays(np.float64, (7, 2), elements=WHOLE), arrays(np.float64, (2, 7, 2), elements=WHOLE))
def test_a_coupling_stays_between_0_and_1(latent: np.ndarray, shares: np.ndarray) -> None:
    moments = LevelMoments(2, 2).add(latent, shares)
    left, between = moments.left_coupling(), moments.between()
    for found in (left, between):
        seen = found[np.isfinite(found)]
        assert (seen >= 0).all() and (seen <= 1 + 1e-6).all()
    still = np.ptp(shares, axis=1).max(axis=1) == 0
    assert np.isnan(between[still]).all() and np.isfinite(np.diag(between)[~still]).all()


def test_wrong_shapes_and_nothing_are_told() -> None:
    moments = LevelMoments(2, 3)
    with pytest.raises(PlaygroundError, match="at least one"):
        moments.between()
    with pytest.raises(PlaygroundError, match="width 3"):
        moments.add(np.zeros((5, 2)), np.zeros((2, 5, 2)))
    with pytest.raises(PlaygroundError, match="2 levels"):
        moments.add(np.zeros((5, 3)), np.zeros((3, 5, 3)))
