"""Joints and rotations of a 24-joint rig <-> the 148 and 296 columns of SnapMoGen (arXiv 2507.09122; systems.md E1).

| columns | content |
|---|---|
| 0 | yaw step to the next frame, in full (HumanML3D: half), radians |
| 1-2 | root velocity x and z in the frame of heading t (HumanML3D: t + 1), a frame |
| 3 | root height |
| 4-147 | 6D rotations of all 24 joints against the world, the heading removed |
| 148-219 | positions of all joints relative to the root's x and z, in the frame of heading t |
| 220-291 | steps of those positions to the next frame |
| 292-295 | contacts of left ankle, left foot, right ankle, right foot |

148 columns are the first 148. Lengths are in the rig's own unit, at 30 frames a second. numpy only.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from playground.errors import PlaygroundError
from playground.motion.rotation import (
    Array,
    matrix_to_6d,
    matrix_to_quaternion,
    qinv,
    qmul,
    qrotate,
    quaternion_to_matrix,
    sixd_to_matrix,
    yaw_quaternion,
)
from playground.motion.source import Source

FPS = 30.0
NAMES = (
    "root", "spine1", "spine2", "spine3", "neck", "neck2", "head", "l_collar", "l_shoulder", "l_elbow", "l_wrist",
    "r_collar", "r_shoulder", "r_elbow", "r_wrist", "pelvis", "l_hip", "l_knee", "l_ankle", "l_foot", "r_hip", "r_knee",
    "r_ankle", "r_foot",
)  # fmt: skip
PARENTS = (-1, 0, 1, 2, 3, 4, 5, 3, 7, 8, 9, 3, 11, 12, 13, 0, 15, 16, 17, 18, 15, 20, 21, 22)
JOINTS = len(NAMES)
ROTATIONS = slice(4, 4 + 6 * JOINTS)
POSITIONS = slice(ROTATIONS.stop, ROTATIONS.stop + 3 * JOINTS)
VELOCITIES = slice(POSITIONS.stop, POSITIONS.stop + 3 * JOINTS)
CONTACTS = slice(VELOCITIES.stop, VELOCITIES.stop + 4)
COLUMNS = (ROTATIONS.stop, CONTACTS.stop)  # 148, 296
FEET = tuple(NAMES.index(name) for name in ("l_ankle", "l_foot", "r_ankle", "r_foot"))
_HEADING_SIGMA = 5.0  # frames
_FLOOR_SHARE = 0.1  # of the heights of the feet, the lowest, whose mean is the floor
_CONTACT_STEP = 0.11  # squared length a frame
_CONTACT_HEIGHT = np.array([9.0, 4.0, 9.0, 4.0])  # of FEET
_FLAT = np.array([1.0, 0.0, 1.0])


def facing_yaw(positions: Array) -> NDArray[np.float64]:
    """Yaw [F] that turns each frame's facing to +Z; positions [F, 24, 3] of the rig.

    Up x across, across from shoulders and hips at an absolute sum of 1 (as the released extraction scales it),
    smoothed over time.
    """
    pairs = (("l_collar", "r_collar"), ("l_hip", "r_hip"))
    sides = [positions[:, NAMES.index(left)] - positions[:, NAMES.index(right)] for left, right in pairs]
    across = np.asarray(sum(sides), np.float64)
    across = across / np.maximum(np.abs(across).sum(axis=-1, keepdims=True), 1e-12)
    forward = gaussian_filter1d(np.cross(across, [0.0, 1.0, 0.0]), _HEADING_SIGMA, axis=0, mode="nearest")
    return -np.arctan2(forward[:, 0], forward[:, 2])


def canonicalise(source: Source) -> Source:
    """A motion of the rig with its feet on y = 0, frame 0 over the origin, facing +Z."""
    positions: Array = source.positions.astype(np.float64)
    rotations: Array = source.rotations.astype(np.float64)
    heights = np.sort(positions[:, list(FEET), 1].ravel())
    floor = heights[: max(1, int(len(heights) * _FLOOR_SHARE))].mean()
    turn = yaw_quaternion(facing_yaw(positions)[0])
    positions, rotations = qrotate(turn, positions), qmul(turn, rotations)
    shift = np.array([positions[0, 0, 0], floor, positions[0, 0, 2]])
    return Source(source.names, source.parents, source.offsets, positions - shift, rotations, source.fps, source.ends)


def to_features296(source: Source) -> NDArray[np.float32]:
    """A motion of the 24-joint rig, F poses -> rows [F - 1, 296]; it is brought into place first (`canonicalise`).

    PlaygroundError for another skeleton, or fewer than two poses. Another frame rate is resampled to 30.
    """
    if source.parents != PARENTS:
        raise PlaygroundError(
            f"the skeleton has {len(source.parents)} joints in another order; SnapMoGen's rig of {JOINTS} is needed"
        )
    source = source if abs(source.fps - FPS) < 1e-3 else source.resampled(FPS)
    if source.frames < 2:
        raise PlaygroundError("a motion needs at least 2 poses to be turned into feature rows")
    yaw, placed = facing_yaw(source.positions), canonicalise(source)
    root = placed.positions[:, 0]
    turn = yaw_quaternion(yaw - yaw[0])
    step = (np.diff(yaw) + np.pi) % (2 * np.pi) - np.pi
    velocity = qrotate(turn[:-1], np.diff(root, axis=0))
    sixd = matrix_to_6d(quaternion_to_matrix(qmul(turn[:, None], placed.rotations)))
    local = qrotate(turn[:, None], placed.positions - root[:, None] * _FLAT)
    feet = placed.positions[:, list(FEET)]
    contacts = (np.sum(np.diff(feet, axis=0) ** 2, axis=-1) < _CONTACT_STEP) & (feet[:-1, :, 1] < _CONTACT_HEIGHT)
    flat = (sixd[:-1], local[:-1], np.diff(local, axis=0))
    parts = [step[:, None], velocity[:, [0, 2]], root[:-1, 1:2], *(x.reshape(len(step), -1) for x in flat), contacts]
    return np.concatenate(parts, axis=-1).astype(np.float32)


def source_of(rows: Array, rig: Array | None = None) -> Source:
    """Feature rows [F, 296], or [F, 148] with the rig's offsets [24, 3], -> a source at 30 fps.

    The root's steps are turned back by the heading of the frame that they start from, as they were taken.
    """
    yaw = np.concatenate([[0.0], np.cumsum(rows[:-1, 0])])
    back = yaw_quaternion(-yaw)
    steps = np.zeros((len(rows), 3))
    steps[1:, [0, 2]] = rows[:-1, 1:3]
    steps[1:] = qrotate(back[:-1], steps[1:])
    root = np.cumsum(steps, axis=0)
    root[:, 1] = rows[:, 3]
    sixd = rows[:, ROTATIONS].reshape(len(rows), JOINTS, 6)
    turned = qmul(back[:, None], matrix_to_quaternion(sixd_to_matrix(sixd)))
    parents = list(PARENTS[1:])
    if rig is None or rows.shape[1] == COLUMNS[1]:
        local = rows[:, POSITIONS].reshape(len(rows), JOINTS, 3)
        joints = qrotate(back[:, None], local) + (root * np.array([1.0, 0.0, 1.0]))[:, None]
        bones = qrotate(qinv(turned[:, parents]), joints[:, 1:] - joints[:, parents])
        rig = np.concatenate([np.zeros((1, 3)), bones.mean(axis=0)])
    else:
        joints = np.repeat(root[:, None], JOINTS, axis=1)
        for joint, parent in enumerate(parents, start=1):
            joints[:, joint] = joints[:, parent] + qrotate(turned[:, parent], rig[joint])
    return Source(NAMES, PARENTS, rig, joints, turned, FPS, {}, "SnapMoGen motion")
