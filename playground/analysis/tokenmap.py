"""The map of single tokens: a sample of what tokens add to the embedding, as points of a plane (Fig 6, per token).

A token's vector is the share of its scale in the dequantized embedding, pooled to the scale's own length, where the
token stands. The sample holds equally many tokens of every scale; t-SNE runs on their main axes, as is usual.
"""

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


def sample_tokens(clips: int, sizes: list[int], seed: int, count: int = SAMPLE) -> NDArray[np.int32]:
    """[m, 3] (row, scale from 1, position): so many tokens in all, as many of each scale, without repetition."""
    rng = np.random.default_rng(seed)
    chosen = []
    for scale, size in enumerate(sizes, start=1):
        drawn = np.sort(rng.choice(clips * size, min(clips * size, max(count // len(sizes), 1)), replace=False))
        chosen.append(np.stack([drawn // size, np.full(len(drawn), scale), drawn % size], axis=1))
    return np.concatenate(chosen).astype(np.int32)


def map_tokens(runtime: "Runtime", ids: list[NDArray[np.int64]], seed: int) -> TokenMap:
    """The map of a sample of the tokens of n clips. ids: [n, s_n] a scale."""
    from playground.probes import token_vectors

    index = sample_tokens(len(ids[0]), [level.shape[1] for level in ids], seed)
    rows = np.unique(index[:, 0])
    vectors = token_vectors(runtime, [level[rows] for level in ids])
    place = np.searchsorted(rows, index[:, 0])
    found = np.stack([vectors[n - 1][p, q] for p, (_, n, q) in zip(place, index, strict=True)]).astype(np.float64)
    main = main_axes(found, min(COMPONENTS, *found.shape))
    scores = main.scores.astype(np.float16)
    return TokenMap(
        index,
        main.centre.astype(np.float32),
        main.axes.astype(np.float32),
        scores,
        EmbeddingMap().fit(scores.astype(np.float64), "tsne", seed).points_.astype(np.float32),
    )
