"""The example library of assets/: a short list of motions with titles and captions of our own. numpy only.

On disk an example library is a folder with two files:

    index.json     {"format": 1, "note": text, "examples": [entry, ...]}
    examples.npz   joints float32 [poses of all examples, 22, 3], ids int16 [tokens of all examples]

    entry = {"id", "title", "caption", "action", "kind", "origin", "frames",
             "joints": [start, stop] | null,                                 # rows of `joints`
             "tokens": {"system", "checkpoint", "sizes", "codes", "start"} | null}   # `sizes` ids a level from `start`

`kind` is one of KINDS. A synthetic motion has joints; a generated one has joints and tokens; a decoded clip has tokens
alone, and the motion is decoded from them on the fly, so no recorded motion is stored.
"""

import json
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.motion import Motion
from playground.motion.skeleton import HUMAN22

FORMAT = 1
KINDS = ("synthetic", "generated", "decoded clip")
MAX_EXAMPLES = 1_000


@dataclass(frozen=True, eq=False)
class StoredTokens:
    """The token sequence of one motion. ids: one int64 [s_n] a level, coarse to fine; codes: codebook size a level."""

    system: str
    checkpoint: str  # the checkpoint the ids belong to; under another one they mean nothing
    ids: tuple[NDArray[np.int64], ...]
    codes: tuple[int, ...]

    def __post_init__(self) -> None:
        if not self.ids or len(self.ids) != len(self.codes):
            raise PlaygroundError(
                f"a token sequence needs a codebook size a level, got {len(self.codes)} for {len(self.ids)} levels"
            )
        for level, (ids, codes) in enumerate(zip(self.ids, self.codes, strict=True), start=1):
            bad = ids.ndim != 1 or not ids.size or not 1 <= codes <= 2**15
            if bad or ids.min() < 0 or ids.max() >= codes:
                raise PlaygroundError(f"level {level} of a token sequence needs ids from 0 to {codes - 1} in one row")


@dataclass(frozen=True, eq=False)
class StoredExample:
    """One entry of the example library. joints: float32 [frames, 22, 3] metres, or None; tokens or None."""

    id: str
    title: str
    caption: str
    action: str
    kind: str  # one of KINDS
    origin: str  # one sentence: where this motion comes from
    frames: int  # poses at 20 fps
    joints: NDArray[np.float32] | None = None
    tokens: StoredTokens | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise PlaygroundError(
                f"example {self.id!r} has the kind {self.kind!r}; one of {', '.join(KINDS)} is accepted"
            )
        if self.joints is None and self.tokens is None:
            raise PlaygroundError(f"example {self.id!r} holds neither joints nor tokens; it needs one of them")
        if self.kind == "decoded clip" and (self.joints is not None or self.tokens is None):
            raise PlaygroundError(f"example {self.id!r} is a decoded clip; it holds tokens and no joints")
        if self.joints is not None and self.joints.shape != (self.frames, HUMAN22.size, 3):
            wanted = [self.frames, HUMAN22.size, 3]
            raise PlaygroundError(f"example {self.id!r} needs joints {wanted}, got {list(self.joints.shape)}")
        if not 1 <= self.frames <= LIMITS.max_frames:
            raise PlaygroundError(
                f"example {self.id!r} has {self.frames} frames; 1 to {LIMITS.max_frames} are accepted"
            )

    def motion(self) -> Motion:
        """The stored joints as a Motion; PlaygroundError for a decoded clip, which a tokenizer has to decode."""
        if self.joints is None:
            raise PlaygroundError(f"example {self.id!r} is stored as tokens; decode them to get a motion")
        return Motion(self.joints, caption=self.caption, name=self.title)


