"""SnapMoGen in the folders that it is published in, built on the spot."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from playground.data.library import Library
from playground.data.sources import prepare
from playground.errors import PlaygroundError
from tests.data.published import (
    L_WRIST,
    R_WRIST,
    SNAP_OFFSETS,
    SNAP_PARENTS,
    SNAP_REST,
    apart,
    array,
    at_20,
    made,
    snap_features,
    snap_motion,
    text,
    waving,
)
from tests.motion.skeletons import STYLES, Rig, bvh_text


def rig_bvh() -> str:
    """The published rig as BVH: two frames of its zero pose."""

    def joint(number: int, depth: int) -> list[str]:
        kids = [child for child, parent in enumerate(SNAP_PARENTS) if parent == number]
        channels = "6 Xposition Yposition Zposition" if number == 0 else "3"
        inner = [f"OFFSET {' '.join(f'{x:.4f}' for x in SNAP_OFFSETS[number])}"]
        inner.append(f"CHANNELS {channels} Xrotation Yrotation Zrotation")
        for child in kids:
            inner += joint(child, depth + 1)
        if not kids:
            inner += ["End Site", "{", "OFFSET 0 0 0", "}"]
        return [f"{'ROOT' if number == 0 else 'JOINT'} {list(SNAP_REST)[number]}", "{", *inner, "}"]

    frame = " ".join(["0"] * (6 + 23 * 3))
    motion = ["MOTION", "Frames: 8", "Frame Time: 0.033333", *[frame] * 8]
    return "\n".join(["HIERARCHY", *joint(0, 0), *motion, ""])


def snapmogen(root: Path, total: int = 296) -> Path:
    positions, quaternions = snap_motion()
    yaw = np.concatenate([[0.0], np.cumsum(np.random.default_rng(0).normal(size=len(positions) - 1) * 0.03)])
    rows = snap_features(positions, quaternions, yaw)[:, :total]
    for name in ("gp_00171", "m_gp_00171"):
        array(root / "renamed_feats" / f"{name}.npy", rows)
    ids = ["gp_00171#0#141", "gp_00171#30#131", "m_gp_00171#0#141", "gp_00171#0#10", "gp_00999#0#90"]
    captions = {id: {"manual": ["the person waves", "a wave"], "gpt": [f"{id} in many words"]} for id in ids}
    text(root / "all_caption_clean.json", json.dumps(captions))
    text(root / "data_split_info" / "train_ids.txt", "\n".join(ids[:2]))
    text(root / "data_split_info" / "val_ids.txt", ids[2])
    text(root / "data_split_info" / "test_ids.txt", "\n".join(ids[3:]))
    return root


def test_snapmogen_becomes_22_joints_at_20_frames_a_second(tmp_path: Path) -> None:
    library, done = made("snapmogen", snapmogen(tmp_path / "in"))
    assert [(clip.id, clip.split) for clip in library.clips] == [
        ("gp_00171#0#141", "train"),
        ("gp_00171#30#131", "train"),
        ("m_gp_00171#0#141", "val"),
    ]
    assert library.clips[0].captions == ("the person waves", "a wave", "gp_00171#0#141 in many words")
    assert library.clips[0].source == "SnapMoGen" and len(done.notes) == 2
    joints = library.joints(0)
    assert abs(len(joints) - 141 * 20 / 30) <= 1
    assert apart(joints, at_20(waving(), 30.0)) < 40
    assert joints[:, R_WRIST, 1].max() > joints[:, L_WRIST, 1].max() + 0.5
    part = library.joints(1)
    assert apart(part, joints[20:]) < 15, "a clip from the middle shows the same poses"


def test_snapmogen_of_148_columns_takes_the_rig_from_a_bvh_file(tmp_path: Path) -> None:
    root = snapmogen(tmp_path / "in", 148)
    with pytest.raises(PlaygroundError, match="need the rig"):
        made("snapmogen", root)
    text(root / "renamed_bvhs" / "m_ep2_00086.bvh", rig_bvh())
    whole = Library.open(prepare_to(snapmogen(tmp_path / "whole"), tmp_path / "whole-out"))
    library, _ = made("snapmogen", root)
    np.testing.assert_allclose(library.joints(0), whole.joints(0), atol=1e-3)
    text(root / "renamed_bvhs" / "a.bvh", bvh_text(waving()[:8], Rig(STYLES["Mixamo"])))
    with pytest.raises(PlaygroundError, match="another skeleton"):
        made("snapmogen", root)


def prepare_to(root: Path, out: Path) -> Path:
    prepare("snapmogen", root, out)
    return out


@pytest.mark.parametrize("missing", ["renamed_feats", "data_split_info", "all_caption_clean.json"])
def test_snapmogen_says_what_is_missing(missing: str, tmp_path: Path) -> None:
    root = snapmogen(tmp_path / "in")
    path = root / missing
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    with pytest.raises(PlaygroundError, match=f"{missing} is missing"):
        made("snapmogen", root)


@pytest.mark.parametrize("content", ["[]", "{", '{"a": 3}', '{"a": {"manual": 3}}', "\ud7ff"])
def test_snapmogen_captions_that_are_no_table_are_refused(content: str, tmp_path: Path) -> None:
    root = snapmogen(tmp_path / "in")
    text(root / "all_caption_clean.json", content)
    with pytest.raises(PlaygroundError, match="captions"):
        made("snapmogen", root)


@pytest.mark.parametrize("id", ["gp_00171", "gp_00171#0", "gp_00171#a#b", "../gp#0#9", "#0#9", "gp_00171#0#-9"])
def test_snapmogen_ids_that_are_none_are_refused(id: str, tmp_path: Path) -> None:
    root = snapmogen(tmp_path / "in")
    text(root / "data_split_info" / "train_ids.txt", id)
    with pytest.raises(PlaygroundError, match="clip"):
        made("snapmogen", root)
