"""What the stored results share: their settings, and the facts that each of them states."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from playground.analysis.results import files_of
from playground.data.library import Library
from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.systems import describe, row_of

if TYPE_CHECKING:
    from playground.evaluation.evaluators import Evaluator

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class Settings:
    """How a result is measured. What an item does not use, its result does not state.

    repeats, mm_texts, mm_samples: of evaluations, sweeps and free-form generation. motions: clips that are edited, and
    generations that are timed. work: where the states of unfinished repeats are kept. evaluators: the shipped ones by
    default.
    """

    library: Path = Path("library")
    split: str = "test"
    seed: int = 0
    repeats: int = 5
    mm_texts: int = 12
    mm_samples: int = 10
    motions: int = 24
    work: Path | None = None
    evaluators: dict[str, "Evaluator"] | None = None

    def opened(self) -> Library:
        """The library. PlaygroundError if it is none, or the split holds nothing."""
        library = Library.open(Path(self.library))
        if not library.split(self.split):
            raise PlaygroundError(f"the split {self.split} of {self.library} is empty")
        return library

    def state(self, item: str, system: str) -> Path | None:
        """The result file beside which the state of unfinished repeats is kept."""
        return None if self.work is None else self.work / f"{item}-{system}.json"


def about(engine: Engine, system: str) -> dict[str, Any]:
    """What a result says of the system that it measured."""
    info = describe(engine.assets, row_of(system))
    size = {"tokens": sum(count for count, _ in engine.scales(system)), "parameters": info.parameters}
    return {"system": system} | files_of(system, engine.assets) | size


def measured(values: ArrayLike) -> dict[str, Any]:
    """{"mean", "ci95", "n"} of one number a motion; ci95 is 1.96 standard errors of the mean. Null without a value."""
    found = np.asarray(values, np.float64)
    found = found[np.isfinite(found)]
    if not found.size:
        return {"mean": None, "ci95": None, "n": 0, "why": "no motion has this number"}
    return {"mean": float(found.mean()), "ci95": float(1.96 * found.std() / np.sqrt(found.size)), "n": int(found.size)}
