"""Measure a system on a split of a library: reconstruction error and code usage (systems.md F2)."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from playground.analysis.passes import ClipPass, clip_passes, first_caption
from playground.analysis.usage import CodeUsage
from playground.data.library import Library
from playground.engine import Engine, default_engine
from playground.errors import PlaygroundError


def evaluate(
    system: str,
    library_path: Path,
    split: str = "test",
    progress: Callable[[int, int], None] | None = None,
    *,
    engine: Engine | None = None,
    seed: int = 0,
) -> dict[str, Any]:
    """Reconstruction and code usage of a system, true first caption at both ends, g = 0.

    Clips are floored to 4 rows and measured on their first 196; too short ones are left out, n counts the others.
    Errors are pelvis-relative millimetres pooled over frames (F2); the mean over sources weighs every source alike.
    Nothing here is drawn at random; seed is only written down. Numbers that do not exist (no token) are None.
    PlaygroundError if the system has no checkpoint, the library is none, or the split holds no clip to measure.
    """
    library = Library.open(Path(library_path))
    chosen = library.split(split)
    runtime = (engine or default_engine()).runtime(system)
    captions = [first_caption(library.clips[i].captions) for i in chosen]
    passes = list(clip_passes(runtime, library, chosen, captions, progress=progress))
    if not passes:
        raise PlaygroundError(f"the split {split} of {library_path} holds no clip long enough to be measured")
    by_source = errors_by_source(passes, [library.clips[one.index].source for one in passes])
    config = runtime.tokenizer.config
    usage = CodeUsage().fit([np.stack(level) for level in zip(*(one.ids for one in passes), strict=True)], config.codes)
    return {
        "system": system,
        "checkpoint": runtime.checkpoint,
        "data": library.name,
        "split": split,
        "n": len(passes),
        "seed": seed,
        "mpjpe_mm": float(np.concatenate([one.errors_mm for one in passes]).mean()),
        "mpjpe_mm_source_mean": float(np.mean([row["mpjpe_mm"] for row in by_source.values()])),
        "by_source": by_source,
        "usage": [float(share) for share in usage.used_],
        "usage_all": usage.used_all_,
        "perplexity": [float(value) if math.isfinite(value) else None for value in usage.perplexity_],
    }


def errors_by_source(passes: list[ClipPass], sources: list[str]) -> dict[str, dict[str, Any]]:
    """{source: {"n": clips, "mpjpe_mm": error pooled over frames}}, sources in the order of their names."""
    rows: dict[str, list[ClipPass]] = {}
    for one, source in zip(passes, sources, strict=True):
        rows.setdefault(source, []).append(one)
    return {
        source: {"n": len(rows[source]), "mpjpe_mm": float(np.concatenate([c.errors_mm for c in rows[source]]).mean())}
        for source in sorted(rows)
    }
