"""What is asked of the engine, checked before any model runs: motions, numbers, places in the tokens, time left."""

import time
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.motion import Motion
from playground.motion.representation import canonicalise, to_features67
from playground.motion.skeleton import HUMAN22
from playground.systems import SamplingDefaults, SystemRow
from playground.tokenizers.token_file import LevelTokens

UNIT = 4  # frames: motions are floored to a multiple of it, as in the published evaluation (A2)

Check = Callable[[], None]


def prepare(motion: Motion, heading: str = "body") -> tuple[NDArray[np.float32], Motion]:
    """A motion as un-normalised rows [F, 67], F a multiple of 4 and at most 196, and the F canonical poses of them.

    heading: the system's rule (`Engine.heading`).
    """
    if motion.skeleton != HUMAN22 or motion.fps != LIMITS.fps:
        raise PlaygroundError(
            f"a tokenizer takes {HUMAN22.size} joints at {LIMITS.fps} frames a second, got {motion.skeleton.size}"
            f" at {motion.fps:g}; read the file with read_motion, which converts it"
        )
    rows = min(motion.frames - 1, LIMITS.max_frames) // UNIT * UNIT
    if rows < LIMITS.min_frames:
        need = (LIMITS.min_frames + 1) / LIMITS.fps
        raise PlaygroundError(f"the motion has {motion.seconds:.2f} s; a tokenizer needs at least {need:.2f} s")
    joints = canonicalise(motion.joints[: rows + 1])
    return to_features67(joints, heading), replace(motion, joints=joints[:rows])


def check_guidance(guidance: float, name: str = "guidance") -> None:
    """PlaygroundError unless 0 <= guidance <= the limit."""
    if not 0 <= guidance <= LIMITS.max_guidance:
        raise PlaygroundError(f"{name} is {guidance:g}; 0 to {LIMITS.max_guidance:g} is accepted")


def check_sampling(seed: int, guidance: float, cfg: float, temperature: float, top_k: float, top_p: float) -> None:
    """PlaygroundError for a number of a draw that is out of range."""
    if not 0 <= seed <= LIMITS.max_seed:
        raise PlaygroundError(f"the seed must be a whole number from 0 to {LIMITS.max_seed}")
    check_guidance(guidance)
    check_guidance(cfg, "cfg")
    if not 0 <= temperature <= LIMITS.max_temperature:
        raise PlaygroundError(f"temperature is {temperature:g}; 0 to {LIMITS.max_temperature:g} is accepted")
    for name, share in (("top_k", top_k), ("top_p", top_p)):
        if not 0 < share <= 1:
            raise PlaygroundError(f"{name} is {share:g}; a share above 0 and at most 1 is accepted")


def check_generation(
    seconds: float, seed: int, guidance: float, cfg: float, temperature: float, top_k: float, top_p: float
) -> int:
    """Frames of a generation of so many seconds: floor(20 s / 4) * 4. PlaygroundError for a number out of range."""
    if not LIMITS.min_seconds <= seconds <= LIMITS.max_seconds:
        raise PlaygroundError(
            f"{seconds:g} seconds were asked for; {LIMITS.min_seconds:g} to {LIMITS.max_seconds:g} are accepted"
        )
    check_sampling(seed, guidance, cfg, temperature, top_k, top_p)
    return int(LIMITS.fps * seconds + 1e-6) // UNIT * UNIT


def whole(value: object, what: str, low: int, high: int) -> int:
    """A whole number from `low` to `high`. PlaygroundError for anything else."""
    try:
        number = int(value)  # type: ignore[call-overload]
        if number != value:
            raise ValueError
    except (TypeError, ValueError, OverflowError):
        raise PlaygroundError(f"{what} must be a whole number from {low} to {high}") from None
    if not low <= number <= high:
        raise PlaygroundError(f"{what} is {number}; {low} to {high} is accepted")
    return number


def check_seeds(seeds: Sequence[int]) -> None:
    """PlaygroundError unless there are 1 to LIMITS.max_seeds seeds, each different."""
    if not 1 <= len(seeds) <= LIMITS.max_seeds or len(set(seeds)) != len(seeds):
        raise PlaygroundError(f"1 to {LIMITS.max_seeds} different seeds are drawn together, got {len(seeds)}")


def settings(row: SystemRow, options: dict[str, Any]) -> SamplingDefaults:
    """A system's sampling with the given numbers in place of its own; None means its own.

    PlaygroundError for a name that is no setting.
    """
    given = {key: value for key, value in options.items() if value is not None}
    try:
        return replace(row.sampling, **given)
    except TypeError:
        names = ", ".join(field.name for field in fields(SamplingDefaults))
        raise PlaygroundError(f"{', '.join(sorted(given))[:80]} were given; {names} are accepted") from None


def check_place(levels: Sequence[LevelTokens], scale: int, position: int) -> tuple[int, int]:
    """Scale (from 1) and position (from 0) of a token as indices from 0. PlaygroundError if there is no such token."""
    level = whole(scale, "the scale", 1, len(levels)) - 1
    return level, whole(position, f"the position in scale {scale}", 0, levels[level].size - 1)


def check_code(codes: int, scale: int, code: int) -> int:
    """A code of a scale's codebook of so many codes. PlaygroundError if there is none of that number."""
    return whole(code, f"the code of scale {scale}", 0, codes - 1)


def check_span(span: Sequence[int], frames: int) -> tuple[int, int]:
    """(start, stop) with 0 <= start < stop <= frames. PlaygroundError for anything else."""
    if isinstance(span, str) or not hasattr(span, "__len__") or len(span) != 2:
        raise PlaygroundError("a span is two whole numbers, its first frame and the frame after its last")
    start = whole(span[0], "the start of the span", 0, frames - 1)
    stop = whole(span[1], "the end of the span", 1, frames)
    if stop <= start:
        raise PlaygroundError(f"the span ends at frame {stop}, but it starts at frame {start}; it must end later")
    return start, stop


def deadline_check(seconds: float | None) -> Check | None:
    """A call that raises PlaygroundError once so many seconds are over; None where there is no limit."""
    if seconds is None:
        return None
    end = time.monotonic() + seconds

    def check() -> None:
        if time.monotonic() > end:
            raise PlaygroundError(f"the request took longer than {seconds:g} s and was stopped; try a shorter motion")

    return check
