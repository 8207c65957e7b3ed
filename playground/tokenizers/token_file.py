"""The token file: the tokens of one motion as JSON that a person can read and another program can write. No torch.

{"format": 1, "system": "lgtok", "checkpoint": "...", "caption": "...", "frames": 196, "fps": 20,
 "levels": [{"size": 3, "codes": 128, "ids": [5, 17, 101]}, ...]}
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.limits import LIMITS

FORMAT = 1
KEYS = ("format", "system", "checkpoint", "caption", "frames", "fps", "levels")


@dataclass(frozen=True, eq=False)
class LevelTokens:
    """The tokens of one level of one motion. ids: int64 [size], each below `codes`."""

    size: int
    codes: int
    ids: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class TokenFile:
    """What a token file holds. frames: feature rows of the motion; levels: coarse to fine."""

    system: str
    checkpoint: str
    caption: str
    frames: int
    levels: tuple[LevelTokens, ...]
    fps: float = float(LIMITS.fps)

    def to_json(self) -> str:
        """The text of the file."""
        levels = [{"size": level.size, "codes": level.codes, "ids": level.ids.tolist()} for level in self.levels]
        head = {"format": FORMAT, "system": self.system, "checkpoint": self.checkpoint, "caption": self.caption}
        return json.dumps(head | {"frames": self.frames, "fps": self.fps, "levels": levels}, ensure_ascii=False) + "\n"

    @classmethod
    def from_json(cls, text: str, name: str = "the token file") -> "TokenFile":
        """Inverse of `to_json`; `name` is what messages call it. PlaygroundError if the text is anything else."""
        try:
            value = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise PlaygroundError(f"{name} is not JSON text") from error
        if not isinstance(value, dict) or not set(KEYS) <= set(value):
            raise PlaygroundError(f"{name} is not a token file; it needs an object with {', '.join(KEYS)}")
        if value["format"] != FORMAT or isinstance(value["format"], bool):
            raise PlaygroundError(f"{name} has the format {_short(value['format'])}; {FORMAT} is accepted")
        for key in ("system", "checkpoint", "caption"):
            if not isinstance(value[key], str) or len(value[key]) > LIMITS.max_prompt_chars:
                raise PlaygroundError(f"{key} of {name} must be a text of at most {LIMITS.max_prompt_chars} characters")
        frames, fps = value["frames"], value["fps"]
        if not _whole(frames) or not 1 <= frames <= LIMITS.max_frames:
            raise PlaygroundError(f"frames of {name} must be a whole number from 1 to {LIMITS.max_frames}")
        if isinstance(fps, bool) or fps != LIMITS.fps:
            raise PlaygroundError(f"fps of {name} must be {LIMITS.fps}")
        levels = value["levels"]
        if not isinstance(levels, list) or not levels:
            raise PlaygroundError(
                f"levels of {name} must be a list with an object of size, codes and ids for each level"
            )
        parsed = tuple(_level(level, number, name) for number, level in enumerate(levels, 1))
        return cls(value["system"], value["checkpoint"], value["caption"], frames, parsed, float(fps))

    @classmethod
    def read(cls, path: Path) -> "TokenFile":
        """PlaygroundError if the file is missing, too large, or no token file."""
        try:
            if path.stat().st_size > LIMITS.max_json_bytes:
                raise PlaygroundError(
                    f"{path} is larger than {LIMITS.max_json_bytes // 2**20} MB, the limit of a token file"
                )
            text = path.read_text(encoding="utf-8")
        except OSError as error:
            raise PlaygroundError(f"{path} cannot be read: {error.strerror or 'unreadable'}") from error
        except UnicodeDecodeError as error:
            raise PlaygroundError(f"{path} is not JSON text") from error
        return cls.from_json(text, str(path))


def _level(level: Any, number: int, name: str) -> LevelTokens:
    where = f"level {number} of {name}"
    if not isinstance(level, dict) or not {"size", "codes", "ids"} <= set(level):
        raise PlaygroundError(f"{where} needs an object with size, codes and ids")
    size, codes, ids = level["size"], level["codes"], level["ids"]
    if not _whole(codes) or not 1 <= codes <= 2**31:
        raise PlaygroundError(f"codes of {where} must be a whole number from 1")
    if not isinstance(ids, list) or size != len(ids) or not ids:
        raise PlaygroundError(f"{where} must have as many ids as its size says, at least one")
    if not all(_whole(id) and 0 <= id < codes for id in ids):
        raise PlaygroundError(f"ids of {where} must be whole numbers from 0 to {codes - 1}")
    return LevelTokens(len(ids), codes, np.asarray(ids, np.int64))


def _whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:40] + "..."
