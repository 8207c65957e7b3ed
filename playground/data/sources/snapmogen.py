"""Source `snapmogen`: SnapMoGen as its authors publish it (arXiv 2507.09122; systems.md E1, E2).

    renamed_feats/SEQUENCE.npy          float [F, 296] (or its first 148 columns), 30 fps, 24 joints
    renamed_bvhs/SEQUENCE.bvh           the same as BVH; one of them is needed where there are 148 columns only
    all_caption_clean.json              clip id -> {"manual": [...], "gpt": [...]}
    data_split_info/SPLIT_ids.txt       clip ids SEQUENCE#start#end, rows of the sequence; SPLIT is train, val or test

The columns are those of motion/snapmogen.py. A clip becomes 22 joints in metres at 20 fps: the rig's offsets follow
from positions and rotations, and the motion is retargeted (motion/retarget.py), scaled by leg length. Mirrored
sequences (m_...) are in the lists.
"""

import json
from collections import Counter
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from playground.data.library import SPLITS, LibraryClip
from playground.data.sources.base import Reading, check_ids, folder, library_clip, read_numbers, read_text, retargeted
from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.bvh import read_bvh
from playground.motion.rotation import Array
from playground.motion.snapmogen import COLUMNS, JOINTS, PARENTS, source_of

NEEDED = ("renamed_feats", "data_split_info", "all_caption_clean.json")


def read_snapmogen(root: Path | None) -> Reading:
    """PlaygroundError where features, captions or split files are missing or broken."""
    root = folder(root)
    for name in NEEDED:
        if not (root / name).exists():
            raise PlaygroundError(f"{root} is not SnapMoGen: {', '.join(NEEDED)} are needed, and {name} is missing")
    info = root / "data_split_info"
    lists = [split for split in SPLITS if (info / f"{split}_ids.txt").is_file()]
    ids = [(split, id) for split in lists for id in read_text(info / f"{split}_ids.txt").split()]
    if not ids:
        raise PlaygroundError(f"{info} names no clip; train_ids.txt, val_ids.txt or test_ids.txt is needed")
    cuts = [(split, id, *_cut(id, info)) for split, id in ids]
    captions = _captions(root / "all_caption_clean.json")
    left_out: Counter[str] = Counter()
    return Reading(len(ids), _clips(root, cuts, captions, left_out), left_out)


def _cut(id: str, info: Path) -> tuple[str, int, int]:
    """`sequence#start#end` -> its parts."""
    check_ids(info, [id])
    sequence, *numbers = id.split("#")
    if not sequence or len(numbers) != 2 or not all(part.isdecimal() and len(part) < 9 for part in numbers):
        raise PlaygroundError(f"{info} holds the clip {id[:80]!r}; SEQUENCE#start#end is needed")
    return sequence, int(numbers[0]), int(numbers[1])


def _captions(path: Path) -> dict[str, tuple[str, ...]]:
    try:
        entries = json.loads(read_text(path))
        found = {id: [*entry.get("manual", []), *entry.get("gpt", [])] for id, entry in entries.items()}
    except (ValueError, AttributeError, TypeError) as error:
        raise PlaygroundError(f"{path} is not a table of captions; clip id -> manual and gpt is needed") from error
    return {id: tuple(line.strip() for line in lines if str(line).strip()) for id, lines in found.items()}


def _clips(
    root: Path,
    cuts: list[tuple[str, str, str, int, int]],
    captions: dict[str, tuple[str, ...]],
    left_out: Counter[str],
) -> Iterator[LibraryClip]:
    rig: Array | None = None
    for split, id, sequence, start, stop in cuts:
        path = root / "renamed_feats" / f"{sequence}.npy"
        if not path.is_file() or not captions.get(id):
            left_out["ids without a motion or a caption"] += 1
            continue
        array = read_numbers(path)
        if array.ndim != 2 or array.shape[1] not in COLUMNS:
            raise PlaygroundError(f"{path} holds {list(array.shape)}; [frames, {COLUMNS[1]}] or [frames, {COLUMNS[0]}]")
        rows = np.array(array[start:stop], np.float64)
        if len(rows) < LIMITS.min_source_frames:
            left_out["clips that end before they begin or with their sequence"] += 1
            continue
        if rows.shape[1] == COLUMNS[0] and rig is None:
            rig = _rig(root / "renamed_bvhs")
        joints = retargeted(rows, partial(source_of, rig=rig), left_out, upright=True)
        if joints is None:
            continue
        clip = library_clip(
            joints,
            left_out,
            id=id,
            source="SnapMoGen",
            split=split,
            label=captions[id][0],
            captions=captions[id],
        )
        if clip:
            yield clip


def _rig(bvhs: Path) -> Array:
    """Offsets [24, 3] of the rig, from any of the published BVH files."""
    path = next(iter(sorted(bvhs.glob("*.bvh"))), None) if bvhs.is_dir() else None
    if path is None:
        raise PlaygroundError(f"features of {COLUMNS[0]} columns need the rig; {bvhs} with a .bvh file is missing")
    source = read_bvh(path.read_bytes())
    if source.parents != PARENTS:
        raise PlaygroundError(f"{path} has another skeleton than SnapMoGen's {JOINTS} joints")
    return source.offsets
