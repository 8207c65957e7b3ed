"""Reading and writing by suffix."""

from pathlib import Path

import numpy as np
import pytest

from playground.errors import PlaygroundError
from playground.motion.features263 import to_features263
from playground.motion.formats import read_motion, write_motion
from playground.motion.gltf import parse_glb
from playground.motion.motion import Motion
from playground.motion.representation import canonicalise, to_features67
from tests.motion.skeletons import STYLES, Rig, bvh_text, walk
from tests.motion.uploads import npy, npz, sentence


@pytest.mark.parametrize("suffix", [".npz", ".bvh"])
def test_out_and_in(tmp_path: Path, suffix: str) -> None:
    motion = Motion(walk(), caption="someone walks round a corner")
    assert write_motion(motion, tmp_path / f"clip{suffix}") == []
    read = read_motion(tmp_path / f"clip{suffix}")
    assert np.abs(read.motion.joints - motion.joints).max() < 1e-4 and read.motion.fps == 20.0 and read.changes == []
    assert read.motion.name == "clip" and read.motion.caption == (motion.caption if suffix == ".npz" else "")
    assert read.mapping.endswith(".")


def test_npz_holds_joints_rate_and_caption_for_everyone(tmp_path: Path) -> None:
    for caption in ("", "ein Mensch grüßt"):
        write_motion(Motion(walk(), caption=caption), tmp_path / "clip.npz")
        with np.load(tmp_path / "clip.npz") as data:
            assert sorted(data) == ["caption", "fps", "joints"] and str(data["caption"]) == caption
            assert data["joints"].dtype == np.float32 and np.array_equal(data["joints"], walk()) and data["fps"] == 20.0
        assert read_motion(tmp_path / "clip.npz").motion.caption == caption


def test_glb_is_sound(tmp_path: Path) -> None:
    assert write_motion(Motion(walk()), tmp_path / "clip.GLB") == []
    parse_glb((tmp_path / "clip.GLB").read_bytes())


@pytest.mark.parametrize("suffix", [".bvh", ".glb"])
def test_changes_are_reported_where_bones_drift(tmp_path: Path, suffix: str) -> None:
    joints = walk() + np.random.default_rng(1).normal(size=walk().shape) * 0.008
    assert "median" in write_motion(Motion(joints), tmp_path / f"a{suffix}")[0]
    assert write_motion(Motion(joints), tmp_path / "a.npz") == []


def test_a_generated_motion_survives_the_round_trip(tmp_path: Path) -> None:
    joints = walk() + 0.004 * np.sin(np.arange(walk().size).reshape(walk().shape))
    motion = Motion(canonicalise(joints))
    write_motion(motion, tmp_path / "a.bvh")
    assert np.linalg.norm(read_motion(tmp_path / "a.bvh").motion.joints - motion.joints, axis=-1).mean() < 0.02


@pytest.mark.parametrize("name", ["a.txt", "a", "a.fbx", "a.exe.zip"])
def test_other_suffixes_are_refused_both_ways(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"x")
    assert ".bvh, .npy, .npz" in sentence(tmp_path / name)
    with pytest.raises(PlaygroundError, match=r"\.npz, \.bvh, \.glb"):
        write_motion(Motion(walk()), tmp_path / name)


def test_unwritable_places_are_one_sentence(tmp_path: Path) -> None:
    for target in (tmp_path / "no" / "a.bvh", tmp_path / "no" / "a.npz", tmp_path / "no" / "a.glb"):
        with pytest.raises(PlaygroundError, match="cannot be written"):
            write_motion(Motion(walk()), target)


def test_joint_arrays_of_every_accepted_shape(tmp_path: Path) -> None:
    joints = walk()
    smpl = np.concatenate([joints, joints[:, -2:]], axis=1)
    for array in (
        joints,
        joints[None],
        joints.reshape(-1, 66),
        smpl,
        joints.astype(np.float64),
        joints.astype(np.float16),
    ):
        read = read_motion(npy(tmp_path / "a.npy", array))
        assert np.abs(read.motion.joints - joints).max() < (0.02 if array.dtype == np.float16 else 1e-5)
    assert "24 joints" in read_motion(npy(tmp_path / "a.npy", smpl)).mapping
    assert np.array_equal(read_motion(npy(tmp_path / "a.npy", np.asfortranarray(joints))).motion.joints, joints)


