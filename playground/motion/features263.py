"""Joints <-> the 263 columns of HumanML3D (systems.md A1: its first 67 are LG-Tok's). numpy only.

| columns | content |
|---|---|
| 0-66 | `to_features67`: heading increment, root velocity, root height, joints 1..21 relative to root and heading |
| 67-192 | 6D rotations of joints 1..21, along the five chains (HumanML3D's inverse kinematics) |
| 193-258 | velocities of joints 0..21 in the frame of heading t, m/frame |
| 259-262 | contacts of left ankle, left foot, right ankle, right foot: squared step below 0.002 m² |
"""

import numpy as np
from numpy.typing import NDArray

from playground.motion.kinematics import unit
from playground.motion.representation import COLUMNS, from_features67, heading, to_features67
from playground.motion.rotation import (
    Array,
    matrix_to_6d,
    qbetween,
    qinv,
    qmul,
    qrotate,
    quaternion_to_matrix,
    sixd_to_matrix,
    yaw_quaternion,
)
from playground.motion.skeleton import CHAINS, FEET, HUMAN22

COLUMNS263 = COLUMNS + 6 * (HUMAN22.size - 1) + 3 * HUMAN22.size + 4
ROTATIONS = slice(COLUMNS, COLUMNS + 6 * (HUMAN22.size - 1))  # 67-192
VELOCITIES = slice(ROTATIONS.stop, ROTATIONS.stop + 3 * HUMAN22.size)  # 193-258
CONTACTS = slice(VELOCITIES.stop, COLUMNS263)  # 259-262
CONTACT_STEP = 0.002  # m² a frame
_LETTERS = {"x": (1, 0, 0), "X": (-1, 0, 0), "y": (0, 1, 0), "Y": (0, -1, 0), "z": (0, 0, 1), "-": (0, 0, 0)}
DIRECTIONS = np.array([_LETTERS[letter] for letter in "-xXyYYyYYyzzyxXzYYYYYY"], np.float64)  # [22, 3] of each bone


def chain_rotations(joints: Array, root: Array) -> Array:
    """Local rotations [F, 22, 4] as HumanML3D computes them from joints [F, 22, 3] and root rotations [F, 4].

    Each bone is the shortest turn of its unit direction; every chain, the arms too, starts from the root's rotation.
    """
    joints = np.asarray(joints, np.float64)
    local = np.zeros((len(joints), HUMAN22.size, 4))
    local[:, 0] = root
    for chain in CHAINS:
        above: Array = np.asarray(root, np.float64)
        for parent, joint in zip(chain, chain[1:], strict=False):
            turned = qbetween(DIRECTIONS[joint], joints[:, joint] - joints[:, parent])
            local[:, joint] = qmul(qinv(above), turned)
            above = turned
    return local


def to_features263(joints: Array, rule: str = "body") -> NDArray[np.float32]:
    """Canonical joints [F, 22, 3] in metres -> float32 [F-1, 263]. PlaygroundError for fewer than two poses.

    rule: how the heading is read off the body; "humanml3d" gives the columns of HumanML3D's released extraction.
    """
    first = to_features67(joints, rule)
    joints = np.asarray(joints, np.float64)
    turn = yaw_quaternion(heading(joints, rule=rule))
    rotations = matrix_to_6d(quaternion_to_matrix(chain_rotations(joints, turn)[:-1, 1:]))
    steps = np.diff(joints, axis=0)
    velocities = qrotate(turn[:-1, None], steps)
    contacts = np.sum(steps[:, list(FEET)] ** 2, axis=-1) < CONTACT_STEP
    rows = [rotations.reshape(len(first), -1), velocities.reshape(len(first), -1), contacts]
    return np.concatenate([first, *(row.astype(np.float32) for row in rows)], axis=-1)


def from_features263(features: Array) -> NDArray[np.float32]:
    """Un-normalised rows [F, 263] -> joints float32 [F, 22, 3] from root and positions, as HumanML3D recovers them."""
    return from_features67(np.asarray(features)[:, :COLUMNS])


def from_rotations263(features: Array, lengths: Array = HUMAN22.bone_lengths) -> NDArray[np.float32]:
    """Un-normalised rows [F, 263] -> joints float32 [F, 22, 3] from root and rotations; lengths [22] in metres."""
    x = np.asarray(features, np.float64)
    positions = from_features67(x[:, :COLUMNS])
    half_yaw = np.concatenate([[0.0], np.cumsum(x[:-1, 0])])
    root = quaternion_to_matrix(yaw_quaternion(2.0 * half_yaw))
    local = sixd_to_matrix(x[:, ROTATIONS].reshape(len(x), -1, 6))
    bones = unit(DIRECTIONS) * np.asarray(lengths, np.float64)[:, None]
    joints = np.repeat(positions[:, :1].astype(np.float64), HUMAN22.size, axis=1)
    for chain in CHAINS:
        turned: Array = root
        for parent, joint in zip(chain, chain[1:], strict=False):
            turned = turned @ local[:, joint - 1]
            joints[:, joint] = joints[:, parent] + turned @ bones[joint]
    return joints.astype(np.float32)
