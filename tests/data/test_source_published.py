"""KIT-ML, CMP and Motion-X in the folders that they are published in, built on the spot."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from playground.data.sources import prepare
from playground.data.sources.kit_ml import NAMES, PARENTS, REST
from playground.errors import PlaygroundError
from playground.motion.features263 import to_features263
from playground.motion.positions import source_of_positions
from playground.motion.representation import canonicalise
from tests.conftest import drifting
from tests.data.published import (
    L_WRIST,
    R_WRIST,
    apart,
    array,
    at_20,
    columns,
    kit_joints,
    made,
    smplx,
    text,
    waving,
)


def kit(root: Path, form: str = "joints") -> Path:
    joints = kit_joints()
    for id, frames in (("00001", len(joints)), ("M00001", 60), ("00002", 20), ("00003", 200)):
        clip = np.resize(joints, (frames, 21, 3)) if frames > len(joints) else joints[:frames]
        if form == "joints":
            array(root / "new_joints" / f"{id}.npy", clip.astype(np.float32))
        else:
            array(root / "new_joint_vecs" / f"{id}.npy", columns(np.concatenate([clip, clip[-1:]]), int(form)))
        text(root / "texts" / f"{id}.txt", f"a person waves {id}#a/DET person/NOUN wave/VERB#0.0#0.0\n")
    text(root / "train.txt", "00001\nM00001\n00002\n")
    text(root / "test.txt", "00003\n00004\n")
    return root


@pytest.mark.parametrize("form", ["joints", "251", "64"])
def test_kit_ml_becomes_22_joints_at_20_frames_a_second(form: str, tmp_path: Path) -> None:
    library, done = made("kit-ml", kit(tmp_path / "in", form))
    assert [(clip.id, clip.split, clip.source) for clip in library.clips] == [
        ("00001", "train", "KIT-ML"),
        ("M00001", "train", "KIT-ML"),
    ]
    assert len(done.notes) == 3  # too short, too long, no files
    joints, expected = library.joints(0), at_20(waving(), 12.5)
    assert abs(len(joints) - len(expected)) <= 1
    assert apart(joints, expected) < 25
    np.testing.assert_allclose(np.linalg.norm(joints[:, 4] - joints[:, 1], axis=-1), 0.3936, atol=2e-3)
    assert joints[:, R_WRIST, 1].max() > joints[:, L_WRIST, 1].max() + 0.5, "it is the right hand that waves"
    assert joints[0, R_WRIST, 0] < joints[0, L_WRIST, 0], "left is +X"


def test_kit_ml_takes_arrays_of_its_own_skeleton_only(tmp_path: Path) -> None:
    root = kit(tmp_path / "in")
    array(root / "new_joints" / "00001.npy", drifting(60))
    with pytest.raises(PlaygroundError, match="21, 3"):
        made("kit-ml", root)


def test_a_body_that_is_none_is_counted(tmp_path: Path) -> None:
    root = kit(tmp_path / "in")
    broken = kit_joints()[:60] + np.arange(60)[:, None, None] * [1e5, 0.0, 0.0]
    for values, note in ((broken, "not understood"), (np.full((60, 21, 3), np.nan), "finite")):
        array(root / "new_joints" / "00001.npy", values)
        library, done = made("kit-ml", root)
        assert [clip.id for clip in library.clips] == ["M00001"]
        assert any(note in line for line in done.notes)


def test_positions_without_length_or_number_are_refused() -> None:
    joints = kit_joints()[:8]
    for place, value in ((5, joints[:, 3]), (5, np.nan)):
        broken = joints.copy()
        broken[:, place] = value
        with pytest.raises(PlaygroundError, match="test motion"):
            source_of_positions(broken, NAMES, PARENTS, REST, 12.5, "test motion")


# ---- CMP -------------------------------------------------------------------------------------------------------------


def test_cmp_is_read_like_humanml3d(tmp_path: Path) -> None:
    root = tmp_path / "in"
    array(root / "new_joint_vecs" / "CMP000001.npy", to_features263(drifting(61)))
    lines = [f"a {word} attack#a/DET attack/NOUN#0.0#0.0" for word in ("quick", "heavy", "low")]
    text(root / "texts" / "CMP000001.txt", "\n".join(lines))
    text(root / "train.txt", "CMP000001\n")
    library, _ = made("cmp", root)
    (clip,) = library.clips
    assert (clip.source, clip.frames, len(clip.captions)) == ("CMP", 60, 3)
    shutil.rmtree(root / "texts")
    with pytest.raises(PlaygroundError, match=r"is not CMP.*texts"):
        prepare("cmp", root, tmp_path / "x")


# ---- Motion-X --------------------------------------------------------------------------------------------------------


def motion_x(
    root: Path, folder: str, rows: np.ndarray, texts: str = "texts/semantic_labels", lists: bool = True
) -> Path:
    array(root / folder / "idea400" / "subset_0000" / "Wave_clip_1.npy", rows)
    array(root / folder / "humanml" / "000021.npy", rows)
    array(root / folder / "idea400" / "Short.npy", rows[:20])
    text(root / texts / "idea400" / "subset_0000" / "Wave_clip_1.txt", "somebody waves\nthe right hand goes up\n")
    text(root / texts / "humanml" / "000021.txt", "waves#wave/VERB#0.0#0.0\nstarts to wave#wave/VERB#0.5#2.5\n")
    text(root / texts / "idea400" / "Short.txt", "a twitch")
    if lists:
        text(root / "train.txt", "idea400/subset_0000/Wave_clip_1\nhumanml/000021\n")
        text(root / "val.txt", "idea400/Short\nidea400/None\n")
    return root


def seen(joints: np.ndarray) -> np.ndarray:
    """More joints in front of and behind which nothing is read: hands and face of SMPL-X."""
    return np.concatenate([joints, np.repeat(joints[:, -1:], 33, axis=1)], axis=1)


FORMS: dict[str, tuple[str, Callable[[], np.ndarray], float]] = {
    "SMPL-X parameters": ("motion_data/smplx_322", smplx, 1.0),
    "HumanML3D's columns": ("vector_263", lambda: to_features263(waving()), 1.0),
    "HumanTOMATO's columns": ("new_joint_vecs", lambda: columns(waving(), 623), 1.0),
    "joints": ("new_joints", lambda: seen(waving()), 1.0),
}


@pytest.mark.parametrize("form", FORMS)
def test_motion_x_in_its_published_forms(form: str, tmp_path: Path) -> None:
    folder, rows, limit = FORMS[form]
    library, done = made("motion-x", motion_x(tmp_path / "in", folder, rows()))
    clips = {clip.id: clip for clip in library.clips}
    assert list(clips) == ["idea400/subset_0000/Wave_clip_1", "humanml/000021", "humanml/000021_0.5_2.5"]
    assert clips["idea400/subset_0000/Wave_clip_1"].captions == ("somebody waves", "the right hand goes up")
    assert clips["humanml/000021_0.5_2.5"].frames == 40
    assert {clip.source for clip in clips.values()} == {"Motion-X"} and len(done.notes) == 2
    expected = canonicalise(at_20(waving().astype(float), 30.0))
    assert apart(library.joints(0), expected) < limit
    assert library.joints(0)[:, R_WRIST, 1].max() > 1.5


def test_motion_x_without_lists_and_with_texts_beside(tmp_path: Path) -> None:
    root = motion_x(tmp_path / "in", "vector_263", to_features263(waving()), texts="texts", lists=False)
    library, _ = made("motion-x", root)
    assert len(library) == 3


@pytest.mark.parametrize(
    ("line", "sentence"),
    [("../in/humanml/000021", "one clip id"), ("/etc/passwd", "one clip id"), ("", "names no clip")],
)
def test_motion_x_lists_stay_inside(line: str, sentence: str, tmp_path: Path) -> None:
    root = motion_x(tmp_path / "in", "vector_263", to_features263(waving()))
    (root / "val.txt").unlink()
    (root / "train.txt").write_text(line)
    with pytest.raises(PlaygroundError, match=sentence):
        prepare("motion-x", root, tmp_path / "out")


@pytest.mark.parametrize("rows", [np.ones((60, 100)), np.ones((60, 21, 3)), np.ones((60, 1))])
def test_motion_x_arrays_of_other_shapes_are_refused(rows: np.ndarray, tmp_path: Path) -> None:
    with pytest.raises(PlaygroundError, match=r"Wave_clip_1\.npy"):
        made("motion-x", motion_x(tmp_path / "in", "motion_data/smplx_322", rows))
