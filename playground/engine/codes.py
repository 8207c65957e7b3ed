"""One code of a codebook: its neighbours, its opposite, where it stands in stored tokens, what it decodes to alone."""

import time
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from playground.data.examples import StoredExample
from playground.errors import PlaygroundError
from playground.findings import Neighbours, Occurrence
from playground.limits import LIMITS
from playground.motion.motion import Motion
from playground.motion.representation import from_features67
from playground.results import Decoded
from playground.stored import StoredAnalysis
from playground.tokenizers.token_file import LevelTokens

if TYPE_CHECKING:
    from playground.runtime import Runtime


def similarities(codebook: NDArray[np.float32], codes: NDArray[np.int64]) -> NDArray[np.float64]:
    """Cosine between some codes [n] and every code of a codebook [V, D]: [n, V], the code itself nan."""
    vectors = codebook.astype(np.float64)
    unit = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
    cosine = unit[codes] @ unit.T
    cosine[np.arange(len(codes)), codes] = np.nan
    return cosine


def opposites(codebook: NDArray[np.float32], codes: NDArray[np.int64]) -> NDArray[np.int64]:
    """The code least like each of some codes [n]; the code itself in a codebook of one."""
    if len(codebook) < 2:
        return codes.copy()
    return np.nanargmin(similarities(codebook, codes), axis=-1).astype(np.int64)


def nearest(codebook: NDArray[np.float32], system: str, scale: int, code: int, count: int) -> Neighbours:
    """The `count` codes most like a code, and its opposite. PlaygroundError for a codebook of one code."""
    if len(codebook) < 2:
        raise PlaygroundError(f"scale {scale} of {system} has a single code, so it has no neighbour")
    cosine = similarities(codebook, np.array([code]))[0]
    order = np.argsort(-cosine, kind="stable")  # nan, the code itself, comes last
    codes = order[: min(count, len(order) - 1)].astype(np.int64)
    opposite = int(np.nanargmin(cosine))
    return Neighbours(system, scale, code, codes, cosine[codes].astype(np.float32), opposite, float(cosine[opposite]))


def prototype(runtime: "Runtime", scale: int, code: int, frames: int) -> Decoded:
    """What a code stands for: its scale alone, every token of it this code, decoded without text."""
    from playground.probes import subset

    began = time.perf_counter()
    tokenizer = runtime.tokenizer
    pairs = enumerate(zip(tokenizer.sizes(frames), tokenizer.quantizer.codes, strict=True), start=1)
    levels = [
        LevelTokens(size, codes, np.full(size, code if n == scale else 0, np.int64)) for n, (size, codes) in pairs
    ]
    features = runtime.decode_embedding(subset(runtime, levels, frames, [scale - 1]), frames, "", 0.0)
    motion = Motion(from_features67(runtime.normaliser.invert(features)))
    return Decoded(motion, features, None, 0.0, 1, time.perf_counter() - began, f"only:{scale}")


def find(
    analysis: StoredAnalysis | None,
    examples: Sequence[StoredExample],
    system: str,
    checkpoint: str,
    scale: int,
    code: int,
    count: int,
) -> list[Occurrence]:
    """Where a code stands in the examples and in the clips of the stored analysis, every motion once before any twice.

    Tokens of another checkpoint are left out; they mean nothing here.
    """
    found = list(_in_examples(examples, system, checkpoint, scale, code))
    if analysis is not None and analysis.checkpoint == checkpoint:
        found += _in_clips(analysis, scale, code)
    seen: dict[str, int] = {}
    ranked = []
    for place, one in enumerate(found):
        seen[one.id] = seen.get(one.id, -1) + 1
        ranked.append((seen[one.id], place, one))
    return [one for _, _, one in sorted(ranked, key=lambda entry: entry[:2])[:count]]


def _in_examples(
    examples: Sequence[StoredExample], system: str, checkpoint: str, scale: int, code: int
) -> Iterator[Occurrence]:
    for example in examples:
        tokens = example.tokens
        if tokens is None or (tokens.system, tokens.checkpoint) != (system, checkpoint) or scale > len(tokens.ids):
            continue
        ids = tokens.ids[scale - 1]
        for position in np.flatnonzero(ids == code):
            yield _occurrence(example.id, "example", example.title, int(position), len(ids), example.frames)


def _in_clips(analysis: StoredAnalysis, scale: int, code: int) -> list[Occurrence]:
    places = [(analysis.clips[row], row, position) for row, position in analysis.where_used(scale - 1, code)]
    return [
        _occurrence(
            clip.id, "clip", f"{clip.caption} ({clip.source})", position, analysis.count(row, scale - 1), clip.frames
        )
        for clip, row, position in places
    ]


def _occurrence(id: str, kind: str, title: str, position: int, size: int, frames: int) -> Occurrence:
    start, stop = position * frames / size, (position + 1) * frames / size
    span = (round(start), max(round(stop), round(start) + 1))
    seconds = (round(start / LIMITS.fps, 3), round(stop / LIMITS.fps, 3))
    return Occurrence(id, kind, title, position, size, span, seconds, frames)


def open_analysis(folder: Path, system: str) -> StoredAnalysis | None:
    """The stored analysis of a system, read once; None where there is none. PlaygroundError if it is broken."""
    path = folder / f"{system}.json"
    return _read_analysis(folder, system, path.stat().st_mtime_ns) if path.is_file() else None


@lru_cache(maxsize=16)
def _read_analysis(folder: Path, system: str, changed: int) -> StoredAnalysis:
    return StoredAnalysis.read(folder, system)
