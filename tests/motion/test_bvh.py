"""BVH out and in, files of other tools, and files that are broken on purpose."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from playground.errors import PlaygroundError
from playground.motion.bvh import read_bvh, write_bvh
from playground.motion.motion import Motion
from playground.motion.skeleton import HUMAN22, Skeleton
from tests.motion.skeletons import Rig, bvh_text, walk

GOOD = """HIERARCHY
ROOT Hips
{
\tOFFSET 1 2 3
\tCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
\tJOINT Knee
\t{
\t\tOFFSET 0 -4 0
\t\tCHANNELS 3 Zrotation Xrotation Yrotation
\t\tEnd Site
\t\t{
\t\t\tOFFSET 0 -3 0
\t\t}
\t}
}
MOTION
Frames: 4
Frame Time: 0.05
0 9 0 0 0 0 0 0 0
0 9 0 90 0 0 0 0 0
0 9 0 0 90 0 0 0 0
5 9 0 0 0 90 0 90 0
"""


def sentence(data: bytes | str) -> str:
    """The one sentence that reading raises."""
    with pytest.raises(PlaygroundError) as caught:
        read_bvh(data.encode() if isinstance(data, str) else data)
    text = str(caught.value)
    assert 20 < len(text) < 260 and "\n" not in text
    return text


def read_back(text: str) -> np.ndarray:
    source = read_bvh(text.encode())
    return source.positions[:, [source.names.index(name) for name in HUMAN22.joints]]


def test_what_is_written_is_read_back() -> None:
    joints = walk()
    text, changes = write_bvh(Motion(joints))
    source = read_bvh(text.encode())
    assert source.fps == 20.0 and not changes and set(source.ends) == {source.names.index(n) for n in (
        "head", "l_wrist", "r_wrist", "l_foot", "r_foot")}  # fmt: skip
    assert np.abs(read_back(text) - joints).max() < 1e-4


def test_written_files_hold_what_blender_expects() -> None:
    lines = write_bvh(Motion(walk()[:10]))[0].splitlines()
    assert lines[0] == "HIERARCHY" and lines[1] == "ROOT pelvis"
    assert sum(line.strip().startswith("JOINT") for line in lines) == 21
    assert sum("CHANNELS 3 Zrotation Xrotation Yrotation" in line for line in lines) == 21
    assert sum("End Site" in line for line in lines) == 5
    motion = lines.index("MOTION")
    assert lines[motion + 1 : motion + 3] == ["Frames: 10", "Frame Time: 0.05000000"]
    rows = np.array([[float(word) for word in line.split()] for line in lines[motion + 3 :]])
    assert rows.shape == (10, 6 + 21 * 3)
    assert np.abs(np.diff(rows[:, 3:], axis=0)).max() < 90.0, "angles do not jump by whole turns"


def test_written_angles_pose_the_skeleton_by_an_independent_reading() -> None:
    joints = walk()[:6]
    lines = [line.strip() for line in write_bvh(Motion(joints))[0].splitlines()]
    names = [line.split()[1] for line in lines if line.startswith(("ROOT", "JOINT"))]
    offsets = [list(map(float, line.split()[1:])) for n, line in enumerate(lines) if line.startswith("OFFSET")
               and lines[n - 2] != "End Site"]  # fmt: skip
    rows = [list(map(float, line.split())) for line in lines[lines.index("MOTION") + 3 :]]
    for f, row in enumerate(rows):
        position, turn = {"pelvis": np.array(row[:3])}, {"pelvis": Rotation.from_euler("ZXY", row[3:6], degrees=True)}
        for n, name in enumerate(names[1:], start=1):
            parent = HUMAN22.joints[HUMAN22.parents[HUMAN22.index(name)]]
            position[name] = position[parent] + turn[parent].apply(offsets[n])
            turn[name] = turn[parent] * Rotation.from_euler("ZXY", row[3 + 3 * n : 6 + 3 * n], degrees=True)
        for name, at in position.items():
            assert np.allclose(at, joints[f, HUMAN22.index(name)], atol=1e-4), name


@given(st.integers(0, 2**16), st.floats(0.002, 0.02))
@settings(max_examples=10)
def test_drifting_bones_are_set_to_their_median_and_reported(seed: int, noise: float) -> None:
    joints = walk()[:40] + np.random.default_rng(seed).normal(size=(40, 22, 3)) * noise
    text, changes = write_bvh(Motion(joints))
    assert len(changes) == 1 and "median" in changes[0] and "mm" in changes[0]
    assert np.linalg.norm(read_back(text) - joints, axis=-1).mean() < 3 * noise


def test_another_skeleton_is_refused() -> None:
    two = Skeleton("two", ("a", "b"), (-1, 0), ((0, 0, 0), (0, 1, 0)))
    with pytest.raises(PlaygroundError, match="not on two"):
        write_bvh(Motion(np.zeros((5, 2, 3)), 20.0, two))


def test_forward_kinematics_of_a_small_file() -> None:
    source = read_bvh(GOOD.encode())
    assert source.names == ("Hips", "Knee") and source.parents == (-1, 0) and source.fps == 20.0
    knees = [[0, 5, 0], [4, 9, 0], [0, 9, -4], [5, 5, 0]]
    assert np.allclose(source.positions[:, 1], knees, atol=1e-9)
    assert np.allclose(source.positions[:, 0], [[0, 9, 0]] * 3 + [[5, 9, 0]])
    assert np.array_equal(source.ends[1], [0, -3, 0])


@pytest.mark.parametrize(
    "change",
    [
        lambda t: t.replace("\n", "\r\n"),
        lambda t: t.replace("\t", "        "),
        lambda t: "\ufeff" + t,
        lambda t: t.replace("Zrotation Xrotation Yrotation", "ZROTATION xrotation YRotation"),
        lambda t: t.replace("ROOT Hips", "# made by hand\nROOT Hips").replace("OFFSET 0 -4 0", "OFFSET 0 -4 0 // shin"),
        lambda t: t.replace("ROOT Hips\n{", "ROOT Hips {"),
        lambda t: t.replace("Frames: 4", "Frames:\t4").replace("Frame Time: 0.05", "Frame Time:0.05"),
        lambda t: t.replace("HIERARCHY", "hierarchy").replace("MOTION", "Motion"),
        lambda t: t.replace("End Site", "End Site Toe"),
        lambda t: t.replace("0 9 0 90 0 0 0 0 0", "0 9 0\n90 0 0 0 0 0"),
        lambda t: t.replace("5 9 0", "5e0 +9.000 -0"),
        lambda t: t + "\n\n  \n",
        lambda t: t.replace("Frames: 4", "Frames: 4 ").rstrip("\n"),
    ],
)
def test_what_files_in_the_wild_do_is_forgiven(change) -> None:
    wanted = read_bvh(GOOD.encode())
    source = read_bvh(change(GOOD).encode())
    assert source.names == wanted.names and np.allclose(source.positions, wanted.positions)


@pytest.mark.parametrize("order", ["XYZ", "ZYX", "YXZ", "YZX"])
def test_any_order_of_channels(order: str) -> None:
    joints = walk()[:8]
    names = {name: name for name in HUMAN22.joints}
    text = bvh_text(joints, Rig(names, unit=1.0, order=order))
    assert np.abs(read_back(text) - joints).max() < 1e-3


def test_positions_on_every_joint_replace_the_offsets() -> None:
    joints = walk()[:8]
    text = bvh_text(joints, Rig({name: name for name in HUMAN22.joints}, unit=1.0, positions_everywhere=True))
    broken_offsets = "\n".join("OFFSET 7 7 7" if "OFFSET" in line else line for line in text.split("\n"))
    assert np.abs(read_back(broken_offsets) - joints).max() < 1e-3


def test_names_with_spaces_stay_whole() -> None:
    assert read_bvh(GOOD.replace("JOINT Knee", "JOINT Bip01 L Calf").encode()).names[1] == "Bip01 L Calf"


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda t: "", "HIERARCHY"),
        (lambda t: "hello", "HIERARCHY"),
        (lambda t: t[: t.index("MOTION")], "MOTION"),
        (lambda t: t[: t.index("Frame Time")], "Frame Time"),
        (lambda t: t[:-6], "looks cut off"),
        (lambda t: t.replace("\t}\n}\nMOTION", "MOTION"), "cut off"),
        (lambda t: t.replace("}\nMOTION", "}}\nMOTION"), "closing"),
        (lambda t: t.replace("Frames: 4", "Frames: 1"), "1 frame"),
        (lambda t: t.replace("Frames: 4", "Frames: 100000"), "100,000 frames"),
        (lambda t: t.replace("Frames: 4", "Frames: -4"), "Frames"),
        (lambda t: t.replace("Frames: 4", "Frames: 5"), "cut off"),
        (lambda t: t.replace("Frame Time: 0.05", "Frame Time: 0"), "frames a second"),
        (lambda t: t.replace("Frame Time: 0.05", "Frame Time: nan"), "finite"),
        (lambda t: t.replace("Frame Time: 0.05", "Frame Time: 0.0000001"), "frames a second"),
        (lambda t: t.replace("Frame Time: 0.05", "Frame Time: soon"), "'soon'"),
        (lambda t: t.replace("CHANNELS 3 Z", "CHANNELS 99 Z"), "99 channels"),
        (lambda t: t.replace("CHANNELS 3 Z", "CHANNELS three Z"), "three channels"),
        (lambda t: t.replace("CHANNELS 3 Zrotation", "CHANNELS 3 Wrotation"), "'Wrotation'"),
        (lambda t: t.replace("CHANNELS 3 Zrotation", "CHANNELS 3 Xrotation"), "twice"),
        (lambda t: t.replace("CHANNELS 3 Zrotation Xrotation Yrotation", "CHANNELS 2 Zrotation Xrotation"), "channels"),
        (lambda t: t.replace("OFFSET 0 -4 0", "OFFSET 0 -4"), "2 of 3|where a number"),
        (lambda t: t.replace("OFFSET 0 -4 0", "OFFSET 0 inf 0"), "finite"),
        (lambda t: t.replace("OFFSET 0 -4 0", "OFFSET a b c"), "'a'"),
        (lambda t: t.replace("JOINT Knee", "BONE Knee"), "'BONE'"),
        (lambda t: t.replace("JOINT Knee", "ROOT Knee"), "one ROOT"),
        (lambda t: t.replace("0 9 0 90", "0 nan 0 90"), "finite"),
        (lambda t: t.replace("0 9 0 90", "0 inf 0 90"), "finite"),
        (lambda t: t.replace("0 9 0 90", "0 1,5 0 90"), "'1,5'"),
        (lambda t: t.replace("0 9 0 90", "0 x 0 90"), "'x'"),
    ],
)
def test_broken_files_get_one_clear_sentence(change, word: str) -> None:
    broken = change(GOOD)
    assert broken != GOOD
    import re

    assert re.search(word, sentence(broken))


def test_too_many_joints_are_refused_before_anything_is_built() -> None:
    tail = "".join(f"JOINT j{n}\n{{\nOFFSET 0 1 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n" for n in range(499))
    text = (
        f"HIERARCHY\nROOT r\n{{\nOFFSET 0 0 0\nCHANNELS 0\n{tail}"
        + "}" * 500
        + "\nMOTION\nFrames: 4\nFrame Time: 0.05\n"
    )
    assert "500 joints" in sentence(text)
    assert "500 joints" in sentence(" ".join(text.split()).replace("MOTION", "\nMOTION"))


@given(st.binary(max_size=400))
def test_binary_rubbish_is_refused(data: bytes) -> None:
    sentence(data)


@given(st.integers(0, len(GOOD)), st.integers(0, 255))
@settings(max_examples=200)
def test_one_wrong_byte_or_a_cut_never_ends_in_another_error(at: int, byte: int) -> None:
    for data in (GOOD.encode()[:at], GOOD.encode()[:at] + bytes([byte]) + GOOD.encode()[at + 1 :]):
        try:
            source = read_bvh(data)
        except PlaygroundError as error:
            assert "\n" not in str(error)
        else:
            assert np.isfinite(source.positions).all() and source.frames == 4


def test_a_hierarchy_of_megabytes_is_refused() -> None:
    assert "1,000,000 characters" in sentence(GOOD.replace("ROOT Hips", "ROOT " + "Hips " * 300_000))


def test_recorded_clips_come_back_within_a_millimetre(library_data: Path) -> None:
    with np.load(library_data / "motions.npz") as data:
        starts, packed, scale = data["offsets"], data["joints"], float(data["scale"])
    for i in range(7, len(starts) - 1, 113):
        joints = packed[starts[i] : starts[i + 1]].astype(float) * scale
        text, changes = write_bvh(Motion(joints))
        assert not changes and np.linalg.norm(read_back(text) - joints, axis=-1).max() < 1e-3, f"clip {i}"
