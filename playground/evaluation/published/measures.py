"""The items that are repeats of an evaluation: all metrics, the guidance sweep, free-form generation.

evaluation      rows {"of": "generated" | "real" | "reconstruction", metric: {"mean", "ci95", "n"}}, and one
                {"of": "every clip once"} with mpjpe_mm, mpjpe_mm_source_mean, by_source, usage, usage_all, perplexity
guidance_sweep  rows {"g", metric: {...}}; "real": {metric: {...}}
free_form       rows {"drawn": "free" | "prompted", "read": name of a reading, "g", metric: {...}}; "real"
"""

from typing import Any

from playground.analysis.results import Result
from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.evaluation.passes import Reading
from playground.evaluation.published.base import Progress, Settings, about
from playground.evaluation.repeats import Plan, Repeat, drawn_name, summarise
from playground.evaluation.run import Order, evaluate, set_up
from playground.evaluation.spread import Spread
from playground.evaluation.sweep import guidance_sweep

GROUPS = {"generated": "metrics", "real": "real", "reconstruction": "reconstruction"}
ONCE = ("mpjpe_mm", "mpjpe_mm_source_mean", "by_source", "usage", "usage_all", "perplexity")
READINGS = {  # of Table 8; the paper's g on HumanML3D and on Motion-X
    "no text": Reading(False),
    "text, g = 0": Reading(True, 0.0),
    "text, g = 1": Reading(True, 1.0),
    "text, g = 2": Reading(True, 2.0),
}


def evaluation(system: str, settings: Settings, engine: Engine, progress: Progress | None) -> Result:
    """Every metric of a system over repeats. PlaygroundError as in `evaluate`, and for no repeat at all."""
    order = _order("evaluation", system, settings)
    found = evaluate(system, settings.library, settings.split, progress, engine=engine, seed=settings.seed, order=order)
    kept = ("data", "split", "n", "seed", "repeats", "mm_texts", "mm_samples", "sampling", "evaluators")
    provenance = about(engine, system) | {key: found[key] for key in kept}
    rows = [{"of": name} | found[table] for name, table in GROUPS.items()]
    rows.append({"of": "every clip once"} | {key: found[key] for key in ONCE})
    return Result("evaluation", "", provenance, rows)


def sweep(system: str, settings: Settings, engine: Engine, progress: Progress | None) -> Result:
    """The guidance sweep of a system. PlaygroundError as in `guidance_sweep`."""
    order = _order("guidance_sweep", system, settings)
    found = guidance_sweep(system, settings.library, settings.split, progress, order=order, engine=engine)
    return Result("guidance_sweep", "", about(engine, system) | found["provenance"], found["rows"],
                  {"real": found["real"]})  # fmt: skip


def free_form(system: str, settings: Settings, engine: Engine, progress: Progress | None) -> Result:
    """Tokens drawn with the captions and without any text, each read in the ways of READINGS (Table 8, A10).

    Windows, captions and seeds are those of the same repeat of an evaluation. PlaygroundError if the system has no
    generator, and as in `evaluate`.
    """
    order = _order("free_form", system, settings)
    order.check()
    campaign = set_up(system, settings.opened(), settings.split, order, engine, Spread())
    if campaign.passes.runtime.generator is None:
        what = "tokenizer" if campaign.passes.runtime.codec is None else "generator"
        raise PlaygroundError(f"the system {system} has no {what}; there is nothing to draw")
    plan, clips = Plan(settings.seed, 0, 0), campaign.clips
    ways = {name: [reading.text, reading.guidance] for name, reading in READINGS.items()}
    tables = campaign.repeat(
        order, {"readings": ways}, 4 * len(clips), progress,
        lambda number: Repeat(campaign.passes, clips, plan, number).read(READINGS),
    )  # fmt: skip
    rows: list[dict[str, Any]] = [
        {"drawn": "prompted" if prompted else "free", "read": name, "g": reading.guidance if reading.text else None}
        | summarise([table[drawn_name(prompted, name)] for table in tables])
        for prompted in (False, True)
        for name, reading in READINGS.items()
    ]
    kept = {key: campaign.settings[key] for key in ("data", "split", "seed", "evaluators")}
    sampling = {key: value for key, value in campaign.settings["sampling"].items() if key != "guidance"}
    provenance = about(engine, system) | kept | {"n": len(clips), "repeats": order.repeats, "sampling": sampling}
    return Result("free_form", "", provenance, rows, {"real": summarise([table["real"] for table in tables])})


def _order(item: str, system: str, settings: Settings) -> Order:
    if settings.repeats < 1:
        raise PlaygroundError(f"{settings.repeats} repeats were asked for; at least 1 is needed")
    return Order(
        settings.repeats, settings.mm_texts, settings.mm_samples, settings.seed, out=settings.state(item, system),
        evaluators=settings.evaluators,
    )  # fmt: skip
