"""A new motion in the stored maps: on the PCA axes by projection, in the t-SNE map by the cost that t-SNE minimises.

The stored points stay where they are. A new vector gets the affinities that t-SNE would give it to the stored vectors
(a Gaussian whose width is found by bisection so that the perplexity is the map's), and its place is the point of the
plane with the least Kullback-Leibler divergence between those and the Student-t affinities on the map. It is the
method of openTSNE's `transform` (Policar et al., "Embedding to reference t-SNE space addresses batch effects in
single-cell classification", 2019), each new point on its own and minimised from the best of its neighbours' places.
"""

import time
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.findings import Placed
from playground.results import Generation, Tokenized
from playground.stored import StoredAnalysis

if TYPE_CHECKING:
    from playground.runtime import Runtime

NEAREST = 8  # stored clips that are named
_STARTS = 10  # neighbours whose places the search may start from
_STEPS = 40

Floats = NDArray[np.float64]


def place_clip(runtime: "Runtime", result: Tokenized | Generation, analysis: StoredAnalysis) -> Placed:
    """A motion in the maps of clips: the mean of its embedding over the latents (I9)."""
    began = time.perf_counter()
    _check(runtime, analysis)
    vector = runtime.embedding(result.levels, result.motion.frames)[0].double().mean(dim=0).numpy()[None]
    means = analysis.means.astype(np.float64)
    places = place(means, analysis.tsne.astype(np.float64), vector, analysis.perplexity)
    order = np.argsort(np.square(means - vector).sum(axis=1), kind="stable")[:NEAREST]
    return Placed(
        system=runtime.name,
        checkpoint=runtime.checkpoint,
        each="clip",
        tsne=places[0].astype(np.float32),
        pca=((vector[0] - analysis.pca_centre) @ analysis.pca_axes.T).astype(np.float32),
        nearest=tuple(analysis.clips[row].id for row in order),
        seconds=time.perf_counter() - began,
    )


def place_tokens(runtime: "Runtime", result: Tokenized | Generation, analysis: StoredAnalysis) -> Placed:
    """Every token of a motion in the maps of tokens, coarse to fine."""
    from playground.probes import token_vectors

    began = time.perf_counter()
    _check(runtime, analysis)
    frames, ids = result.motion.frames, [level.ids[None] for level in result.levels]
    runtime.embedding(result.levels, frames, 0)
    vectors = np.concatenate([level[0] for level in token_vectors(runtime, ids, frames)])
    scores = (vectors.astype(np.float64) - analysis.token_centre) @ analysis.token_axes.T
    reference = analysis.token_scores.astype(np.float64)
    perplexity = max(1.0, min(analysis.perplexity, (len(reference) - 1) / 3))
    return Placed(
        system=runtime.name,
        checkpoint=runtime.checkpoint,
        each="token",
        tsne=place(reference, analysis.token_tsne.astype(np.float64), scores, perplexity).astype(np.float32),
        pca=scores[:, :2].astype(np.float32),
        nearest=(),
        seconds=time.perf_counter() - began,
    )


def place(reference: Floats, points: Floats, vectors: Floats, perplexity: float) -> Floats:
    """Places [m, 2] of new vectors [m, D] among the places [n, 2] of reference vectors [n, D].

    Only the 3 * perplexity nearest references attract, as in Barnes-Hut t-SNE; all repel.
    """
    squared = np.square(vectors).sum(axis=1)[:, None] + np.square(reference).sum(axis=1) - 2 * vectors @ reference.T
    near = np.argsort(squared, axis=1, kind="stable")[:, : max(int(3 * perplexity), 2)]
    weights = affinities(np.maximum(np.take_along_axis(squared, near, axis=1), 0.0), perplexity)
    return _settle(points, points[near], weights)


def affinities(squared: Floats, perplexity: float) -> Floats:
    """Gaussian affinities [m, k] for squared distances [m, k], rows sum to 1 and have the perplexity (at most k)."""
    gap = squared - squared.min(axis=1, keepdims=True)
    low, high = np.full(len(gap), -60.0), np.full(len(gap), 60.0)  # log2 of the precision, per mean distance
    unit = np.maximum(gap.mean(axis=1, keepdims=True), 1e-300)
    wanted = np.log(min(perplexity, gap.shape[1]))
    for _ in range(80):
        middle = (low + high) / 2
        chance = _softmax(-gap / unit * np.exp2(middle)[:, None])
        entropy = -(chance * np.log(np.maximum(chance, 1e-300))).sum(axis=1)
        wide = entropy > wanted
        low, high = np.where(wide, middle, low), np.where(wide, high, middle)
    return _softmax(-gap / unit * np.exp2((low + high) / 2)[:, None])


def costs(points: Floats, attracting: Floats, weights: Floats, at: Floats) -> Floats:
    """Kullback-Leibler divergence [m], up to a constant, of new points at `at` [m, 2] among fixed points [n, 2].

    attracting: places [m, k, 2] of those that attract each, with their weights [m, k].
    """
    pull = np.log1p(np.square(attracting - at[:, None]).sum(axis=-1)) * weights
    away = np.square(at).sum(axis=1)[:, None] + np.square(points).sum(axis=1) - 2 * at @ points.T
    return np.asarray(pull.sum(axis=1) + np.log((1.0 / (1.0 + away)).sum(axis=1)), np.float64)


def _settle(points: Floats, attracting: Floats, weights: Floats) -> Floats:
    """The places [m, 2] of least cost, by descent with a step that grows while it helps."""
    middle = (weights[..., None] * attracting).sum(axis=1)
    starts = [middle, *np.moveaxis(attracting[:, :_STARTS], 1, 0)]
    found = np.stack([costs(points, attracting, weights, start) for start in starts])
    rows = np.arange(len(weights))
    at, best, step = np.stack(starts)[found.argmin(axis=0), rows], found.min(axis=0), np.ones(len(weights))
    for _ in range(_STEPS):
        trial = at - step[:, None] * _gradient(points, attracting, weights, at)
        cost = costs(points, attracting, weights, trial)
        better = cost < best
        at, best = np.where(better[:, None], trial, at), np.where(better, cost, best)
        step *= np.where(better, 1.5, 0.5)
    return at


def _gradient(points: Floats, attracting: Floats, weights: Floats, at: Floats) -> Floats:
    """Derivative [m, 2] of `costs` by `at`."""
    to = at[:, None] - attracting
    pull = ((weights / (1.0 + np.square(to).sum(axis=-1)))[..., None] * to).sum(axis=1)
    away = np.square(at).sum(axis=1)[:, None] + np.square(points).sum(axis=1) - 2 * at @ points.T
    near = 1.0 / (1.0 + away)
    square = np.square(near)
    push = (square.sum(axis=1)[:, None] * at - square @ points) / near.sum(axis=1)[:, None]
    return np.asarray(2 * (pull - push), np.float64)


def _softmax(scores: Floats) -> Floats:
    chance = np.exp(scores - scores.max(axis=1, keepdims=True))
    return np.asarray(chance / chance.sum(axis=1, keepdims=True), np.float64)


def _check(runtime: "Runtime", analysis: StoredAnalysis) -> None:
    if analysis.checkpoint != runtime.checkpoint:
        raise PlaygroundError(
            f"the stored maps of {runtime.name} belong to another checkpoint; `python -m playground.analysis.store`"
            " makes them again"
        )
