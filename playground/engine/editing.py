"""Editing: frames drawn anew between frames that stay (systems.md A8 Eq. 7, A10 editing, I3).

Three things keep the other frames as they were. Tokens outside the edit hold their codes at every scale while the
generator draws (A10). The text acts on the edited frames only when the tokens are decoded (Eq. 7). And because a
latent is not a frame, the kept frames are copied back from the source: that is the guarantee (motion/stitch.py).
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from playground.engine.checks import Check, check_span
from playground.engine.microscope import governed
from playground.errors import PlaygroundError
from playground.findings import Edited, Seam
from playground.limits import LIMITS
from playground.motion.measures import mpjpe
from playground.motion.motion import Motion
from playground.motion.representation import from_features67
from playground.motion.stitch import BLEND, check_anchor, jolt_mm, rows_yaw, runs, stitch
from playground.results import Generation, Tokenized
from playground.systems import SamplingDefaults

if TYPE_CHECKING:
    from playground.runtime import Runtime

KINDS = ("inpaint", "outpaint", "prefix", "suffix", "inbetween")
PROMISE = (
    "Frames outside the span are the source's own poses, copied back after decoding; only the {blend} edited frames at"
    " each border lean towards them."
)

Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class EditRequest:
    """What is to be edited, checked already."""

    kind: str  # one of KINDS
    span: tuple[int, int]
    prompt: str | None  # None is free-form
    seed: int
    how: SamplingDefaults
    anchor: str = "place"
    measured: bool = False  # tokens by the frames that they were measured to govern, not by their equal shares

    def __post_init__(self) -> None:
        check_anchor(self.anchor)


def benchmark_span(kind: str, frames: int) -> tuple[int, int]:
    """The span of the published benchmark masks: 25 to 75 % for in- and out-painting, half for prefix and suffix."""
    if kind in ("prefix", "suffix"):
        return (frames // 2, frames) if kind == "prefix" else (0, frames // 2)
    return frames // 4, 3 * frames // 4


def edited_frames(kind: str, span: Sequence[int], frames: int) -> Bools:
    """Frames to be drawn anew, bool [F].

    inpaint and inbetween: those of the span. outpaint: all but the span. prefix: what comes before the span stays, the
    rest is drawn. suffix: what comes after the span stays. PlaygroundError for another kind or span, or if too few
    frames are drawn or stay.
    """
    if kind not in KINDS:
        raise PlaygroundError(f"the edit is {str(kind)[:40]!r}; {', '.join(KINDS)} are accepted")
    start, stop = check_span(span, frames)
    edited = np.zeros(frames, bool)
    edited[start if kind != "suffix" else 0 : stop if kind != "prefix" else frames] = True
    edited = ~edited if kind == "outpaint" else edited
    for what, count in (("drawn anew", edited.sum()), ("left as they are", frames - edited.sum())):
        if count < LIMITS.min_edit_frames:
            raise PlaygroundError(
                f"{int(count)} of {frames} frames would be {what}; at least {LIMITS.min_edit_frames} are needed"
            )
    return edited


def edit(runtime: "Runtime", source: Tokenized | Generation, request: EditRequest, check: Check | None) -> Edited:
    """Draw the edited frames of a motion anew and put them back between the kept ones."""
    from playground.probes import decode_edited, draw_scales, keep

    began = time.perf_counter()
    frames = source.motion.frames
    edited = edited_frames(request.kind, request.span, frames)
    redraw = edited_tokens(runtime, source, edited, request, check)
    kept_tokens = keep(source.levels, redraw)
    *_, last = draw_scales(runtime, request.prompt, frames, (request.seed,), request.how, check, kept_tokens)
    levels, text = last.levels[0], request.prompt or ""
    gate = np.convolve(edited, np.ones(2 * BLEND + 1), mode="same") > 0
    rows = decode_edited(runtime, levels, frames, text, request.how.guidance, gate)
    made = from_features67(rows)
    joints, yaw = source.motion.joints, rows_yaw(_rows(runtime, source))
    arrays = (joints, yaw, made, rows_yaw(rows), ~edited)
    done, raw = (stitch(*arrays, anchor=request.anchor, blend=size) for size in (BLEND, 0))
    borders = sorted({f for run in runs(edited) for f in run if 0 < f < frames})
    return Edited(
        system=source.system,
        checkpoint=source.checkpoint,
        kind=request.kind,
        span=request.span,
        prompt=text,
        seed=request.seed,
        anchor=request.anchor,
        source=source.motion,
        motion=Motion(done.joints, caption=text or source.caption),
        kept=~edited,
        levels=levels,
        redrawn=tuple(redraw),
        seams=tuple(Seam(f, jolt_mm(done.joints, f), jolt_mm(raw.joints, f), jolt_mm(joints, f)) for f in borders),
        blend=BLEND,
        gap_m=done.gap_m,
        gap_degrees=done.gap_degrees,
        promise=PROMISE.format(blend=BLEND),
        plain=Motion(made, caption=text),
        plain_error_mm=mpjpe(joints[~edited], made[~edited]),
        seconds=time.perf_counter() - began,
    )


def edited_tokens(
    runtime: "Runtime", source: Tokenized | Generation, edited: Bools, request: EditRequest, check: Check | None
) -> list[Bools]:
    """Tokens to be drawn anew, bool [s_n] a scale, for the frames to be drawn anew (bool [F]).

    As published, latents are taken as equal shares of the time, and the mask is resized to every scale (A10). With
    `measured`, a token counts by the frames it governs: more than half of them must be edited. In-betweening redraws
    every token that reaches into the span at all, so that nothing of the old frames is left; so does a span that is
    too short for any latent.
    """
    from playground.probes import resized_masks

    sizes = [level.size for level in source.levels]
    if request.measured:
        spans = [governed(runtime, source, scale, 0.0, check) for scale in range(1, len(sizes) + 1)]
        shares = [np.array([edited[a:b].mean() if b > a else 0.0 for a, b in level]) for level in spans]
    else:
        shares = [_share_of(edited, size) for size in sizes]
    if request.kind == "inbetween" or not (shares[-1] > 0.5).any():
        return [share > 0 for share in shares]
    return [share > 0.5 for share in shares] if request.measured else resized_masks(shares[-1] > 0.5, sizes)


def _share_of(edited: Bools, size: int) -> NDArray[np.float64]:
    """Share [size] of each of so many equal pieces of the time that is edited."""
    total = np.concatenate([[0.0], np.cumsum(edited)])
    at = np.interp(np.linspace(0, len(edited), size + 1), np.arange(len(total)), total)
    return np.diff(at) * size / len(edited)


def _rows(runtime: "Runtime", source: Tokenized | Generation) -> NDArray[np.float32]:
    """Un-normalised rows [F, 67] of the source motion."""
    if isinstance(source, Generation):
        return runtime.normaliser.invert(source.features)
    if len(source.features) != source.motion.frames:
        raise PlaygroundError("the motion itself is not at hand, only its tokens; tokenize a motion to edit it")
    return source.features
