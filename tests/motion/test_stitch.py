"""Frames between frames: kept ones untouched, borders closed, both anchors, nasty masks."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from playground.errors import PlaygroundError
from playground.motion.representation import from_features67
from playground.motion.stitch import BLEND, Track, jolt_mm, rows_yaw, runs, stitch
from playground.motion.synthetic import corpus


def recorded(index: int = 0, frames: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Joints and yaw of a synthetic motion."""
    from playground.motion.representation import canonicalise, to_features67

    joints = canonicalise(corpus(4, seed=2)[index].motion.joints)
    joints = np.concatenate([joints, np.repeat(joints[-1:], frames + 1, axis=0)])[: frames + 1]
    rows = to_features67(joints)
    return from_features67(rows), rows_yaw(rows)


FIRST, SECOND = recorded(0), recorded(1)


def distances(joints: np.ndarray) -> np.ndarray:
    """[F, F] between all pelvises, and [F, 22, 22] inside each pose: what a rigid move leaves alone."""
    return np.linalg.norm(joints[:, :, None] - joints[:, None], axis=-1)


def test_a_track_is_the_motion_again():
    joints, yaw = FIRST
    track = Track.of(joints, yaw)
    np.testing.assert_allclose(track.joints(), joints, atol=1e-5)
    moved = track.moved(7, np.array([3.0, -2.0]), 1.0)
    np.testing.assert_allclose(moved.place[7], [3.0, -2.0])
    assert moved.yaw[7] == pytest.approx(1.0)
    np.testing.assert_allclose(distances(moved.joints()), distances(joints.astype(np.float64)), atol=1e-5)
    steps, before = np.diff(moved.place, axis=0), np.diff(track.place, axis=0)
    np.testing.assert_allclose(np.linalg.norm(steps, axis=1), np.linalg.norm(before, axis=1), atol=1e-9)


def test_yaw_turns_each_pose_as_recovery_does():
    rows = np.random.default_rng(0).normal(size=(9, 67)) * 0.3
    joints = from_features67(rows)
    pose = Track.of(joints, rows_yaw(rows)).pose
    np.testing.assert_allclose(pose[:, 1:], rows[:, 4:].reshape(9, 21, 3), atol=1e-5)


@pytest.mark.parametrize("anchor", ["place", "body"])
def test_a_motion_put_into_itself_is_unchanged(anchor):
    joints, yaw = FIRST
    kept = np.ones(60, bool)
    kept[20:35] = False
    done = stitch(joints, yaw, joints, yaw, kept, anchor=anchor)
    np.testing.assert_allclose(done.joints, joints, atol=1e-4)
    assert done.gap_m < 1e-4 and done.gap_degrees < 0.01
    elsewhere = Track.of(joints, yaw).moved(0, np.array([5.0, 5.0]), 2.0)
    again = stitch(joints, yaw, elsewhere.joints(), elsewhere.yaw, kept, anchor=anchor)
    np.testing.assert_allclose(again.joints, joints, atol=1e-4)  # where the made motion stood does not matter


MASKS = st.lists(st.booleans(), min_size=60, max_size=60).map(np.array)
BLOCKS = st.lists(st.integers(0, 60), min_size=2, max_size=6).map(
    lambda edges: (np.searchsorted(np.sort(edges), np.arange(60), side="right") % 2).astype(bool)
)


@settings(max_examples=40)
@given(st.one_of(MASKS, BLOCKS), st.booleans())
def test_kept_frames_are_the_sources_own(kept, whole):
    (joints, yaw), (made, made_yaw) = FIRST, SECOND
    done = stitch(joints, yaw, made, made_yaw, kept, anchor="place", blend=BLEND if whole else 0)
    np.testing.assert_array_equal(done.joints[kept], joints[kept])
    assert np.isfinite(done.joints).all()
    moved = stitch(joints, yaw, made, made_yaw, kept, anchor="body", blend=BLEND if whole else 0)
    for start, stop in runs(kept):
        was, now = joints[start:stop].astype(np.float64), moved.joints[start:stop].astype(np.float64)
        np.testing.assert_allclose(distances(now), distances(was), atol=1e-4)
        np.testing.assert_allclose(now[..., 1], was[..., 1], atol=1e-5)  # moved on the floor, as one piece
        np.testing.assert_allclose(
            np.linalg.norm(now[:, 0] - now[0, 0], axis=-1), np.linalg.norm(was[:, 0] - was[0, 0], axis=-1), atol=1e-4
        )
    before = int(np.argmin(kept)) if not kept.all() else 60
    np.testing.assert_array_equal(moved.joints[:before], joints[:before])


def test_borders_are_smoother_with_the_blend_and_the_path_is_continuous():
    (joints, yaw), (made, made_yaw) = FIRST, SECOND
    kept = np.ones(60, bool)
    kept[20:44] = False
    arrays = (joints, yaw, made, made_yaw, kept)
    done, raw = stitch(*arrays), stitch(*arrays, blend=0)
    for frame in (20, 44):
        assert jolt_mm(done.joints, frame) < jolt_mm(raw.joints, frame)
    steps = np.linalg.norm(np.diff(done.joints[:, 0], axis=0), axis=-1)
    share = done.gap_m * 1.5 / 25  # the steepest part of the eased way
    speed = max(np.linalg.norm(np.diff(part[:, 0], axis=0), axis=-1).max() for part in (joints, made))
    assert steps.max() < speed + share + 0.1
    body = stitch(*arrays, anchor="body")
    assert np.linalg.norm(body.joints[44, 0] - joints[44, 0]) == pytest.approx(done.gap_m, abs=0.05)
    np.testing.assert_array_equal(body.joints[:20], joints[:20])


def test_without_a_kept_side_the_made_frames_stand_as_made():
    (joints, yaw), (made, made_yaw) = FIRST, SECOND
    alone = stitch(joints, yaw, made, made_yaw, np.zeros(60, bool))
    np.testing.assert_allclose(alone.joints, made, atol=1e-5)
    assert (alone.gap_m, alone.gap_degrees) == (0, 0)
    kept = np.arange(60) >= 40  # the beginning is made: it is put where it meets the kept end
    done = stitch(joints, yaw, made, made_yaw, kept, blend=0)
    to = np.linalg.norm(done.joints[39, 0] - joints[40, 0])
    assert to == pytest.approx(np.linalg.norm(np.diff(made[39:41, 0], axis=0)), abs=0.2)


def test_runs_and_jolts_against_loops():
    flags = np.array([1, 1, 0, 1, 0, 0, 1], bool)
    assert list(runs(flags)) == [(0, 2), (3, 4), (6, 7)] and list(runs(np.zeros(3, bool))) == []
    x = np.random.default_rng(1).normal(size=(8, 22, 3))

    def second(f: int) -> float:
        return float(np.mean([np.linalg.norm(x[f + 1, j] - 2 * x[f, j] + x[f - 1, j]) for j in range(22)]))

    assert jolt_mm(x, 4) == pytest.approx(1000 * max(second(3), second(4)))
    assert jolt_mm(x, 1) == pytest.approx(1000 * second(1)) and jolt_mm(x, 7) == pytest.approx(1000 * second(6))
    assert jolt_mm(x[:2], 1) == 0.0


def test_unknown_anchors_are_refused():
    with pytest.raises(PlaygroundError, match="place or body"):
        stitch(*FIRST, *SECOND, np.ones(60, bool), anchor="floor")