def test_features_of_both_kinds(tmp_path: Path) -> None:
    for columns in (to_features67(walk()), to_features263(walk())):
        read = read_motion(npy(tmp_path / "a.npy", columns))
        assert np.abs(read.motion.joints - walk()[:-1]).max() < 1e-4 and str(columns.shape[1]) in read.mapping
        assert np.array_equal(read_motion(npz(tmp_path / "a.npz", features=columns)).motion.joints, read.motion.joints)
        normal = (columns - columns.mean(0)) / (columns.std(0) + 1e-3)
        assert "not normalised" in sentence(npy(tmp_path / "b.npy", normal))


@pytest.mark.parametrize("key", ["joints", "Jtr", "joints3d", "positions", "anything"])
@pytest.mark.parametrize("rate", ["mocap_framerate", "mocap_frame_rate", "fps"])
def test_amass_style_joints(tmp_path: Path, key: str, rate: str) -> None:
    joints = np.repeat(walk()[:40], 3, axis=0)[:, :, [0, 2, 1]] * [1.0, -1.0, 1.0] + [4.0, -3.0, 0.0]
    pose = np.zeros((120, 156))
    read = read_motion(npz(tmp_path / "a.npz", **{key: joints, rate: 60.0, "betas": np.zeros(16), "poses": pose}))
    assert np.abs(read.motion.joints - canonicalise(walk()[:40])).max() < 0.02
    assert any("Z points up" in change for change in read.changes) and any("60 frames" in c for c in read.changes)


def test_smpl_parameters_alone_need_a_body_model(tmp_path: Path) -> None:
    path = npz(tmp_path / "a.npz", poses=np.zeros((90, 156)), trans=np.zeros((90, 3)), betas=np.zeros(16),
               mocap_framerate=120.0, gender="female")  # fmt: skip
    assert "body model" in sentence(path)


def test_other_bones_are_brought_to_the_reference_and_said(tmp_path: Path) -> None:
    tall = walk() * np.float32(1.3)
    read = read_motion(npy(tmp_path / "a.npy", tall))
    assert np.abs(read.motion.joints - canonicalise(walk())).max() < 0.02
    assert any("scaled by 0.769" in change for change in read.changes)


def test_a_start_cuts_the_front_and_length_is_kept(tmp_path: Path) -> None:
    write_motion(Motion(walk()), tmp_path / "a.npz")
    read = read_motion(tmp_path / "a.npz", start_seconds=1.5)
    assert read.motion.frames == len(walk()) - 30
    assert np.abs(read.motion.joints - canonicalise(walk()[30:])).max() < 1e-5
    long = np.concatenate([walk()] * 40)
    assert read_motion(npy(tmp_path / "b.npy", long)).motion.frames == len(long)


def test_bvh_uploads_say_how_they_were_mapped(tmp_path: Path) -> None:
    (tmp_path / "a.bvh").write_text(bvh_text(walk()[:30], Rig(STYLES["Xsens"], fps=20)))
    read = read_motion(tmp_path / "a.bvh")
    assert "Xsens" in read.mapping and any("centimetres" in change for change in read.changes)


def test_recorded_clips_survive_every_format(library_data: Path, tmp_path: Path) -> None:
    with np.load(library_data / "motions.npz") as data:
        starts, packed, scale = data["offsets"], data["joints"], float(data["scale"])
    for i in range(11, len(starts) - 1, 577):
        joints = packed[starts[i] : starts[i + 1]].astype(np.float32) * np.float32(scale)
        for suffix in (".npz", ".bvh"):
            write_motion(Motion(joints), tmp_path / f"a{suffix}")
            read = read_motion(tmp_path / f"a{suffix}")
            assert np.linalg.norm(read.motion.joints - joints, axis=-1).max() < 1.1e-3 and not read.changes, f"clip {i}"
        for columns in (to_features67(joints), to_features263(joints)):
            read = read_motion(npy(tmp_path / "a.npy", columns))
            assert np.abs(read.motion.joints - joints[:-1]).max() < 1e-4, f"clip {i}"
