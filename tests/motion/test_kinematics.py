"""Forward kinematics against a loop with scipy's rotations; bones, two-bone IK, rigid motions as properties."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from playground.motion import kinematics as k
from playground.motion.skeleton import HUMAN22
from tests.motion.skeletons import walk

SEEDS = st.integers(0, 2**16)
PARENTS = HUMAN22.parents


def random_rotations(seed: int, frames: int, size: float = 0.6) -> np.ndarray:
    vectors = np.random.default_rng(seed).normal(size=(frames * 22, 3)) * size
    return Rotation.from_rotvec(vectors).as_quat()[:, [3, 0, 1, 2]].reshape(frames, 22, 4)


@given(SEEDS)
@settings(max_examples=25)
def test_forward_kinematics_against_a_walk_down_the_tree(seed: int) -> None:
    rotations, root = random_rotations(seed, 3), np.random.default_rng(seed).normal(size=(3, 3))
    joints = k.forward_kinematics(rotations, root)
    for f in range(3):
        for joint in range(22):
            chain = []
            j = joint
            while PARENTS[j] >= 0:
                chain.append(j)
                j = PARENTS[j]
            position, turn = root[f].copy(), Rotation.identity()
            for j in reversed(chain):
                w, x, y, z = rotations[f, PARENTS[j]]
                turn = turn * Rotation.from_quat([x, y, z, w])
                position = position + turn.apply(HUMAN22.offsets[j])
            assert np.allclose(joints[f, joint], position, atol=1e-9)
    assert np.allclose(k.bone_lengths(joints), HUMAN22.bone_lengths, atol=1e-6)


@given(SEEDS)
@settings(max_examples=30)
def test_rotations_from_joints_give_the_joints_back(seed: int) -> None:
    joints = k.forward_kinematics(random_rotations(seed, 5), np.zeros((5, 3)))
    rotations = k.rotations_from_joints(joints)
    assert np.allclose(np.linalg.norm(rotations, axis=-1), 1.0)
    assert np.allclose(k.forward_kinematics(rotations, joints[:, 0]), joints, atol=1e-6)


def test_rotations_of_the_t_pose_are_none_and_a_turned_body_turns_at_the_pelvis_only() -> None:
    rest = k.forward_kinematics(np.tile([1.0, 0, 0, 0], (1, 22, 1)), np.zeros((1, 3)))
    turn = Rotation.from_euler("YXZ", [70, 20, -30], degrees=True)
    rotations = k.rotations_from_joints(np.stack([rest[0], turn.apply(rest[0])]))
    assert np.allclose(np.abs(rotations[0, :, 0]), 1.0, atol=1e-9)
    assert np.allclose(np.abs(rotations[1, 1:, 0]), 1.0, atol=1e-9)
    assert np.allclose(np.abs(rotations[1, 0, [1, 2, 3, 0]] @ turn.as_quat()), 1.0)


def test_limbs_get_no_twist_of_their_own_and_the_spine_shares_it() -> None:
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (1, 22, 1))
    half = np.radians(60) / 2
    turns[0, 9] = [np.cos(half), 0, np.sin(half), 0]  # the chest turns by 60 degrees, pelvis and spine do not
    joints = k.forward_kinematics(turns, np.zeros((1, 3)))
    rotations = k.rotations_from_joints(joints)
    twist = [np.degrees(2 * np.arctan2(abs(rotations[0, j, 2]), abs(rotations[0, j, 0]))) for j in (3, 6, 9)]
    assert np.allclose(twist, 20.0, atol=8.0) and sum(twist) == pytest.approx(60.0, abs=2.0)
    for joint in (16, 18, 4, 5):  # hanging on straight bones, these turn about nothing
        assert abs(rotations[0, joint, 0]) == pytest.approx(1.0, abs=1e-6)


@given(SEEDS, st.floats(0.02, 2.5))
def test_two_bone_ik_keeps_its_bones_and_reaches_what_can_be_reached(seed: int, distance: float) -> None:
    rng = np.random.default_rng(seed)
    start, pole = rng.normal(size=(6, 3)), rng.normal(size=(6, 3))
    away = rng.normal(size=(6, 3))
    end = start + away / np.linalg.norm(away, axis=-1, keepdims=True) * distance
    middle, reached = k.two_bone_ik(start, end, (0.5, 0.4), pole)
    assert np.allclose(np.linalg.norm(middle - start, axis=-1), 0.5, atol=1e-6)
    assert np.allclose(np.linalg.norm(reached - middle, axis=-1), 0.4, atol=1e-6)
    gap = np.linalg.norm(reached - end, axis=-1)
    assert np.allclose(gap, max(0.0, distance - 0.9, 0.1 - distance), atol=1e-5)
    line = (end - start) / distance
    sideways = pole - np.sum(pole * line, axis=-1, keepdims=True) * line
    assert (np.sum((middle - start) * sideways, axis=-1) > -1e-5).all(), "the middle joint bends towards the pole"


@pytest.mark.parametrize("end", [[0.0, 0.0, 0.0], [0.0, -0.9, 0.0], [0.0, -50.0, 0.0]])
def test_two_bone_ik_survives_a_pole_along_the_chain_and_an_end_on_the_start(end: list[float]) -> None:
    middle, reached = k.two_bone_ik(np.zeros((1, 3)), np.array([end]), (0.5, 0.4), np.array([[0.0, 1.0, 0.0]]))
    assert np.isfinite(middle).all() and np.isfinite(reached).all()
    assert np.linalg.norm(middle) == pytest.approx(0.5, abs=1e-6)


@given(SEEDS)
@settings(max_examples=20)
def test_set_bone_lengths_sets_them_and_keeps_directions_and_feet(seed: int) -> None:
    joints = walk()[:20].astype(float)
    lengths = HUMAN22.bone_lengths * np.random.default_rng(seed).uniform(0.97, 1.03, 22)
    out = k.set_bone_lengths(joints, lengths)
    assert np.allclose(k.bone_lengths(out), lengths, atol=1e-6)
    for j in (3, 6, 9, 12, 15, 18, 21):
        before, after = joints[:, j] - joints[:, PARENTS[j]], out[:, j] - out[:, PARENTS[j]]
        assert np.allclose(np.cross(before, after), 0.0, atol=1e-6)
    for hip, knee, ankle, _ in k.LEGS:
        reach = lengths[knee] + lengths[ankle] - np.linalg.norm(joints[:, ankle] - out[:, hip], axis=-1)
        moved = np.linalg.norm(out[:, ankle] - joints[:, ankle], axis=-1)
        assert (moved[reach > 0.002] < k.FOOT_TOLERANCE + 1e-6).all()


def test_set_bone_lengths_without_feet_only_stretches() -> None:
    joints = walk()[:5].astype(float)
    out = k.set_bone_lengths(joints, 2.0 * HUMAN22.bone_lengths, keep_feet=False)
    assert np.allclose(out - out[:, :1], 2.0 * (joints - joints[:, :1]), atol=1e-5)


def test_a_bone_without_length_gets_a_direction() -> None:
    joints = np.zeros((2, 22, 3))
    out = k.set_bone_lengths(joints, HUMAN22.bone_lengths)
    assert np.isfinite(out).all() and np.allclose(k.bone_lengths(out), HUMAN22.bone_lengths, atol=1e-6)


def test_a_rigid_motion_stays_and_says_nothing() -> None:
    joints = walk()
    rigid = k.make_rigid(joints)
    assert np.abs(rigid.joints - joints).max() < 1e-4 and not rigid.changes()
    assert np.allclose(np.linalg.norm(rigid.offsets, axis=-1), HUMAN22.bone_lengths, atol=1e-4)


@given(SEEDS, st.floats(0.001, 0.03))
@settings(max_examples=15)
def test_a_drifting_motion_becomes_rigid_near_by(seed: int, noise: float) -> None:
    rng = np.random.default_rng(seed)
    joints = walk()[:40] + rng.normal(size=(40, 22, 3)) * noise
    rigid = k.make_rigid(joints)
    assert np.ptp(k.bone_lengths(rigid.joints), axis=0).max() < 1e-6
    rotations = k.rotations_from_joints(rigid.joints, rigid.offsets)
    assert np.allclose(k.forward_kinematics(rotations, rigid.joints[:, 0], rigid.offsets), rigid.joints, atol=1e-6)
    assert rigid.moved == pytest.approx(np.linalg.norm(rigid.joints - joints, axis=-1).max())
    assert np.linalg.norm(rigid.joints - joints, axis=-1).mean() < 3 * noise
    assert bool(rigid.changes()) == (rigid.moved > k.CHANGE_WORTH_SAYING)


def test_recorded_clips_are_rigid_to_their_rounding(library_data: Path) -> None:
    with np.load(library_data / "motions.npz") as data:
        starts, packed, scale = data["offsets"], data["joints"], float(data["scale"])
    for i in range(5, len(starts) - 1, 97):
        joints = packed[starts[i] : starts[i + 1]].astype(float) * scale
        rigid = k.make_rigid(joints)
        assert rigid.moved < 1.1e-3 and not rigid.changes(), f"clip {i}"
