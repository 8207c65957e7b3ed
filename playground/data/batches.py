"""Library -> training batches: weighted clips, windows, mirroring, speed changes, length buckets.

A batch is a pure function of (seed, step): nothing is remembered between steps, so a run that is resumed at step k sees
the same batches as one that never stopped, and every process of a distributed run takes its slice of one global batch.
Two halves: `draw` decides with a few arrays of random numbers what to cut, `fill` cuts it, all motions at once, on the
device of the model, where the rows of all clips lie. So a batch costs a few milliseconds on any machine.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from playground.data.library import Library
from playground.limits import LIMITS
from playground.motion.representation import Normaliser, mirror_features67, to_features67
from playground.nn.transfer import on_device
from playground.text.prompts import mirror_caption

if TYPE_CHECKING:
    from playground.motion.synthetic import Synthetic

SLOWEST, FASTEST = 0.8, 1.25  # range of the speed changes


@dataclass(frozen=True)
class Sample:
    """One clip that can be drawn. features: un-normalised rows [F, 67]."""

    features: NDArray[np.float32]
    captions: tuple[str, ...]
    source: str
    action: str


@dataclass(frozen=True)
class BatchConfig:
    """How clips are drawn and cut."""

    size: int = 32  # motions a batch, over all processes
    unit: int = 4  # window lengths are multiples of it (A2)
    shortest: int = 64  # shortest random window, rows; shorter clips are taken whole
    whole: float = 0.5  # share of windows that take the longest length possible; the rest draw a random length
    shorter: float = 1 / 3  # of the whole ones, share that is one unit shorter (A2's coin)
    mirror: float = 0.5  # share of mirrored motions
    speed: float = 0.0  # share of motions played at 0.8 to 1.25 times their speed
    source_balance: float = 0.5  # 0: by number of clips; 1: every source equally often
    action_balance: float = 0.5  # the same for the actions inside a source
    bucket: int = 8  # batches drawn together and sorted by length


@dataclass(frozen=True, eq=False)
class Cuts:
    """Windows that are decided and not cut yet, one a motion, arrays [n]."""

    sample: NDArray[np.int64]  # which sample
    caption: NDArray[np.int64]  # which of its captions
    speed: NDArray[np.float64]  # how fast it is played
    start: NDArray[np.int64]  # first row, counted after the change of speed
    rows: NDArray[np.int64]  # length of the window
    mirrored: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.sample)

    def take(self, which: NDArray[np.int64] | slice) -> "Cuts":
        """Some of them."""
        return Cuts(
            self.sample[which],
            self.caption[which],
            self.speed[which],
            self.start[which],
            self.rows[which],
            self.mirrored[which],
        )


@dataclass(frozen=True, eq=False)
class Batch:
    """features float32 [B, F, 67] normalised, zero beyond each length; lengths int64 [B]; one caption a motion.

    mean_frames: real frames of the whole batch divided by the number of processes, so that sums over it, averaged over
    processes, are means over the whole batch.
    """

    features: Tensor
    lengths: Tensor
    captions: list[str]
    sources: list[str]
    mean_frames: float


def library_samples(library: Library, split: str) -> list[Sample]:
    """Every clip of a split of a library."""
    clips = library.clips
    return [
        Sample(library.features(i), clips[i].captions, clips[i].source, clips[i].action) for i in library.split(split)
    ]


def synthetic_samples(corpus: Sequence["Synthetic"]) -> list[Sample]:
    """The parametric corpus as samples of the source `Synthetic`."""
    return [
        Sample(to_features67(item.motion.joints), tuple(item.captions), "Synthetic", item.action) for item in corpus
    ]


def sample_weights(samples: Sequence[Sample], config: BatchConfig) -> NDArray[np.float64]:
    """Probability [n] of each sample: counts of sources and of actions inside a source, raised to 1 - balance."""
    sources = Counter(s.source for s in samples)
    actions = Counter((s.source, s.action) for s in samples)
    inside = Counter[str]()
    for (source, _), count in actions.items():
        inside[source] += count ** (1 - config.action_balance)
    weights = [
        sources[s.source] ** (1 - config.source_balance)
        * actions[s.source, s.action] ** (-config.action_balance)
        / inside[s.source]
        for s in samples
    ]
    array = np.asarray(weights, np.float64)
    return array / array.sum()


class BatchSource:
    """Draws batches from samples; holds no state of a draw. The rows of all samples lie on `device`."""

    def __init__(
        self,
        samples: Sequence[Sample],
        normaliser: Normaliser,
        config: BatchConfig,
        seed: int,
        device: torch.device | str = "cpu",
    ) -> None:
        self.samples = [s for s in samples if len(s.features) >= config.unit]
        self.normaliser = normaliser
        self.config = config
        self.seed = seed
        self.device = torch.device(device)
        self.weights = sample_weights(self.samples, config)
        self._lengths = np.array([len(s.features) for s in self.samples], np.int64)
        self._starts = np.cumsum(self._lengths) - self._lengths
        self._rows = torch.from_numpy(np.concatenate([s.features for s in self.samples])).to(self.device)
        numbered = mirror_features67(np.arange(1.0, self._rows.shape[1] + 1)[None])[0]  # the mirror, column by column
        self._twin = torch.from_numpy(np.abs(numbered).astype(np.int64) - 1).to(self.device)
        self._sign = torch.from_numpy(np.sign(numbered).astype(np.float32)).to(self.device)
        self._mean = torch.from_numpy(normaliser.mean).to(self.device)
        self._std = torch.from_numpy(normaliser.std).to(self.device)

    def captions(self) -> list[str]:
        """Every caption a batch can hold, mirrored ones included."""
        texts = {c for s in self.samples for c in s.captions}
        return sorted(texts | {mirror_caption(t) for t in texts})

    def batch(self, step: int, rank: int = 0, world: int = 1) -> Batch:
        """The slice of global batch number `step` that belongs to process `rank` of `world`."""
        c = self.config
        block, place = divmod(step, c.bucket)
        rng = np.random.default_rng([self.seed, block])
        chosen = rng.choice(len(self.samples), size=c.size * c.bucket, p=self.weights)
        cuts = self.draw(chosen, rng)
        by_length = np.argsort(cuts.rows, kind="stable")
        first = int(rng.permutation(c.bucket)[place]) * c.size
        whole = cuts.take(by_length[first : first + c.size])
        return self.fill(whole.take(slice(rank, None, world)), int(whole.rows.max()), float(whole.rows.sum()) / world)

    def draw(self, chosen: NDArray[np.int64], rng: np.random.Generator) -> Cuts:
        """A random window of each of the samples chosen (numbers [n]): caption, speed, place, length, mirror."""
        c, unit = self.config, self.config.unit
        coin = rng.random((8, len(chosen)))
        lengths = self._lengths[chosen]
        speed = np.where(coin[0] < c.speed, SLOWEST + (FASTEST - SLOWEST) * coin[1], 1.0)
        after = np.maximum(((lengths - 1) / speed).astype(np.int64) + 1, 2)
        speed = np.where(after < unit, 1.0, speed)  # too short to be played faster
        after = np.where(speed == 1.0, lengths, after)
        longest = np.minimum(after, LIMITS.max_frames) // unit * unit
        shorter = np.where(coin[3] < c.shorter, np.maximum(longest - unit, unit), longest)
        least = max(c.shortest // unit, 1)
        units = np.maximum(longest // unit - least + 1, 1)  # how many lengths a random window can have
        random = np.where(longest > c.shortest, (least + (coin[4] * units).astype(np.int64)) * unit, longest)
        rows = np.where(coin[2] < c.whole, shorter, random)
        start = (coin[5] * (after - rows + 1)).astype(np.int64)
        counts = np.array([max(len(self.samples[i].captions), 1) for i in chosen])
        return Cuts(chosen, (coin[6] * counts).astype(np.int64), speed, start, rows, coin[7] < c.mirror)

    def fill(self, cuts: Cuts, longest: int | None = None, mean_frames: float | None = None) -> Batch:
        """The windows as one normalised batch, padded on the right to `longest` rows (that of the windows by default).

        Played `speed` times as fast means interpolated linearly, with the increments of the first columns scaled.
        """
        longest = longest or int(cuts.rows.max())

        def column(values: NDArray[np.generic]) -> Tensor:
            return on_device(values, self.device)[:, None]

        speed, rows, last = column(cuts.speed), column(cuts.rows), column(self._lengths[cuts.sample] - 1)
        steps = torch.arange(longest, device=self.device)[None]
        at = torch.minimum((column(cuts.start) + steps) * speed, last)  # (B, F), float64
        low = torch.minimum(at.long(), (last - 1).clamp(min=0))
        share = (at - low)[..., None].float()
        base = column(self._starts[cuts.sample])
        features = torch.lerp(self._rows[base + low], self._rows[base + torch.minimum(low + 1, last)], share)
        features[..., :3] *= speed[..., None].float()
        turned = features[..., self._twin] * self._sign
        features = torch.where(column(cuts.mirrored)[..., None], turned, features)
        features = (features - self._mean) / self._std * (steps < rows)[..., None]
        frames = float(cuts.rows.sum()) if mean_frames is None else mean_frames
        captions = [self._caption(*drawn) for drawn in zip(cuts.sample, cuts.caption, cuts.mirrored, strict=True)]
        return Batch(features, rows[:, 0], captions, [self.samples[i].source for i in cuts.sample], frames)

    def _caption(self, sample: int, which: int, mirrored: bool) -> str:
        captions = self.samples[sample].captions
        if not captions:
            return ""
        return _mirrored(captions[which]) if mirrored else captions[which]


_mirrored = lru_cache(maxsize=65_536)(mirror_caption)


def whole_batches(samples: Sequence[Sample], normaliser: Normaliser, size: int, unit: int = 4) -> list[Batch]:
    """Every sample once, first caption, floored to the unit and cut to the longest length, sorted by length."""
    source = BatchSource(samples, normaliser, BatchConfig(unit=unit), seed=0)
    lengths = np.array([len(s.features) for s in source.samples], np.int64)
    order = np.argsort(lengths, kind="stable")
    zeros = np.zeros(len(order), np.int64)
    rows = np.minimum(lengths, LIMITS.max_frames)[order] // unit * unit
    cuts = Cuts(order, zeros, np.ones(len(order)), zeros, rows, zeros.astype(np.bool_))
    return [source.fill(cuts.take(slice(start, start + size))) for start in range(0, len(order), size)]
