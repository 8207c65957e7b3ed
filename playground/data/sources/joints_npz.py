"""Source `joints-npz`: a folder with motions.npz (all clips back to back) and clips.jsonl (one object a clip).

motions.npz: `joints` int16 or float [frames, 22, 3], `scale` metres per unit (1 if absent), `offsets` int64 [clips+1]
(clip i is rows offsets[i]:offsets[i+1]), `fps` 20, `joint_names` in the playground's order if present. clips.jsonl:
`index`, `id`, `source`, `split`, `label`, `captions` (a list of objects with `text`). Any split may be empty.
"""

import json
import zipfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from playground.data.library import SPLITS, LibraryClip
from playground.data.sources.base import Reading, folder, library_clip, read_text
from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.skeleton import HUMAN22


def read_joints_npz(root: Path | None) -> Reading:
    """PlaygroundError where the two files are missing, broken or do not fit together."""
    motions, index = folder(root) / "motions.npz", folder(root) / "clips.jsonl"
    for path in (motions, index):
        if not path.is_file():
            raise PlaygroundError(f"{path} is missing; joints-npz needs a folder with motions.npz and clips.jsonl")
    entries = [_entry(index, number, line) for number, line in enumerate(read_text(index).splitlines(), 1) if line]
    joints, scale, offsets = _arrays(motions)
    clips = len(offsets) - 1
    for entry in entries:
        if not 0 <= entry["index"] < clips:
            raise PlaygroundError(f"{index} names clip number {entry['index']}, but {motions} holds {clips} clips")
    left_out: Counter[str] = Counter()
    return Reading(len(entries), _clips(entries, joints, scale, offsets, left_out), left_out)


def _entry(path: Path, number: int, line: str) -> dict:
    """One checked line of clips.jsonl, reduced to what a library keeps."""
    try:
        entry = json.loads(line)
        captions = tuple(str(caption["text"]) for caption in entry["captions"])
        index = entry["index"]
        checked = {key: str(entry[key]) for key in ("id", "source", "split")}
    except (ValueError, TypeError, KeyError) as error:
        raise PlaygroundError(
            f"line {number} of {path} is not a clip; it needs index, id, source, split and captions with a text each"
        ) from error
    if not isinstance(index, int) or isinstance(index, bool):
        raise PlaygroundError(f"line {number} of {path} has the index {index!r}; a whole number is needed")
    if checked["split"] not in SPLITS:
        raise PlaygroundError(
            f"line {number} of {path} has the split {checked['split']!r}; one of {', '.join(SPLITS)} is accepted"
        )
    return checked | {"index": index, "captions": captions, "label": str(entry.get("label") or " ".join(captions[:1]))}


def _arrays(path: Path) -> tuple[NDArray[np.generic], float, NDArray[np.int64]]:
    """joints, scale and offsets of motions.npz, checked against each other."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            joints, offsets = archive["joints"], archive["offsets"]
            scale = float(archive["scale"]) if "scale" in archive else 1.0
            fps = float(archive["fps"]) if "fps" in archive else float(LIMITS.fps)
            names = [str(name) for name in archive["joint_names"]] if "joint_names" in archive else None
    except (OSError, KeyError, ValueError, TypeError, EOFError, MemoryError, zipfile.BadZipFile) as error:
        raise PlaygroundError(f"{path} is not a motion archive; it needs the arrays joints and offsets") from error
    if joints.ndim != 3 or joints.shape[1:] != (HUMAN22.size, 3) or joints.dtype.kind not in "if":
        raise PlaygroundError(
            f"{path} holds joints {list(joints.shape)} of {joints.dtype}; numbers [F, {HUMAN22.size}, 3] are needed"
        )
    if offsets.ndim != 1 or offsets.dtype.kind not in "iu" or len(offsets) < 2:
        raise PlaygroundError(
            f"{path} holds offsets {list(offsets.shape)} of {offsets.dtype}; int64 [clips+1] is needed"
        )
    offsets = offsets.astype(np.int64)
    if offsets[0] < 0 or offsets[-1] > len(joints) or (np.diff(offsets) < 0).any():
        raise PlaygroundError(f"{path} has offsets that do not rise from 0 to its {len(joints)} frames")
    if not np.isfinite(scale) or scale <= 0:
        raise PlaygroundError(f"{path} has the scale {scale}; metres per unit, above 0, is needed")
    if fps != LIMITS.fps:
        raise PlaygroundError(f"{path} has {fps:g} frames a second; joints-npz needs {LIMITS.fps}")
    if names is not None and tuple(names) != HUMAN22.joints:
        raise PlaygroundError(f"{path} has its joints in another order; needed: {', '.join(HUMAN22.joints)}")
    return joints, scale, offsets


def _clips(
    entries: list[dict], joints: NDArray[np.generic], scale: float, offsets: NDArray[np.int64], left_out: Counter[str]
) -> Iterator[LibraryClip]:
    for entry in entries:
        rows = joints[offsets[entry["index"]] : offsets[entry["index"] + 1]].astype(np.float32) * np.float32(scale)
        facts = {key: entry[key] for key in ("id", "source", "split", "label", "captions")}
        clip = library_clip(rows, left_out, **facts)
        if clip:
            yield clip
