"""Motions drawn from text, scale by scale, one or several seeds at once, whole or with tokens that stay."""

import time
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from playground.engine.checks import Check
from playground.motion.motion import Motion
from playground.motion.representation import from_features67
from playground.results import Generation, GenerationStep
from playground.systems import SamplingDefaults

if TYPE_CHECKING:
    from playground.generators.base import Edit
    from playground.runtime import Runtime


def draw_steps(
    runtime: "Runtime",
    prompt: str | None,
    frames: int,
    seeds: Sequence[int],
    how: SamplingDefaults,
    check: Check | None,
    edit: "Edit | None" = None,
    previews: bool = True,
) -> Iterator[tuple[GenerationStep, ...]]:
    """Yield one step a seed after every scale; without previews after the last one alone."""
    from playground.probes import decode_many, draw_scales

    if runtime.diffusion is not None and edit is None:
        yield from _denoised(runtime, prompt, frames, seeds, how, check, previews)
        return
    entropy: list[NDArray[np.float32]] = []
    text = prompt or ""
    for drawn in draw_scales(runtime, prompt, frames, seeds, how, check, edit):
        entropy.extend(drawn.entropy)
        count = len(runtime.tokenizer.config.scales)
        if not previews and drawn.level < count:
            continue
        features = decode_many(runtime, drawn.embedding, frames, text, how.guidance)
        rows = runtime.normaliser.invert(features)
        yield tuple(
            GenerationStep(
                drawn.level,
                drawn.levels[row],
                tuple(level[row] for level in entropy),
                Motion(from_features67(rows[row]), caption=text),
                features[row],
                count,
            )
            for row in range(len(seeds))
        )


def _denoised(
    runtime: "Runtime",
    prompt: str | None,
    frames: int,
    seeds: Sequence[int],
    how: SamplingDefaults,
    check: Check | None,
    previews: bool,
) -> Iterator[tuple[GenerationStep, ...]]:
    """The same without tokens: a step is one of denoising, and its motion what the network guesses by then."""
    from playground.probes import draw_features

    for done, count, features in draw_features(runtime, prompt, frames, seeds, how, check):
        if previews or done == count:
            rows, text = runtime.normaliser.invert(features), prompt or ""
            yield tuple(
                GenerationStep(done, (), (), Motion(from_features67(one), caption=text), own, count)
                for one, own in zip(rows, features, strict=True)
            )


def finish(runtime: "Runtime", step: GenerationStep, seed: int, how: SamplingDefaults, began: float) -> Generation:
    """The last step as a finished generation; began: perf_counter() at its start."""
    return Generation(
        system=runtime.name,
        checkpoint=runtime.checkpoint,
        prompt=step.motion.caption,
        seed=seed,
        levels=step.levels,
        entropy=step.entropy,
        motion=step.motion,
        features=step.features,
        seconds=time.perf_counter() - began,
        sampling=how,
    )
