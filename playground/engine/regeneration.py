"""What else a token could have been, and a motion drawn anew from one scale on."""

import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from playground.engine.checks import Check, check_code, check_place
from playground.engine.generation import draw_steps
from playground.engine.microscope import with_code
from playground.errors import PlaygroundError
from playground.findings import Alternatives
from playground.results import Generation, GenerationStep, Tokenized
from playground.systems import SamplingDefaults

if TYPE_CHECKING:
    from playground.runtime import Runtime


def alternatives(
    runtime: "Runtime",
    result: Generation | Tokenized,
    how: SamplingDefaults,
    scale: int,
    position: int,
    count: int,
    check: Check | None,
) -> Alternatives:
    """The most probable codes of one token of a generated or real motion, given what was drawn before it.

    A generator without a likelihood (a masked one) is asked for this token with all others of its scale given.
    """
    from playground.probes import chances, draw_scales, keep

    began = time.perf_counter()
    level, place = check_place(result.levels, scale, position)
    hidden = [np.zeros(one.size, bool) for one in result.levels]
    hidden[level][place] = not runtime.drawing.likelihood
    steps = draw_scales(
        runtime, result.caption or None, result.motion.frames, (0,), how, check, keep(result.levels, hidden)
    )
    step, logits = next((step, found) for step in steps if (found := step.logits_of(scale)) is not None)
    guided, drawn = chances(logits[0, place], how)
    codes = np.argsort(-guided, kind="stable")[:count].astype(np.int64)
    chosen = int(result.levels[level].ids[place])
    return Alternatives(
        scale=scale,
        position=place,
        chosen=chosen,
        codes=codes,
        probabilities=guided[codes],
        chances=drawn[codes],
        chosen_probability=float(guided[chosen]),
        entropy=float(step.entropy[scale - 1 - step.level][0, place]),
        seconds=time.perf_counter() - began,
    )


def regenerate_steps(
    runtime: "Runtime",
    generation: Generation,
    scale: int,
    position: int | None,
    code: int | None,
    seed: int,
    check: Check | None,
    previews: bool,
) -> Iterator[GenerationStep]:
    """Scales before `scale` stay; with a position and a code that token is forced; the rest is drawn with the seed."""
    from playground.probes import keep

    level, place = check_place(generation.levels, scale, position or 0)
    if (position is None) != (code is None):
        raise PlaygroundError("to force a token give both its position and its code; to force none give neither")
    levels = generation.levels
    redraw = [np.full(one.size, n >= level) for n, one in enumerate(levels)]
    if code is not None:
        levels = with_code(levels, level, place, check_code(levels[level].codes, scale, code))
        redraw[level][place] = False
    steps = draw_steps(
        runtime,
        generation.prompt or None,
        generation.motion.frames,
        (seed,),
        generation.sampling,
        check,
        keep(levels, redraw),
        previews,
    )
    yield from (step for (step,) in steps)
