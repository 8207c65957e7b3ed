"""The order of two actions, on motions whose order is known by construction."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from playground.analysis.order import action_signal, attention_lag, centre, clauses, in_order
from playground.errors import PlaygroundError
from playground.motion.skeleton import HUMAN22

FRAMES = 60
WRIST, PELVIS = HUMAN22.joints.index("l_wrist"), 0


def acting(walk: slice | None = None, hands: slice | None = None, squat: slice | None = None) -> np.ndarray:
    """A body that stands at the origin but for what it does during the spans."""
    joints = np.ones((FRAMES, 22, 3)) * np.array([0.0, 1.0, 0.0])
    if walk:
        steps = np.zeros(FRAMES)
        steps[walk] = 0.05
        joints[..., 2] += np.cumsum(steps)[:, None]
    if hands:
        joints[hands, WRIST, 1] += 0.7
    if squat:
        joints[squat, PELVIS, 1] -= 0.4
    return joints


EARLY, LATE = slice(5, 20), slice(40, 55)


@pytest.mark.parametrize(("first", "second"), [("walk", "hands"), ("hands", "squat"), ("squat", "walk")])
def test_an_order_is_seen_both_ways(first: str, second: str) -> None:
    joints = acting(**{first: EARLY, second: LATE})
    assert in_order(first, second, joints) is True and in_order(second, first, joints) is False
    assert in_order(first, second, acting(**{first: EARLY})) is None  # the second one never happens
    assert 0 < centre(action_signal(first, joints)) < 0.4 < centre(action_signal(second, joints))


def test_a_centre_by_hand() -> None:
    assert centre([0, 0, 2]) == 1.0 and centre([1, 0, 1]) == 0.5 and centre([3, 1, 0]) == pytest.approx(0.125)
    assert np.isnan(centre([0, 0]))
    for wrong in ([1.0], [-1.0, 1.0], [[1.0, 2.0]]):
        with pytest.raises(PlaygroundError, match="centre in time"):
            centre(wrong)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(0, 1e6), min_size=2, max_size=30))
def test_a_reversed_signal_has_the_mirrored_centre(values: list[float]) -> None:
    found = centre(values)
    if np.isfinite(found):
        assert 0 <= found <= 1 and centre(values[::-1]) == pytest.approx(1 - found, abs=1e-9)


def test_clauses_leave_out_what_says_nothing() -> None:
    words = ["[CLS]", "a", "person", "walks", "forward", "and", "then", "raises", "both", "hands", ".", "[SEP]"]
    assert clauses(words) == ([3, 4], [7, 8, 9])
    for wrong in (["walks"], ["then", "walks"], ["walks", "then", "runs", "then", "jumps"], ["a", "then", "runs"]):
        with pytest.raises(PlaygroundError, match="two clauses"):
            clauses(wrong)


def test_a_lag_is_a_difference_of_mean_centres() -> None:
    weights = np.zeros((11, 4))
    weights[0, 0], weights[[1, 3], 1], weights[10, 2] = 0.2, 0.5, 7.0  # centres 0, 0.2 and 1; the last word is unseen
    assert attention_lag(weights, [0, 1], [2]) == pytest.approx(1.0 - 0.1)
    assert attention_lag(weights, [2], [0, 1, 3]) == pytest.approx(0.1 - 1.0)
    assert np.isnan(attention_lag(weights, [0], [3]))
    with pytest.raises(PlaygroundError, match="both clauses"):
        attention_lag(weights, [], [1])


def test_an_unknown_action_is_told() -> None:
    with pytest.raises(PlaygroundError, match="dance"):
        action_signal("dance", acting())
