"""Motion metrics against loops over frames and joints, and on motions that should not be measured."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.errors import PlaygroundError
from playground.motion.measures import bone_drift, foot_sliding, joint_errors, mpjpe, path_drift
from playground.motion.skeleton import HUMAN22

SEEDS = st.integers(0, 2**16)


def motion(frames: int, seed: int, size: float = 1.0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(frames, 22, 3)) * size


@given(st.integers(1, 6), SEEDS)
def test_mpjpe_against_a_loop(frames: int, seed: int) -> None:
    a, b = motion(frames, seed), motion(frames, seed + 1)
    total = 0.0
    for f in range(frames):
        for j in range(22):
            delta = [(a[f, j, c] - a[f, 0, c]) - (b[f, j, c] - b[f, 0, c]) for c in range(3)]
            total += math.sqrt(sum(value * value for value in delta))
    assert mpjpe(a, b) == pytest.approx(total / (frames * 22) * 1000, rel=1e-9)
    assert mpjpe(a, b) == pytest.approx(mpjpe(b, a))


@given(st.integers(1, 5), SEEDS)
def test_mpjpe_does_not_see_where_the_pelvis_is(frames: int, seed: int) -> None:
    a = motion(frames, seed)
    moved = a + motion(frames, seed + 1)[:, :1]
    assert mpjpe(a, moved) == pytest.approx(0.0, abs=1e-9)


def test_one_joint_one_centimetre_off() -> None:
    a = motion(3, 0)
    b = a.copy()
    b[:, 20, 1] += 0.01
    assert mpjpe(a, b) == pytest.approx(10 / 22)


def test_clips_pool_by_frame() -> None:
    pairs = [(motion(2, 0), motion(2, 1)), (motion(7, 2), motion(7, 3))]
    pooled = np.concatenate([joint_errors(a, b) for a, b in pairs]).mean()
    joined = mpjpe(np.concatenate([a for a, _ in pairs]), np.concatenate([b for _, b in pairs]))
    assert pooled == pytest.approx(joined)


@pytest.mark.parametrize("metric", [foot_sliding, bone_drift, lambda joints: mpjpe(joints, joints)])
@pytest.mark.parametrize(
    "joints", [np.zeros((0, 22, 3)), np.zeros((4, 21, 3)), np.zeros((22, 3)), np.full((4, 22, 3), np.nan),
               np.full((4, 22, 3), np.inf)],
)  # fmt: skip
def test_what_is_no_motion_is_refused(metric, joints: np.ndarray) -> None:
    with pytest.raises(PlaygroundError):
        metric(joints)


def test_lengths_must_agree() -> None:
    with pytest.raises(PlaygroundError, match="3 and 4 frames"):
        mpjpe(motion(3, 0), motion(4, 0))


def slow_sliding(joints: np.ndarray, fps: float) -> float:
    top = bottom = 0.0
    for f in range(len(joints) - 1):
        for toe in (10, 11):
            here, there = joints[f, toe], joints[f + 1, toe]
            height = max(here[1], there[1])
            if height >= 0.05:
                continue
            weight = 2 - 2 ** (max(height, 0.0) / 0.05)
            top += weight * math.hypot(there[0] - here[0], there[2] - here[2]) * fps * 1000
            bottom += weight
    return top / bottom if bottom else float("nan")


@given(st.integers(2, 12), SEEDS, st.sampled_from([0.01, 0.05, 1.0]), st.sampled_from([20.0, 60.0]))
def test_sliding_against_a_loop(frames: int, seed: int, size: float, fps: float) -> None:
    joints = motion(frames, seed, size)
    expected, measured = slow_sliding(joints, fps), foot_sliding(joints, fps)
    assert math.isnan(measured) if math.isnan(expected) else measured == pytest.approx(expected)


def test_planted_sliding_and_flying_feet() -> None:
    joints = np.zeros((10, 22, 3))
    assert foot_sliding(joints) == 0.0
    joints[:, :, 0] = np.arange(10)[:, None] * 0.01  # one centimetre a frame at 20 frames a second
    assert foot_sliding(joints) == pytest.approx(200.0)
    assert math.isnan(foot_sliding(joints + np.array([0.0, 0.5, 0.0])))
    assert foot_sliding(joints + np.array([0.0, 0.5, 0.0]), floor=0.5) == pytest.approx(200.0)


def test_sliding_needs_two_frames() -> None:
    with pytest.raises(PlaygroundError, match="2 frames"):
        foot_sliding(np.zeros((1, 22, 3)))


@given(st.integers(1, 8), SEEDS)
def test_drift_against_a_loop(frames: int, seed: int) -> None:
    joints = motion(frames, seed)
    deviations = []
    for bone in range(1, 22):
        lengths = [float(np.linalg.norm(joints[f, bone] - joints[f, HUMAN22.parents[bone]])) for f in range(frames)]
        middle = (
            sorted(lengths)[frames // 2] if frames % 2 else sum(sorted(lengths)[frames // 2 - 1 : frames // 2 + 1]) / 2
        )
        deviations += [abs(length - middle) for length in lengths]
    assert bone_drift(joints) == pytest.approx(np.mean(deviations) * 1000)


def test_a_rigid_body_does_not_drift() -> None:
    pose = motion(1, 5)
    turned = pose @ np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    assert bone_drift(np.concatenate([pose, turned + 3.0, pose - 1.0])) == pytest.approx(0.0, abs=1e-9)


@given(st.integers(1, 6), SEEDS)
def test_path_drift_against_a_loop(frames: int, seed: int) -> None:
    a, b = motion(frames, seed), motion(frames, seed + 1)
    total = sum(math.hypot(a[f, 0, 0] - b[f, 0, 0], a[f, 0, 2] - b[f, 0, 2]) for f in range(frames))
    assert path_drift(a, b) == pytest.approx(total / frames)
    raised = a + np.array([0.0, 3.0, 0.0])
    assert path_drift(a, raised) == 0.0
    with pytest.raises(PlaygroundError, match="one length"):
        path_drift(a, motion(frames + 1, seed))
