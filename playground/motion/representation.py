"""Joints <-> the 67 columns of LG-Tok (systems.md A1), canonicalisation, mirroring, normalisation. No torch.

Columns: 0 heading increment (half the yaw angle, rad/frame), 1-2 root velocity x and z in the character frame
(m/frame), 3 root height (m), 4-66 joints 1..21 relative to the root's x, z and heading (m). They are the first 67 of
HumanML3D's 263.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from playground.errors import PlaygroundError
from playground.motion.rotation import qrotate, yaw_quaternion
from playground.motion.skeleton import ACROSS, HUMAN22

COLUMNS = 4 + 3 * (HUMAN22.size - 1)  # 67
GROUPS: tuple[tuple[int, ...], ...] = ((0,), (1, 2), (3,), tuple(range(4, COLUMNS)))  # columns that share one std
HEADING_SIGMA = 20.0  # frames; HumanML3D smooths the facing direction with it
HEADINGS = ("body", "humanml3d")  # rules of the smoothed heading; see `facing`

Array = NDArray[np.floating]


def facing(joints: Array, rule: str = "body") -> NDArray[np.float64]:
    """Horizontal facing [F, 3] of joints [F, 22, 3]: up x across, by one of two rules for across.

    body: (r_shoulder - l_shoulder) + (r_hip - l_hip), the facing at length 1 (A1). humanml3d: shoulders minus hips at
    length 1 in space, as HumanML3D's released extraction computes it: it exchanges the names of the hips.
    """
    right_hip, left_hip, right_shoulder, left_shoulder = (joints[:, j].astype(np.float64) for j in ACROSS)
    shoulders, hips = right_shoulder - left_shoulder, right_hip - left_hip
    across = shoulders - hips if rule == "humanml3d" else shoulders + hips
    direction = np.stack([across[:, 2], np.zeros(len(across)), -across[:, 0]], axis=-1)
    norm = np.linalg.norm(across if rule == "humanml3d" else direction, axis=-1, keepdims=True)
    return np.where(norm > 1e-9, direction / np.maximum(norm, 1e-9), np.array([0.0, 0.0, 1.0]))


def heading(joints: Array, smooth: bool = True, rule: str = "body") -> NDArray[np.float64]:
    """Yaw [F] in radians that turns each frame's facing direction to +Z; frame 0 is exactly 0 when smoothed (A1).

    rule: one of HEADINGS; ValueError for another.
    """
    if rule not in HEADINGS:
        raise ValueError(f"unknown heading rule {rule!r}; accepted: {', '.join(HEADINGS)}")
    raw = facing(joints, rule)
    direction = gaussian_filter1d(raw, HEADING_SIGMA, axis=0, mode="nearest", truncate=4.0) if smooth else raw
    yaw = np.asarray(-np.arctan2(direction[:, 0], direction[:, 2]), np.float64)
    if smooth:
        yaw[0] = 0.0
    return yaw


def canonicalise(joints: Array) -> NDArray[np.float32]:
    """joints [F, 22, 3] -> float32 of the same shape: lowest joint at y=0, frame 0 over the origin, facing +Z."""
    turn = yaw_quaternion(heading(np.asarray(joints[:1]), smooth=False))[0]
    turned = qrotate(turn, np.asarray(joints, np.float64))
    shift = np.array([turned[0, 0, 0], turned[..., 1].min(), turned[0, 0, 2]])
    return (turned - shift).astype(np.float32)


def to_features67(joints: Array, rule: str = "body") -> NDArray[np.float32]:
    """Canonical joints [F, 22, 3] in metres -> float32 [F-1, 67]. PlaygroundError for fewer than two poses.

    rule: how the heading is read off the body (`facing`); recovery is the same for every rule.
    """
    if len(joints) < 2:
        raise PlaygroundError("a motion needs at least 2 poses to be turned into feature rows")
    joints = np.asarray(joints, np.float64)
    yaw = heading(joints, rule=rule)
    turn = yaw_quaternion(yaw)
    step = np.diff(yaw)
    half_turn = ((step + np.pi) % (2 * np.pi) - np.pi) / 2.0
    velocity = qrotate(turn[1:], np.diff(joints[:, 0], axis=0))
    local = joints[:-1, 1:] - joints[:-1, :1] * np.array([1.0, 0.0, 1.0])
    local = qrotate(turn[:-1, None], local)
    rows = [half_turn[:, None], velocity[:, [0, 2]], joints[:-1, 0, 1:2], local.reshape(len(local), -1)]
    return np.concatenate(rows, axis=-1).astype(np.float32)


def from_features67(features: Array) -> NDArray[np.float32]:
    """Feature rows [F, 67] (un-normalised) -> joints float32 [F, 22, 3] in metres (A1, recovery)."""
    x = np.asarray(features, np.float64)
    half_yaw = np.concatenate([[0.0], np.cumsum(x[:-1, 0])])
    back = yaw_quaternion(-2.0 * half_yaw)
    step = np.zeros((len(x), 3))
    step[1:, [0, 2]] = x[:-1, 1:3]
    root = np.cumsum(qrotate(back, step), axis=0)
    root[:, 1] = x[:, 3]
    local = qrotate(back[:, None], x[:, 4:].reshape(len(x), -1, 3))
    local = local + (root * np.array([1.0, 0.0, 1.0]))[:, None]
    return np.concatenate([root[:, None], local], axis=1).astype(np.float32)


def mirror_joints(joints: Array) -> Array:
    """Swap left and right: joints [F, 22, 3] with x negated and paired joints exchanged."""
    return joints[:, list(HUMAN22.mirror)] * np.array([-1.0, 1.0, 1.0], joints.dtype)


def mirror_features67(features: Array) -> Array:
    """The features of the mirrored motion: rows [F, 67] -> [F, 67]; equals extracting after `mirror_joints`."""
    local = features[:, 4:].reshape(len(features), -1, 3)
    twins = [twin - 1 for twin in HUMAN22.mirror[1:]]
    local = local[:, twins] * np.array([-1.0, 1.0, 1.0], features.dtype)
    head = features[:, :4] * np.array([-1.0, -1.0, 1.0, 1.0], features.dtype)
    return np.concatenate([head, local.reshape(len(features), -1)], axis=-1)


@dataclass(frozen=True, eq=False)
class Normaliser:
    """Column-wise (x - mean) / std; mean, std float32 [C]."""

    mean: NDArray[np.float32]
    std: NDArray[np.float32]

    @classmethod
    def fit(cls, rows: Iterable[Array], groups: Sequence[Sequence[int]] = GROUPS) -> "Normaliser":
        """Mean per column over all rows [F, C]; std per column, then averaged inside each group of columns (A1).

        A group that never varies gets std 1.
        """
        data = np.concatenate([np.asarray(r, np.float64) for r in rows])
        std = data.std(axis=0)
        for group in groups:
            std[list(group)] = std[list(group)].mean()
        return cls(data.mean(axis=0).astype(np.float32), np.where(std > 1e-6, std, 1.0).astype(np.float32))

    def apply(self, features: Array) -> NDArray[np.float32]:
        """Un-normalised features [..., C] -> normalised float32."""
        return ((features - self.mean) / self.std).astype(np.float32)

    def invert(self, features: Array) -> NDArray[np.float32]:
        """Normalised features [..., C] -> un-normalised float32."""
        return (features * self.std + self.mean).astype(np.float32)
