"""Published motion data on disk -> one motion library: the readers by name, and `prepare`, which runs one of them."""

import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from playground.data.library import LibraryClip, write_library
from playground.data.sources.base import Reading, SourceEntry
from playground.data.sources.bvh import read_bvh_folder
from playground.data.sources.deepmimic import read_deepmimic
from playground.data.sources.humanml3d import read_cmp, read_humanml3d
from playground.data.sources.joints_npz import read_joints_npz
from playground.data.sources.kit_ml import read_kit_ml
from playground.data.sources.motionx import read_motion_x
from playground.data.sources.snapmogen import read_snapmogen
from playground.errors import PlaygroundError

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,59}")  # of a library

SOURCES: dict[str, SourceEntry] = {
    "joints-npz": SourceEntry(read_joints_npz, True, "a folder with motions.npz and clips.jsonl"),
    "humanml3d": SourceEntry(read_humanml3d, True, "HumanML3D as its authors publish it"),
    "kit-ml": SourceEntry(read_kit_ml, True, "KIT-ML in HumanML3D's folders, 21 joints at 12.5 frames a second"),
    "motion-x": SourceEntry(read_motion_x, True, "Motion-X as published, body only"),
    "snapmogen": SourceEntry(read_snapmogen, True, "SnapMoGen as its authors publish it, unpacked"),
    "cmp": SourceEntry(read_cmp, True, "CMP (Combat Motion Processed) as its authors publish it"),
    "bvh": SourceEntry(
        read_bvh_folder,
        True,
        "a folder of .bvh files, with captions.csv if you have captions",
        partial(read_bvh_folder, cut_long=True),
    ),
    "deepmimic": SourceEntry(read_deepmimic, False, "the motions that an installed pybullet package carries"),
}


@dataclass(frozen=True)
class Prepared:
    """What `prepare` wrote: number of clips, and one sentence for everything that was left out."""

    clips: int
    notes: tuple[str, ...]


def open_source(source: str, root: Path | None, cut: bool = False) -> Reading:
    """Check a source and its folder; the clips are read while `Reading.clips` is consumed.

    cut: long takes are cut at still moments (data/segment.py). PlaygroundError where the source has none, and for an
    unknown source, a folder that is missing, not expected or not what the source needs.
    """
    if source not in SOURCES:
        raise PlaygroundError(f"unknown source {source!r}; one of {', '.join(SOURCES)} is accepted")
    entry = SOURCES[source]
    if entry.needs_root and root is None:
        raise PlaygroundError(f"the source {source} needs a folder: {entry.what}")
    if not entry.needs_root and root is not None:
        raise PlaygroundError(f"the source {source} takes no folder: it reads {entry.what}")
    if root is not None and not root.is_dir():
        raise PlaygroundError(f"{root} is not a folder; the source {source} needs {entry.what}")
    if not cut:
        return entry.read(root)
    if entry.read_cut is None or root is None:
        takes = ", ".join(name for name, other in SOURCES.items() if other.read_cut)
        raise PlaygroundError(f"the clips of {source} are cut already; long takes of {takes} can be cut")
    return entry.read_cut(root)


def prepare(
    source: str,
    root: Path | None,
    out: Path,
    progress: Callable[[int, int], None] | None = None,
    cut: bool = False,
    name: str = "",
) -> Prepared:
    """Read a source and write it as a library to the folder `out`, which appears only when all of it is written.

    progress: called with (clips done, clips expected); name: what results call the data, the source where it is "".
    PlaygroundError as in `open_source`, for a broken file, for a clip id that comes twice, for a name of other
    characters, and where `out` is something else than a library or an empty folder.
    """
    if name and not NAME.fullmatch(name):
        raise PlaygroundError(f"the name {name[:60]!r} is not accepted; up to 60 letters, digits, - _ and . are")
    if out.exists() and not (out.is_dir() and ((out / "library.json").is_file() or not any(out.iterdir()))):
        raise PlaygroundError(f"{out} exists and is not a motion library; name a new or empty folder")
    reading = open_source(source, root, cut)
    report = (lambda done: progress(min(done, reading.total), reading.total)) if progress else None
    partial = out.with_name(out.name + ".partial")
    shutil.rmtree(partial, ignore_errors=True)
    try:
        count = write_library(partial, _unique(reading.clips), name or source, report)
        shutil.rmtree(out, ignore_errors=True)
        partial.replace(out)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return Prepared(count, tuple(f"{number} left out: {why}" for why, number in sorted(reading.left_out.items())))


def _unique(clips: Iterator[LibraryClip]) -> Iterator[LibraryClip]:
    seen: set[str] = set()
    for clip in clips:
        if clip.id in seen:
            raise PlaygroundError(f"the clip id {clip.id!r} comes twice; every clip needs its own")
        seen.add(clip.id)
        yield clip
