"""The map of single tokens: a sample of what tokens add to the embedding, as points of a plane (Fig 6, per token).

A token's vector is the share of its scale in the dequantized embedding, pooled to the scale's own length, where the
token stands. The sample holds equally many tokens of every scale; t-SNE runs on their main axes, as is usual.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from playground.analysis.embedding import EmbeddingMap, main_axes

if TYPE_CHECKING:
    from playground.runtime import Runtime

SAMPLE = 2400  # tokens of the map, all scales together
COMPONENTS = 50  # main axes that t-SNE and placing work on

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class TokenMap:
    """A sample of m tokens as points; names and shapes as in `playground/stored.py`."""

    token_index: NDArray[np.int32]  # [m, 3] row, scale from 1, position
    token_centre: Floats  # [D]
    token_axes: Floats  # [k, D]
    token_scores: NDArray[np.float16]  # [m, k]
    token_tsne: Floats  # [m, 2]


def sample_tokens(ids: Sequence[NDArray[np.int64]], seed: int, count: int = SAMPLE) -> NDArray[np.int32]:
    """[m, 3] (row, scale from 1, position): so many real tokens in all, as many of each scale, without repetition.

    ids: [n, s_n] a scale, -1 where a motion has no token.
    """
    rng = np.random.default_rng(seed)
    chosen = []
    for scale, level in enumerate(ids, start=1):
        real, size = np.flatnonzero(level >= 0), level.shape[1]
        drawn = real[np.sort(rng.choice(len(real), min(len(real), max(count // len(ids), 1)), replace=False))]
        chosen.append(np.stack([drawn // size, np.full(len(drawn), scale), drawn % size], axis=1))
    return np.concatenate(chosen).astype(np.int32)


def map_tokens(runtime: "Runtime", ids: list[NDArray[np.int64]], frames: Sequence[int], seed: int) -> TokenMap:
    """The map of a sample of the tokens of n clips of so many frames [n]. ids: as in `sample_tokens`."""
    index = sample_tokens(ids, seed)
    rows = np.unique(index[:, 0])
    vectors = _vectors(runtime, [level[rows] for level in ids], np.asarray(frames)[rows])
    place = np.searchsorted(rows, index[:, 0])
    found = np.stack([vectors[p][n - 1][q] for p, (_, n, q) in zip(place, index, strict=True)]).astype(np.float64)
    main = main_axes(found, min(COMPONENTS, *found.shape))
    scores = main.scores.astype(np.float16)
    return TokenMap(
        index,
        main.centre.astype(np.float32),
        main.axes.astype(np.float32),
        scores,
        EmbeddingMap().fit(scores.astype(np.float64), "tsne", seed).points_.astype(np.float32),
    )


def _vectors(
    runtime: "Runtime", ids: list[NDArray[np.int64]], frames: NDArray[np.int64]
) -> list[list[NDArray[np.float32]]]:
    """What each token adds, a list a clip: [s_n, D] a level. Clips of as many tokens are looked at together."""
    from playground.probes import token_vectors

    sizes = np.array([runtime.tokenizer.sizes(int(count)) for count in frames])
    found: list[list[NDArray[np.float32]]] = [[] for _ in frames]
    for same in np.unique(sizes, axis=0):
        rows = np.flatnonzero((sizes == same).all(axis=1))
        own = [level[rows, :size] for level, size in zip(ids, same, strict=True)]
        for level in token_vectors(runtime, own, int(frames[rows[0]])):
            for row, vectors in zip(rows, level, strict=True):
                found[row].append(vectors)
    return found
