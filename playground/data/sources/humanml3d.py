"""Source `humanml3d`: HumanML3D as its authors publish it (Guo et al., CVPR 2022; systems.md A1), and `cmp`, alike.

    new_joints/ID.npy       float [F, 22, 3], metres, 20 fps; or, where it is missing,
    new_joint_vecs/ID.npy   float [F, 263]
    texts/ID.txt            lines `caption#tokens#start#end`; start and end in seconds, 0 or nan for the whole clip
    train.txt val.txt test.txt   one id a line; ids that begin with M are mirrored copies and stand in the lists

A caption with a start and an end makes an item of its own, as in the authors' loader; captions of one span share it.
Clips and items of fewer than 40 or of 200 and more frames are left out, as there. CMP (Combat Motion Processed: moves
from games, three captions each) and KIT-ML (kit_ml.py) are published in the same folders: `Layout` says what differs.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from playground.data.library import SPLITS, LibraryClip
from playground.data.sources.base import (
    SHORTEST,
    Reading,
    check_ids,
    folder,
    library_clip,
    read_numbers,
    read_text,
    retargeted,
)
from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.features263 import COLUMNS263, from_features263
from playground.motion.skeleton import HUMAN22
from playground.motion.source import Source

Span = tuple[float, float]
Joints = NDArray[np.floating]


@dataclass(frozen=True)
class Layout:
    """What differs between data sets that are published in HumanML3D's folders."""

    source: str  # name of the data set
    read: Callable[[Path], Joints]  # one .npy file -> joints [F, J, 3] at the data set's own rate
    fps: float = LIMITS.fps
    shortest: int = 40  # frames (A1, clip filter)
    too_long: int = 200
    source_of: Callable[[Joints], Source] | None = None  # joints of one item -> what is retargeted; None: 22 joints


def read_humanml3d(root: Path | None) -> Reading:
    """PlaygroundError where the split files, the texts or the motions are missing."""
    return read_layout(root, Layout("HumanML3D", read_joints))


def read_cmp(root: Path | None) -> Reading:
    """PlaygroundError where the split files, the texts or the motions are missing."""
    return read_layout(root, Layout("CMP", read_joints))


def read_layout(root: Path | None, layout: Layout) -> Reading:
    """A data set in HumanML3D's folders. PlaygroundError where split files, texts or motions are missing."""
    root = folder(root)
    lists = [split for split in SPLITS if (root / f"{split}.txt").is_file()]
    motions = [root / name for name in ("new_joints", "new_joint_vecs") if (root / name).is_dir()]
    if not lists or not motions or not (root / "texts").is_dir():
        raise PlaygroundError(
            f"{root} is not {layout.source}: train.txt, val.txt or test.txt, a folder texts and a folder new_joints or "
            "new_joint_vecs are needed"
        )
    ids = [(split, id) for split in lists for id in read_text(root / f"{split}.txt").split()]
    for split in lists:
        check_ids(root / f"{split}.txt", (id for name, id in ids if name == split))
    if not ids:
        raise PlaygroundError(f"the split files of {root} name no clip")
    left_out: Counter[str] = Counter()
    return Reading(len(ids), _clips(root, layout, motions, ids, left_out), left_out)


def _clips(
    root: Path, layout: Layout, motions: list[Path], ids: list[tuple[str, str]], left_out: Counter[str]
) -> Iterator[LibraryClip]:
    for split, id in ids:
        files = [folder / f"{id}.npy" for folder in motions]
        found = next((path for path in files if path.is_file()), None)
        if found is None or not (root / "texts" / f"{id}.txt").is_file():
            left_out["ids without a motion or a text file"] += 1
            continue
        joints = layout.read(found)
        spans = read_captions(root / "texts" / f"{id}.txt", left_out)
        if not spans:
            left_out["ids without a caption"] += 1
        for span, captions in spans.items():
            rows = cut(joints, span, layout.fps)
            if len(rows) >= layout.too_long or len(rows) < layout.shortest:
                over = len(rows) >= layout.too_long
                why = f"{layout.too_long} or more" if over else f"fewer than {layout.shortest}"
                left_out[f"clips of {why} frames"] += 1
                continue
            on22 = rows if layout.source_of is None else retargeted(rows, layout.source_of, left_out, upright=True)
            if on22 is None:
                continue
            clip = library_clip(
                on22,
                left_out,
                id=item_id(id, span),
                source=layout.source,
                split=split,
                label=captions[0],
                captions=captions,
                shortest=SHORTEST,
            )
            if clip:
                yield clip


def cut(joints: Joints, span: Span, fps: float) -> Joints:
    """The frames of a span in seconds; all of them for (0, 0)."""
    return joints if span == (0.0, 0.0) else joints[int(span[0] * fps) : int(span[1] * fps)]


def item_id(id: str, span: Span) -> str:
    """The id of a clip, with its span where that is a part."""
    return id if span == (0.0, 0.0) else f"{id}_{span[0]:g}_{span[1]:g}"


def read_joints(path: Path) -> Joints:
    """Joints [F, 22, 3] of one .npy file that holds them or 263 columns. PlaygroundError for anything else."""
    array = read_numbers(path)
    if array.ndim == 3 and array.shape[1:] == (HUMAN22.size, 3):
        return np.array(array, np.float32)
    if array.ndim == 2 and array.shape[1] == COLUMNS263:
        return from_features263(np.array(array, np.float32))
    raise PlaygroundError(
        f"{path} holds {array.dtype} {list(array.shape)}; float [frames, 22, 3] or [frames, {COLUMNS263}] is needed"
    )


def read_captions(path: Path, left_out: Counter[str]) -> dict[Span, tuple[str, ...]]:
    """The captions of one text file by span in seconds; (0, 0) is the whole clip.

    A line of another form, or with a span that ends before it starts, is counted in `left_out`, as the published
    loaders pass over it. PlaygroundError for a file that is no text.
    """
    spans: dict[Span, tuple[str, ...]] = {}
    for line in read_text(path).splitlines():
        if not line.strip():
            continue
        parts = line.rsplit("#", 3)
        try:
            start, end = (0.0 if math.isnan(float(tag)) else float(tag) for tag in parts[2:])
        except ValueError:
            left_out["lines that are not of the form caption#tokens#start#end"] += 1
            continue
        if not (0.0 <= start < end < math.inf or start == end == 0.0):
            left_out["lines whose span does not end after it starts"] += 1
            continue
        if caption := parts[0].strip():
            spans[start, end] = (*spans.get((start, end), ()), caption)
    return spans
