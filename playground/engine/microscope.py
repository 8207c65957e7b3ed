"""The token microscope: one token replaced by another code, and the frames that a change of it moves.

LG-Tok's latents are not frames by construction. Which frames a token governs is measured here: the token is replaced,
the motion is decoded again, and the difference says where the change lands (motion/differences.py).
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from playground.engine.checks import Check, check_code, check_place
from playground.engine.codes import nearest, opposites
from playground.errors import PlaygroundError
from playground.findings import Swap
from playground.motion.differences import governed_span, joint_differences
from playground.motion.motion import Motion
from playground.motion.representation import from_features67
from playground.results import Generation, Tokenized
from playground.tokenizers.token_file import LevelTokens

if TYPE_CHECKING:
    from playground.runtime import Runtime

Result = Tokenized | Generation
CHOICES = ("nearest", "opposite")


def with_code(levels: Sequence[LevelTokens], level: int, position: int, code: int) -> tuple[LevelTokens, ...]:
    """The same tokens with another code at one place (level and position from 0)."""
    ids = levels[level].ids.copy()
    ids[position] = code
    return (*levels[:level], replace(levels[level], ids=ids), *levels[level + 1 :])


def swap(runtime: "Runtime", result: Result, scale: int, position: int, code: int | str, guidance: float) -> Swap:
    """One token replaced. code: its number, or "nearest" or "opposite" to the code that stands there."""
    began = time.perf_counter()
    level, place = check_place(result.levels, scale, position)
    before = int(result.levels[level].ids[place])
    new = _chosen(runtime, result.levels[level], scale, before, code)
    levels = with_code(result.levels, level, place, new)
    frames, text, count = result.motion.frames, result.caption, len(levels)
    old = runtime.normaliser.invert(runtime.decode(result.levels, frames, text, guidance, count))
    features = runtime.decode(levels, frames, text, guidance, count)
    rows = runtime.normaliser.invert(features)
    original, motion = Motion(from_features67(old), caption=text), Motion(from_features67(rows), caption=text)
    difference = joint_differences(old, rows)
    apart = (original.joints[:, 0] - motion.joints[:, 0])[:, [0, 2]]
    return Swap(
        scale=scale,
        position=place,
        before=before,
        code=new,
        guidance=guidance,
        levels=levels,
        tokenized=_with_levels(runtime, result, levels, motion, features, guidance),
        original=original,
        motion=motion,
        features=features,
        difference=difference,
        drift=np.linalg.norm(apart, axis=-1).astype(np.float32),
        span=governed_span(difference),
        seconds=time.perf_counter() - began,
    )


def governed(runtime: "Runtime", result: Result, scale: int, guidance: float, check: Check | None) -> NDArray[np.int64]:
    """Measured span [s, 2] of every token of a scale: each alone is replaced by its code's opposite, in one batch."""
    from playground.probes import decode_many, replaced

    level, _ = check_place(result.levels, scale, 0)
    ids = result.levels[level].ids
    variants = np.tile(ids, (len(ids), 1))
    np.fill_diagonal(variants, opposites(runtime.codebooks()[level], ids))
    frames, text = result.motion.frames, result.caption
    old = runtime.normaliser.invert(runtime.decode(result.levels, frames, text, guidance, len(result.levels)))
    embeddings = replaced(runtime, result.levels, frames, level, variants)
    rows = runtime.normaliser.invert(decode_many(runtime, embeddings, frames, text, guidance, check))
    return np.array([governed_span(one) for one in joint_differences(rows, old)], np.int64)


def _chosen(runtime: "Runtime", tokens: LevelTokens, scale: int, before: int, code: int | str) -> int:
    if not isinstance(code, str):
        return check_code(tokens.codes, scale, code)
    if code not in CHOICES:
        raise PlaygroundError(f"the code is {code[:40]!r}; a number, {' or '.join(CHOICES)} is accepted")
    found = nearest(runtime.codebooks()[scale - 1], runtime.name, scale, before, 1)
    return int(found.codes[0]) if code == "nearest" else found.opposite


def _with_levels(
    runtime: "Runtime",
    result: Result,
    levels: tuple[LevelTokens, ...],
    motion: Motion,
    features: NDArray[np.float32],
    guidance: float,
) -> Result:
    """What was given with other tokens, and the numbers that follow from them."""
    from playground.probes import energies, shares

    if isinstance(result, Generation):
        how = replace(result.sampling, guidance=guidance)
        return replace(result, levels=levels, motion=motion, features=features, sampling=how)
    parts = np.concatenate([part.numpy() for part in shares(runtime, levels, motion.frames)])
    energy = np.full(len(levels) + 1, np.nan, np.float32)
    if len(result.features):
        energy = energies(runtime, result.features, result.caption, levels)
    return replace(result, levels=levels, per_level=parts, embedding=parts.sum(axis=0), residual_energy=energy)
