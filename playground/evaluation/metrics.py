"""The metrics of text-to-motion, each a pure function of arrays (systems.md F2). numpy only, float64 inside.

Every function returns a float, or `Missing` with a sentence where the sample is too small to say anything. Embeddings
are rows of an evaluator (evaluators.py). What is drawn at random is drawn from the numpy Generator given.

MPJPE, foot sliding and bone drift of one motion stand in motion/measures.py; `average` pools them. Code usage and code
perplexity use analysis/usage.py. Prompts obeyed stands in prompts_obeyed.py.
"""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import ArrayLike, NDArray

from playground.analysis.usage import CodeUsage
from playground.errors import PlaygroundError

Floats = NDArray[np.float64]
PAIRS, FEW_PAIRS = 300, 100  # of Diversity: the usual number, and that of small sets
SAMPLE_PAIRS = 10  # of MultiModality, a text


@dataclass(frozen=True)
class Missing:
    """A metric that does not exist here, and why; one sentence."""

    why: str


Value = float | Missing


# ---- distributions of embeddings -------------------------------------------------------------------------------------


def fid(real: ArrayLike, made: ArrayLike) -> Value:
    """Frechet distance of two sets of embeddings [n, D] and [m, D], unbiased covariances (Heusel et al., 2017; F2).

    ||mu_r - mu_m||^2 + tr(S_r + S_m - 2 (S_r S_m)^(1/2)). The trace of the root is taken from the eigenvalues of
    S_r^(1/2) S_m S_r^(1/2), which exist for singular covariances too: where the published code adds 1e-6 to the
    diagonals because its root came out infinite, nothing has to be added here. Missing below 2 motions on a side.
    """
    first, second = _rows(real), _rows(made)
    _same_width(first, second)
    if min(len(first), len(second)) < 2:
        return Missing(f"FID needs at least 2 motions on each side, there are {len(first)} and {len(second)}")
    gap = first.mean(axis=0) - second.mean(axis=0)
    one, other = (np.atleast_2d(np.cov(rows, rowvar=False)) for rows in (first, second))
    values, vectors = np.linalg.eigh(one)
    root = (vectors * np.sqrt(np.clip(values, 0.0, None))) @ vectors.T  # (D, D)
    product = np.linalg.eigvalsh(root @ other @ root)
    overlap = np.sqrt(np.clip(product, 0.0, None)).sum()
    return float(max(gap @ gap + np.trace(one) + np.trace(other) - 2.0 * overlap, 0.0))


def diversity(motions: ArrayLike, rng: np.random.Generator, pairs: int | None = None) -> Value:
    """Mean Euclidean distance of random pairs of embeddings [n, D], each side drawn without replacement (F2).

    pairs: 300 by default, 100 where there are fewer motions. Missing where there are fewer motions than pairs.
    """
    rows = _rows(motions)
    count = pairs or (PAIRS if len(rows) >= PAIRS else FEW_PAIRS)
    if len(rows) < count:
        return Missing(f"Diversity draws {count} pairs without replacement, there are {len(rows)} motions")
    first = rng.choice(len(rows), count, replace=False)
    second = rng.choice(len(rows), count, replace=False)
    return float(np.linalg.norm(rows[first] - rows[second], axis=-1).mean())


def multimodality(motions: ArrayLike, rng: np.random.Generator, pairs: int = SAMPLE_PAIRS) -> Value:
    """Mean Euclidean distance of random pairs of motions made for one text; motions: embeddings [texts, samples, D].

    The same pairs of sample numbers are taken for every text, each side drawn without replacement (F2). Missing
    without a text or with fewer samples than pairs.
    """
    made = np.asarray(motions, np.float64)
    if made.ndim != 3 or not np.isfinite(made).all():
        raise PlaygroundError(f"MultiModality takes finite embeddings [texts, samples, D], got {list(made.shape)}")
    texts, samples = made.shape[:2]
    if not texts or samples < pairs:
        return Missing(f"MultiModality draws {pairs} pairs a text, there are {samples} motions for {texts} texts")
    first = rng.choice(samples, pairs, replace=False)
    second = rng.choice(samples, pairs, replace=False)
    return float(np.linalg.norm(made[:, first] - made[:, second], axis=-1).mean())


# ---- motion against text ---------------------------------------------------------------------------------------------


def r_precision(
    texts: ArrayLike,
    motions: ArrayLike,
    pool: int,
    top: int,
    rng: np.random.Generator,
    groups: Sequence[Hashable] | None = None,
) -> Value:
    """Share of texts that find their motion among the `top` nearest of a pool (Guo et al., 2022; F2).

    texts, motions: embeddings [n, D], row i belongs together. The items are shuffled and cut into pools of `pool`, the
    last partial pool is dropped; every text ranks the motions of its pool by Euclidean distance. groups None: only its
    own motion counts. groups, one a row (the caption string): any motion of the same group counts. Among motions at
    exactly the same distance the order is open: the chance of a hit over all orders counts, so that a collapsed
    embedding scores as guessing does. Missing where there is no whole pool. The same rng state gives the same pools.
    """
    words, moves = _pair(texts, motions)
    if groups is not None and len(groups) != len(words):
        raise PlaygroundError(f"R-Precision takes one group for each of {len(words)} texts, got {len(groups)}")
    if not 1 <= top <= pool:
        raise PlaygroundError(f"R-Precision takes a top of 1 to the size of the pool, {pool}; got {top}")
    if len(words) < pool:
        return Missing(f"R-Precision with a pool of {pool} needs as many captioned motions, there are {len(words)}")
    order = rng.permutation(len(words))
    hits = []
    for start in range(0, len(words) - pool + 1, pool):
        rows = order[start : start + pool]
        distance = np.linalg.norm(words[rows, None] - moves[None, rows], axis=-1)  # (pool texts, pool motions)
        for line in range(pool):
            right = np.arange(pool) == line
            if groups is not None:
                right = np.array([groups[row] == groups[rows[line]] for row in rows])
            hits.append(_chance(distance[line], right, top))
    return float(np.mean(hits))


