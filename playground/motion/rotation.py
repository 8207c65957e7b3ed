"""Rotations, the only place they are written: quaternions (w, x, y, z), matrices, 6D, Euler angles. numpy only.

All functions take and return arrays whose last axes hold one rotation; leading axes broadcast.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]


def qnormalise(q: Array) -> Array:
    """[..., 4] -> unit quaternions; a zero quaternion becomes the identity."""
    norm = np.linalg.norm(q, axis=-1, keepdims=True)
    identity = np.zeros_like(q)
    identity[..., 0] = 1.0
    return np.where(norm > 0, q / np.where(norm > 0, norm, 1.0), identity)


def qmul(a: Array, b: Array) -> Array:
    """Hamilton product [..., 4]: rotating by `qmul(a, b)` rotates by b, then by a."""
    aw, ax, ay, az = np.moveaxis(np.asarray(a), -1, 0)
    bw, bx, by, bz = np.moveaxis(np.asarray(b), -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def qinv(q: Array) -> Array:
    """Inverse of unit quaternions [..., 4]."""
    return np.asarray(q) * np.array([1.0, -1.0, -1.0, -1.0], dtype=np.asarray(q).dtype)


def qrotate(q: Array, v: Array) -> Array:
    """Rotate vectors v [..., 3] by unit quaternions q [..., 4]."""
    axis = np.broadcast_to(q[..., 1:], np.broadcast_shapes(q[..., 1:].shape, v.shape))
    cross = np.cross(axis, v)
    return v + 2.0 * (q[..., :1] * cross + np.cross(axis, cross))


def qbetween(a: Array, b: Array) -> Array:
    """Shortest rotation [..., 4] taking direction a [..., 3] to direction b [..., 3]; half a turn for opposite ones."""
    a = a / np.maximum(np.linalg.norm(a, axis=-1, keepdims=True), 1e-12)
    b = b / np.maximum(np.linalg.norm(b, axis=-1, keepdims=True), 1e-12)
    w = 1.0 + np.sum(a * b, axis=-1, keepdims=True)
    spare = np.where(np.abs(a[..., :1]) < 0.9, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    axis = np.where(w > 1e-9, np.cross(a, b), np.cross(a, spare))
    return qnormalise(np.concatenate([np.where(w > 1e-9, w, 0.0), axis], axis=-1))


def yaw_quaternion(angle: Array) -> Array:
    """Rotation [..., 4] by `angle` [...] radians about Y: +Z turns towards +X."""
    half = np.asarray(angle) / 2.0
    zero = np.zeros_like(half)
    return np.stack([np.cos(half), zero, np.sin(half), zero], axis=-1)
