"""Curves over time for the synthetic corpus: minimum-jerk easing, keyed tracks, slow seeded variation. numpy only."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.floating]


def ease(u: ArrayLike) -> Array:
    """Minimum-jerk step (Flash and Hogan 1985): 0 for u <= 0, 1 for u >= 1, smooth in between."""
    u = np.clip(np.asarray(u, np.float64), 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def keyed(t: Array, keys: Sequence[tuple[float, ArrayLike]]) -> Array:
    """Track [F, ...] through (time, value) keys in order of time, minimum-jerk between neighbours, held outside."""
    value = np.asarray(keys[0][1], np.float64)
    out = np.broadcast_to(value, t.shape + value.shape).copy()
    for (start, old), (stop, new) in zip(keys, keys[1:], strict=False):
        share = ease((t - start) / max(stop - start, 1e-6)).reshape(t.shape + (1,) * value.ndim)
        out += share * (np.asarray(new, np.float64) - np.asarray(old, np.float64))
    return out


def hermite(u: Array, start: ArrayLike, stop: ArrayLike, slope: ArrayLike, end_slope: ArrayLike = 0.0) -> Array:
    """Cubic from `start` to `stop` over u in 0..1 with the given slopes per unit of u."""
    u = np.clip(u, 0.0, 1.0)
    rise = u * u * (3.0 - 2.0 * u)
    return np.asarray(
        np.asarray(start) * (1.0 - rise) + np.asarray(stop) * rise
        + np.asarray(slope) * u * (1.0 - u) ** 2 + np.asarray(end_slope) * u * u * (u - 1.0)
    )  # fmt: skip


def window(t: Array, start: float, stop: float, fade: float) -> Array:
    """[F] 1 between start + fade and stop - fade, 0 outside start..stop, minimum-jerk flanks."""
    return ease((t - start) / fade) * ease((stop - t) / fade)


def wobble(t: Array, rng: np.random.Generator, size: float, columns: int = 1, slowest: float = 6.0) -> Array:
    """Slow natural variation [F, columns] of about `size`: three sines, periods slowest/4..slowest, free phases."""
    period = slowest / rng.uniform(1.0, 4.0, (3, columns))
    phase = rng.uniform(0.0, 2.0 * np.pi, (3, columns))
    weight = rng.uniform(0.3, 1.0, (3, columns))
    waves = np.sin(2.0 * np.pi * t[:, None, None] / period + phase) * weight
    return size * waves.sum(axis=1) / 1.2


def smooth(x: Array, sigma: float) -> Array:
    """Gaussian filter along the first axis, edge values repeated; sigma in frames."""
    radius = max(int(3.0 * sigma + 0.5), 1)
    kernel = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    kernel /= kernel.sum()
    padded = np.concatenate([np.repeat(x[:1], radius, axis=0), x, np.repeat(x[-1:], radius, axis=0)])
    return np.asarray(sum(w * padded[i : i + len(x)] for i, w in enumerate(kernel)))


def dilate(x: Array, radius: int) -> Array:
    """Largest value within `radius` frames, along the first axis, edge values repeated."""
    padded = np.concatenate([np.repeat(x[:1], radius, axis=0), x, np.repeat(x[-1:], radius, axis=0)])
    return np.asarray(np.max([padded[i : i + len(x)] for i in range(2 * radius + 1)], axis=0))
