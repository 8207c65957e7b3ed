"""Every source, from a folder built on the spot, to a library; and every way in which a folder can be wrong."""

import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.data.actions import GROUPS, action_of
from playground.data.library import Library
from playground.data.sources import SOURCES, open_source, prepare
from playground.data.sources.base import split_of
from playground.errors import PlaygroundError
from playground.motion.skeleton import HUMAN22
from tests.conftest import drifting

LENGTHS = (30, 48, 17)


def joints_npz(folder: Path, changes: dict | None = None, entries: list[dict] | None = None) -> Path:
    """A joints-npz folder of three clips; `changes` replaces arrays (None removes one)."""
    folder.mkdir(exist_ok=True)
    clips = [drifting(frames, seed=frames) for frames in LENGTHS]
    arrays = {
        "joints": np.round(np.concatenate(clips) / 0.0006).astype(np.int16),
        "scale": np.float32(0.0006),
        "offsets": np.cumsum([0, *LENGTHS]),
        "fps": np.float32(20),
        "joint_names": np.array(HUMAN22.joints),
    }
    arrays |= changes or {}
    np.savez(folder / "motions.npz", **{name: value for name, value in arrays.items() if value is not None})
    if entries is None:
        entries = [entry(number) for number in range(len(LENGTHS))]
    (folder / "clips.jsonl").write_text("".join(json.dumps(line) + "\n" for line in entries), encoding="utf-8")
    return folder


def entry(number: int, **changes: object) -> dict:
    split = ("train", "val", "train")[number]
    fields = {"index": number, "id": f"clip{number}", "source": "Made", "split": split, "label": "walk-left|happy"}
    return fields | {"captions": [{"text": f"clip {number} glides"}, {"text": "it sways"}]} | changes


def refused(source: str, root: Path | None, out: Path) -> str:
    """The message with which a source is refused; nothing may be left behind."""
    with pytest.raises(PlaygroundError) as caught:
        prepare(source, root, out)
    message = str(caught.value)
    assert message and "\n" not in message
    assert not out.exists() and not out.with_name(out.name + ".partial").exists()
    return message


def test_joints_npz_becomes_a_library(tmp_path: Path) -> None:
    steps: list[tuple[int, int]] = []
    done = prepare("joints-npz", joints_npz(tmp_path / "in"), tmp_path / "out", lambda *step: steps.append(step))
    assert (done.clips, done.notes) == (3, ()) and steps == [(1, 3), (2, 3), (3, 3)]
    library = Library.open(tmp_path / "out")
    assert [clip.id for clip in library.clips] == ["clip0", "clip1", "clip2"]
    assert [clip.split for clip in library.clips] == ["train", "val", "train"] and library.split("test") == []
    assert library.clips[1].captions == ("clip 1 glides", "it sways") and library.clips[1].action == "walk"
    for number, frames in enumerate(LENGTHS):
        np.testing.assert_allclose(library.joints(number), drifting(frames, seed=frames), atol=4e-4)
        assert library.features(number).shape == (frames - 1, 67)


def test_clips_are_turned_and_moved_to_the_origin(tmp_path: Path) -> None:
    quarter = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    clips = [drifting(frames, seed=frames) @ quarter.T + [3.0, 0.7, -2.0] for frames in LENGTHS]
    changes = {"joints": np.concatenate(clips).astype(np.float32), "scale": None, "joint_names": None, "fps": None}
    prepare("joints-npz", joints_npz(tmp_path / "in", changes), tmp_path / "out")
    library = Library.open(tmp_path / "out")
    for number, frames in enumerate(LENGTHS):
        np.testing.assert_allclose(library.joints(number), drifting(frames, seed=frames), atol=1e-5)


def test_unusable_clips_are_left_out_and_counted(tmp_path: Path) -> None:
    joints = np.concatenate([drifting(frames) for frames in LENGTHS]).astype(np.float32)
    joints[0, 5] = np.nan
    root = joints_npz(tmp_path / "in", {"joints": joints, "scale": None, "offsets": np.array([0, 30, 78, 94])})
    done = prepare("joints-npz", root, tmp_path / "out")
    assert done.clips == 1 and len(done.notes) == 2
    assert Library.open(tmp_path / "out").clips[0].id == "clip1"


