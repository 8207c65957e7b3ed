"""The 263 columns against HumanML3D's steps written out with scalar loops, and back again."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from playground.errors import PlaygroundError
from playground.motion import features263 as f
from playground.motion.representation import heading, to_features67
from playground.motion.skeleton import CHAINS, HUMAN22
from tests.motion.skeletons import walk

SEEDS = st.integers(0, 2**16)
UNIT = {"l_hip": (1, 0, 0), "r_hip": (-1, 0, 0), "l_collar": (1, 0, 0), "r_collar": (-1, 0, 0), "l_foot": (0, 0, 1),
        "r_foot": (0, 0, 1), "head": (0, 0, 1)}  # fmt: skip
UP = ("spine1", "spine2", "spine3", "neck")


def direction(joint: int) -> tuple[int, int, int]:
    """The unit direction of a bone in HumanML3D's table: outwards, forwards, up, else down."""
    name = HUMAN22.joints[joint]
    return UNIT.get(name, (0, 1, 0) if name in UP else (0, -1, 0))


def shortest(u: np.ndarray, v: np.ndarray) -> Rotation:
    v = v / np.linalg.norm(v)
    axis, cosine = np.cross(u, v), float(u @ v)
    sine = np.linalg.norm(axis)
    return Rotation.from_rotvec(axis / max(sine, 1e-12) * np.arctan2(sine, cosine))


def slow_rotations(joints: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """[F-1, 126]: along each chain the bone's turn as seen from the turn above it; chains start from the heading."""
    rows = np.zeros((len(joints) - 1, 22, 6))
    for t in range(len(joints) - 1):
        for chain in CHAINS:
            above = Rotation.from_euler("Y", yaw[t])
            for parent, joint in zip(chain, chain[1:], strict=False):
                turned = shortest(np.array(direction(joint), float), joints[t, joint] - joints[t, parent])
                matrix = (above.inv() * turned).as_matrix()
                rows[t, joint] = [*matrix[:, 0], *matrix[:, 1]]
                above = turned
    return rows[:, 1:].reshape(len(rows), -1)


def test_columns_against_scalar_loops() -> None:
    joints = walk()[:30].astype(np.float64)
    x = f.to_features263(joints)
    yaw = heading(joints)
    assert x.shape == (29, 263) and x.dtype == np.float32
    assert np.allclose(x[:, f.ROTATIONS], slow_rotations(joints, yaw), atol=1e-5)
    for t in range(29):
        turn = Rotation.from_euler("Y", yaw[t])
        for j in range(22):
            step = turn.apply(joints[t + 1, j] - joints[t, j])
            assert np.allclose(x[t, 193 + 3 * j : 196 + 3 * j], step, atol=1e-6)
        for n, j in enumerate((7, 10, 8, 11)):
            squared = sum(float(joints[t + 1, j, c] - joints[t, j, c]) ** 2 for c in range(3))
            assert x[t, 259 + n] == (1.0 if squared < 0.002 else 0.0)


def test_the_layout_is_humanml3ds() -> None:
    assert (
        263,
        slice(67, 193),
        slice(193, 259),
        slice(259, 263),
    ) == (f.COLUMNS263, f.ROTATIONS, f.VELOCITIES, f.CONTACTS)


@given(SEEDS)
@settings(max_examples=25)
def test_first_columns_are_the_67_bit_for_bit_and_positions_come_back(seed: int) -> None:
    rng = np.random.default_rng(seed)
    joints = walk()[:40] + rng.normal(size=(40, 22, 3)).astype(np.float32) * 0.05
    joints[0] = walk()[0]
    x = f.to_features263(joints)
    assert np.array_equal(x[:, :67], to_features67(joints))
    assert np.abs(f.from_features263(x) - joints[:-1]).max() < 1e-4


def test_rotations_and_bone_lengths_give_the_joints_back() -> None:
    joints = walk()
    assert np.abs(f.from_rotations263(f.to_features263(joints)) - joints[:-1]).max() < 1e-3


def test_a_standing_body_has_contacts_and_a_jump_has_none() -> None:
    still = np.repeat(walk()[:1], 5, axis=0)
    assert (f.to_features263(still)[:, f.CONTACTS] == 1).all()
    still[:, :, 1] += np.arange(5)[:, None] * 0.06
    assert (f.to_features263(still)[:, f.CONTACTS] == 0).all()


def test_one_pose_has_no_features() -> None:
    with pytest.raises(PlaygroundError):
        f.to_features263(walk()[:1])


def test_recorded_clips_come_back(library_data: Path) -> None:
    with np.load(library_data / "motions.npz") as data:
        starts, packed, scale = data["offsets"], data["joints"], float(data["scale"])
    for i in range(3, len(starts) - 1, 41):
        joints = packed[starts[i] : starts[i + 1]].astype(np.float32) * np.float32(scale)
        x = f.to_features263(joints)
        assert np.isfinite(x).all() and np.array_equal(x[:, :67], to_features67(joints))
        assert np.abs(f.from_features263(x) - joints[:-1]).max() < 1e-4, f"clip {i}"
        assert np.abs(f.from_rotations263(x) - joints[:-1]).max() < 5e-3, f"clip {i}"
