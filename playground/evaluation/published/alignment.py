"""The item alignment: "A then B" against "B then A" (CASIM): do motions keep the order, and where do models look?

alignment  rows {"prompt", "first", "second": actions, "seconds", "kept": {"mean", "ci95", "n"} share of motions with
           the actions in the order of the sentence, "words" [W], "weights" [steps][W] of the motion of the first seed,
           "what": which attention that is, "lag": how much later the second clause is looked at}; words, weights and
           lag are null, and "why" says it, where a system has no attention to single words

Sentences are ours; nothing of a data set is stored.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from playground.analysis.order import attention_lag, clauses, in_order
from playground.analysis.results import Result
from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.evaluation.published.base import Progress, Settings, about, measured
from playground.results import Generation

SECONDS = 6.0
ACTIONS = {"walk": "walks forward", "hands": "raises both hands", "squat": "squats down"}
ORDERS = (("walk", "hands"), ("hands", "walk"), ("walk", "squat"), ("squat", "walk"), ("hands", "squat"),
          ("squat", "hands"))  # fmt: skip
STEPS = 30  # of the stored maps

Floats = NDArray[np.float64]


def alignment(system: str, settings: Settings, engine: Engine, progress: Progress | None) -> Result:
    """Some motions a sentence; settings.motions in all. PlaygroundError if it cannot draw."""
    each = max(settings.motions // len(ORDERS), 1)
    rows: list[dict[str, Any]] = []
    for number, (first, second) in enumerate(ORDERS, 1):
        prompt = f"a person {ACTIONS[first]} and then {ACTIONS[second]}"
        made = [
            engine.generate(prompt, SECONDS, system, seed=settings.seed + place, deadline=None) for place in range(each)
        ]
        kept = [in_order(first, second, one.motion.joints) for one in made]
        row = {"prompt": prompt, "first": first, "second": second, "seconds": made[0].motion.seconds}
        row |= {"kept": measured([np.nan if one is None else float(one) for one in kept])}
        rows.append(row | _looked(engine, made[0]))
        if progress:
            progress(number, len(ORDERS))
    facts = {"seed": settings.seed, "motions": settings.motions, "sampling": vars(made[0].sampling)}
    return Result("alignment", "", about(engine, system) | facts, rows)


def _looked(engine: Engine, made: Generation) -> dict[str, Any]:
    """The attention to words of one motion, as a row holds it."""
    try:
        found = engine.alignment(made, deadline=None)
    except PlaygroundError as error:
        return {"words": None, "weights": None, "what": None, "lag": None, "why": str(error)}
    weights = np.asarray(found.weights, np.float64)
    lag = attention_lag(weights, *clauses(found.words))
    return {
        "words": found.words,
        "weights": np.round(coarse(weights, STEPS), 4).tolist(),
        "what": found.what,
        "lag": lag if np.isfinite(lag) else None,
    }


def coarse(weights: Floats, steps: int) -> Floats:
    """Means over at most `steps` equal parts of the time axis, [steps, W]."""
    parts = np.array_split(np.asarray(weights, np.float64), min(steps, len(weights)))
    return np.stack([part.mean(axis=0) for part in parts])
