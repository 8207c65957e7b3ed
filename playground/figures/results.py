"""All trained systems in one table, from stored results: `python -m playground.figures.results` prints it (README)."""

import sys

from playground.analysis.results import Estimate, Result, read_result
from playground.figures.tables import DASH, Table, guidance_of, number, significant
from playground.systems import SYSTEMS

GENERATED, CLIPS = "generated", "every clip once"
HEADS = (
    "system", "tokens", "numbers, M", "checkpoints", "MPJPE, mm", "g", "FID", "Top 3 of 32", "prompts obeyed",
    "feet slide, mm/s",
)  # fmt: skip


def stored_evaluations() -> dict[str, Result]:
    """The stored evaluation of every system that has one, in the order of the table of systems."""
    found = {name: read_result("evaluation", name) for name in SYSTEMS}
    return {name: result for name, result in found.items() if result is not None}


def results_table(results: dict[str, Result]) -> Table:
    """One row a system: what it is, how it rebuilds the test clips, and what it makes of their captions."""
    rows = [_real(next(iter(results.values())))] if results else []
    for name, result in results.items():
        facts = result.provenance
        marks = [f"`{mark}`" for mark in (facts.get("checkpoint"), facts.get("generator")) if mark]
        rows.append((
            f"`{name}`", str(facts.get("tokens") or DASH), significant(facts["parameters"] / 1e6),
            ", ".join(dict.fromkeys(marks)), number(result.estimate("mpjpe_mm", of=CLIPS)), guidance_of(result),
            *_drawn(result, GENERATED),
        ))  # fmt: skip
    return Table(HEADS, tuple(rows), "All systems", measured(results))


def measured(results: dict[str, Result]) -> str:
    """What the table was measured on: data, split, clips, repeats and seed; system by system where these differ."""
    found: dict[str, list[str]] = {}
    for name, facts in ((name, result.provenance) for name, result in results.items()):
        line = (
            f"{facts['data']}, {facts['split']} split, {facts['n']} clips, {facts['repeats']} repeats (mean and 95 % "
            f"interval), seed {facts['seed']}, evaluator tmr {facts['evaluators']['tmr']}"
        )
        found.setdefault(line, []).append(name)
    return "; ".join(line if len(found) == 1 else f"{', '.join(names)}: {line}" for line, names in found.items())


def _real(result: Result) -> tuple[str, ...]:
    return ("recorded motion", *[DASH] * 5, *_drawn(result, "real"))


def _drawn(result: Result, of: str) -> tuple[str, ...]:
    obeyed = Estimate(None) if of == "real" else result.estimate("prompts_obeyed")
    told = DASH if obeyed.mean is None else f"{100 * obeyed.mean:.0f} %"
    values = [number(result.estimate(key, of=of)) for key in ("fid", "r_precision_top3_pool32")]
    return (*values, told, number(result.estimate("foot_sliding", of=of)))


def main() -> int:
    """The command; returns its exit status."""
    table = results_table(stored_evaluations())
    sys.stdout.write(f"{table.markdown}\n\n{table.caption}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
