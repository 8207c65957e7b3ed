"""Source `bvh`: a folder of .bvh files (also in folders below it), with captions in captions.csv where it is there.

captions.csv has a header and the columns `file` (path below the folder), `caption`, and, if wanted, `start` and `end`
(seconds), `split` and `action`. Rows of one file and span are captions of one clip. A file that no row names, and every
file where there is no table, is read whole and captioned with the words of its file name. On demand, what is longer
than 12 s is cut at still moments (data/segment.py); the parts keep its captions.
"""

import csv
import io
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from playground.data.actions import words_of
from playground.data.library import SPLITS, LibraryClip
from playground.data.segment import LONGEST, segment
from playground.data.sources.base import Reading, folder, library_clip, read_text, split_of
from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.formats import read_motion

TABLE = "captions.csv"
COLUMNS = ("file", "caption", "start", "end", "split", "action")


@dataclass(frozen=True)
class Cut:
    """One clip wanted from a file: seconds start..end (None: to the end of the file)."""

    start: float
    end: float | None
    split: str
    action: str
    captions: tuple[str, ...]


def read_bvh_folder(root: Path | None, cut_long: bool = False) -> Reading:
    """PlaygroundError where there is no .bvh file or the table of captions does not fit the folder.

    cut_long: takes longer than 12 s become several clips, their spans in their ids.
    """
    root = folder(root)
    files = sorted(path for path in root.rglob("*") if path.suffix.lower() == ".bvh" and path.is_file())
    if not files:
        raise PlaygroundError(f"{root} holds no .bvh file")
    takes = {path.relative_to(root).as_posix(): path for path in files}
    cuts = _read_table(root / TABLE, set(takes)) if (root / TABLE).is_file() else {}
    plan = [(take, cut) for take in takes for cut in cuts.get(take) or [_whole(take)]]
    left_out: Counter[str] = Counter()
    return Reading(len(plan), _clips(takes, plan, left_out, cut_long), left_out)


def _whole(take: str) -> Cut:
    words = words_of(Path(take).stem)
    return Cut(0.0, None, split_of(take), words, (words,) if words else ())


def _clips(
    takes: dict[str, Path], plan: list[tuple[str, Cut]], left_out: Counter[str], cut_long: bool
) -> Iterator[LibraryClip]:
    joints, current = None, None
    for take, cut in plan:
        if joints is None or take != current:
            current = take
            try:
                joints = read_motion(takes[take]).motion.joints
            except PlaygroundError as error:
                raise PlaygroundError(f"{take}: {error}") from error
        start, stop = int(cut.start * LIMITS.fps), None if cut.end is None else int(cut.end * LIMITS.fps)
        if max(start, (stop or 0) - 1) > len(joints):
            wanted = f"from {cut.start:g} s" if stop is None else f"up to {cut.end:g} s"
            raise PlaygroundError(f"{TABLE} wants {take} {wanted}, but it ends at {len(joints) / LIMITS.fps:g} s")
        for name, part in _parts(take, cut, joints[start:stop], cut_long):
            clip = library_clip(
                part,
                left_out,
                id=name,
                source="BVH",
                split=cut.split,
                label=cut.action or " ".join(cut.captions[:1]),
                captions=cut.captions,
            )
            if clip:
                yield clip


def _parts(
    take: str, cut: Cut, joints: NDArray[np.float32], cut_long: bool
) -> Iterator[tuple[str, NDArray[np.float32]]]:
    """The clips that one wanted span gives, with their ids: itself, or its parts where it is cut."""
    name = Path(take).with_suffix("").as_posix()
    if cut_long and len(joints) > LONGEST * LIMITS.fps:
        for start, stop in segment(joints, LIMITS.fps).spans:
            yield f"{name}_{cut.start + start / LIMITS.fps:g}_{cut.start + stop / LIMITS.fps:g}", joints[start:stop]
    else:
        yield name if cut.end is None and not cut.start else f"{name}_{cut.start:g}_{cut.end or 'end'}", joints


def _read_table(path: Path, takes: set[str]) -> dict[str, list[Cut]]:
    """The cuts of each file that the table names, rows of one file and span joined."""
    try:
        header, *lines = csv.reader(io.StringIO(read_text(path), newline=""), strict=True)
    except (csv.Error, ValueError) as error:
        raise PlaygroundError(f"{path} is not a CSV table with a header") from error
    columns = [name.strip() for name in header]
    if not {"file", "caption"} <= set(columns) or not set(columns) <= set(COLUMNS):
        raise PlaygroundError(f"{path} needs the columns file and caption; start, end, split and action may be there")
    joined: dict[str, dict[tuple[float, float | None], Cut]] = {}
    for number, line in enumerate(lines, 2):
        if not line:
            continue
        where = f"row {number} of {path}"
        if len(line) > len(columns):
            raise PlaygroundError(f"{where} has more fields than columns; put captions with commas in quotes")
        row = dict.fromkeys(COLUMNS, "") | {name: field.strip() for name, field in zip(columns, line, strict=False)}
        take = row["file"].replace("\\", "/").removeprefix("./")
        if take not in takes:
            raise PlaygroundError(f"{where} names the file {take!r}, which is not in the folder")
        cut = _cut(row, where, take)
        spans = joined.setdefault(take, {})
        before = spans.get((cut.start, cut.end))
        if before:
            cut = Cut(cut.start, cut.end, before.split, before.action or cut.action, before.captions + cut.captions)
        spans[cut.start, cut.end] = cut
    return {take: list(spans.values()) for take, spans in joined.items()}


def _cut(row: dict[str, str], where: str, take: str) -> Cut:
    try:
        start = float(row["start"] or 0.0)
        end = float(row["end"]) if row["end"] else None
    except ValueError as error:
        raise PlaygroundError(f"{where} has a start or end that is not a number of seconds") from error
    if not 0.0 <= start < (math.inf if end is None else end) or end == math.inf:
        raise PlaygroundError(f"{where} has the span {start:g} to {row['end']} s; it must end after it starts")
    if row["split"] and row["split"] not in SPLITS:
        raise PlaygroundError(f"{where} has the split {row['split']!r}; one of {', '.join(SPLITS)} is accepted")
    captions = (row["caption"],) if row["caption"] else _whole(take).captions
    return Cut(start, end, row["split"] or split_of(take), row["action"], captions)
