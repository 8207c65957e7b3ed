"""Source `humanml3d`: HumanML3D as its authors publish it (Guo et al., CVPR 2022; systems.md A1).

    new_joints/ID.npy       float [F, 22, 3], metres, 20 fps; or, where it is missing,
    new_joint_vecs/ID.npy   float [F, 263]
    texts/ID.txt            lines `caption#tokens#start#end`; start and end in seconds, 0 or nan for the whole clip
    train.txt val.txt test.txt   one id a line; ids that begin with M are mirrored copies and stand in the lists

A caption with a start and an end makes an item of its own, as in the authors' loader; captions of one span share it.
Clips and items of fewer than 40 or of 200 and more frames are left out, as there.
"""

import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from playground.data.library import SPLITS, LibraryClip
from playground.data.sources.base import Reading, folder, library_clip, read_text
from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.features263 import COLUMNS263, from_features263
from playground.motion.skeleton import HUMAN22

SHORTEST, TOO_LONG = 40, 200  # frames (A1, clip filter)
Span = tuple[float, float]


def read_humanml3d(root: Path | None) -> Reading:
    """PlaygroundError where the split files, the texts or the motions are missing."""
    root = folder(root)
    lists = [split for split in SPLITS if (root / f"{split}.txt").is_file()]
    motions = [root / name for name in ("new_joints", "new_joint_vecs") if (root / name).is_dir()]
    if not lists or not motions or not (root / "texts").is_dir():
        raise PlaygroundError(
            f"{root} is not HumanML3D: train.txt, val.txt or test.txt, a folder texts and a folder new_joints or "
            "new_joint_vecs are needed"
        )
    ids = [(split, id) for split in lists for id in read_text(root / f"{split}.txt").split()]
    for split, id in ids:
        if "/" in id or "\\" in id:
            raise PlaygroundError(f"{root / split}.txt holds {id!r}; one clip id a line is accepted")
    if not ids:
        raise PlaygroundError(f"the split files of {root} name no clip")
    left_out: Counter[str] = Counter()
    return Reading(len(ids), _clips(root, motions, ids, left_out), left_out)


def _clips(
    root: Path, motions: list[Path], ids: list[tuple[str, str]], left_out: Counter[str]
) -> Iterator[LibraryClip]:
    for split, id in ids:
        files = [folder / f"{id}.npy" for folder in motions]
        found = next((path for path in files if path.is_file()), None)
        if found is None or not (root / "texts" / f"{id}.txt").is_file():
            left_out["ids without a motion or a text file"] += 1
            continue
        joints = read_joints(found)
        spans = read_captions(root / "texts" / f"{id}.txt")
        if not spans:
            left_out["ids without a caption"] += 1
        for (start, end), captions in spans.items():
            whole = (start, end) == (0.0, 0.0)
            rows = joints if whole else joints[int(start * LIMITS.fps) : int(end * LIMITS.fps)]
            if len(rows) >= TOO_LONG:
                left_out[f"clips of {TOO_LONG} or more frames"] += 1
                continue
            clip = library_clip(
                rows,
                left_out,
                id=id if whole else f"{id}_{start:g}_{end:g}",
                source="HumanML3D",
                split=split,
                label=captions[0],
                captions=captions,
                shortest=SHORTEST,
            )
            if clip:
                yield clip


def read_joints(path: Path) -> NDArray[np.floating]:
    """Joints [F, 22, 3] of one .npy file that holds them or 263 columns. PlaygroundError for anything else."""
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise PlaygroundError(f"{path} is not an array file that numpy can read without pickle") from error
    if array.dtype.kind == "f" and array.ndim == 3 and array.shape[1:] == (HUMAN22.size, 3):
        return np.array(array, np.float32)
    if array.dtype.kind == "f" and array.ndim == 2 and array.shape[1] == COLUMNS263 and len(array):
        return from_features263(np.array(array, np.float32))
    raise PlaygroundError(
        f"{path} holds {array.dtype} {list(array.shape)}; float [frames, 22, 3] or [frames, {COLUMNS263}] is needed"
    )


def read_captions(path: Path) -> dict[Span, tuple[str, ...]]:
    """The captions of one text file by span in seconds; (0, 0) is the whole clip. PlaygroundError for a broken line."""
    spans: dict[Span, tuple[str, ...]] = {}
    for number, line in enumerate(read_text(path).splitlines(), 1):
        if not line.strip():
            continue
        parts = line.rsplit("#", 3)
        try:
            start, end = (0.0 if math.isnan(float(tag)) else float(tag) for tag in parts[2:])
        except ValueError as error:
            raise PlaygroundError(f"line {number} of {path} is not of the form caption#tokens#start#end") from error
        if not (0.0 <= start < end < math.inf or start == end == 0.0):
            raise PlaygroundError(
                f"line {number} of {path} has the span {start:g} to {end:g} s; it must end after it starts"
            )
        if caption := parts[0].strip():
            spans[start, end] = (*spans.get((start, end), ()), caption)
    return spans
