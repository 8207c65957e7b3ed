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


def axis_quaternion(axis: int, angle: Array) -> Array:
    """Rotation [..., 4] by `angle` [...] radians about coordinate axis 0 (x), 1 (y) or 2 (z)."""
    half = np.asarray(angle, np.float64) / 2.0
    q = np.zeros((*half.shape, 4))
    q[..., 0], q[..., 1 + axis] = np.cos(half), np.sin(half)
    return q


def slerp(a: Array, b: Array, t: Array | float) -> Array:
    """Rotation [..., 4] the share t [...] of the shorter way from a to b (unit quaternions)."""
    dot = np.sum(a * b, axis=-1, keepdims=True)
    b = np.where(dot < 0, -b, b)
    angle = np.arccos(np.clip(np.abs(dot), 0.0, 1.0))
    share = np.asarray(t, np.float64)[..., None]
    sine = np.sin(angle)
    near = sine < 1e-6
    safe = np.where(near, 1.0, sine)
    from_a = np.where(near, 1.0 - share, np.sin((1.0 - share) * angle) / safe)
    from_b = np.where(near, share, np.sin(share * angle) / safe)
    return qnormalise(from_a * a + from_b * b)


def qcontinuous(q: Array) -> Array:
    """The same rotations [F, ..., 4] with signs chosen so that neighbours in time lie on one half sphere."""
    dots = np.sum(q[1:] * q[:-1], axis=-1, keepdims=True)
    flips = np.cumprod(np.where(dots < 0, -1.0, 1.0), axis=0)
    return np.concatenate([q[:1], q[1:] * flips], axis=0)


def quaternion_to_matrix(q: Array) -> Array:
    """Unit quaternions [..., 4] -> rotation matrices [..., 3, 3] acting on column vectors."""
    columns = [qrotate(q, np.broadcast_to(unit, (*q.shape[:-1], 3))) for unit in np.eye(3)]
    return np.stack(columns, axis=-1)


def matrix_to_quaternion(matrix: Array) -> Array:
    """Rotation matrices [..., 3, 3] -> unit quaternions [..., 4], w >= 0; stable for half turns."""
    m = np.asarray(matrix, np.float64)
    diagonal = np.diagonal(m, axis1=-2, axis2=-1)
    trace = diagonal.sum(-1, keepdims=True)
    squares = np.concatenate([1.0 + trace, 1.0 - trace + 2.0 * diagonal], axis=-1)  # 4 w², 4 x², 4 y², 4 z²
    sums = [m[..., i, j] + m[..., j, i] for i, j in ((0, 1), (0, 2), (1, 2))]  # 4 xy, 4 xz, 4 yz
    differences = [m[..., i, j] - m[..., j, i] for i, j in ((2, 1), (0, 2), (1, 0))]  # 4 wx, 4 wy, 4 wz
    rows = [
        [squares[..., 0], *differences],
        [differences[0], squares[..., 1], sums[0], sums[1]],
        [differences[1], sums[0], squares[..., 2], sums[2]],
        [differences[2], sums[1], sums[2], squares[..., 3]],
    ]
    products = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)  # 4 q qᵀ
    best = np.argmax(squares, axis=-1)
    q = qnormalise(np.take_along_axis(products, best[..., None, None], axis=-2)[..., 0, :])
    return np.where(q[..., :1] < 0, -q, q)


def matrix_to_6d(matrix: Array) -> Array:
    """Rotation matrices [..., 3, 3] -> their first two columns, one after the other, [..., 6]."""
    return np.concatenate([matrix[..., :, 0], matrix[..., :, 1]], axis=-1)


def sixd_to_matrix(sixd: Array) -> Array:
    """Two columns [..., 6], not necessarily orthonormal -> rotation matrices [..., 3, 3] (Gram-Schmidt)."""
    first, second = sixd[..., :3], sixd[..., 3:]
    x = first / np.maximum(np.linalg.norm(first, axis=-1, keepdims=True), 1e-12)
    z = np.cross(x, second)
    z = z / np.maximum(np.linalg.norm(z, axis=-1, keepdims=True), 1e-12)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def rotvec_to_quaternion(rotvec: Array) -> Array:
    """Axis times angle in radians [..., 3] -> unit quaternions [..., 4]; the zero vector is no rotation."""
    rotvec = np.asarray(rotvec, np.float64)
    half = np.linalg.norm(rotvec, axis=-1, keepdims=True) / 2.0
    return np.concatenate([np.cos(half), rotvec * (np.sinc(half / np.pi) / 2.0)], axis=-1)


def euler_to_quaternion(angles: Array, order: str) -> Array:
    """Angles [..., K] in radians about the axes named by `order` ("ZXY": first letter applied last) -> [..., 4]."""
    q = axis_quaternion("XYZ".index(order[0].upper()), angles[..., 0])
    for k, letter in enumerate(order[1:], start=1):
        q = qmul(q, axis_quaternion("XYZ".index(letter.upper()), angles[..., k]))
    return q


def euler_to_matrix(angles: Array, order: str = "ZXY") -> Array:
    """Angles [..., 3] in radians, intrinsic about the three axes of `order` -> matrices [..., 3, 3], R = R1 R2 R3."""
    return quaternion_to_matrix(euler_to_quaternion(angles, order))


def matrix_to_euler(matrix: Array, order: str = "ZXY") -> Array:
    """Matrices [..., 3, 3] -> angles [..., 3] in radians for `order`, any order of three different axes.

    The middle angle lies in [-90, 90] degrees; where it is +-90 the last angle is 0.
    """
    m = np.asarray(matrix, np.float64)
    i, j, k = ("XYZ".index(letter.upper()) for letter in order)
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    cosine = np.hypot(m[..., i, i], m[..., i, j])
    middle = np.arctan2(sign * m[..., i, k], cosine)
    locked = cosine < 1e-9
    first = np.where(
        locked,
        np.arctan2(sign * m[..., k, j], m[..., j, j]),
        np.arctan2(-sign * m[..., j, k], m[..., k, k]),
    )
    last = np.where(locked, 0.0, np.arctan2(-sign * m[..., i, j], m[..., i, i]))
    return np.stack([first, middle, last], axis=-1)


def fit_rotation(source: Array, target: Array) -> Array:
    """Rotation [..., 4] that best takes vectors source [..., K, 3] to target [..., K, 3]: least squares, Kabsch."""
    covariance = np.swapaxes(np.asarray(target, np.float64), -1, -2) @ np.asarray(source, np.float64)
    u, _, vt = np.linalg.svd(covariance)
    flip = np.where(np.linalg.det(u @ vt) < 0, -1.0, 1.0)
    u = np.concatenate([u[..., :2], u[..., 2:] * flip[..., None, None]], axis=-1)
    return matrix_to_quaternion(u @ vt)