BAD_ARRAYS = {
    "no joints": {"joints": None},
    "no offsets": {"offsets": None},
    "21 joints": {"joints": np.zeros((95, 21, 3), np.int16)},
    "flat joints": {"joints": np.zeros((95, 66), np.int16)},
    "text joints": {"joints": np.full((95, 22, 3), "a")},
    "falling offsets": {"offsets": np.array([0, 48, 30, 95])},
    "offsets beyond the end": {"offsets": np.array([0, 30, 78, 96])},
    "negative offsets": {"offsets": np.array([-1, 30, 78, 95])},
    "float offsets": {"offsets": np.array([0.0, 30, 78, 95])},
    "one offset": {"offsets": np.array([0])},
    "zero scale": {"scale": np.float32(0)},
    "NaN scale": {"scale": np.float32(np.nan)},
    "a list of scales": {"scale": np.ones(3, np.float32)},
    "30 fps": {"fps": np.float32(30)},
    "another joint order": {"joint_names": np.array(HUMAN22.joints[::-1])},
    "pickled joints": {"joints": np.array([{"a": 1}, None], dtype=object)},
}


@pytest.mark.parametrize("changes", BAD_ARRAYS.values(), ids=BAD_ARRAYS.keys())
def test_bad_arrays_are_one_sentence(changes: dict, tmp_path: Path) -> None:
    refused("joints-npz", joints_npz(tmp_path / "in", changes), tmp_path / "out")


BAD_ENTRIES = {
    "index beyond the end": {"index": 3},
    "negative index": {"index": -1},
    "index true": {"index": True},
    "index as text": {"index": "0"},
    "another split": {"split": "dev"},
    "captions a text": {"captions": "walks"},
    "captions without text": {"captions": [{}]},
    "captions null": {"captions": None},
    "an id twice": {"id": "clip1"},
}


@pytest.mark.parametrize("changes", BAD_ENTRIES.values(), ids=BAD_ENTRIES.keys())
def test_bad_entries_are_one_sentence(changes: dict, tmp_path: Path) -> None:
    root = joints_npz(tmp_path / "in", entries=[entry(0, **changes), entry(1)])
    refused("joints-npz", root, tmp_path / "out")


def test_broken_files_are_one_sentence(tmp_path: Path) -> None:
    root = joints_npz(tmp_path / "in")
    good = (root / "motions.npz").read_bytes()
    for bad in (b"", good[:500], b"PK\x03\x04" + bytes(100), bytes(range(256))):
        (root / "motions.npz").write_bytes(bad)
        assert "motions.npz" in refused("joints-npz", root, tmp_path / "out")
    (root / "motions.npz").write_bytes(good)
    for text in (b"{", b"[]\n", b"\xff\xfe", b"", b"null\n"):
        (root / "clips.jsonl").write_bytes(text)
        refused("joints-npz", root, tmp_path / "out")
    (root / "clips.jsonl").unlink()
    assert "missing" in refused("joints-npz", root, tmp_path / "out")


def test_an_archive_that_claims_terabytes_is_refused(tmp_path: Path) -> None:
    root = joints_npz(tmp_path / "in")
    header = io.BytesIO()
    shape = (10**11, 22, 3)
    np.lib.format.write_array_header_1_0(header, {"descr": "<i2", "fortran_order": False, "shape": shape})
    with zipfile.ZipFile(root / "motions.npz", "w") as archive:
        archive.writestr("joints.npy", header.getvalue() + bytes(100))
        archive.writestr("offsets.npy", header.getvalue() + bytes(100))
    refused("joints-npz", root, tmp_path / "out")


@pytest.mark.parametrize("source", SOURCES)
def test_a_folder_that_is_not_there_or_empty_is_refused(source: str, tmp_path: Path) -> None:
    refused(source, tmp_path / "none", tmp_path / "out")
    if SOURCES[source].needs_root:
        (tmp_path / "empty").mkdir()
        refused(source, tmp_path / "empty", tmp_path / "out")
        refused(source, None, tmp_path / "out")


