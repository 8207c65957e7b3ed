"""SnapMoGen's columns against a slow extraction and on the way back, on a synthetic rig of 24 joints."""

import io
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from playground.errors import PlaygroundError
from playground.motion.bvh import read_bvh, write_source
from playground.motion.formats import read_motion, read_snapmogen_rows
from playground.motion.snapmogen import (
    COLUMNS,
    CONTACTS,
    NAMES,
    PARENTS,
    POSITIONS,
    ROTATIONS,
    VELOCITIES,
    canonicalise,
    source_of,
    to_features296,
)
from playground.motion.source import Source
from tests.data.published import SNAP_OFFSETS, SNAP_PARENTS, rotation, snap_motion
from tests.motion.skeletons import STYLES, Rig, bvh_text

PLACES = {name: number for number, name in enumerate(NAMES)}


def rig_motion(turns: float = 1.3) -> Source:
    """Somebody on the rig who waves while walking a curve of so many turns, off the origin and above the floor."""
    positions, quaternions = snap_motion()
    frames = len(positions)
    yaw = 0.7 + np.linspace(0.0, 2 * np.pi * turns, frames)
    spin = Rotation.from_euler("Y", yaw[:, None])
    world = [(spin * rotation(quaternions[:, joint])).as_quat(scalar_first=True) for joint in range(24)]
    root = positions[:, 0] * [0, 1, 0] + np.stack([40 + 30 * np.sin(yaw), 5 + 0 * yaw, 9 - 30 * np.cos(yaw)], -1)
    placed = np.repeat(root[:, None], 24, axis=1)
    for joint, parent in enumerate(SNAP_PARENTS):
        if parent >= 0:
            placed[:, joint] = placed[:, parent] + rotation(world[parent]).apply(SNAP_OFFSETS[joint])
    return Source(NAMES, PARENTS, SNAP_OFFSETS, placed, np.stack(world, axis=1), 30.0)


def slow_rows(source: Source) -> np.ndarray:
    """The released extraction, frame by frame with scipy's rotations."""
    p, frames = source.positions, source.frames
    feet = [PLACES[name] for name in ("l_ankle", "l_foot", "r_ankle", "r_foot")]
    heights = sorted(p[:, feet, 1].ravel().tolist())
    floor = np.mean(heights[: int(0.1 * len(heights))])
    forward = []
    for t in range(frames):
        across = p[t, PLACES["l_collar"]] - p[t, PLACES["r_collar"]] + p[t, PLACES["l_hip"]] - p[t, PLACES["r_hip"]]
        across = across / np.abs(across).sum()
        forward.append([-across[2], 0.0, across[0]])
    smooth = gaussian_filter1d(np.array(forward), 5.0, axis=0, mode="nearest")
    headings = [Rotation.from_euler("Y", -np.arctan2(f[0], f[2])) for f in smooth]
    first = headings[0]
    p = first.apply((p - [0, floor, 0]).reshape(-1, 3)).reshape(p.shape)
    world = [[first * rotation(source.rotations[t, j]) for j in range(24)] for t in range(frames)]
    turns = [heading * first.inv() for heading in headings]
    local = np.array([turns[t].apply(p[t] - p[t, 0] * [1, 0, 1]) for t in range(frames)])
    rows = []
    for t in range(frames - 1):
        step = turns[t].apply(p[t + 1, 0] - p[t, 0])
        row = [(turns[t + 1] * turns[t].inv()).as_rotvec()[1], step[0], step[2], p[t, 0, 1]]
        for joint in range(24):
            matrix = (turns[t] * world[t][joint]).as_matrix()
            row += [*matrix[:, 0], *matrix[:, 1]]
        row += [*local[t].ravel(), *(local[t + 1] - local[t]).ravel()]
        for joint, height in zip(feet, (9, 4, 9, 4), strict=True):
            still = ((p[t + 1, joint] - p[t, joint]) ** 2).sum() < 0.11
            row.append(float(still and p[t, joint, 1] < height))
        rows.append(row)
    return np.array(rows)


@pytest.fixture(scope="module")
def motion() -> Source:
    return rig_motion()


@pytest.fixture(scope="module")
def rows(motion: Source) -> np.ndarray:
    return to_features296(motion)


def test_columns_equal_a_slow_extraction(motion: Source, rows: np.ndarray) -> None:
    assert rows.shape == (motion.frames - 1, 296) and rows.dtype == np.float32
    np.testing.assert_allclose(rows, slow_rows(motion), atol=2e-4)


def test_layout_is_root_rotations_positions_velocities_contacts(rows: np.ndarray) -> None:
    spans = [(part.start, part.stop) for part in (ROTATIONS, POSITIONS, VELOCITIES, CONTACTS)]
    assert spans == [(4, 148), (148, 220), (220, 292), (292, 296)] and COLUMNS == (148, 296)
    assert not rows[:, [POSITIONS.start, POSITIONS.start + 2]].any(), "the root's own x and z"
    np.testing.assert_allclose(rows[:, POSITIONS.start + 1], rows[:, 3], atol=1e-4)
    np.testing.assert_allclose(rows[1:, POSITIONS], (rows[:, POSITIONS] + rows[:, VELOCITIES])[:-1], atol=1e-4)
    assert set(np.unique(rows[:, CONTACTS])) <= {0.0, 1.0}


