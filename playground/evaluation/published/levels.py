"""The item levels: error, energy and coupling of a tokenizer when only its first levels are kept.

levels  rows as evaluation/levels.py tells, with mpjpe_mm and energy as {"mean", "ci95", "n"} over clips; "between" and
        "vectors" as there
"""

from typing import Any

from playground.analysis.passes import first_caption
from playground.analysis.results import Result
from playground.engine import Engine
from playground.evaluation.items import measurable
from playground.evaluation.levels import measure_levels
from playground.evaluation.published.base import Progress, Settings, about, measured
from playground.evaluation.repeats import MAIN
from playground.evaluation.run import shipped_evaluators

OVER_CLIPS = ("mpjpe_mm", "energy")


def levels(system: str, settings: Settings, engine: Engine, progress: Progress | None) -> Result:
    """Every clip of the split, from no level to all. PlaygroundError if the split holds no clip to measure."""
    library = settings.opened()
    clips = measurable(library, library.split(settings.split))
    captions = [first_caption(library.clips[index].captions) for index in clips]
    judges = shipped_evaluators() if settings.evaluators is None else settings.evaluators
    judge = judges.get(MAIN)
    found = summed(measure_levels(engine.runtime(system), library, clips, captions, judge, progress))
    facts: dict[str, Any] = {"data": library.name, "split": settings.split, "n": len(clips), "seed": settings.seed}
    facts["evaluators"] = {} if judge is None else {MAIN: judge.hash[:12]}
    return Result("levels", "", about(engine, system) | facts, found.pop("rows"), found)


def summed(found: dict[str, Any]) -> dict[str, Any]:
    """What `measure_levels` gives with the numbers over clips summed up, as stored results hold them."""
    rows = [row | {key: measured(row[key]) for key in OVER_CLIPS} for row in found["rows"]]
    return found | {"rows": rows}
