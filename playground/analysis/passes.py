"""One pass of a tokenizer over clips of a library: tokens, embedding, residual energy and error of every clip."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from playground.data.library import Library
from playground.limits import LIMITS
from playground.motion.measures import joint_errors
from playground.motion.representation import from_features67
from playground.text.prompts import normalise

if TYPE_CHECKING:
    from torch import Tensor

    from playground.runtime import Runtime
    from playground.text.features import TextFeatures

UNIT = 4  # rows: clips are floored to a multiple of it (systems.md A2)
BATCH = 32

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ClipPass:
    """What tokenizing and decoding one clip gave."""

    index: int  # clip of the library
    rows: int  # feature rows measured
    ids: tuple[NDArray[np.int64], ...]  # [s_n] a level
    mean_embedding: Floats  # [D], z_hat averaged over the motion's own latents
    energy: Floats  # [N+1], share of the latent's energy left after 0..N scales
    errors_mm: Floats  # [rows], pelvis-relative error of each frame (F2)


@dataclass(frozen=True, eq=False)
class ClipBatch:
    """Clips of one batch, cut and ready for the tokenizer."""

    indices: list[int]  # clips of the library
    rows: list[int]  # feature rows of each
    given: list[NDArray[np.float32]]  # un-normalised rows [rows, C] of each
    features: "Tensor"  # [B, F, C] normalised, 0 beyond each clip's rows
    lengths: "Tensor"  # int64 [B]
    text: "TextFeatures | None"


def rows_of(frames: int) -> int:
    """Feature rows of a clip that are measured: poses - 1, at most 196, floored to 4; 0 if fewer than the minimum."""
    rows = min(frames - 1, LIMITS.max_frames) // UNIT * UNIT
    return rows if rows >= LIMITS.min_frames else 0


def first_caption(captions: Sequence[str]) -> str:
    """The caption an evaluation uses: the first one, cleaned; "" where there is none."""
    return normalise(captions[0], what="caption", allow_empty=True) if captions else ""


def clip_passes(
    runtime: "Runtime",
    library: Library,
    indices: Sequence[int],
    captions: Sequence[str],
    *,
    batch: int = BATCH,
    progress: Callable[[int, int], None] | None = None,
) -> Iterator[ClipPass]:
    """Tokenize and decode clips, caption at both ends, g = 0. Clips too short to tokenize are left out.

    indices: clips of the library; captions: one each, "" for none. Clips of similar length run together, so results do
    not come in the order of `indices`; each says which clip it is. Of longer clips the first 196 rows are measured.
    """
    work = sum(rows_of(library.clips[i].frames) > 0 for i in indices)
    done = 0
    for group in clip_batches(runtime, library, indices, captions, batch=batch):
        yield from _one_batch(runtime, group)
        done += len(group.rows)
        if progress:
            progress(done, work)


def clip_batches(
    runtime: "Runtime", library: Library, indices: Sequence[int], captions: Sequence[str], *, batch: int = BATCH
) -> Iterator[ClipBatch]:
    """The batches that `clip_passes` runs over; arguments as there."""
    work = [(rows_of(library.clips[i].frames), i, text) for i, text in zip(indices, captions, strict=True)]
    work = sorted((entry for entry in work if entry[0]), key=lambda entry: (not entry[2], entry[0], entry[1]))
    for group in _groups(work, batch):
        yield _clip_batch(runtime, library, group)


def _groups(work: list[tuple[int, int, str]], batch: int) -> Iterator[list[tuple[int, int, str]]]:
    """Neighbours of the list in groups of at most `batch`, captioned and bare clips apart."""
    for bare in (False, True):
        part = [entry for entry in work if (not entry[2]) == bare]
        yield from (part[start : start + batch] for start in range(0, len(part), batch))


def _clip_batch(runtime: "Runtime", library: Library, group: list[tuple[int, int, str]]) -> ClipBatch:
    import torch

    rule = runtime.heading
    given = [library.features(index, rule)[:rows] for rows, index, _ in group]
    lengths = torch.tensor([rows for rows, _, _ in group])
    padded = torch.zeros(len(group), int(lengths.max()), given[0].shape[1])
    for line, values in enumerate(given):
        padded[line, : len(values)] = torch.from_numpy(runtime.normaliser.apply(values))
    text = runtime.encoder.encode([caption for _, _, caption in group]) if group[0][2] else None
    return ClipBatch([index for _, index, _ in group], [rows for rows, _, _ in group], given, padded, lengths, text)


def _one_batch(runtime: "Runtime", group: ClipBatch) -> Iterator[ClipPass]:
    tokenizer = runtime.tokenizer
    quantized = tokenizer.encode(group.features, group.lengths, group.text)
    decoded = tokenizer.decode(quantized.embedding, group.lengths, group.text).numpy()
    norm = quantized.residual_norm.double().numpy()  # (N + 1, B)
    energy = norm / np.maximum(norm[0], 1e-12)
    for line, (index, rows, given) in enumerate(zip(group.indices, group.rows, group.given, strict=True)):
        rebuilt, sizes = from_features67(runtime.normaliser.invert(decoded[line, :rows])), tokenizer.sizes(rows)
        yield ClipPass(
            index=index,
            rows=rows,
            ids=tuple(i[line, :size].numpy() for i, size in zip(quantized.tokens.ids, sizes, strict=True)),
            mean_embedding=quantized.embedding[line, : sizes[-1]].double().mean(dim=0).numpy(),
            energy=energy[:, line],
            errors_mm=joint_errors(from_features67(given), rebuilt),
        )
