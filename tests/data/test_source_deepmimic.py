"""The DeepMimic motions, from a stand-in for the pybullet package: same layout, a humanoid and motions of our own."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from playground.data.library import Library
from playground.data.sources import prepare
from playground.data.sources.deepmimic import read_body, read_frames
from playground.errors import PlaygroundError

JOINTS = [  # name, parent, kind, offset in the file's units (a quarter of them are metres)
    ("root", "base", "fixed", (0.0, 0.0, 0.0)),
    ("chest", "root", "spherical", (0.0, 1.0, 0.0)),
    ("neck", "chest", "spherical", (0.0, 0.9, 0.0)),
    ("right_hip", "root", "spherical", (0.0, 0.0, 0.34)),
    ("right_knee", "right_hip", "revolute", (0.0, -1.7, 0.0)),
    ("right_ankle", "right_knee", "spherical", (0.0, -1.65, 0.0)),
    ("right_shoulder", "chest", "spherical", (-0.1, 0.97, 0.73)),
    ("right_elbow", "right_shoulder", "revolute", (0.0, -1.1, 0.0)),
    ("right_wrist", "right_elbow", "fixed", (0.0, -1.0, 0.0)),
    ("left_hip", "root", "spherical", (0.0, 0.0, -0.34)),
    ("left_knee", "left_hip", "revolute", (0.0, -1.7, 0.0)),
    ("left_ankle", "left_knee", "spherical", (0.0, -1.65, 0.0)),
    ("left_shoulder", "chest", "spherical", (-0.1, 0.97, -0.73)),
    ("left_elbow", "left_shoulder", "revolute", (0.0, -1.1, 0.0)),
    ("left_wrist", "left_elbow", "fixed", (0.0, -1.0, 0.0)),
]
COLUMNS = 44


def urdf() -> str:
    rows = []
    for name, parent, kind, (x, y, z) in JOINTS:
        axis = '<axis xyz="0 0 1" />' if kind == "revolute" else ""
        rows.append(
            f'<joint name="{name}" type="{kind}"><parent link="{parent}" /><child link="{name}" />'
            f'<origin rpy="0 0 0" xyz="{x} {y} {z}" />{axis}</joint>'
        )
    return f"<robot>{''.join(rows)}</robot>\n\0"


def walking(frames: int = 60, bend: float = -0.4) -> np.ndarray:
    """Frames that glide along +X at 1.2 m/s with bent knees; every ball joint at rest."""
    rows = np.zeros((frames, COLUMNS))
    rows[:, 0] = 1 / 30
    rows[:, 1], rows[:, 2] = np.arange(frames) * 1.2 / 30, 0.85
    column = 4
    for name, _, kind, _ in JOINTS:
        if kind == "spherical" or name == "root":
            rows[:, column] = 1.0
            column += 4
        elif kind == "revolute":
            rows[:, column] = bend if "knee" in name else 0.3
            column += 1
    assert column == COLUMNS
    return rows


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that is found as the package pybullet_data."""
    folder = tmp_path / "site" / "pybullet_data"
    (folder / "humanoid").mkdir(parents=True)
    (folder / "data" / "motions" / "walker").mkdir(parents=True)
    (folder / "__init__.py").write_text("")
    (folder / "humanoid" / "humanoid.urdf").write_text(urdf())
    motions = {"humanoid3d_walk": walking(), "walker/turn_left0": walking(45), "humanoid3d_short": walking(9)}
    for name, frames in motions.items():
        text = json.dumps({"Loop": "wrap", "Frames": frames.tolist()})
        (folder / "data" / "motions" / f"{name}.txt").write_text(text)
    dog = json.dumps({"Loop": "wrap", "Frames": np.ones((20, 20)).tolist()})
    (folder / "data" / "motions" / "dog.txt").write_text(dog)
    monkeypatch.syspath_prepend(folder.parent)
    monkeypatch.delitem(sys.modules, "pybullet_data", raising=False)
    return folder


