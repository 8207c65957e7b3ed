"""Everything that strangers may upload as an array: one sentence each, no pickle, nothing allocated on trust."""

import io
import pickle
import re
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
from playground.motion.formats import read_motion
from tests.motion.skeletons import walk
from tests.motion.uploads import npy, npz, sentence

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
