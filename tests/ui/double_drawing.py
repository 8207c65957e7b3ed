"""What the engine's stand-in draws: several seeds at once, alternatives, motions drawn anew, edits."""

import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from playground.engine.editing import BLEND, PROMISE, benchmark_span, edited_frames
from playground.findings import Alternatives, Edited, Seam
from playground.motion.motion import Motion
from playground.results import Generation, GenerationStep, Tokenized
from playground.tokenizers.token_file import LevelTokens


class Drawing:
    """Mixed into the stand-in; rests on its `generate_steps`, `tokenize` and `calls`."""

    calls: list[str]
    pause: Callable[[], None]
    generate_steps: Callable[..., Iterator[GenerationStep]]
    tokenize: Callable[..., Tokenized]

    def generate_many_steps(
        self, prompt: str | None, seconds: float, system: str, seeds: Sequence[int], **options: Any
    ) -> Iterator[tuple[GenerationStep, ...]]:
        pause, self.pause = self.pause, lambda: None
        others = [list(self.generate_steps(prompt, seconds, system, seed, **options)) for seed in seeds[1:]]
        self.pause = pause
        yield from zip(self.generate_steps(prompt, seconds, system, seeds[0], **options), *others, strict=True)

    def generate(self, prompt: str | None, seconds: float, system: str, seed: int = 0, **options: Any) -> Generation:
        *_, last = self.generate_steps(prompt, seconds, system, seed, **options)
        made = (last.levels, last.entropy, last.motion, last.features)
        return Generation(system, "fake", prompt or "", seed, *made, 0.1)

    refines = True

    def refine(self, made: Generation) -> Generation:
        self.calls.append("refine")
        return replace(made, motion=_moved(made.motion, 0.5), refiner="fake")

    def alternatives(self, result: Any, scale: int, position: int, count: int = 8) -> Alternatives:
        self.calls.append(f"alternatives {scale} {position}")
        level = result.levels[scale - 1]
        chosen = int(level.ids[position])
        codes = (chosen + np.arange(count)) % level.codes
        shares = (0.4 * 0.7 ** np.arange(count)).astype(np.float32)
        chances = np.where(np.arange(count) < count - 1, shares, 0).astype(np.float32)
        return Alternatives(scale, position, chosen, codes, shares, chances, float(shares[0]), 2.5, 0.01)

    def regenerate_steps(
        self, generation: Generation, scale: int, position: int | None = None, code: int | None = None,
        seed: int | None = None, **options: Any,
    ) -> Iterator[GenerationStep]:  # fmt: skip
        self.calls.append(f"regenerate {scale} {position} {code} {seed}")
        rng = np.random.default_rng(zlib.crc32(f"{scale} {position} {code} {seed} {generation.seed}".encode()))
        levels = list(generation.levels)
        for n, old in enumerate(levels):
            if n >= scale - 1:
                ids = rng.integers(0, old.codes, old.size)
                if n == scale - 1 and position is not None and code is not None:
                    ids[position] = code
                levels[n] = LevelTokens(old.size, old.codes, ids)
        for n in range(1, len(levels) + 1):
            kept, entropy = tuple(levels[:n]), generation.entropy[:n]
            yield GenerationStep(n, kept, entropy, _moved(generation.motion, 0.02), generation.features, len(levels))

    def edit(
        self, source: Any, span: Sequence[int] | None, prompt: str | None, seed: int = 0, kind: str = "inpaint",
        system: str = "lgtok", caption: str | None = None, anchor: str = "place", **options: Any,
    ) -> Edited:  # fmt: skip
        used = system if isinstance(source, Motion) else source.system
        self.calls.append(f"edit {kind} {span} {prompt} {seed} {used}")
        if isinstance(source, Motion):
            source = self.tokenize(source, source.caption if caption is None else caption, system)
        frames = source.motion.frames
        start, stop = benchmark_span(kind, frames) if span is None else span
        drawn = edited_frames(kind, (start, stop), frames)
        joints = source.motion.joints.copy()
        joints[drawn] += np.float32(0.1)
        share = [np.interp(np.arange(o.size) / o.size, np.arange(frames) / frames, drawn) for o in source.levels]
        redrawn = tuple(one > 0.5 for one in share)
        levels = tuple(
            LevelTokens(o.size, o.codes, np.where(mask, (o.ids + 1 + seed) % o.codes, o.ids))
            for o, mask in zip(source.levels, redrawn, strict=True)
        )
        borders = [f for f in range(1, frames) if drawn[f] != drawn[f - 1]]
        motion = replace(source.motion, joints=joints)
        return Edited(
            source.system, "fake", kind, (start, stop), prompt or "", seed, anchor, source.motion, motion, ~drawn,
            levels, redrawn, tuple(Seam(f, 12.0 + f / 100, 80.0, 10.0) for f in borders), BLEND, 0.5, 3.0,
            PROMISE.format(blend=BLEND), motion, 30.0, 0.2,
        )  # fmt: skip


def _moved(motion: Motion, by: float) -> Motion:
    return replace(motion, joints=(motion.joints + np.float32(by)).astype(np.float32))
