"""Residual energy against a loop over scales."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.analysis.residual import ScaleEnergy, residual_energy
from playground.errors import PlaygroundError


@given(st.integers(1, 6), st.integers(1, 9), st.integers(1, 5), st.integers(0, 2**16))
def test_against_a_loop(scales: int, latents: int, width: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    z, levels = rng.normal(size=(latents, width)), rng.normal(size=(scales, latents, width))
    rest, expected = z.copy(), [1.0]
    for level in levels:
        rest = rest - level
        expected.append(sum(value**2 for value in rest.ravel()) / sum(value**2 for value in z.ravel()))
    np.testing.assert_allclose(residual_energy(z, levels), expected, rtol=1e-9)


def test_a_perfect_quantizer_leaves_nothing() -> None:
    z = np.random.default_rng(0).normal(size=(4, 3))
    np.testing.assert_allclose(residual_energy(z, np.stack([z * 0.5, z * 0.5])), [1.0, 0.25, 0.0], atol=1e-15)


def test_a_latent_of_zero_has_no_shares() -> None:
    assert np.isnan(residual_energy(np.zeros((2, 3)), np.zeros((4, 2, 3)))).all()


@pytest.mark.parametrize("z, levels", [((2, 3), (4, 3, 2)), ((2,), (4, 2)), ((2, 3), (2, 3))])
def test_shapes_that_do_not_fit_are_refused(z: tuple[int, ...], levels: tuple[int, ...]) -> None:
    with pytest.raises(PlaygroundError):
        residual_energy(np.ones(z), np.ones(levels))


def test_summary_over_motions() -> None:
    rows = np.array([[1.0, 0.5, 0.1], [1.0, 0.7, 0.3], [np.nan] * 3])
    energy = ScaleEnergy().fit(rows)
    assert energy.count_ == 2
    np.testing.assert_allclose(energy.left_, [1.0, 0.6, 0.2])
    np.testing.assert_allclose(energy.gain_, [0.4, 0.4])
    assert (energy.low_ <= energy.left_).all() and (energy.left_ <= energy.high_).all()


@pytest.mark.parametrize("rows", [np.zeros((0, 3)), np.full((2, 3), np.nan), np.ones(3), np.ones((2, 1))])
def test_summary_of_nothing_is_refused(rows: np.ndarray) -> None:
    with pytest.raises(PlaygroundError):
        ScaleEnergy().fit(rows)