def test_the_whole_turn_is_in_the_first_column(rows: np.ndarray) -> None:
    assert np.abs(rows[:, 0]).max() < 0.3, "a step never jumps by a whole turn"
    assert rows[:, 0].sum() == pytest.approx(-2 * np.pi * 1.3, abs=0.6)


@pytest.mark.parametrize("columns", COLUMNS)
def test_the_way_back_gives_the_motion_in_place(motion: Source, rows: np.ndarray, columns: int) -> None:
    back = source_of(rows[:, :columns].astype(np.float64), SNAP_OFFSETS)
    placed = canonicalise(motion)
    centimetres = np.abs(back.positions - placed.positions[:-1]).max()
    assert centimetres < 1e-2, "0.1 mm in the rig's unit"
    same = np.abs(np.sum(back.rotations * placed.rotations[:-1], axis=-1))
    np.testing.assert_allclose(same, 1.0, atol=1e-6)
    assert back.fps == 30.0 and back.parents == PARENTS


def test_bvh_of_the_rig_is_read_back(motion: Source, rows: np.ndarray) -> None:
    source = source_of(rows.astype(np.float64))
    back = read_bvh(write_source(source).encode())
    assert back.names == NAMES and back.parents == PARENTS and back.fps == 30.0
    assert np.abs(back.positions - source.positions).max() < 1e-2
    np.testing.assert_allclose(np.abs(np.sum(back.rotations * source.rotations, axis=-1)), 1.0, atol=1e-6)
    np.testing.assert_allclose(back.offsets[1:], SNAP_OFFSETS[1:], atol=1e-3)
    np.testing.assert_allclose(to_features296(back)[:, :148], to_features296(source)[:, :148], atol=1e-3)


def test_another_rate_is_resampled(motion: Source) -> None:
    half = Source(NAMES, PARENTS, SNAP_OFFSETS, motion.positions[::2], motion.rotations[::2], 15.0)
    assert abs(len(to_features296(half)) - (motion.frames - 1)) <= 1


def test_other_skeletons_and_single_poses_are_refused(motion: Source) -> None:
    other = read_bvh(bvh_text(np.repeat(np.zeros((1, 22, 3)), 8, 0), Rig(STYLES["Mixamo"])).encode())
    with pytest.raises(PlaygroundError, match="rig of 24"):
        to_features296(other)
    one = Source(NAMES, PARENTS, SNAP_OFFSETS, motion.positions[:1], motion.rotations[:1], 30.0)
    with pytest.raises(PlaygroundError, match="2 poses"):
        to_features296(one)


def test_files_of_columns_become_motions(rows: np.ndarray, tmp_path: Path) -> None:
    np.save(tmp_path / "rows.npy", rows)
    read = read_motion(tmp_path / "rows.npy")
    assert "296 SnapMoGen columns" in read.mapping
    assert abs(read.motion.frames - len(rows) * 20 / 30) <= 1 and read.motion.fps == 20
    np.savez(tmp_path / "short.npz", features=rows[:, :148], offsets=SNAP_OFFSETS, fps=30)
    short = read_motion(tmp_path / "short.npz")
    np.testing.assert_allclose(short.motion.joints, read.motion.joints, atol=1e-3)
    source = read_snapmogen_rows(tmp_path / "short.npz")
    np.testing.assert_allclose(source.positions, source_of(rows.astype(float)).positions, atol=1e-2)


def saved(**arrays: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


BAD = {
    "148 columns without a rig": (saved(features=np.zeros((40, 148))), "need the rig"),
    "a rig of words": (saved(features=np.zeros((40, 148)), offsets=np.full((24, 3), "a")), "need the rig"),
    "a rig of 22": (saved(features=np.zeros((40, 148)), offsets=np.zeros((22, 3))), "need the rig"),
    "a rig with NaN": (saved(features=np.ones((40, 148)), offsets=np.full((24, 3), np.nan)), "finite"),
    "NaN": (saved(features=np.full((40, 296), np.nan)), "finite"),
    "huge": (saved(features=np.full((40, 296), 1e30)), "finite"),
    "nothing but zeros": (saved(features=np.zeros((40, 296))), "array|motion|skeleton|body"),
    "too short": (saved(features=np.zeros((2, 296))), "frames"),
}


@pytest.mark.parametrize("case", BAD)
def test_broken_columns_are_refused_in_one_sentence(case: str, tmp_path: Path) -> None:
    data, why = BAD[case]
    (tmp_path / "bad.npz").write_bytes(data)
    with pytest.raises(PlaygroundError, match=why) as caught:
        read_motion(tmp_path / "bad.npz")
    assert "\n" not in str(caught.value)


def test_noise_is_refused_or_becomes_finite_numbers(tmp_path: Path) -> None:
    np.save(tmp_path / "noise.npy", np.random.default_rng(0).normal(size=(40, 296)))
    try:
        joints = read_motion(tmp_path / "noise.npy").motion.joints
    except PlaygroundError as error:
        assert "\n" not in str(error)
    else:
        assert np.isfinite(joints).all()


def test_other_columns_are_not_taken_for_snapmogens(tmp_path: Path) -> None:
    np.save(tmp_path / "rows.npy", np.zeros((40, 263)))
    with pytest.raises(PlaygroundError, match="148 or 296"):
        read_snapmogen_rows(tmp_path / "rows.npy")
