"""Long takes cut where the body is nearly still, as SnapMoGen's recordings were (arXiv 2507.09122; systems.md E2).

Mean speed of hip and end effectors, smoothed; its local minima; each becomes a cut with a chance that falls with its
speed; then no part is shorter than 4 s or longer than 12 s. The paper does not print the chance: 1 - v_i is used, v_i
the speed of minimum i on the scale from the stillest minimum of the take (0) to the fastest (1).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import find_peaks

from playground.motion.skeleton import HUMAN22

SHORTEST, LONGEST = 4.0, 12.0  # seconds of a part
SMOOTHING = 0.25  # seconds, standard deviation of the Gaussian
NOTICED = 1e-3  # m/s by which a minimum lies below its surroundings; less is rounding
MEASURED = (0, *(HUMAN22.index(name) for name in ("head", "l_wrist", "r_wrist", "l_foot", "r_foot")))


@dataclass(frozen=True, eq=False)
class Segmentation:
    """The speed curve of a take, its minima and the cuts."""

    fps: float
    speed: NDArray[np.float64]  # [F] m/s, smoothed
    minima: NDArray[np.int64]  # frames, in order
    chance: NDArray[np.float64]  # of each minimum to become a cut, 0..1
    cuts: NDArray[np.int64]  # frames at which a new part begins, in order
    forced: NDArray[np.bool_]  # [cuts] made only because a part was too long

    @property
    def spans(self) -> list[tuple[int, int]]:
        """First frame and frame after the last of every part; together they are the whole take."""
        edges = [0, *self.cuts.tolist(), len(self.speed)]
        return list(zip(edges, edges[1:], strict=False))


def mean_speed(joints: NDArray[np.floating], fps: float) -> NDArray[np.float64]:
    """Mean speed [F] in m/s of hip, head, wrists and feet; joints [F, 22, 3] in metres, at least two frames."""
    velocity = np.gradient(joints[:, list(MEASURED)].astype(np.float64), axis=0) * fps
    mean: NDArray[np.float64] = np.linalg.norm(velocity, axis=-1).mean(axis=1)
    return gaussian_filter1d(mean, SMOOTHING * fps, mode="nearest")


def segment(
    joints: NDArray[np.floating],
    fps: float,
    seed: int = 0,
    shortest: float = SHORTEST,
    longest: float = LONGEST,
) -> Segmentation:
    """Cut a take, joints [F, 22, 3] in metres, into parts of `shortest` to `longest` seconds.

    Drawn with `seed`, the stillest first. A take below 2 `shortest` stays whole where `longest` allows it. ValueError
    for fewer than two frames, or limits between which nothing fits (`longest` must be at least 2 `shortest`).
    """
    least, most = int(np.ceil(shortest * fps)), int(longest * fps)
    if len(joints) < 2 or not 0 < 2 * least <= most:
        raise ValueError("a take needs 2 frames, and the longest part twice the frames of the shortest")
    speed = mean_speed(joints, fps)
    minima = find_peaks(-speed, prominence=NOTICED)[0].astype(np.int64)
    chance = 1.0 - _shares(speed[minima])
    drawn = np.random.default_rng(seed).random(len(minima)) < chance
    cuts: list[int] = []
    for frame in sorted(minima[drawn].tolist(), key=lambda f: (speed[f], f)):
        if all(abs(frame - edge) >= least for edge in (0, len(speed), *cuts)):
            cuts.append(frame)
    free = set(cuts)
    _shorten([0, *sorted(cuts), len(speed)], speed, minima, least, most, free)
    ordered = np.array(sorted(free), np.int64)
    return Segmentation(fps, speed, minima, chance, ordered, ~np.isin(ordered, cuts))


def _shares(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values on the scale from the smallest (0) to the largest (1); all 0 where they are equal."""
    span = float(np.ptp(values)) if len(values) else 0.0
    return (values - values.min()) / span if span > 1e-9 else np.zeros(len(values))


def _shorten(
    edges: list[int], speed: NDArray[np.float64], minima: NDArray[np.int64], least: int, most: int, found: set[int]
) -> None:
    """Add cuts to `found` until no part exceeds `most`: at the stillest minimum inside, else at the stillest frame."""
    waiting = list(zip(edges, edges[1:], strict=False))
    while waiting:
        start, stop = waiting.pop()
        if stop - start <= most:
            continue
        low, high = start + least, stop - least
        inside = minima[(minima >= low) & (minima <= high)]
        frames = inside if len(inside) else np.arange(low, high + 1)
        cut = int(frames[np.argmin(speed[frames])])
        found.add(cut)
        waiting += [(start, cut), (cut, stop)]