def test_unknown_sources_and_occupied_folders_are_refused(tmp_path: Path) -> None:
    root = joints_npz(tmp_path / "in")
    assert "joints-npz" in refused("amass", root, tmp_path / "out")
    with pytest.raises(PlaygroundError, match="not a motion library"):
        prepare("joints-npz", root, root)
    assert (root / "motions.npz").is_file()
    (tmp_path / "file").write_text("mine")
    with pytest.raises(PlaygroundError, match="not a motion library"):
        prepare("joints-npz", root, tmp_path / "file")
    assert (tmp_path / "file").read_text() == "mine"


def test_a_library_is_replaced_only_by_a_finished_one(tmp_path: Path) -> None:
    root, out = joints_npz(tmp_path / "in"), tmp_path / "out"
    prepare("joints-npz", root, out)
    joints_npz(root, entries=[entry(0), entry(0)])
    with pytest.raises(PlaygroundError, match="twice"):
        prepare("joints-npz", root, out)
    assert len(Library.open(out)) == 3
    joints_npz(root, entries=[entry(2)])
    prepare("joints-npz", root, out)
    assert [clip.id for clip in Library.open(out).clips] == ["clip2"]


def test_the_recorded_data_becomes_a_library(library_data: Path, tmp_path: Path) -> None:
    done = prepare("joints-npz", library_data, tmp_path / "out")
    lines = [json.loads(line) for line in (library_data / "clips.jsonl").read_text(encoding="utf-8").splitlines()]
    library = Library.open(tmp_path / "out")
    assert done.clips == len(lines) == len(library)
    assert [clip.id for clip in library.clips] == [line["id"] for line in lines]
    assert [clip.frames for clip in library.clips] == [line["n_frames"] for line in lines]
    with np.load(library_data / "motions.npz") as archive:
        joints, offsets, scale = archive["joints"], archive["offsets"], np.float32(archive["scale"])
    for number in range(0, len(lines), 97):
        original = joints[offsets[number] : offsets[number + 1]].astype(np.float32) * scale
        np.testing.assert_allclose(library.joints(number), original, atol=1e-6)


@given(st.text(max_size=40))
def test_every_label_has_one_of_the_actions(label: str) -> None:
    assert action_of(label) in {name for name, _ in GROUPS} | {"other"}


@pytest.mark.parametrize(
    ("label", "action"),
    [
        ("WalkLeft01", "walk"),
        ("walk_turn-left|sad", "walk and turn"),
        ("a man raises both of his hands", "raise hands"),
        ("throwsAJavelin2Reps", "play ball"),
        ("someone waves", "wave"),
        ("jogOnPlace", "run"),
        ("zxcv", "other"),
        ("", "other"),
    ],
)
def test_labels_of_many_styles_find_their_action(label: str, action: str) -> None:
    assert action_of(label) == action


def test_takes_without_a_split_fall_80_5_15() -> None:
    splits = [split_of(f"take{number}") for number in range(4000)]
    assert splits == [split_of(f"take{number}") for number in range(4000)]
    shares = {name: splits.count(name) / len(splits) for name in ("train", "val", "test")}
    assert shares == pytest.approx({"train": 0.80, "val": 0.05, "test": 0.15}, abs=0.03)


def test_opening_reads_no_clip(tmp_path: Path) -> None:
    reading = open_source("joints-npz", joints_npz(tmp_path / "in"))
    assert reading.total == 3 and not reading.left_out


def test_a_library_has_the_name_that_it_is_given(tmp_path):
    root = joints_npz(tmp_path / "in")
    prepare("joints-npz", root, tmp_path / "out", name="my-set.2")
    assert Library.open(tmp_path / "out").name == "my-set.2"
    prepare("joints-npz", root, tmp_path / "plain")
    assert Library.open(tmp_path / "plain").name == "joints-npz"
    for wrong in ("a b", "../x", "x" * 61, "-"):
        with pytest.raises(PlaygroundError, match="letters, digits"):
            prepare("joints-npz", root, tmp_path / "other", name=wrong)
    assert not (tmp_path / "other").exists()
