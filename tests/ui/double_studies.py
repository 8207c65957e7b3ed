"""The studies of the engine's stand-in: decodes of scale sets, one token swapped, words, places in the maps."""

import zlib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from playground.engine.checks import check_code, whole
from playground.engine.codes import nearest
from playground.engine.microscope import with_code
from playground.errors import PlaygroundError
from playground.findings import Alignment, Attention, Language, Neighbours, Placed, ScaleSet, ScaleStudy, Swap
from playground.motion.measures import mpjpe
from playground.motion.motion import Motion
from playground.results import Decoded, Generation, Tokenized
from playground.tokenizers.token_file import LevelTokens


class Studies:
    """What the rooms ask beyond tokens and back. Needs `calls` and `codebooks` of the stand-in."""

    calls: list[str]
    codebooks: Callable[[str], list[NDArray[Any]]]

    def scale_study(self, tokenized: Tokenized, guidance: float = 0.0, kind: str = "upto") -> ScaleStudy:
        self.calls.append(f"scale_study {kind}")
        count = len(tokenized.levels)
        sets = tuple(ScaleSet.of(f"{kind}:{n}", count) for n in range(1, count + 1))
        size = 0.2 + 0.2 * (zlib.crc32(tokenized.motion.joints.tobytes()) % 100) / 100
        motions = tuple(shaken(tokenized.motion, size * 0.75 ** len(one.levels(count))) for one in sets)
        errors = np.array([mpjpe(tokenized.motion.joints, motion.joints) for motion in motions], np.float32)
        return ScaleStudy(
            tokenized.system, "fake", guidance, sets, errors, tokenized.residual_energy, motions, 0.04
        )  # fmt: skip

    def neighbours(self, system: str, scale: int, code: int, count: int = 8) -> Neighbours:
        self.calls.append("neighbours")
        self._check(system, scale, code)
        return nearest(self.codebooks(system)[scale - 1].astype(np.float32), system, scale, code, count)

    def prototype(self, system: str, scale: int, code: int, seconds: float = 2.0) -> Decoded:
        self.calls.append(f"prototype {scale}.{code}")
        self._check(system, scale, code)
        frames = int(20 * seconds) // 4 * 4
        joints = np.resize(still(), (frames, 22, 3)) + 0.001 * code
        return Decoded(Motion(joints.astype(np.float32)), np.zeros((frames, 67), np.float32), None, 0.0, 1, 0.02)

    def _check(self, system: str, scale: int, code: int) -> None:
        sizes = [len(codebook) for codebook in self.codebooks(system)]
        check_code(sizes[whole(scale, "the scale", 1, len(sizes)) - 1], scale, code)

    def swap(self, result: Tokenized, scale: int, position: int, code: int, guidance: float = 0.0) -> Swap:
        self.calls.append(f"swap {scale}.{position}.{code}")
        before = result.levels[scale - 1]
        if not 0 <= code < before.codes:
            raise PlaygroundError(f"code {code} of scale {scale}; 0 to {before.codes - 1} are accepted")
        levels = with_code(result.levels, scale - 1, position, code)
        start, stop = self.governed(result, scale)[position]
        moved = result.motion.joints.copy()
        moved[start:stop, 20, 0] += 0.1
        motion = replace(result.motion, joints=moved)
        difference = np.linalg.norm(moved - result.motion.joints, axis=-1).astype(np.float32)
        return Swap(
            scale, position, int(before.ids[position]), code, guidance, levels, replace(result, levels=levels),
            result.motion, motion, np.zeros((motion.frames, 67), np.float32), difference,
            np.zeros(motion.frames, np.float32), (int(start), int(stop)), 0.05,
        )  # fmt: skip

    def governed(self, result: Tokenized, scale: int, guidance: float = 0.0) -> NDArray[np.int64]:
        size, frames = result.levels[scale - 1].size, result.motion.frames
        edges = np.linspace(0, frames, size + 1).astype(int)
        return np.stack([np.maximum(edges[:-1] - 1, 0), edges[1:]], axis=1)  # one frame early, unlike the even shares

    def language(self, tokenized: Tokenized, wrong: str) -> Language:
        self.calls.append("language")
        if wrong == tokenized.caption:
            raise PlaygroundError("the wrong caption is the right one; write another one to see what it changes")
        others = [tuple(_some_other(level, share) for level in tokenized.levels) for share in (2, 1)]
        flips = [tuple(a.ids != b.ids for a, b in zip(tokenized.levels, other, strict=True)) for other in others]
        motions = tuple(shaken(tokenized.motion, size) for size in (0.01, 0.02, 0.03))
        errors = tuple(mpjpe(tokenized.motion.joints, motion.joints) for motion in motions)
        return Language(
            tokenized.caption, wrong, tokenized.levels, others[0], others[1], flips[0], flips[1], errors, motions, 0.06
        )  # type: ignore[arg-type]

    def attention(self, result: Tokenized, caption: str | None = None) -> Attention:
        words = ["[CLS]", *(result.caption if caption is None else caption).split(), "##ly", "[SEP]"]
        weights = np.random.default_rng(2).uniform(size=(result.motion.frames, len(words)))
        weights = (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)
        return Attention(words, weights, weights[None, None], 4, 0.02)

    def looks_at_words(self, system: str) -> bool:
        return True

    def alignment(self, made: Generation) -> Alignment:
        self.calls.append(f"alignment {made.seed}")
        if not made.prompt:
            raise PlaygroundError("this motion was drawn without words, so no moment looked at any")
        words = ["[CLS]", *made.prompt.split(), ".", "[SEP]"]
        weights = np.random.default_rng(made.seed).uniform(size=(2, made.motion.frames, len(words)))
        weights[:, :, 0] += 4  # marks take most of it
        by_step = (weights / weights.sum(axis=-1, keepdims=True)).astype(np.float32)
        what = "detokenizer, mean over layers and heads"
        if not made.levels:
            what = "last layer of the denoiser, mean over steps and heads"
        return Alignment(made.system, "fake", what, words, by_step.mean(axis=0), by_step, 1, 0.02)

    def place(self, result: Any, system: str | None = None, each: str = "clip") -> Placed:
        self.calls.append(f"place {each}")
        nearest_clips = ("c3", "c0", "c6")
        if each == "clip":
            at = np.array([1.5, 2.5], np.float32)
            return Placed("lgtok", "fake00000000", each, at, at[::-1].copy(), nearest_clips, 0.03)
        spots = np.random.default_rng(4).normal(size=(sum(level.size for level in result.levels), 2))
        return Placed("lgtok", "fake00000000", each, spots.astype(np.float32), -spots.astype(np.float32), (), 0.05)


def _some_other(level: LevelTokens, share: int) -> LevelTokens:
    """Every share-th token another code."""
    ids = level.ids.copy()
    ids[::share] = (ids[::share] + 1) % level.codes
    return LevelTokens(level.size, level.codes, ids)


def still() -> NDArray[np.float32]:
    """One standing pose [1, 22, 3]."""
    from playground.motion.synthetic import corpus

    return corpus(1, seed=4)[0].motion.joints[:1]


def shaken(motion: Motion, size: float) -> Motion:
    """The motion with every joint off by a smooth wobble of `size` metres."""
    rng = np.random.default_rng(7)
    phase = rng.uniform(0, 2 * np.pi, (22, 3))
    time = np.arange(motion.frames)[:, None, None] / 20
    return replace(motion, joints=(motion.joints + size * 0.3 * np.sin(2 * time + phase)).astype(np.float32))
