"""Means over the frames of clips and paired differences, against resampling and the plain formula."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.analysis.paired import difference, weighted
from playground.analysis.results import Estimate, verdict_of_pairs
from playground.errors import PlaygroundError


@given(st.lists(st.tuples(st.floats(-1e3, 1e3), st.integers(1, 200)), min_size=1, max_size=40))
def test_the_mean_is_that_of_all_frames(clips: list[tuple[float, int]]) -> None:
    values, frames = (list(column) for column in zip(*clips, strict=True))
    mean, half = weighted(values, frames)
    assert mean == pytest.approx(np.repeat(values, frames).mean(), abs=1e-9, rel=1e-9)
    assert half >= 0.0
    if len(set(frames)) == 1:
        assert half == pytest.approx(1.96 * np.std(values) / np.sqrt(len(values)), abs=1e-9)


def test_the_interval_is_that_of_resampled_clips() -> None:
    rng = np.random.default_rng(0)
    frames = rng.integers(20, 200, 400)
    values = 30 + 0.2 * frames + rng.gamma(2.0, 10.0, 400)
    drawn = [np.average(values[some], weights=frames[some]) for some in rng.integers(0, 400, (3000, 400))]
    assert weighted(values, frames)[1] == pytest.approx(1.96 * np.std(drawn), rel=0.06)


def test_a_difference_compares_every_clip_with_itself() -> None:
    mean, half = difference("10 200 30", "11 202 31.5", "50 100 50")
    assert mean == pytest.approx((1 * 50 + 2 * 100 + 1.5 * 50) / 200)
    assert half < 1.0 < weighted([10, 200, 30], [50, 100, 50])[1]  # the clips differ far more than the two systems
    assert difference("1 2", "1 2", "3 4") == (0.0, 0.0)


@pytest.mark.parametrize("words", [("1 2", "1", "3 4"), ("1 2", "1 x", "3 4"), ("", "", ""), ("1", "2", "0"),
                                   ("1 2", "1 2", "3")])  # fmt: skip
def test_what_cannot_be_compared_is_one_sentence(words: tuple[str, str, str]) -> None:
    with pytest.raises(PlaygroundError):
        difference(*words)


def test_the_verdict_follows_the_interval() -> None:
    assert verdict_of_pairs(Estimate(1.0, 0.5)).startswith("seen")
    assert verdict_of_pairs(Estimate(-1.0, 0.5)).startswith("not seen")
    assert verdict_of_pairs(Estimate(1.0, 1.5)).startswith("undecided")
    with pytest.raises(PlaygroundError):
        verdict_of_pairs(Estimate(None))
