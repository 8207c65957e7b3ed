"""Measures of one motion, or of two, from joint positions alone (systems.md F2). numpy only, float64 inside."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.skeleton import HUMAN22

TOES = (HUMAN22.index("l_foot"), HUMAN22.index("r_foot"))
CONTACT_HEIGHT = 0.05  # metres: the height of a toe above the floor at which it no longer counts as touching


def mpjpe(a: ArrayLike, b: ArrayLike) -> float:
    """Mean per-joint position error in mm, pelvis-relative (F2).

    a, b: [F, 22, 3] metres. Each frame's own pelvis is subtracted, then the distances are averaged over all frames and
    all 22 joints; the pelvis counts, with 0. PlaygroundError if the shapes differ, F = 0 or a value is not finite.
    """
    return float(joint_errors(a, b).mean())


def joint_errors(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    """[F] mean error of each frame in mm; `mpjpe` is its mean, so clips pool by concatenation. Arguments as there."""
    first, second = _joints(a), _joints(b)
    if first.shape != second.shape:
        raise PlaygroundError(f"two motions of one length are compared, got {len(first)} and {len(second)} frames")
    difference = (first - first[:, :1]) - (second - second[:, :1])  # (F, J, 3)
    return np.asarray(np.linalg.norm(difference, axis=-1).mean(axis=-1) * 1000.0)


def foot_sliding(joints: ArrayLike, fps: float = LIMITS.fps, floor: float = 0.0) -> float:
    """How fast the toes slide while they touch the ground, in mm/s; 0 is a planted foot.

    joints: [F, 22, 3] metres, Y up, F >= 2. For each toe and each two neighbouring frames, h is the larger of the two
    heights above `floor` and v the horizontal speed between them. The result is the mean of v over pairs with h < 5 cm,
    weighted by 2 - 2^(h / 5 cm), which is 1 on the ground and 0 at 5 cm (the weight of Zhang et al., "Mode-Adaptive
    Neural Networks", 2018; toes below the floor weigh 1). nan if no toe ever touches the ground.
    """
    toes = _joints(joints)[:, TOES, :]
    if len(toes) < 2:
        raise PlaygroundError("foot sliding needs a motion of at least 2 frames")
    height = np.maximum(toes[1:, :, 1], toes[:-1, :, 1]) - floor  # (F-1, 2)
    step = (toes[1:] - toes[:-1])[..., (0, 2)]
    speed = np.linalg.norm(step, axis=-1) * fps * 1000.0  # (F-1, 2)
    weight = np.clip(2.0 - 2.0 ** (np.clip(height, 0.0, CONTACT_HEIGHT) / CONTACT_HEIGHT), 0.0, 1.0)
    total = weight.sum()
    return float((weight * speed).sum() / total) if total > 0 else float("nan")


def path_drift(a: ArrayLike, b: ArrayLike) -> float:
    """How far apart two motions of one length walk, in metres: the mean distance of their roots over the ground.

    a, b: [F, 22, 3] metres, Y up, in one coordinate system. PlaygroundError as in `mpjpe`.
    """
    first, second = _joints(a), _joints(b)
    if first.shape != second.shape:
        raise PlaygroundError(f"two motions of one length are compared, got {len(first)} and {len(second)} frames")
    return float(np.linalg.norm((first - second)[:, 0][:, (0, 2)], axis=-1).mean())


def bone_drift(joints: ArrayLike) -> float:
    """How much the bones change their length during a motion, in mm; 0 is a rigid skeleton.

    joints: [F, 22, 3] metres. Mean over frames and the 21 bones of |length - that bone's median length in this motion|.
    It does not compare with a reference body: a rigid skeleton of any proportions has no drift.
    """
    positions = _joints(joints)
    parents = np.asarray(HUMAN22.parents[1:])
    lengths = np.linalg.norm(positions[:, 1:] - positions[:, parents], axis=-1)  # (F, J-1)
    return float(np.abs(lengths - np.median(lengths, axis=0)).mean() * 1000.0)


def _joints(values: ArrayLike) -> NDArray[np.float64]:
    """The argument as float64 [F, 22, 3]; PlaygroundError for another shape, no frames or non-finite values."""
    joints = np.asarray(values, np.float64)
    if joints.ndim != 3 or joints.shape[1:] != (HUMAN22.size, 3) or not len(joints):
        raise PlaygroundError(f"joints [frames, {HUMAN22.size}, 3] are measured, got {list(joints.shape)}")
    if not np.isfinite(joints).all():
        raise PlaygroundError("the motion holds positions that are not finite numbers; every value must be finite")
    return joints
