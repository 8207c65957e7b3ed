"""Differences of motions against a slow formula in the world, and spans against all runs of frames."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from playground.errors import PlaygroundError
from playground.motion.differences import body_joints, governed_span, joint_differences
from playground.motion.representation import from_features67
from playground.motion.rotation import qrotate, yaw_quaternion


def wandering(frames: int = 12, seed: int = 0) -> np.ndarray:
    """Rows [frames, 67] with large steps and turns."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(frames, 67)) * 0.3
    rows[:, 3] += 1.0
    return rows


def seen_slowly(rows: np.ndarray) -> np.ndarray:
    """The recovered motion, each frame seen from the body's place and heading one frame before."""
    joints, yaw = from_features67(rows).astype(np.float64), np.concatenate([[0.0], -2 * np.cumsum(rows[:-1, 0])])
    out = []
    for frame in range(len(rows)):
        before = max(frame - 1, 0)
        moved = joints[frame] - joints[before, 0] * [1, 0, 1]
        out.append(qrotate(yaw_quaternion(np.array(-yaw[before])), moved))
    return np.stack(out)


def test_body_joints_are_the_world_seen_from_one_frame_before():
    rows = wandering()
    np.testing.assert_allclose(body_joints(rows), seen_slowly(rows), atol=1e-5)
    both = np.stack([rows, wandering(seed=1)])
    np.testing.assert_allclose(body_joints(both)[1], body_joints(both[1]))


def test_a_change_of_one_frame_counts_there_and_not_later():
    rows = wandering()
    for column in (0, 1, 2):  # turn and step of frame 5, seen in frame 6
        changed = rows.copy()
        changed[5, column] += 0.2
        frames = np.flatnonzero(joint_differences(rows, changed).max(axis=1) > 1e-6)
        assert frames.tolist() == [6]
        world = np.abs(from_features67(rows) - from_features67(changed)).max(axis=(1, 2))
        assert (world[6:] > 1e-3).all()  # in the world it never ends
    changed = rows.copy()
    changed[5, 4 + 3 * 9 : 4 + 3 * 10] += [0.3, 0.0, 0.4]  # joint 10
    difference = joint_differences(rows, changed)
    assert difference[5, 10] == pytest.approx(0.5, abs=1e-6)
    assert difference.sum() == pytest.approx(0.5, abs=1e-6)
    changed = rows.copy()
    changed[5, 3] -= 0.25
    assert joint_differences(rows, changed)[5, 0] == pytest.approx(0.25, abs=1e-6)


def test_many_against_one_and_shapes_that_do_not_fit():
    rows = np.stack([wandering(seed=s) for s in range(3)])
    together = joint_differences(rows, rows[0])
    assert together.shape == (3, 12, 22) and not together[0].any()
    np.testing.assert_array_equal(together[2], joint_differences(rows[2], rows[0]))
    for wrong in (rows[0, :5], rows[0][:, :66], rows[0, 0]):
        with pytest.raises(PlaygroundError, match="are compared"):
            joint_differences(rows[0], wrong)


def slow_span(difference: np.ndarray, share: float) -> tuple[int, int]:
    energy = (difference.astype(np.float64) ** 2).sum(axis=1)
    whole = energy.sum()
    if not whole > 0:
        return 0, 0
    runs = [(a, b) for a in range(len(energy)) for b in range(a + 1, len(energy) + 1)]
    enough = [(a, b) for a, b in runs if energy[a:b].sum() >= share * whole * (1 - 1e-9)]
    shortest = min(b - a for a, b in enough)
    return max(((a, b) for a, b in enough if b - a == shortest), key=lambda r: (energy[r[0] : r[1]].sum(), -r[0]))


SHAPES = st.tuples(st.integers(1, 14), st.integers(1, 3))
VALUES = st.sampled_from([0, 0, 0.5, 1, 2, 8])


@given(arrays.arrays(np.float32, SHAPES, elements=VALUES), st.sampled_from([0.5, 0.8, 1.0]))
def test_spans_are_the_shortest_runs(difference, share):
    start, stop = governed_span(difference, share)
    slow = slow_span(difference, share)
    assert stop - start == slow[1] - slow[0]
    energy = (difference.astype(np.float64) ** 2).sum(axis=1)
    assert energy[start:stop].sum() == pytest.approx(energy[slow[0] : slow[1]].sum())


def test_nothing_changed_governs_nothing():
    assert governed_span(np.zeros((9, 22))) == (0, 0)
    assert governed_span(np.eye(9, 22)[:, :1] * 3) == (0, 1)
