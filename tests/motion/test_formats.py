"""Reading and writing by suffix, and everything that strangers may upload."""

import io
import pickle
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.features263 import to_features263
from playground.motion.formats import read_motion, write_motion
from playground.motion.gltf import parse_glb
from playground.motion.motion import Motion
from playground.motion.representation import canonicalise, to_features67
from tests.motion.skeletons import STYLES, Rig, bvh_text, walk


def sentence(path: Path) -> str:
    """The one sentence that reading raises."""
    with pytest.raises(PlaygroundError) as caught:
        read_motion(path)
    text = str(caught.value)
    assert 10 < len(text) < 260 and "\n" not in text and "Traceback" not in text
    return text


def npz(path: Path, **arrays: Any) -> Path:
    np.savez(path, **arrays)
    return path


def npy(path: Path, array: Any) -> Path:
    np.save(path, array)
    return path


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


BAD_ARRAYS: list[tuple[Any, str]] = [
    (np.zeros((50, 21, 3)), "21 joints"),
    (np.zeros((50, 17, 3)), "17 joints"),
    (np.zeros((50, 500, 3)), "500 joints"),
    (np.zeros((50, 22, 2)), "shape"),
    (np.zeros((50, 262)), "shape"),
    (np.zeros(7), "shape"),
    (np.zeros(()), "shape"),
    (np.zeros((0, 22, 3)), "0 frames"),
    (walk()[:1], "1 frame;"),
    (walk()[:3], "3 frames"),
    (np.zeros((100_000, 22, 3), np.float16), "100,000 frames"),
    (np.where(np.arange(22)[:, None] == 3, np.nan, walk()), "NaN"),
    (np.where(np.arange(22)[:, None] == 3, np.inf, walk()), "NaN"),
    (np.full((20, 22, 3), 1e300), "huge"),
    (np.zeros((50, 22, 3)), "keep their distances"),
    (np.random.default_rng(0).normal(size=(50, 22, 3)), "keep their distances"),
    (np.random.default_rng(0).normal(size=(50, 67)), "not normalised|keep their distances"),
    (np.array(["a", "b", "c", "d"]), "numbers"),
    (np.zeros((20, 22, 3), complex), "numbers"),
    (np.zeros((20, 22, 3), [("x", "f4"), ("y", "f4")]), "numbers"),
]


@pytest.mark.parametrize(("array", "word"), BAD_ARRAYS)
def test_arrays_that_are_no_motion(tmp_path: Path, array: Any, word: str) -> None:
    import re

    assert re.search(word, sentence(npy(tmp_path / "a.npy", array)))
    assert re.search(word, sentence(npz(tmp_path / "a.npz", joints=array)))


def test_pickles_are_never_opened(tmp_path: Path) -> None:
    trap = [1]

    class Trap:
        def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
            return (trap.append, (2,))

    objects = np.array([Trap(), Trap()], dtype=object)
    with io.BytesIO() as out:
        np.save(out, objects, allow_pickle=True)
        (tmp_path / "a.npy").write_bytes(out.getvalue())
    np.savez(tmp_path / "b.npz", joints=objects)
    (tmp_path / "c.npy").write_bytes(pickle.dumps({"joints": walk()}))
    assert "pickle" in sentence(tmp_path / "a.npy") and "pickle" in sentence(tmp_path / "b.npz")
    assert "not a numpy array" in sentence(tmp_path / "c.npy") and trap == [1]