def _chance(distance: Floats, right: NDArray[np.bool_], top: int) -> float:
    """Chance that one of the right motions is among the `top` nearest, all orders of equal distances alike."""
    nearest = distance[right].min()
    places = top - int((distance < nearest).sum())  # left for those at exactly that distance
    level = distance == nearest
    wrong, all_there = int((level & ~right).sum()), int(level.sum())
    places = min(max(places, 0), all_there)
    return 1.0 - comb(wrong, places) / comb(all_there, places)


def mm_dist(texts: ArrayLike, motions: ArrayLike) -> Value:
    """Mean Euclidean distance of every text to its own motion; embeddings [n, D] (F2)."""
    words, moves = _pair(texts, motions)
    if not len(words):
        return Missing("MM-Dist needs at least one captioned motion")
    return float(np.linalg.norm(words - moves, axis=-1).mean())


def clip_score(texts: ArrayLike, motions: ArrayLike) -> Value:
    """Mean cosine of every text and its own motion; embeddings [n, D] of a CLIP-style evaluator (F2).

    A vector of zeros has cosine 0 with everything.
    """
    words, moves = _pair(texts, motions)
    if not len(words):
        return Missing("the CLIP-style score needs at least one captioned motion")
    size = np.linalg.norm(words, axis=-1) * np.linalg.norm(moves, axis=-1)
    dots = (words * moves).sum(axis=-1)
    return float(np.divide(dots, size, out=np.zeros_like(dots), where=size > 0).mean())


# ---- tokens ----------------------------------------------------------------------------------------------------------


def code_usage(ids: Sequence[ArrayLike], codes: Sequence[int]) -> Value:
    """Share of the codes hit at least once, averaged over the scales; ids: integers of any shape a scale (F2)."""
    usage = CodeUsage().fit(ids, codes)
    return float(usage.used_.mean()) if usage.totals_.all() else Missing("code usage needs tokens of every scale")


def code_perplexity(ids: Sequence[ArrayLike], codes: Sequence[int]) -> Value:
    """exp(-sum p ln(p + 1e-7)), p the code frequencies of a scale, averaged over the scales; arguments as above."""
    usage = CodeUsage().fit(ids, codes)
    return float(usage.perplexity_.mean()) if usage.totals_.all() else Missing("perplexity needs tokens of every scale")


def model_perplexity_nll(log_likelihoods: Sequence[ArrayLike]) -> Value:
    """Reading (a) of F2: exp(-mean ln p) of the true tokens of a scale, teacher-forced, averaged over the scales.

    log_likelihoods: ln p of every true token, an array of any shape a scale; impossible tokens (-inf) give inf.
    """
    scales = [np.asarray(values, np.float64) for values in log_likelihoods]
    if not scales or not all(values.size for values in scales):
        return Missing("model perplexity needs the likelihood of at least one token of every scale")
    if any(np.isnan(values).any() or (values > 0).any() for values in scales):
        raise PlaygroundError("log-likelihoods are numbers of at most 0")
    return float(np.mean([np.exp(-values.mean()) for values in scales]))


def model_perplexity_argmax(predictions: Sequence[ArrayLike], codes: Sequence[int]) -> Value:
    """Reading (b) of F2: exp(entropy) of the histogram of arg-max predictions a scale, averaged over the scales.

    What the released code of LG-Tok calls perplexity; predictions: code ids, an array of any shape a scale.
    """
    return code_perplexity(predictions, codes)


# ---- pooling ---------------------------------------------------------------------------------------------------------


def average(values: ArrayLike, weights: ArrayLike | None = None, what: str = "the mean") -> Value:
    """Mean of what was measured on every motion, weighted if asked; nan (nothing to measure there) is left out."""
    numbers = np.asarray(values, np.float64).ravel()
    weight = np.ones_like(numbers) if weights is None else np.asarray(weights, np.float64).ravel()
    if len(weight) != len(numbers):
        raise PlaygroundError(f"a mean takes one weight for each of {len(numbers)} values, got {len(weight)}")
    there = ~np.isnan(numbers) & (weight > 0)
    if not there.any():
        return Missing(f"{what} cannot be measured on any of {len(numbers)} motions")
    return float(np.average(numbers[there], weights=weight[there]))


# ---- inside ----------------------------------------------------------------------------------------------------------


def _rows(values: ArrayLike) -> Floats:
    rows = np.asarray(values, np.float64)
    if rows.ndim != 2 or not np.isfinite(rows).all():
        raise PlaygroundError(f"embeddings are finite numbers of shape [motions, D], got {list(rows.shape)}")
    return rows


def _same_width(first: Floats, second: Floats) -> None:
    if first.shape[1] != second.shape[1]:
        raise PlaygroundError(f"embeddings of one width are compared, got {first.shape[1]} and {second.shape[1]}")


def _pair(texts: ArrayLike, motions: ArrayLike) -> tuple[Floats, Floats]:
    words, moves = _rows(texts), _rows(motions)
    _same_width(words, moves)
    if len(words) != len(moves):
        raise PlaygroundError(f"every text has its motion, got {len(words)} texts and {len(moves)} motions")
    return words, moves
