"""The one on-disk motion library: a folder of flat binary arrays that are memory-mapped, plus two JSON files.

library.json     format, name, skeleton, fps, layout, number of clips
clips.jsonl      one object a clip: id, source, split, action, captions, start, stop (pose rows)
joints.f32       float32 [poses, J, 3], metres, canonical per clip, clips back to back
features.f32     float32 [rows, C], un-normalised; a clip of N poses has N-1 rows
"""

import json
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.representation import COLUMNS, GROUPS, Normaliser, to_features67
from playground.motion.skeleton import HUMAN22

SPLITS = ("train", "val", "test")
FORMAT = 1


@dataclass(frozen=True, eq=False)
class LibraryClip:
    """One clip on its way into a library. joints: float32 [F, 22, 3], canonical, 20 fps."""

    id: str
    source: str
    split: str
    action: str
    captions: tuple[str, ...]
    joints: NDArray[np.float32]


@dataclass(frozen=True)
class Clip:
    """One clip of an opened library; poses start..stop-1 of the joint array."""

    id: str
    source: str
    split: str
    action: str
    captions: tuple[str, ...] = field(repr=False)
    start: int
    stop: int

    @property
    def frames(self) -> int:
        """Number of poses."""
        return self.stop - self.start


def write_library(
    path: Path, clips: Iterable[LibraryClip], name: str, progress: Callable[[int], None] | None = None
) -> int:
    """Write clips one after the other to the folder `path`; returns how many. PlaygroundError if there is none."""
    path.mkdir(parents=True, exist_ok=True)
    count = start = 0
    with (
        open(path / "joints.f32", "wb") as joints,
        open(path / "features.f32", "wb") as features,
        open(path / "clips.jsonl", "w", encoding="utf-8") as index,
    ):
        for clip in clips:
            if clip.split not in SPLITS:
                raise PlaygroundError(f"clip {clip.id} has split {clip.split!r}; accepted: {', '.join(SPLITS)}")
            rows = np.ascontiguousarray(clip.joints, np.float32)
            rows.tofile(joints)
            to_features67(rows).tofile(features)
            entry = Clip(clip.id, clip.source, clip.split, clip.action, clip.captions, start, start + len(rows))
            index.write(json.dumps(asdict(entry), ensure_ascii=False) + "\n")
            start, count = start + len(rows), count + 1
            if progress:
                progress(count)
    if not count:
        raise PlaygroundError(f"no usable clip was found for the library {name}")
    head = {"format": FORMAT, "name": name, "skeleton": HUMAN22.name, "fps": LIMITS.fps, "layout": "human67"}
    (path / "library.json").write_text(json.dumps(head | {"clips": count, "poses": start}, indent=1) + "\n")
    return count


class Library:
    """A folder written by `write_library`, opened read-only; arrays stay on disk until a clip is asked for."""

    def __init__(self, path: Path, name: str, clips: list[Clip]) -> None:
        self.path = path
        self.name = name
        self.clips = clips
        poses = clips[-1].stop
        shape = (poses, HUMAN22.size, 3)
        self._joints = np.memmap(path / "joints.f32", np.float32, mode="r", shape=shape)
        self._features = np.memmap(path / "features.f32", np.float32, mode="r", shape=(poses - len(clips), COLUMNS))

    @classmethod
    def open(cls, path: Path) -> "Library":
        """PlaygroundError if `path` is not a library or its files do not fit together."""
        try:
            head = json.loads((path / "library.json").read_text())
            if head["format"] != FORMAT or head["layout"] != "human67":
                raise PlaygroundError(f"{path} is a library of format {head['format']}, this version reads {FORMAT}")
            clips = []
            with open(path / "clips.jsonl", encoding="utf-8") as index:
                for line in index:
                    entry = json.loads(line)
                    clips.append(Clip(**(entry | {"captions": tuple(entry["captions"])})))
            return cls(path, head["name"], clips)
        except (OSError, KeyError, TypeError, ValueError, IndexError) as error:
            if isinstance(error, PlaygroundError):
                raise
            raise PlaygroundError(f"{path} is not a motion library; make one with the prepare command") from error

    def __len__(self) -> int:
        return len(self.clips)

    def split(self, name: str) -> list[int]:
        """Indices of the clips of a split. PlaygroundError for an unknown name."""
        if name not in SPLITS:
            raise PlaygroundError(f"unknown split {name!r}; accepted: {', '.join(SPLITS)}")
        return [i for i, clip in enumerate(self.clips) if clip.split == name]

    def joints(self, index: int) -> NDArray[np.float32]:
        """Joints [F, 22, 3] of one clip, metres."""
        clip = self.clips[index]
        return np.asarray(self._joints[clip.start : clip.stop])

    def features(self, index: int, heading: str = "body") -> NDArray[np.float32]:
        """Un-normalised feature rows [F-1, 67] of one clip; by another heading rule they are made from the joints."""
        if heading != "body":
            return to_features67(self.joints(index), heading)
        clip = self.clips[index]
        return np.asarray(self._features[clip.start - index : clip.stop - index - 1])

    @cached_property
    def normaliser(self) -> Normaliser:
        """Fitted on the training split (all clips where it is empty), std shared inside the groups of A1."""
        rows = self.split("train") or list(range(len(self)))
        return Normaliser.fit((self.features(i) for i in rows), GROUPS)