def header(shape: str, descr: str = "'<f8'") -> bytes:
    text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    text += b" " * (-(len(text) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text


@pytest.mark.parametrize(
    ("shape", "descr"),
    [("(1000000000000, 22, 3)", "'<f8'"), ("(12000, 120, 3)", "'<f8'"), ("(50, 22, 3)", "'<f8'"),
     ("(-5, 22, 3)", "'<f8'"),
     ("(50, 22, 3)", "'|O'"), ("(50, 22, 3)", "'<U400000000'"), ("'abc'", "'<f8'"), ("(50, 22, 3)", "'nonsense'"),
     ("(" * 200 + ")" * 200, "'<f8'"), ("(50, 22, 3.0)", "'<f8'"), ("(9" * 50 + ")", "'<f8'")],
)  # fmt: skip
def test_headers_that_lie_cost_nothing(tmp_path: Path, shape: str, descr: str) -> None:
    data = header(shape, descr) + b"\0" * 800
    (tmp_path / "a.npy").write_bytes(data)
    sentence(tmp_path / "a.npy")
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("joints.npy", data)
    sentence(tmp_path / "a.npz")


def test_zip_bombs_are_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("joints.npy", header("(300000000,)", "'|u1'") + b"\0" * 30_000_000)
    assert (tmp_path / "a.npz").stat().st_size < 100_000 and "300 MB" in sentence(tmp_path / "a.npz")
    with zipfile.ZipFile(tmp_path / "b.npz", "w") as archive:
        for n in range(70):
            archive.writestr(f"a{n}.npy", b"")
    assert "more than 64 arrays" in sentence(tmp_path / "b.npz")
    with zipfile.ZipFile(tmp_path / "c.npz", "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("joints.npy", header("(50, 22, 3)") + b"\0" * 26400)
    assert "unusual way" in sentence(tmp_path / "c.npz")


def test_archives_without_a_motion(tmp_path: Path) -> None:
    assert "needs an array 'joints'" in sentence(npz(tmp_path / "a.npz", x=np.zeros(3), y=np.zeros(4)))
    with zipfile.ZipFile(tmp_path / "b.npz", "w") as archive:
        archive.writestr("notes.txt", "hello")
    assert "no arrays" in sentence(tmp_path / "b.npz")
    assert "frame rate" in sentence(npz(tmp_path / "c.npz", joints=walk(), fps=np.array([20.0, 30.0])))
    assert "frame rate" in sentence(npz(tmp_path / "d.npz", joints=walk(), fps="fast"))
    assert "frames a second" in sentence(npz(tmp_path / "e.npz", joints=walk(), fps=float("nan")))
    assert "frames a second" in sentence(npz(tmp_path / "f.npz", joints=walk(), fps=-20.0))


def test_a_slow_clip_that_would_grow_beyond_the_limit(tmp_path: Path) -> None:
    assert "12,000" in sentence(npz(tmp_path / "a.npz", joints=np.concatenate([walk()] * 60), fps=1.0))
    assert "1 pose" in sentence(npz(tmp_path / "b.npz", joints=walk()[:4], fps=1000.0))


def test_missing_empty_and_huge_files(tmp_path: Path) -> None:
    assert "no file" in sentence(tmp_path / "gone.bvh")
    (tmp_path / "folder.bvh").mkdir()
    assert "no file" in sentence(tmp_path / "folder.bvh")
    for suffix in ("bvh", "npy", "npz"):
        (tmp_path / f"a.{suffix}").write_bytes(b"")
        assert "empty" in sentence(tmp_path / f"a.{suffix}")
        with (tmp_path / f"b.{suffix}").open("wb") as file:
            file.truncate(LIMITS.max_upload_bytes + 1)
        assert "20 MB" in sentence(tmp_path / f"b.{suffix}")


@pytest.mark.parametrize("suffix", ["bvh", "npy", "npz"])
@given(data=st.binary(min_size=1, max_size=300))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
def test_rubbish_is_refused(tmp_path: Path, suffix: str, data: bytes) -> None:
    magic = {"npy": b"\x93NUMPY\x01\x00", "npz": b"PK\x03\x04", "bvh": b"HIERARCHY\n"}[suffix]
    for content in (data, magic + data):
        (tmp_path / f"a.{suffix}").write_bytes(content)
        sentence(tmp_path / f"a.{suffix}")


@pytest.mark.parametrize("suffix", ["npy", "npz"])
@given(share=st.floats(0, 1), byte=st.integers(0, 255))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
def test_cut_and_damaged_files_end_in_a_motion_or_a_sentence(
    tmp_path: Path, suffix: str, share: float, byte: int
) -> None:
    path = tmp_path / f"a.{suffix}"
    if suffix == "npy":
        np.save(path, walk()[:5])
    else:
        np.savez_compressed(path, joints=walk()[:5], fps=20.0, caption="x")
    data = path.read_bytes()
    at = min(int(share * len(data)), len(data) - 1)
    path.write_bytes(data[:at])
    with pytest.raises(PlaygroundError):
        read_motion(path)
    path.write_bytes(data[:at] + bytes([byte]) + data[at + 1 :])
    try:
        read = read_motion(path)
    except PlaygroundError as error:
        assert "\n" not in str(error)
    else:
        assert np.isfinite(read.motion.joints).all()


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
