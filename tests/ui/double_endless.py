"""The endless motion of the engine's stand-in: a figure that walks on, in another way for each instruction."""

import zlib
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from playground.engine.checks import check_sampling
from playground.engine.endless import Seams, Switch, Trail
from playground.errors import PlaygroundError
from playground.motion.motion import Motion
from playground.motion.representation import to_features67
from playground.motion.synthetic import corpus
from playground.text.prompts import normalise
from playground.tokenizers.token_file import LevelTokens

CODES = (128, 128, 192)  # of each level
UNIT, EARLY = 4, 16  # frames of a step, frames drawn ahead


@lru_cache(maxsize=1)
def _ways() -> list[NDArray[np.float32]]:
    """Feature rows of six motions."""
    return [to_features67(one.motion.joints) for one in corpus(6, seed=4)]


class Session:
    """What the room uses of an endless session; no model."""

    def __init__(self, prompt: str, seed: int, pause: Callable[[], None]) -> None:
        self.prompt, self.seed, self.pause = normalise(prompt), seed, pause
        self.frames = self.drawn = 0
        self.switches: list[Switch] = []
        self._trail = Trail()
        self._ids: dict[int, NDArray[np.int64]] = {}

    def say(self, prompt: str) -> int:
        self.prompt = normalise(prompt)
        self.switches = [one for one in self.switches if one.frame != self.drawn]
        self.switches.append(Switch(self.drawn, self.prompt, None))
        return self.drawn

    def advance(self, seconds: float) -> Motion:
        self.pause()
        count = int(20 * seconds)
        start, self.frames = self.frames, self.frames + count
        while self.drawn < self.frames + EARLY:
            mark = zlib.crc32(f"{self.prompt} {self.seed} {self.drawn}".encode())
            self._ids[self.drawn // UNIT] = np.random.default_rng(mark).integers(0, CODES)
            self.drawn += UNIT
        rows = _ways()[zlib.crc32(self.prompt.encode()) % 6]
        at = (start + np.arange(count)) % len(rows)
        self.switches = [Switch(one.frame, one.prompt, 210.0 if one.frame < start else None) for one in self.switches]
        return Motion(self._trail.push(rows[at]), caption=self.prompt)

    def levels(self, start: int, stop: int) -> tuple[LevelTokens, ...]:
        ids = np.stack([self._ids[step] for step in range(start // UNIT, -(-stop // UNIT))], axis=1)
        return tuple(LevelTokens(len(row), size, row) for row, size in zip(ids, CODES, strict=True))

    def seams(self) -> Seams:
        near = 210.0 if self.switches else None
        return Seams(
            "mogo", "fake", self.seed, self.frames, tuple(self.switches), len(self.switches), near, 180.0
        )  # fmt: skip


class Endless:
    """The way in. `untrained` stands for a copy without the system."""

    calls: list[str]
    pause: Callable[[], None]
    untrained = False

    def endless(self, prompt: str, system: str = "mogo", seed: int = 0) -> Session:
        self.calls.append("endless")
        if self.untrained:
            raise PlaygroundError("the system mogo is not trained yet")
        check_sampling(seed, 0.0, 1.0, 1.0, 1.0, 1.0)
        return Session(prompt, seed, self.pause)