class ExampleStore:
    """The examples of one folder, in the order of its index."""

    def __init__(self, examples: Iterable[StoredExample], note: str = "") -> None:
        self.examples = tuple(examples)
        self.note = note
        self._by_id = {example.id: example for example in self.examples}
        if len(self._by_id) != len(self.examples):
            raise PlaygroundError("an example library needs a different id for every example")

    @classmethod
    def open(cls, path: str | Path) -> "ExampleStore":
        """Read the folder `path`; PlaygroundError if it is not an example library of this format."""
        folder = Path(path)
        try:
            index = json.loads((folder / "index.json").read_text(encoding="utf-8"))
            with np.load(folder / "examples.npz", allow_pickle=False) as arrays:
                joints, ids = arrays["joints"], arrays["ids"]
            if index["format"] != FORMAT:
                raise PlaygroundError(f"the example library has format {index['format']}; this version reads {FORMAT}")
            if len(index["examples"]) > MAX_EXAMPLES:
                raise PlaygroundError(f"the example library has more than {MAX_EXAMPLES} entries")
            return cls([_entry(entry, joints, ids) for entry in index["examples"]], note=str(index.get("note", "")))
        except (OSError, ValueError, KeyError, TypeError, AttributeError, EOFError, zipfile.BadZipFile) as error:
            if isinstance(error, PlaygroundError):
                raise
            raise PlaygroundError(
                f"{folder.name} is no readable example library; it needs index.json and examples.npz of format {FORMAT}"
            ) from error

    def __len__(self) -> int:
        return len(self.examples)

    def __iter__(self) -> Iterator[StoredExample]:
        return iter(self.examples)

    def __getitem__(self, id: str) -> StoredExample:
        """The example of that id; PlaygroundError if there is none."""
        if id not in self._by_id:
            raise PlaygroundError(f"there is no example {id!r}; the library holds {', '.join(self._by_id) or 'none'}")
        return self._by_id[id]


def _entry(entry: dict[str, Any], joints: NDArray[np.float32], ids: NDArray[np.int16]) -> StoredExample:
    """One entry of the index with its arrays cut out; ValueError, KeyError or TypeError if they do not fit."""
    rows, tokens = entry["joints"], entry["tokens"]
    cut = None
    if rows is not None:
        if not 0 <= rows[0] < rows[1] <= len(joints):
            raise ValueError("joint rows outside the file")
        cut = np.asarray(joints[rows[0] : rows[1]], np.float32)
    stored = None
    if tokens is not None:
        edges = np.cumsum([tokens["start"], *tokens["sizes"]])
        if min(tokens["sizes"]) < 1 or edges[0] < 0 or edges[-1] > len(ids):
            raise ValueError("token ids outside the file")
        levels = tuple(ids[start:stop].astype(np.int64) for start, stop in pairwise(edges))
        stored = StoredTokens(
            str(tokens["system"]), str(tokens["checkpoint"]), levels, tuple(map(int, tokens["codes"]))
        )
    text = {key: str(entry[key]) for key in ("id", "title", "caption", "action", "kind", "origin")}
    return StoredExample(**text, frames=int(entry["frames"]), joints=cut, tokens=stored)


def write_examples(path: str | Path, examples: Iterable[StoredExample], note: str = "") -> None:
    """Write an example library into the folder `path` (made if absent), replacing the one that is there."""
    store = ExampleStore(examples, note)
    entries, joints, ids = [], [np.zeros((0, HUMAN22.size, 3), np.float32)], [np.zeros(0, np.int16)]
    for example in store:
        entry: dict[str, Any] = {key: getattr(example, key) for key in ("id", "title", "caption", "action", "kind")}
        entry |= {"origin": example.origin, "frames": example.frames, "joints": None, "tokens": None}
        if example.joints is not None:
            start = sum(map(len, joints))
            joints.append(np.asarray(example.joints, np.float32))
            entry["joints"] = [start, start + len(example.joints)]
        if example.tokens is not None:
            tokens = example.tokens
            entry["tokens"] = {"system": tokens.system, "checkpoint": tokens.checkpoint}
            entry["tokens"] |= {"sizes": [len(level) for level in tokens.ids], "codes": list(tokens.codes)}
            entry["tokens"] |= {"start": sum(map(len, ids))}
            ids.extend(level.astype(np.int16) for level in tokens.ids)
        entries.append(entry)
    folder = Path(path)
    folder.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(folder / "examples.npz", joints=np.concatenate(joints), ids=np.concatenate(ids))
    text = json.dumps({"format": FORMAT, "note": store.note, "examples": entries}, indent=1, ensure_ascii=False)
    (folder / "index.json").write_text(text + "\n", encoding="utf-8")