def test_motions_become_clips(package: Path, tmp_path: Path) -> None:
    done = prepare("deepmimic", None, tmp_path / "out")
    library = Library.open(tmp_path / "out")
    assert [clip.id for clip in library.clips] == ["deepmimic_walk", "deepmimic_turn_left0"] and done.clips == 2
    assert [clip.action for clip in library.clips] == ["walk", "walk"]
    assert all(len(clip.captions) == 1 and clip.captions[0].startswith("a person") for clip in library.clips)
    assert sorted(note.split(":")[0] for note in done.notes) == ["1 left out", "1 left out"]  # the dog, the short one
    joints = library.joints(0)
    assert len(joints) == 40  # 59 steps of 1/30 s at 20 fps, and the first pose
    travelled = joints[-1, 0] - joints[0, 0]
    assert travelled[2] == pytest.approx(1.2 * 39 / 20, rel=0.05) and abs(travelled[0]) < 0.1
    assert joints[:, 4, 2].mean() > joints[:, 7, 2].mean()  # a bent knee is in front of its ankle


def test_forward_kinematics_by_hand(package: Path) -> None:
    """Two joints of a random frame, multiplied out with matrices."""
    rng = np.random.default_rng(0)
    frames = walking(2)
    frames[:, 4:] = rng.normal(size=(2, COLUMNS - 4))
    frames[:, 0] = 1 / 30
    path = package / "data" / "motions" / "random.txt"
    path.write_text(json.dumps({"Frames": frames.tolist()}))
    source = read_frames(path, read_body(package / "humanoid" / "humanoid.urdf"))
    assert source is not None and source.fps == 30.0
    root, hip = matrix(frames[1, 4:8]), matrix(frames[1, 16:20])  # after root, chest and neck: 4 + 3 * 4
    cos, sin = np.cos(frames[1, 20]), np.sin(frames[1, 20])
    knee = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    at_hip = frames[1, 1:4] + root @ [0, 0, 0.34 / 4]
    at_knee = at_hip + root @ hip @ [0, -1.7 / 4, 0]
    at_ankle = at_knee + root @ hip @ knee @ [0, -1.65 / 4, 0]
    for name, expected in (("right_hip", at_hip), ("right_knee", at_knee), ("right_ankle", at_ankle)):
        np.testing.assert_allclose(source.positions[1, source.names.index(name)], expected, atol=1e-9)


def matrix(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrix of a quaternion (w, x, y, z) of any length."""
    w, x, y, z = quaternion / np.sqrt(np.sum(quaternion**2))
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_without_pybullet_one_sentence_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "pybullet_data", None)
    with pytest.raises(PlaygroundError, match="needs the package pybullet") as caught:
        prepare("deepmimic", None, tmp_path / "out")
    assert "\n" not in str(caught.value) and not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("humanoid/humanoid.urdf", "<robot>"),
        ("humanoid/humanoid.urdf", "<robot></robot>"),
        ("humanoid/humanoid.urdf", "<robot><joint/></robot>"),
        ("data/motions/humanoid3d_walk.txt", "{"),
        ("data/motions/humanoid3d_walk.txt", "[]"),
        ("data/motions/humanoid3d_walk.txt", '{"Frames": [[1, 2], [3]]}'),
        ("data/motions/humanoid3d_walk.txt", '{"Frames": [[NaN, 2], [3, 4]]}'),
        ("data/motions/humanoid3d_walk.txt", json.dumps({"Frames": [[0.0] * COLUMNS] * 30})),
    ],
)
def test_broken_files_are_named(file: str, text: str, package: Path, tmp_path: Path) -> None:
    (package / file).write_text(text)
    with pytest.raises(PlaygroundError, match=Path(file).name):
        prepare("deepmimic", None, tmp_path / "out")


def test_a_package_without_motions_is_refused(package: Path, tmp_path: Path) -> None:
    for path in (package / "data" / "motions").rglob("*.txt"):
        path.unlink()
    with pytest.raises(PlaygroundError, match="holds no motions"):
        prepare("deepmimic", None, tmp_path / "out")
