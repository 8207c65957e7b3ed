"""Means over the frames of many clips, and the difference of two systems on the same clips."""

import numpy as np
from numpy.typing import ArrayLike

from playground.errors import PlaygroundError


def weighted(values: ArrayLike, weights: ArrayLike) -> tuple[float, float]:
    """Mean of one value a clip, weighted by its frames, and half its 95 % interval over clips; [n], [n].

    The interval is 1.96 standard errors of the ratio of two sums (first order), so it is that of the weighted mean.
    PlaygroundError without a clip, for other shapes, and for weights that are not above 0.
    """
    x, w = np.asarray(values, np.float64), np.asarray(weights, np.float64)
    if x.ndim != 1 or x.shape != w.shape or not x.size or not (w > 0).all():
        raise PlaygroundError("a mean over clips needs as many values as weights above 0, and one clip at least")
    mean = float((x * w).sum() / w.sum())
    parts = w / w.mean() * (x - mean)
    return mean, float(1.96 * np.sqrt((parts**2).mean() / x.size))


def difference(first: str, second: str, frames: str) -> tuple[float, float]:
    """`second` minus `first`, words with one value a clip, as `weighted` has it: every clip is compared with itself.

    PlaygroundError unless all three hold as many numbers.
    """
    try:
        a, b, w = (np.array([float(word) for word in words.split()]) for words in (first, second, frames))
    except ValueError as error:
        raise PlaygroundError("the values of clips are no numbers") from error
    if a.shape != b.shape:
        raise PlaygroundError(f"{a.size} clips cannot be compared with {b.size}")
    return weighted(b - a, w)
