"""How evenly a tokenizer uses its codes (systems.md F2: codebook usage, code perplexity; Fig 7 of LG-Tok)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from playground.errors import PlaygroundError


class CodeUsage:
    """Code frequencies of every scale.

    After `fit`:
        counts_      list of int64 [V_n], how often each code of scale n was used
        totals_      int64 [N], tokens counted at each scale
        used_        float64 [N], share of the scale's codes used at least once
        used_all_    float, share of all codes of all scales used at least once
        perplexity_  float64 [N], exp(-sum p ln(p + 1e-7)), p the frequencies (F2); nan where nothing was counted
        dead_        list of int64 arrays, the codes never used
    """

    counts_: list[NDArray[np.int64]]
    totals_: NDArray[np.int64]
    used_: NDArray[np.float64]
    used_all_: float
    perplexity_: NDArray[np.float64]
    dead_: list[NDArray[np.int64]]

    def fit(self, ids_per_scale: Sequence[ArrayLike], codes: Sequence[int]) -> "CodeUsage":
        """Count. ids_per_scale: one integer array of any shape a scale; codes: codebook size V_n a scale.

        PlaygroundError if the two differ in length, ids are not integers or lie outside 0..V_n - 1.
        """
        if len(ids_per_scale) != len(codes) or not len(codes):
            raise PlaygroundError(
                f"code usage needs ids and a codebook size for every scale, got {len(ids_per_scale)} and {len(codes)}"
            )
        pairs = zip(ids_per_scale, codes, strict=True)
        return self.fit_counts([_count(ids, size, scale) for scale, (ids, size) in enumerate(pairs, start=1)])

    def fit_counts(self, counts: Sequence[ArrayLike]) -> "CodeUsage":
        """The same from counts that are already there, one array [V_n] a scale."""
        self.counts_ = [np.asarray(count, np.int64) for count in counts]
        if not self.counts_ or any(count.ndim != 1 or not len(count) or count.min() < 0 for count in self.counts_):
            raise PlaygroundError("code counts need one row of numbers of at least 0 for every scale")
        self.totals_ = np.array([count.sum() for count in self.counts_], np.int64)
        self.dead_ = [np.flatnonzero(count == 0) for count in self.counts_]
        self.used_ = np.array([np.mean(count > 0) for count in self.counts_])
        self.used_all_ = float(np.mean(np.concatenate(self.counts_) > 0))
        self.perplexity_ = np.array([perplexity(count) for count in self.counts_])
        return self

    @property
    def codes_(self) -> list[int]:
        """Codebook size V_n of every scale."""
        return [len(count) for count in self.counts_]

    def coverage(self, k: int) -> NDArray[np.float64]:
        """[N] share of the tokens of each scale that its k most used codes make up; nan where nothing was counted."""
        if k < 0:
            raise PlaygroundError(f"coverage counts the k most used codes, k of at least 0; got {k}")
        largest = [np.sort(count)[::-1][:k].sum() for count in self.counts_]
        return np.array([top / total if total else np.nan for top, total in zip(largest, self.totals_, strict=True)])

    def relative(self, scale: int, order: str = "sorted") -> NDArray[np.float64]:
        """[V_n] frequency of every code of one scale (0-based) times V_n, so that 1 is even use.

        order: "sorted" from the most used down, or "index" by code id. Zeros where nothing was counted.
        """
        if order not in ("sorted", "index"):
            raise PlaygroundError(f"codes are ordered 'sorted' or 'index', not {order!r}")
        count = self.counts_[scale]
        share = count * (len(count) / max(int(self.totals_[scale]), 1))
        return np.asarray(np.sort(share)[::-1] if order == "sorted" else share, np.float64)


def perplexity(counts: ArrayLike) -> float:
    """exp(-sum p ln(p + 1e-7)) of the frequencies p behind some counts; nan if all are 0. F2."""
    count = np.asarray(counts, np.float64)
    if not count.sum():
        return float("nan")
    p = count / count.sum()
    return float(np.exp(-np.sum(p * np.log(p + 1e-7))))


def _count(ids: ArrayLike, size: int, scale: int) -> NDArray[np.int64]:
    """Histogram int64 [size] of the ids of one scale."""
    flat = np.asarray(ids).ravel()
    if not flat.size:
        return np.zeros(size, np.int64)
    if not np.issubdtype(flat.dtype, np.integer):
        raise PlaygroundError(f"token ids are whole numbers; scale {scale} holds {flat.dtype} values")
    if flat.min() < 0 or flat.max() >= size:
        raise PlaygroundError(f"token ids of scale {scale} lie in 0 to {size - 1}; got {flat.min()} to {flat.max()}")
    return np.bincount(flat, minlength=size).astype(np.int64)


def expected_used(total: int, codes: int) -> float:
    """Share of a codebook that `total` tokens reach on average if every code is as likely as any other."""
    return 1.0 - (1.0 - 1.0 / codes) ** int(total)
