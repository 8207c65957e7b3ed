"""The stored analysis of a system with what is computed from it: code usage, residual energy. numpy only.

What is kept and how is described in `playground/stored.py`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from playground.analysis.residual import ScaleEnergy
from playground.analysis.usage import CodeUsage
from playground.stored import StoredAnalysis, StoredClip

DECODED_NOTE = "a token sequence of a test clip, decoded on the fly"
BundleClip = StoredClip


@dataclass(frozen=True, eq=False)
class Bundle(StoredAnalysis):
    """Stored analysis of one system on n clips."""

    @cached_property
    def usage(self) -> CodeUsage:
        """Code usage over all clips of the split."""
        return CodeUsage().fit_counts(np.split(self.counts, np.cumsum(self.codes)[:-1]))

    @cached_property
    def residual(self) -> ScaleEnergy:
        """Residual energy by scale over all clips."""
        return ScaleEnergy().fit(self.energy)


def write_bundle(folder: Path, bundle: Bundle) -> None:
    """Write both files of a bundle into `folder`, made if absent."""
    bundle.write(folder)


def read_bundle(folder: Path, system: str) -> Bundle:
    """The stored analysis of a system. PlaygroundError if it is absent or broken."""
    return Bundle.read(folder, system)


def stored_systems(folder: Path) -> list[str]:
    """Names of the systems that have a stored analysis in `folder`, sorted."""
    return sorted(path.stem for path in folder.glob("*.json") if path.with_suffix(".npz").is_file())


def counts_of(ids: Sequence[NDArray[np.int64]], codes: Sequence[int]) -> NDArray[np.int32]:
    """Counts of every code of every scale, back to back [sum of codes]; ids: [n, s_n] a scale, -1 for no token."""
    return np.concatenate(CodeUsage().fit([level[level >= 0] for level in ids], codes).counts_).astype(np.int32)


def padded_ids(clips: Sequence[Sequence[NDArray[np.int64]]], sizes: Sequence[int]) -> list[NDArray[np.int64]]:
    """Tokens of n clips, one array a scale each, as one array [n, s_n] a scale, filled up with -1."""
    levels = [np.full((len(clips), size), -1, np.int64) for size in sizes]
    for row, clip in enumerate(clips):
        for level, ids in zip(levels, clip, strict=True):
            level[row, : len(ids)] = ids
    return levels
