"""Motions as points of a plane: t-SNE and PCA of dequantized embeddings (systems.md G1 Fig 6, I9)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.decomposition import PCA
from sklearn.manifold import TSNE
from sklearn.neighbors import NearestNeighbors
from threadpoolctl import threadpool_limits

from playground.errors import PlaygroundError

METHODS = ("tsne", "pca")
PERPLEXITY = 30.0  # systems.md I9


def motion_means(embeddings: Iterable[ArrayLike]) -> NDArray[np.float64]:
    """One vector a motion: the mean of its dequantized embedding z_hat [T, D] over the latents. Returns [n, D]. I9."""
    means = [np.asarray(embedding, np.float64).mean(axis=0) for embedding in embeddings]
    return np.stack(means) if means else np.zeros((0, 0))


class EmbeddingMap:
    """Places n vectors in the plane.

    After `fit`:
        points_      float64 [n, 2]
        method_      "tsne" or "pca"
        seed_        the seed used
        perplexity_  of t-SNE, min(30, (n - 1) / 3) and at least 1; nan for PCA
        explained_   float64 [2], share of the variance along the two axes; nan for t-SNE
        centre_      float64 [D] and
        axes_        float64 [2, D] of PCA, points_ = (embeddings - centre_) @ axes_.T; zeros for t-SNE
    """

    points_: NDArray[np.float64]
    method_: str
    seed_: int
    perplexity_: float
    explained_: NDArray[np.float64]
    centre_: NDArray[np.float64]
    axes_: NDArray[np.float64]

    def __init__(self, perplexity: float = PERPLEXITY) -> None:
        self.perplexity = perplexity

    def fit(self, embeddings: ArrayLike, method: str = "tsne", seed: int = 0) -> "EmbeddingMap":
        """embeddings: [n, D], n >= 1, finite. The same seed gives the same points on one machine.

        t-SNE (scikit-learn: Barnes-Hut, learning rate "auto", one thread, random_state = seed) starts from PCA; in it
        who is near whom means something, distances between groups do not. Vectors that are all equal go to the origin.
        PlaygroundError for an unknown method, an empty set, or values that are not finite.
        """
        if method not in METHODS:
            raise PlaygroundError(f"unknown map {method!r}; accepted: {', '.join(METHODS)}")
        rows = np.asarray(embeddings, np.float64)
        if rows.ndim != 2 or not rows.size:
            raise PlaygroundError(f"a map needs at least one vector, as an array [n, D]; got {list(rows.shape)}")
        if not np.isfinite(rows).all():
            raise PlaygroundError("the embeddings hold values that are not finite; every value must be finite")
        self.method_, self.seed_ = method, seed
        self.perplexity_, self.explained_ = float("nan"), np.full(2, np.nan)
        self.points_ = np.zeros((len(rows), 2))
        self.centre_, self.axes_ = rows.mean(axis=0), np.zeros((2, rows.shape[1]))
        if method == "tsne":
            self.perplexity_ = max(1.0, min(self.perplexity, (len(rows) - 1) / 3))
        size = float(np.abs(rows).max()) or 1.0  # the largest value becomes 1, so that no square overflows
        rows = rows / size
        if np.ptp(rows, axis=0).any():
            with threadpool_limits(limits=1):
                self.points_ = self._tsne(rows) if method == "tsne" else self._pca(rows) * size
        return self

    def _pca(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Scores [n, 2] on the two main axes; a second column of zeros where there is only one."""
        main = main_axes(rows)
        self.explained_, self.axes_ = main.explained, main.axes
        return main.scores

    def _tsne(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """t-SNE of rows of which at least two differ; it starts from PCA with a spread of 1e-4 along the first axis."""
        start = main_axes(rows).scores
        start = (start / start[:, 0].std() * 1e-4).astype(np.float32)
        model = TSNE(perplexity=self.perplexity_, init=start, learning_rate="auto", random_state=self.seed_, n_jobs=1)
        return np.asarray(model.fit_transform(rows), np.float64)


@dataclass(frozen=True, eq=False)
class MainAxes:
    """PCA of n vectors: scores = (rows - centre) @ axes.T."""

    scores: NDArray[np.float64]  # [n, k]
    explained: NDArray[np.float64]  # [k] share of the variance along each axis
    centre: NDArray[np.float64]  # [D]
    axes: NDArray[np.float64]  # [k, D]


def main_axes(rows: NDArray[np.float64], count: int = 2) -> MainAxes:
    """PCA of rows [n, D] along the `count` main axes; zeros for an axis that is not there."""
    kept = min(count, *rows.shape)
    model = PCA(n_components=kept, svd_solver="full")
    scores, explained, axes = np.zeros((len(rows), count)), np.zeros(count), np.zeros((count, rows.shape[1]))
    scores[:, :kept] = model.fit_transform(rows)
    explained[:kept] = np.nan_to_num(model.explained_variance_ratio_)
    axes[:kept] = model.components_
    return MainAxes(scores, explained, model.mean_, axes)


def neighbour_agreement(embeddings: ArrayLike, labels: Sequence[str], k: int = 10) -> tuple[float, float]:
    """How well groups hold together in the full space: (agreement, chance).

    agreement: mean over vectors of the share of their k nearest others (Euclidean, [n, D]) with the same label; chance:
    what shuffled labels give on average. k is cut to n - 1; both nan if n < 2. A picture of t-SNE can flatter or hide
    groups; this number cannot.
    """
    groups = agreement_by_label(embeddings, labels, k)
    n = sum(group.count for group in groups)
    if n < 2:
        return float("nan"), float("nan")
    return (
        sum(group.count * group.agreement for group in groups) / n,
        sum(group.count * group.chance for group in groups) / n,
    )


@dataclass(frozen=True)
class LabelAgreement:
    """How well the vectors of one label hold together."""

    label: str
    count: int
    agreement: float  # mean share of a vector's nearest others that have its label
    chance: float  # the same for shuffled labels


def agreement_by_label(embeddings: ArrayLike, labels: Sequence[str], k: int = 10) -> list[LabelAgreement]:
    """`neighbour_agreement` for the vectors of each label, the most frequent label first; nan where n < 2."""
    rows, names = np.asarray(embeddings, np.float64), np.asarray(labels)
    if rows.ndim != 2 or len(rows) != len(names):
        raise PlaygroundError(f"one label a vector is needed, got {len(names)} labels for {list(rows.shape)}")
    n = len(rows)
    if n < 2:
        return [LabelAgreement(str(name), 1, float("nan"), float("nan")) for name in names]
    search = NearestNeighbors(n_neighbors=min(k, n - 1)).fit(rows)
    same = (names[search.kneighbors(return_distance=False)] == names[:, None]).mean(axis=1)  # [n], others only
    found = [(str(name), names == name) for name in np.unique(names)]
    groups = [LabelAgreement(m, int(w.sum()), float(same[w].mean()), float((w.sum() - 1) / (n - 1))) for m, w in found]
    return sorted(groups, key=lambda group: (-group.count, group.label))
