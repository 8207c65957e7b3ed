"""How well an evaluator finds real motions by their captions, and the best that any reader of the text could do.

R-Precision (systems.md F2) in two readings, since captions made from templates repeat: only the text's own motion is
right, or any motion of the pool whose text is the same string. Two ceilings go with the first reading: a reader that
tells captions apart perfectly but not the motions that share one, and a reader that knows the action label alone.
"""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from playground.data.batches import Sample
from playground.errors import PlaygroundError
from playground.evaluation.metrics import r_precision

POOLS = (32, 100)
TOPS = (1, 2, 3)
READINGS = ("own", "same_caption", "ceiling_caption", "ceiling_action")


class Embedder(Protocol):
    """The two methods of an Evaluator that are needed here."""

    def embed_rows(self, rows: Sequence[NDArray[np.floating]]) -> NDArray[np.float32]:
        """Un-normalised feature rows [F, 67] -> [n, D]."""

    def embed_texts(self, texts: Sequence[str]) -> NDArray[np.float32]:
        """Texts -> [n, D]."""


def ceiling(alike: NDArray[np.bool_], pool: int, rng: np.random.Generator) -> list[float]:
    """Expected share of own motions in the top 1, 2, 3 for a reader to whom the motions alike are one; [tops].

    alike: bool [n, n], row by row the motions that a text cannot tell from its own, own included. The pools are those
    of `r_precision` with the same rng state.
    """
    order = rng.permutation(len(alike))
    pools = [order[start : start + pool] for start in range(0, len(order) - pool + 1, pool)]
    counts = np.concatenate([alike[np.ix_(rows, rows)].sum(axis=1) for rows in pools])
    return [float(np.minimum(1.0, top / counts).mean()) for top in TOPS]


def retrieval(
    evaluator: Embedder,
    samples: Sequence[Sample],
    *,
    pools: Sequence[int] = POOLS,
    repeats: int = 20,
    seed: int = 0,
) -> dict[str, Any]:
    """{"n", "repeats", "seed", and for each pool a table {reading: {"top1": {"mean", "ci95"}, ...}}}.

    Every repeat draws one caption a clip and new pools. A pool larger than the sample has no table. ci95 is 1.96
    standard deviations over the root of the repeats. PlaygroundError if no clip has a caption.
    """
    kept = [sample for sample in samples if sample.captions]
    if not kept:
        raise PlaygroundError("retrieval needs clips with captions, and there is none")
    captions = sorted({caption for sample in kept for caption in sample.captions})
    number = {caption: row for row, caption in enumerate(captions)}
    texts = evaluator.embed_texts(captions)
    motions = evaluator.embed_rows([sample.features for sample in kept])
    own = [np.array([number[c] for c in sample.captions]) for sample in kept]
    owners = np.zeros((len(captions), len(kept)), np.bool_)
    for clip, rows in enumerate(own):
        owners[rows, clip] = True
    actions = np.array([sample.action for sample in kept])
    tables: dict[str, Any] = {}
    for pool in pools:
        if pool > len(kept):
            continue
        runs = []
        for repeat in range(repeats):
            key = [seed, 4, pool, repeat]
            drawn = np.array([np.random.default_rng([*key, clip]).choice(rows) for clip, rows in enumerate(own)])
            scores = [
                [r_precision(texts[drawn], motions, pool, top, np.random.default_rng(key), groups) for top in TOPS]
                for groups in (None, drawn.tolist())
            ]
            bounds = [
                ceiling(alike, pool, np.random.default_rng(key))
                for alike in (owners[drawn], actions[:, None] == actions)
            ]
            runs.append(np.array([*scores, *bounds], np.float64))
        tables[f"pool{pool}"] = _table(np.stack(runs))
    return {"n": len(kept), "repeats": repeats, "seed": seed, **tables}


def _table(runs: NDArray[np.float64]) -> dict[str, dict[str, dict[str, float]]]:
    """[repeats, readings, tops] -> {reading: {top: {mean, ci95}}}."""
    mean, spread = runs.mean(axis=0), 1.96 * runs.std(axis=0) / np.sqrt(len(runs))
    return {
        reading: {
            f"top{top}": {"mean": float(mean[row, column]), "ci95": float(spread[row, column])}
            for column, top in enumerate(TOPS)
        }
        for row, reading in enumerate(READINGS)
    }


def retrieval_lines(facts: dict[str, Any]) -> list[str]:
    """The table of `retrieval` as Markdown rows, for a model card."""
    names = {
        "own": "own motion only",
        "same_caption": "any motion with the same caption string",
        "ceiling_caption": "ceiling: captions told apart perfectly, own motion only",
        "ceiling_action": "ceiling: only the action label known, own motion only",
    }
    tops = [f"top{top}" for top in TOPS]
    lines = ["| pool | reading | top 1 | top 2 | top 3 |", "|---|---|---|---|---|"]
    for pool in (key for key in facts if key.startswith("pool")):
        for reading in READINGS:
            cells = [facts[pool][reading][top] for top in tops]
            shown = [
                f"{c['mean']:.3f} ± {c['ci95']:.3f}" if not reading.startswith("ceiling") else f"{c['mean']:.3f}"
                for c in cells
            ]
            lines.append(f"| {pool.removeprefix('pool')} | {names[reading]} | " + " | ".join(shown) + " |")
    return lines
