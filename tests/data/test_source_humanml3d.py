"""HumanML3D as its authors publish it, built on the spot."""

from pathlib import Path

import numpy as np
import pytest

from playground.data.library import Library
from playground.data.sources import prepare
from playground.errors import PlaygroundError
from playground.motion.features263 import to_features263
from tests.conftest import drifting

TEXTS = {
    "000001": "a person walks.#a/DET person/NOUN walk/VERB#0.0#0.0\nsomeone strolls#someone/PRON stroll/VERB#nan#nan\n",
    "M000001": "a person walks to the right.#a/DET person/NOUN walk/VERB#0.0#0.0\n",
    "000002": "jumps twice#jump/VERB#0.0#0.0\nkicks#kick/VERB#1.0#4.0\nkicks again#kick/VERB#1.0#4.0\n\n",
    "000003": "waves, the colour is #ff0000#wave/VERB#0.0#0.0\n",
    "000004": "sits#sit/VERB#0.0#0.5\n",
}
FRAMES = {"000001": 60, "M000001": 60, "000002": 120, "000003": 45, "000004": 70}


def humanml3d(root: Path, joints: bool = True, vectors: bool = False) -> Path:
    (root / "texts").mkdir(parents=True)
    if joints:
        (root / "new_joints").mkdir()
    if vectors:
        (root / "new_joint_vecs").mkdir()
    for id, text in TEXTS.items():
        (root / "texts" / f"{id}.txt").write_text(text, encoding="utf-8")
        motion = drifting(FRAMES[id], seed=FRAMES[id])
        if joints:
            np.save(root / "new_joints" / f"{id}.npy", motion)
        if vectors:
            np.save(root / "new_joint_vecs" / f"{id}.npy", to_features263(drifting(FRAMES[id] + 1, seed=FRAMES[id])))
    (root / "train.txt").write_text("000001\nM000001\n000002\n")
    (root / "val.txt").write_text("000003")
    (root / "test.txt").write_text("000004\n000005\n")
    return root


def test_clips_captions_spans_and_splits(tmp_path: Path) -> None:
    done = prepare("humanml3d", humanml3d(tmp_path / "in"), tmp_path / "out")
    library = Library.open(tmp_path / "out")
    clips = {clip.id: clip for clip in library.clips}
    assert list(clips) == ["000001", "M000001", "000002", "000002_1_4", "000003"] and done.clips == 5
    assert [clip.split for clip in clips.values()] == ["train", "train", "train", "train", "val"]
    assert clips["000001"].captions == ("a person walks.", "someone strolls")
    assert clips["000002"].captions == ("jumps twice",) and clips["000002"].frames == 120
    assert clips["000002_1_4"].captions == ("kicks", "kicks again") and clips["000002_1_4"].frames == 60
    assert clips["000003"].captions == ("waves, the colour is #ff0000",)
    assert [clip.action for clip in clips.values()] == ["walk", "walk", "jump", "kick", "wave"]
    assert len(done.notes) == 2  # the half second of 000004, and 000005, which has no files
    np.testing.assert_allclose(library.joints(0), drifting(60, seed=60), atol=1e-6)


def test_a_span_starts_over_the_origin(tmp_path: Path) -> None:
    prepare("humanml3d", humanml3d(tmp_path / "in"), tmp_path / "out")
    cut = Library.open(tmp_path / "out").joints(3)
    whole = drifting(120, seed=120)
    expected = whole[20:80] - whole[20, 0] * [1, 0, 1]
    np.testing.assert_allclose(cut, expected, atol=1e-5)


def test_columns_are_turned_back_into_joints(tmp_path: Path) -> None:
    prepare("humanml3d", humanml3d(tmp_path / "in", joints=False, vectors=True), tmp_path / "out")
    library = Library.open(tmp_path / "out")
    assert [clip.frames for clip in library.clips] == [60, 60, 120, 60, 45]
    np.testing.assert_allclose(library.joints(0), drifting(61, seed=60)[:60], atol=1e-4)


def test_the_other_folder_helps_out_where_a_motion_is_missing(tmp_path: Path) -> None:
    root = humanml3d(tmp_path / "in", vectors=True)
    (root / "new_joints" / "000001.npy").unlink()
    assert prepare("humanml3d", root, tmp_path / "out").clips == 5


def test_long_clips_are_left_out(tmp_path: Path) -> None:
    root = humanml3d(tmp_path / "in")
    np.save(root / "new_joints" / "000001.npy", drifting(200))
    np.save(root / "new_joints" / "M000001.npy", drifting(199))
    np.save(root / "new_joints" / "000003.npy", drifting(39))
    np.save(root / "new_joints" / "000002.npy", np.full((60, 22, 3), np.nan, np.float32))
    done = prepare("humanml3d", root, tmp_path / "out")
    assert [clip.id for clip in Library.open(tmp_path / "out").clips] == ["M000001"]
    assert sum(int(note.split()[0]) for note in done.notes) == 1 + 1 + 2 + 1 + 1


BAD_TEXTS = {
    "no fields": "a person walks",
    "two fields": "a person walks#a b",
    "a span of words": "walks#walk#from#to",
    "an empty span": "walks#walk#3.0#3.0",
    "a span backwards": "walks#walk#3.0#1.0",
    "a negative span": "walks#walk#-1.0#2.0",
    "an endless span": "walks#walk#0.0#inf",
}


@pytest.mark.parametrize("text", BAD_TEXTS.values(), ids=BAD_TEXTS.keys())
def test_a_broken_line_is_counted_and_the_others_are_read(text: str, tmp_path: Path) -> None:
    root = humanml3d(tmp_path / "in")
    (root / "texts" / "000001.txt").write_text(f"fine#f#0.0#0.0\n{text}\nalso fine#f#nan#nan\n")
    notes = prepare("humanml3d", root, tmp_path / "out").notes
    assert len([note for note in notes if note.startswith("1 left out: lines ")]) == 1
    clip = next(clip for clip in Library.open(tmp_path / "out").clips if clip.id == "000001")
    assert clip.captions == ("fine", "also fine")


BAD_MOTIONS = {
    "wrong joints": np.zeros((60, 21, 3), np.float32),
    "wrong columns": np.zeros((60, 251), np.float32),
    "whole numbers": np.zeros((60, 22, 3), np.int64),
    "objects": np.array([{}, []], dtype=object),
    "a number": np.float32(3.0),
    "no frames of columns": np.zeros((0, 263), np.float32),
}


@pytest.mark.parametrize("array", BAD_MOTIONS.values(), ids=BAD_MOTIONS.keys())
def test_a_broken_motion_names_its_file(array: np.ndarray, tmp_path: Path) -> None:
    root = humanml3d(tmp_path / "in")
    np.save(root / "new_joints" / "000002.npy", array)
    with pytest.raises(PlaygroundError, match=r"000002\.npy"):
        prepare("humanml3d", root, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_what_is_not_humanml3d_is_one_sentence(tmp_path: Path) -> None:
    root = humanml3d(tmp_path / "in")
    (root / "train.txt").write_text("../../etc/passwd\n")
    with pytest.raises(PlaygroundError, match="one clip id a line"):
        prepare("humanml3d", root, tmp_path / "out")
    for name in ("train.txt", "val.txt", "test.txt"):
        (root / name).write_text("")
    with pytest.raises(PlaygroundError, match="name no clip"):
        prepare("humanml3d", root, tmp_path / "out")
    for name in ("train.txt", "val.txt", "test.txt"):
        (root / name).unlink()
    with pytest.raises(PlaygroundError, match="is not HumanML3D"):
        prepare("humanml3d", root, tmp_path / "out")
