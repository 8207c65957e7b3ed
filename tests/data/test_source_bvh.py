"""A folder of BVH files, with and without a table of captions."""

from pathlib import Path

import numpy as np
import pytest

from playground.data.library import SPLITS, Library
from playground.data.sources import prepare
from playground.errors import PlaygroundError
from playground.motion.formats import write_motion
from playground.motion.motion import Motion
from tests.conftest import drifting

FILES = {"walk_slowly01.bvh": 60, "deep/er/KickHigh.BVH": 50, "notes/stand.bvh": 45}


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("recordings")
    for name, frames in FILES.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        write_motion(Motion(drifting(frames, seed=frames)), root / "made.bvh")
        (root / "made.bvh").rename(root / name)
    (root / "readme.txt").write_text("not a motion")
    return root


@pytest.fixture
def table(recordings: Path) -> Path:
    """The place of the table; it is gone after the test."""
    path = recordings / "captions.csv"
    yield path
    path.unlink(missing_ok=True)


def test_a_plain_folder_is_captioned_by_its_names(recordings: Path, tmp_path: Path) -> None:
    prepare("bvh", recordings, tmp_path / "out")
    library = Library.open(tmp_path / "out")
    assert {clip.id: clip.captions for clip in library.clips} == {
        "deep/er/KickHigh": ("kick high",), "notes/stand": ("stand",), "walk_slowly01": ("walk slowly",),
    }  # fmt: skip
    assert {clip.action for clip in library.clips} == {"kick", "stand", "walk"}
    assert all(clip.split in SPLITS for clip in library.clips)
    frames = {clip.id: (number, clip.frames) for number, clip in enumerate(library.clips)}
    number, poses = frames["walk_slowly01"]
    assert poses == 60
    np.testing.assert_allclose(library.joints(number), drifting(60, seed=60), atol=1e-3)


def test_a_table_gives_captions_spans_splits_and_actions(recordings: Path, table: Path, tmp_path: Path) -> None:
    table.write_text(
        "\ufefffile, caption ,start,end,split,action\n"
        'walk_slowly01.bvh,"someone strolls, slowly",,,val,\n'
        "walk_slowly01.bvh,a stroll,,,,\n"
        "walk_slowly01.bvh,the middle of it,1,2.5,test,run\n"
        "\n"
        "./deep\\er/KickHigh.BVH,,0.5,,train,kick\n",
        encoding="utf-8",
    )
    prepare("bvh", recordings, tmp_path / "out")
    clips = {clip.id: clip for clip in Library.open(tmp_path / "out").clips}
    assert list(clips) == ["deep/er/KickHigh_0.5_end", "notes/stand", "walk_slowly01", "walk_slowly01_1_2.5"]
    whole, cut, kick = clips["walk_slowly01"], clips["walk_slowly01_1_2.5"], clips["deep/er/KickHigh_0.5_end"]
    assert whole.captions == ("someone strolls, slowly", "a stroll") and whole.split == "val"
    assert (whole.frames, cut.frames, kick.frames) == (60, 30, 40)
    assert cut.captions == ("the middle of it",) and (cut.split, cut.action) == ("test", "run")
    assert kick.captions == ("kick high",) and (kick.split, kick.action) == ("train", "kick")


BAD_TABLES = {
    "nothing": "",
    "no header": "walk_slowly01.bvh,a stroll\n",
    "an unknown column": "file,caption,mood\n",
    "no caption column": "file,start\n",
    "an unknown file": "file,caption\nrun.bvh,runs\n",
    "a file outside": "file,caption\n../walk_slowly01.bvh,runs\n",
    "too many fields": "file,caption\nwalk_slowly01.bvh,runs, and stops\n",
    "an open quote": 'file,caption\nwalk_slowly01.bvh,"runs\n',
    "a start of words": "file,caption,start,end\nwalk_slowly01.bvh,walks,now,then\n",
    "a start below zero": "file,caption,start,end\nwalk_slowly01.bvh,walks,-1,2\n",
    "a start of NaN": "file,caption,start,end\nwalk_slowly01.bvh,walks,nan,2\n",
    "an endless end": "file,caption,start,end\nwalk_slowly01.bvh,walks,0,inf\n",
    "an end before the start": "file,caption,start,end\nwalk_slowly01.bvh,walks,2,1\n",
    "an end after the clip": "file,caption,start,end\nwalk_slowly01.bvh,walks,0,9\n",
    "an unknown split": "file,caption,split\nwalk_slowly01.bvh,walks,dev\n",
    "a start after the clip": "file,caption,start\nwalk_slowly01.bvh,walks,5\n",
    "bytes": "\x00\x01",
}


@pytest.mark.parametrize("text", BAD_TABLES.values(), ids=BAD_TABLES.keys())
def test_a_bad_table_is_one_sentence(text: str, recordings: Path, table: Path, tmp_path: Path) -> None:
    table.write_text(text)
    with pytest.raises(PlaygroundError) as caught:
        prepare("bvh", recordings, tmp_path / "out")
    assert "captions.csv" in str(caught.value) and "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_broken_file_is_named(tmp_path: Path) -> None:
    root = tmp_path / "in"
    root.mkdir()
    (root / "fine.bvh").write_text("HIERARCHY\nno\n")
    with pytest.raises(PlaygroundError, match=r"fine\.bvh"):
        prepare("bvh", root, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_folder_without_bvh_files_says_so(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    with pytest.raises(PlaygroundError, match=r"no \.bvh file"):
        prepare("bvh", tmp_path / "in", tmp_path / "out")


def test_long_takes_are_cut_on_demand(tmp_path: Path) -> None:
    root = tmp_path / "in"
    root.mkdir()
    frames = 30 * 20
    time = np.arange(frames) / 20
    still = np.exp(-0.5 * ((time - 9.0) / 0.4) ** 2) + np.exp(-0.5 * ((time - 19.0) / 0.4) ** 2)
    way = np.cumsum(np.maximum(1.0 - still, 0.0)) / 20
    joints = drifting(frames, seed=1) * [1, 1, 0] + np.stack([0 * way, 0 * way, way], -1)[:, None]
    write_motion(Motion(joints), root / "long_walk.bvh")
    write_motion(Motion(drifting(60)), root / "short.bvh")
    (root / "captions.csv").write_text("file,caption,start,end\nlong_walk.bvh,walks and stops,,\nshort.bvh,walks,,\n")
    prepare("bvh", root, tmp_path / "whole")
    assert [clip.frames for clip in Library.open(tmp_path / "whole").clips] == [frames, 60]
    prepare("bvh", root, tmp_path / "cut", cut=True)
    library = Library.open(tmp_path / "cut")
    assert [clip.frames for clip in library.clips] == pytest.approx([180, 200, 220, 60], abs=4)
    assert sum(clip.frames for clip in library.clips) == frames + 60
    assert len({clip.id for clip in library.clips}) == 4 and library.clips[0].id.startswith("long_walk_0_")
    assert {clip.captions for clip in library.clips[:3]} == {("walks and stops",)}
    assert len({clip.split for clip in library.clips[:3]}) == 1


@pytest.mark.parametrize("source", ["joints-npz", "deepmimic"])
def test_only_takes_can_be_cut(source: str, tmp_path: Path) -> None:
    root = None if source == "deepmimic" else tmp_path
    with pytest.raises(PlaygroundError, match="cut already; long takes of bvh"):
        prepare(source, root, tmp_path / "out", cut=True)
