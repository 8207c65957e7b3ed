"""The table of stored results: what each item is and how it is computed; results read, or computed now."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from playground.analysis.results import RESULTS, Result, is_stale, read_result
from playground.engine import Engine, default_engine
from playground.errors import PlaygroundError
from playground.evaluation.published import alignment, levels, measures, motions, timing
from playground.evaluation.published.base import Progress, Settings
from playground.systems import DEFAULT_SYSTEM, SYSTEMS, checkpoint_path, row_of

Compute = Callable[[str, Settings, Engine, Progress | None], Result]
_ASKED = ("split", "seed", "repeats", "mm_texts", "mm_samples", "motions")


@dataclass(frozen=True)
class Item:
    """One kind of stored result."""

    name: str
    what: str
    compute: Compute
    draws: bool = True  # is there nothing to measure without a generator?
    tokenless: bool = False  # is there something to measure without a tokenizer?
    guided: bool = False  # is it about a decoder that reads text, or stands beside one that does?


ITEMS: dict[str, Item] = {
    item.name: item
    for item in (
        Item("evaluation", "every metric (Tables 1, 2, 3, Fig 2, perplexity)", measures.evaluation, False, True),
        Item("guidance_sweep", "quality against g (Fig 5, Table 5)", measures.sweep, guided=True),
        Item(
            "free_form",
            "tokens with and without text, read with and without it (Table 8)",
            measures.free_form,
            guided=True,
        ),
        Item("edits", "the benchmark masks (Fig 11)", motions.edits),
        Item("strips", "motions of prompts (Figs 4, 9, 10)", motions.strips, tokenless=True),
        Item("levels", "levels kept against error, energy and coupling (MOGO, SnapMoGen)", levels.levels, False),
        Item("alignment", "A then B, B then A: order and attention (CASIM)", alignment.alignment, tokenless=True),
        Item("inference_time", "seconds a motion (Table 9)", timing.inference_time, tokenless=True),
    )
}
OURS = tuple(name for name, row in SYSTEMS.items() if row.command == "train")
LGTOK = tuple(name for name in OURS if SYSTEMS[name].family == "lgtok")


def settings_of(system: str, library: Path) -> Settings:
    """How a system is measured by default: 20 repeats for the flagship, 5 for others.

    MultiModality is smaller than the paper's 96 texts by 30 motions, which `evaluate` takes: an hour a system on a CPU.
    """
    if system == DEFAULT_SYSTEM:
        return Settings(library, repeats=20, mm_texts=24, motions=100)
    return Settings(library)


def item_of(name: str) -> Item:
    """A row of the table. PlaygroundError for an unknown name."""
    if name not in ITEMS:
        raise PlaygroundError(f"unknown item {str(name)[:80]!r}; one of {', '.join(ITEMS)} is accepted")
    return ITEMS[name]


def applies(item: Item, system: str) -> bool:
    """Whether a system is of a kind that has what an item measures: tokens, a generator where it draws, LG-Tok's g."""
    row = row_of(system)
    guided = row.family == "lgtok" or not item.guided
    return bool((item.tokenless or row.tokenizer) and (row.generator or not item.draws) and guided)


def can_measure(item: Item, system: str, engine: Engine) -> bool:
    """Whether the files that an item needs are there."""
    row = row_of(system)
    if not applies(item, system):
        return False
    parts = row.parts if item.draws else row.needed
    return all(checkpoint_path(engine.assets, system, part).is_file() for part in parts)


def compute(
    name: str, system: str, settings: Settings, engine: Engine | None = None, progress: Progress | None = None
) -> Result:
    """Compute one result now, with the command line that does the same. PlaygroundError as its item says."""
    item, engine = item_of(name), engine or default_engine()
    row_of(system)
    found = item.compute(system, settings, engine, progress)
    return replace(found, made_by=command_line(name, system, settings, found.provenance))


def command_line(name: str, system: str, settings: Settings, provenance: dict[str, Any]) -> str:
    """The call that makes a result; it names what the result depends on."""
    words = ["python -m playground.evaluation.published", name, "--system", system]
    if "data" in provenance:
        words += ["--library", Path(settings.library).name]
    words += [f"--{key.replace('_', '-')} {provenance[key]}" for key in _ASKED if key in provenance]
    return " ".join(words)


def up_to_date(found: Result | None, engine: Engine, settings: Settings) -> bool:
    """Whether a stored result is of the files and the usual sampling that are there now, and of these settings."""
    if found is None:
        return False
    given = settings.evaluators
    judges = None if given is None else {name: one.hash[:12] for name, one in given.items()}
    told = found.provenance
    same = all(told[key] == getattr(settings, key) for key in _ASKED if key in told)
    return same and not is_stale(found, engine.assets, judges)


def results_of(
    name: str,
    systems: Iterable[str] | None = None,
    *,
    recompute: bool = False,
    library: str | Path = "library",
    folder: Path = RESULTS,
    engine: Engine | None = None,
    **changes: Any,
) -> dict[str, Result | None]:
    """Results of an item by system, None where there is none: what the notebooks call.

    recompute: compute now, for every system whose files are there, and keep nothing. systems: LG-Tok's by default.
    changes: fields of Settings that are to be other than the default ones; None leaves the default.
    """
    item = item_of(name)
    names = [row_of(system).name for system in (LGTOK if systems is None else systems)]
    if not recompute:
        return {system: read_result(name, system, folder) for system in names}
    engine = engine or default_engine()
    asked = {key: value for key, value in changes.items() if value is not None}
    found: dict[str, Result | None] = {}
    for system in names:
        settings = replace(settings_of(system, Path(library)), **asked)
        found[system] = compute(name, system, settings, engine) if can_measure(item, system, engine) else None
    return found
