"""Library -> training batches: weighted clips, windows, mirroring, speed changes, length buckets.

A batch is a pure function of (seed, step): nothing is remembered between steps, so a run that is resumed at step k sees
the same batches as one that never stopped, and every process of a distributed run takes its slice of one global batch.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from playground.data.library import Library
from playground.limits import LIMITS
from playground.motion.representation import Normaliser, mirror_features67, to_features67
from playground.text.prompts import mirror_caption

if TYPE_CHECKING:
    from playground.motion.synthetic import Synthetic


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
class Batch:
    """features float32 [B, F, 67] normalised, zero beyond each length; lengths int64 [B]; one caption a motion.

    mean_frames: real frames of the whole batch divided by the number of processes, so that sums over it, averaged over
    processes, are means over the whole batch.
    """

    features: NDArray[np.float32]
    lengths: NDArray[np.int64]
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


def change_speed(features: NDArray[np.float32], factor: float) -> NDArray[np.float32]:
    """Rows [F, 67] of the same motion played `factor` times as fast: interpolated, increments scaled."""
    rows = max(int((len(features) - 1) / factor) + 1, 2)
    at = np.minimum(np.arange(rows) * factor, len(features) - 1)
    low = np.minimum(at.astype(np.int64), len(features) - 2) if len(features) > 1 else np.zeros(rows, np.int64)
    share = (at - low)[:, None].astype(np.float32)
    high = np.minimum(low + 1, len(features) - 1)
    out = features[low] * (1 - share) + features[high] * share
    out[:, :3] *= factor
    return out.astype(np.float32)


def window(rows: int, config: BatchConfig, rng: np.random.Generator) -> tuple[int, int]:
    """Start and length of a random window of a clip of `rows` rows; the length is a multiple of the unit."""
    longest = min(rows, LIMITS.max_frames) // config.unit * config.unit
    length = longest
    if rng.random() < config.whole:
        if rng.random() < config.shorter:
            length = max(longest - config.unit, config.unit)
    elif longest > config.shortest:
        length = int(rng.integers(config.shortest // config.unit, longest // config.unit + 1)) * config.unit
    return int(rng.integers(0, rows - length + 1)), length


class BatchSource:
    """Draws batches from samples; holds no state of a draw."""

    def __init__(self, samples: Sequence[Sample], normaliser: Normaliser, config: BatchConfig, seed: int) -> None:
        self.samples = [s for s in samples if len(s.features) >= config.unit]
        self.normaliser = normaliser
        self.config = config
        self.seed = seed
        self.weights = sample_weights(self.samples, config)

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
        cuts = [self.cut(self.samples[i], np.random.default_rng([self.seed, block, n])) for n, i in enumerate(chosen)]
        cuts.sort(key=lambda cut: len(cut[0]))
        order = rng.permutation(c.bucket)
        start = int(order[place]) * c.size
        whole = cuts[start : start + c.size]
        longest, frames = max(len(cut[0]) for cut in whole), sum(len(cut[0]) for cut in whole)
        return self.collate(whole[rank::world], longest, frames / world)

    def cut(self, sample: Sample, rng: np.random.Generator) -> tuple[NDArray[np.float32], str, str]:
        """One window of a sample: un-normalised rows [F, 67], caption, source."""
        c = self.config
        features, caption = sample.features, str(rng.choice(sample.captions)) if sample.captions else ""
        if rng.random() < c.speed:
            features = change_speed(features, float(rng.uniform(0.8, 1.25)))
        start, length = window(len(features), c, rng)
        features = features[start : start + length]
        if rng.random() < c.mirror:
            features, caption = mirror_features67(features), mirror_caption(caption)
        return features, caption, sample.source

    def collate(
        self,
        cuts: Sequence[tuple[NDArray[np.float32], str, str]],
        longest: int | None = None,
        mean_frames: float | None = None,
    ) -> Batch:
        """Windows as one normalised batch, padded on the right to `longest` rows (that of the windows by default)."""
        lengths = np.array([len(cut[0]) for cut in cuts], np.int64)
        longest = longest or int(lengths.max())
        features = np.zeros((len(cuts), longest, cuts[0][0].shape[1]), np.float32)
        for row, (rows, _, _) in enumerate(cuts):
            features[row, : len(rows)] = self.normaliser.apply(rows)
        frames = float(lengths.sum()) if mean_frames is None else mean_frames
        return Batch(features, lengths, [cut[1] for cut in cuts], [cut[2] for cut in cuts], frames)


def whole_batches(samples: Sequence[Sample], normaliser: Normaliser, size: int, unit: int = 4) -> list[Batch]:
    """Every sample once, first caption, floored to the unit and cut to the longest length, sorted by length."""
    config = BatchConfig(unit=unit)
    source = BatchSource(samples, normaliser, config, seed=0)
    cuts = []
    for sample in sorted(source.samples, key=lambda s: len(s.features)):
        length = min(len(sample.features), LIMITS.max_frames) // unit * unit
        cuts.append((sample.features[:length], next(iter(sample.captions), ""), sample.source))
    return [source.collate(cuts[i : i + size]) for i in range(0, len(cuts), size)]
