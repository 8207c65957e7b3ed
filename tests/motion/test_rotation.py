"""Rotations against scipy's, and against matrices multiplied by hand."""

import itertools
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from playground.motion import rotation as r

ORDERS = ["".join(letters) for letters in itertools.permutations("XYZ")]
SEEDS = st.integers(0, 2**16)
ANGLES = st.one_of(st.sampled_from([0.0, 90.0, -90.0, 180.0, -180.0, 89.999999, 1e-9]), st.floats(-360, 360))
VECTORS = st.tuples(*[st.floats(-5, 5, allow_nan=False, width=32)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3)


def ours(turn: Rotation) -> np.ndarray:
    """scipy (x, y, z, w) -> ours (w, x, y, z)."""
    return turn.as_quat()[..., [3, 0, 1, 2]]


def some(seed: int, count: int = 7) -> Rotation:
    return Rotation.random(count, rng=np.random.default_rng(seed))


@given(SEEDS)
def test_products_inverses_and_rotated_vectors_agree_with_scipy(seed: int) -> None:
    a, b = some(seed), some(seed + 1)
    v = np.random.default_rng(seed).normal(size=(7, 3))
    assert np.allclose(r.quaternion_to_matrix(r.qmul(ours(a), ours(b))), (a * b).as_matrix(), atol=1e-12)
    assert np.allclose(r.quaternion_to_matrix(r.qinv(ours(a))), a.inv().as_matrix(), atol=1e-12)
    assert np.allclose(r.qrotate(ours(a), v), a.apply(v), atol=1e-12)


@pytest.mark.parametrize("order", ORDERS)
@given(angles=st.tuples(ANGLES, ANGLES, ANGLES))
def test_euler_angles_to_matrices_and_back(order: str, angles: tuple[float, float, float]) -> None:
    radians = np.radians(np.array(angles))
    matrix = r.euler_to_matrix(radians, order)
    assert np.allclose(matrix, Rotation.from_euler(order, radians).as_matrix(), atol=1e-12)
    back = r.matrix_to_euler(matrix, order)
    assert abs(back[1]) <= np.pi / 2 + 1e-12
    assert np.allclose(r.euler_to_matrix(back, order), matrix, atol=1e-7)


def test_euler_angles_away_from_the_pole_are_the_same_numbers_as_scipys() -> None:
    turns = some(3, 200)
    for order in ORDERS:
        assert np.allclose(r.matrix_to_euler(turns.as_matrix(), order), turns.as_euler(order), atol=1e-9)


@given(st.sampled_from([(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -2, 3)]), ANGLES)
def test_matrices_to_quaternions_also_for_half_turns(axis: tuple[int, int, int], degrees: float) -> None:
    turn = Rotation.from_rotvec(np.radians(degrees) * np.array(axis) / np.linalg.norm(axis))
    q = r.matrix_to_quaternion(turn.as_matrix())
    assert q[0] >= 0 and np.linalg.norm(q) == pytest.approx(1.0)
    assert np.allclose(r.quaternion_to_matrix(q), turn.as_matrix(), atol=1e-7)


@given(SEEDS)
def test_six_numbers_keep_a_rotation_and_repair_a_bent_one(seed: int) -> None:
    matrix = some(seed).as_matrix()
    sixd = r.matrix_to_6d(matrix)
    assert np.array_equal(sixd[..., :3], matrix[..., 0]) and np.array_equal(sixd[..., 3:], matrix[..., 1])
    assert np.allclose(r.sixd_to_matrix(sixd), matrix, atol=1e-12)
    bent = r.sixd_to_matrix(sixd + 0.1 * np.random.default_rng(seed).normal(size=sixd.shape))
    assert np.allclose(bent @ np.swapaxes(bent, -1, -2), np.eye(3), atol=1e-9)
    assert np.allclose(np.linalg.det(bent), 1.0)


@given(VECTORS, VECTORS)
def test_between_takes_the_first_direction_to_the_second_the_short_way(a: tuple, b: tuple) -> None:
    a, b = np.array(a, float), np.array(b, float)
    q = r.qbetween(a, b)
    turned = r.qrotate(q, a / np.linalg.norm(a))
    assert np.allclose(turned, b / np.linalg.norm(b), atol=1e-5)
    angle = np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)
    assert 2 * np.arccos(np.clip(q[0], -1, 1)) == pytest.approx(angle, abs=1e-4)


