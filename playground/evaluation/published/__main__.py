"""Stored results from checkpoints and a library: `python -m playground.evaluation.published ITEM --library DIR`.

Without an ITEM, or with `all`, whatever is missing or belongs to other checkpoints is computed. Repeats that were
finished before a stop are kept in WORK; the same call goes on.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from playground.analysis.results import RESULTS, read_result, write_result
from playground.engine import default_engine
from playground.errors import PlaygroundError
from playground.evaluation.published.base import Settings
from playground.evaluation.published.items import (
    ITEMS,
    OURS,
    applies,
    can_measure,
    compute,
    item_of,
    settings_of,
    up_to_date,
)
from playground.progress import Progress
from playground.systems import row_of


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its exit status."""
    options = _parser().parse_args(arguments)
    try:
        names = list(ITEMS) if options.item == "all" else [item_of(options.item).name]
        for name in names:
            for system in options.system or OURS:
                _one(name, row_of(system).name, options)
    except (PlaygroundError, OSError) as error:
        sys.stderr.write(f"{' '.join(str(error).split())}\n")
        return 2
    except KeyboardInterrupt:
        sys.stderr.write("stopped; finished repeats are kept\n")
        return 130
    return 0


def _one(name: str, system: str, options: argparse.Namespace) -> None:
    """Compute and write one result, unless it is there already or cannot be."""
    engine, item = default_engine(), ITEMS[name]
    settings = _settings(system, options)
    if not can_measure(item, system, engine):
        why = "not trained yet" if applies(item, system) else "is not measured of a system of this kind"
        _say(f"{name}, {system}: {why}")
    elif not options.again and up_to_date(read_result(name, system, options.out), engine, settings):
        _say(f"{name}, {system}: up to date")
    elif options.list:
        _say(f"{name}, {system}: to be computed")
    else:
        with Progress(f"{name}, {system}") as progress:
            found = compute(name, system, settings, engine, progress)
        _say(f"{write_result(found, options.out)}: {found.line}")
        state = settings.state(name, system)
        if state is not None:
            state.with_name(f"{state.stem}.state.json").unlink(missing_ok=True)


def _settings(system: str, options: argparse.Namespace) -> Settings:
    asked = {key: getattr(options, key) for key in ("split", "seed", "repeats", "mm_texts", "mm_samples", "motions")}
    known = settings_of(system, options.library)
    return replace(known, work=options.work, **{key: value for key, value in asked.items() if value is not None})


def _parser() -> argparse.ArgumentParser:
    about = "Make stored results: what is missing, or belongs to other checkpoints."
    parser = argparse.ArgumentParser(prog="python -m playground.evaluation.published", description=about)
    parser.add_argument("item", nargs="?", default="all", metavar="ITEM", help=f"all, or {', '.join(ITEMS)}")
    parser.add_argument("--library", type=Path, default=Path("library"), metavar="DIR")
    parser.add_argument("--system", action="append", metavar="NAME", help="all of ours by default; may be repeated")
    parser.add_argument("--split")
    parser.add_argument("--seed", type=int)
    parser.add_argument("--repeats", type=int, help="default: 20 for the flagship, 5 for others")
    parser.add_argument("--mm-texts", type=int, help="texts of MultiModality (24 for the flagship, 12 for others)")
    parser.add_argument("--mm-samples", type=int, help="motions a text of MultiModality (10)")
    parser.add_argument("--motions", type=int, help="clips that are edited, generations that are timed (100, 24)")
    parser.add_argument("--out", type=Path, default=RESULTS, metavar="DIR")
    parser.add_argument("--work", type=Path, default=Path("runs/figures"), metavar="DIR")
    parser.add_argument("--again", action="store_true", help="compute what is up to date, too")
    parser.add_argument("--list", action="store_true", help="say what would be computed")
    return parser


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
