"""The root refiner behind numpy arrays: a motion's way over the ground, computed anew from how its joints move.

The network says how the root turns and how it moves. Only how it moves is taken, and most of that: the heading stays
as it was drawn, since errors of a turn add up over a motion, and standing feet hardly gain by it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.motion.representation import Normaliser, from_features67
from playground.results import Generation

if TYPE_CHECKING:
    from playground.runtime import Runtime

Rows = NDArray[np.float32]
TAKEN = slice(1, 3)  # root velocity x and z
SHARE = 0.7  # of the way from the drawn velocity to the network's; chosen on validation clips (assets/README.md)
ABSENT = "no root refiner is shipped with this copy; train one: python -m playground train root-refiner"


def refiner_path(assets: Path) -> Path:
    """Where the refiner's checkpoint stands."""
    return assets / "checkpoints" / "refiner" / "root.safetensors"


@dataclass(frozen=True, eq=False)
class Refiner:
    """A trained root refiner; stateless, safe to share between threads."""

    network: Any
    normaliser: Normaliser  # of the rows that it reads
    checkpoint: str  # first 12 digits of the sha256 of its file

    def rows(self, motions: Sequence[Rows]) -> list[Rows]:
        """Un-normalised rows [F, 67] of motions -> the same with another velocity of the root, columns 1 and 2."""
        import torch

        lengths = [len(one) for one in motions]
        padded = np.zeros((len(motions), max(lengths), len(self.normaliser.mean)), np.float32)
        for line, one in zip(padded, motions, strict=True):
            line[: len(one)] = self.normaliser.apply(one)
        with torch.no_grad():
            root = self.network(torch.from_numpy(padded), torch.tensor(lengths)).numpy()
        mean, std = self.normaliser.mean[TAKEN], self.normaliser.std[TAKEN]
        refined = [np.array(one, np.float32) for one in motions]
        for said, one in zip(root, refined, strict=True):
            one[:, TAKEN] += SHARE * (said[: len(one), TAKEN] * std + mean - one[:, TAKEN])
        return refined


def open_refiner(assets: Path) -> Refiner:
    """The shipped refiner, loaded once. PlaygroundError in one sentence where there is none or the file is broken."""
    path = refiner_path(assets)
    if not path.is_file():
        raise PlaygroundError(ABSENT)
    return _load(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=2)
def _load(path: Path, changed: int) -> Refiner:
    from playground.checkpoints import load_model
    from playground.generators.refiner import RefinerConfig, build_refiner

    network, card = load_model(path, "refiner", RefinerConfig, build_refiner)
    if card.normaliser is None:
        raise PlaygroundError(f"{path} carries no normaliser; it is not a finished refiner checkpoint")
    return Refiner(network, card.normaliser, card.hash[:12])


def refine(refiner: Refiner, runtime: "Runtime", made: Generation) -> Generation:
    """A generation with its root refined, itself if it is; every token stays."""
    if made.refiner == refiner.checkpoint:
        return made
    (rows,) = refiner.rows([runtime.normaliser.invert(made.features)])
    motion = replace(made.motion, joints=from_features67(rows))
    return replace(made, motion=motion, features=runtime.normaliser.apply(rows), refiner=refiner.checkpoint)