@given(VECTORS)
def test_between_opposite_directions_is_half_a_turn(a: tuple) -> None:
    a = np.array(a, float)
    assert np.allclose(r.qrotate(r.qbetween(a, -2 * a), a), -a, atol=1e-6 * np.linalg.norm(a) + 1e-9)


@given(SEEDS, st.floats(0, 1))
def test_slerp_agrees_with_scipy_and_takes_the_short_way(seed: int, share: float) -> None:
    a, b = some(seed), some(seed + 9)
    mixed = r.slerp(ours(a), -ours(b), np.full(7, share))
    for i in range(7):
        wanted = Slerp([0, 1], Rotation.concatenate([a[i], b[i]]))(share).as_matrix()
        assert np.allclose(r.quaternion_to_matrix(mixed[i]), wanted, atol=1e-6)


def test_slerp_between_equal_rotations_stays() -> None:
    q = ours(some(0))
    assert np.allclose(r.slerp(q, q, 0.3), q, atol=1e-12)


@given(SEEDS)
def test_continuous_signs_change_no_rotation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    smooth = ours(Rotation.from_rotvec(np.cumsum(rng.normal(size=(40, 3)) * 0.2, axis=0)))[:, None]
    flipped = smooth * rng.choice([-1.0, 1.0], size=(40, 1, 1))
    fixed = r.qcontinuous(flipped)
    assert (np.sum(fixed[1:] * fixed[:-1], axis=-1) > 0).all()
    assert np.allclose(np.abs(np.sum(fixed * smooth, axis=-1)), 1.0)


@given(SEEDS)
def test_fit_finds_the_rotation_of_rotated_vectors(seed: int) -> None:
    turns = some(seed)
    points = np.random.default_rng(seed).normal(size=(4, 3))
    seen = np.stack([turn.apply(points) for turn in turns])
    assert np.allclose(r.quaternion_to_matrix(r.fit_rotation(points, seen)), turns.as_matrix(), atol=1e-7)


def test_fit_never_mirrors_and_is_the_best_of_many() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(3, 3))
    mirrored = points * [-1, 1, 1]
    fitted = r.quaternion_to_matrix(r.fit_rotation(points, mirrored))
    assert np.linalg.det(fitted) == pytest.approx(1.0)
    best = np.square(points @ fitted.T - mirrored).sum()
    for turn in some(1, 3000).as_matrix():
        assert np.square(points @ turn.T - mirrored).sum() >= best - 1e-9


def test_yaw_turns_forward_to_the_left() -> None:
    assert np.allclose(r.qrotate(r.yaw_quaternion(np.array(np.pi / 2)), np.array([0.0, 0.0, 1.0])), [1, 0, 0])


def test_a_zero_quaternion_becomes_no_rotation_without_a_warning() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.array_equal(r.qnormalise(np.zeros((2, 4))), [[1, 0, 0, 0], [1, 0, 0, 0]])


@given(st.tuples(*[st.floats(-7, 7)] * 3))
def test_axis_times_angle_agrees_with_scipy(rotvec: tuple[float, float, float]) -> None:
    expected = Rotation.from_rotvec(rotvec).as_matrix()
    assert np.allclose(r.quaternion_to_matrix(r.rotvec_to_quaternion(np.array(rotvec))), expected, atol=1e-9)
    assert np.array_equal(r.rotvec_to_quaternion(np.zeros((2, 3))), [[1, 0, 0, 0]] * 2)
