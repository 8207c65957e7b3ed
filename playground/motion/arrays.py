"""npy and npz files from strangers: what a header declares is checked before a byte is allocated; no pickle, ever."""

import io
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.limits import LIMITS

MAX_MEMBERS = 64  # arrays in one npz file
MAX_BYTES = 8 * LIMITS.max_upload_bytes  # one array in memory
MAX_HEADER = 10_000  # characters of an npy header
_DESCR = r"""['"]descr['"]\s*:\s*['"]([^'"]{1,60})['"]"""
_ORDER = r"""['"]fortran_order['"]\s*:\s*(True|False)"""
_SHAPE = r"""['"]shape['"]\s*:\s*\(([\d,\s]{0,200})\)"""
_BAD_ZIP = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    ValueError,
    RuntimeError,
    EOFError,
    OSError,
)


@dataclass(frozen=True)
class Header:
    """What an npy header declares; nothing is read yet."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    fortran: bool

    @property
    def size(self) -> int:
        """Bytes of the array."""
        return prod(self.shape) * self.dtype.itemsize


def _declared(stream: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any], bool]:
    """Shape, type and order that an npy header states; an error for anything else. Nothing is evaluated."""
    version = npy.read_magic(stream)
    length = struct.unpack("<H", stream.read(2))[0] if version == (1, 0) else struct.unpack("<I", stream.read(4))[0]
    if version[0] > 3 or length > MAX_HEADER:
        raise ValueError("no header")
    text = stream.read(length).decode("latin-1")
    found = [re.search(pattern, text) for pattern in (_DESCR, _ORDER, _SHAPE)]
    if len(text) != length or not all(found):
        raise ValueError("no header")
    descr, order, sizes = (match.group(1) for match in found if match)
    shape = tuple(int(word) for word in sizes.replace(",", " ").split())
    return shape, np.dtype(descr), order == "True"


def read_header(stream: IO[bytes], what: str) -> Header:
    """The header at the start of an npy stream. PlaygroundError unless it declares numbers or text of a sane size."""
    try:
        shape, dtype, fortran = _declared(stream)
    except (ValueError, TypeError, SyntaxError, struct.error, zlib.error, zipfile.BadZipFile, EOFError, OSError):
        raise PlaygroundError(f"{what} is not a numpy array of plain numbers, or it is cut off or damaged") from None
    if dtype.hasobject:
        raise PlaygroundError(f"{what} holds Python objects (pickle), which are never read; save plain numbers")
    header = Header(shape, dtype, fortran)
    if dtype.kind not in "fiubU":
        raise PlaygroundError(f"{what} holds values of type {dtype.str[:20]!r}; plain numbers are accepted")
    if header.size > MAX_BYTES:
        raise PlaygroundError(
            f"{what} declares {header.size / 1e6:,.0f} MB of values; at most {MAX_BYTES / 1e6:,.0f} MB are accepted"
        )
    return header


def read_values(stream: IO[bytes], header: Header, what: str) -> NDArray[Any]:
    """The values behind a header. PlaygroundError if the stream ends early."""
    try:
        data = stream.read(header.size) if header.size else b""
    except _BAD_ZIP:
        raise PlaygroundError(f"{what} is damaged and cannot be unpacked") from None
    if len(data) != header.size:
        raise PlaygroundError(f"{what} is cut off: {header.size:,} bytes are declared and {len(data):,} are there")
    if not header.size:
        return np.zeros(header.shape, header.dtype)
    flat = np.frombuffer(data, header.dtype)
    return flat.reshape(header.shape, order="F" if header.fortran else "C")


@dataclass(frozen=True)
class Arrays:
    """The arrays of one file: headers first, values when asked for."""

    headers: dict[str, Header]
    values: Callable[[str], NDArray[Any]]


def _open_npy(data: bytes) -> Arrays:
    header = read_header(io.BytesIO(data), "the npy file")

    def values(name: str) -> NDArray[Any]:
        stream = io.BytesIO(data)
        return read_values(stream, read_header(stream, "the npy file"), "the npy file")

    return Arrays({"": header}, values)


def _check_directory(data: bytes) -> None:
    """PlaygroundError unless the zip directory at the end is small; it is read in one piece later."""
    at = data.rfind(b"PK\x05\x06", max(0, len(data) - 65_557))
    if at < 0 or at + 22 > len(data):
        raise PlaygroundError("the npz file is no zip archive, or it is cut off")
    count, size = struct.unpack("<HI", data[at + 10 : at + 16])
    if b"PK\x06\x07" in data[max(0, at - 20) : at] or count > MAX_MEMBERS or size > MAX_MEMBERS * 1024:
        raise PlaygroundError(f"the npz file holds more than {MAX_MEMBERS} arrays")


def _open_npz(data: bytes) -> Arrays:
    _check_directory(data)
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
        members = {info.filename.removesuffix(".npy"): info for info in archive.infolist() if not info.is_dir()}
    except _BAD_ZIP:
        raise PlaygroundError("the npz file is no zip archive, or it is cut off") from None

    def opened(name: str) -> tuple[IO[bytes], Header]:
        info, what = members[name], f"the array '{name[:40]}' of the npz file"
        if info.flag_bits & 1 or info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise PlaygroundError(f"{what} is encrypted or packed in an unusual way; save it with numpy.savez")
        try:
            stream = archive.open(info)
        except _BAD_ZIP:
            raise PlaygroundError(f"{what} is damaged and cannot be unpacked") from None
        return stream, read_header(stream, what)

    headers: dict[str, Header] = {}
    for name, info in members.items():
        if info.filename.endswith(".npy"):
            stream, headers[name] = opened(name)
            stream.close()
    if not headers:
        raise PlaygroundError("the npz file holds no arrays")

    def values(name: str) -> NDArray[Any]:
        stream, header = opened(name)
        return read_values(stream, header, f"the array '{name[:40]}' of the npz file")

    return Arrays(headers, values)


def open_arrays(path: Path) -> Arrays:
    """The arrays of an npy (named "") or npz file. PlaygroundError unless it is a sound file within limits."""
    data = path.read_bytes()
    return _open_npz(data) if data[:2] == b"PK" or path.suffix.lower() == ".npz" else _open_npy(data)
