"""The guidance sweep (LG-Tok, Fig 5): quality of generated motions against the guidance scale g of the detokenizer.

Tokens are drawn once a repeat and decoded at every g; both branches of the decoder run once, since the decode at g is
(1 + g) times the one with text minus g times the one without (A8). Windows, captions and tokens are those of the same
repeat of an evaluation with the same seed.

    python -m playground.evaluation.sweep --system lgtok --library library --repeats 5 --json sweep.json
"""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

from playground.data.library import Library
from playground.engine import Engine, check_guidance, default_engine
from playground.errors import PlaygroundError
from playground.evaluation.repeats import Plan, Repeat, name_of, summarise
from playground.evaluation.run import Order, set_up
from playground.evaluation.spread import Spread, join_spread
from playground.progress import Progress
from playground.systems import row_of

SCALES = tuple(step / 2 for step in range(9))  # g = 0, 0.5, ..., 4


def guidance_sweep(
    system: str,
    library_path: Path,
    split: str = "test",
    progress: Callable[[int, int], None] | None = None,
    *,
    scales: Sequence[float] = SCALES,
    order: Order | None = None,
    engine: Engine | None = None,
    spread: Spread | None = None,
) -> dict[str, Any]:
    """{"item", "provenance", "real": {metric: {"mean", "ci95", "n"}}, "rows": [{"g", metric: {...}, ...}]}.

    The metrics are those of generated motions in an evaluation but for MultiModality and the prompts. order: repeats
    (5 by default), seed, cfg, the file beside which the state is kept, and the evaluators; its guidance is not used.
    With a `spread` the first process returns the result, the others {}.
    PlaygroundError if the system has no generator, and as in `evaluate`.
    """
    order, spread, engine = order or Order(repeats=5), spread or Spread(), engine or default_engine()
    order = replace(order, guidance=None)
    order.check()
    for g in scales:
        check_guidance(g)
    if not scales or not order.repeats:
        raise PlaygroundError("a guidance sweep needs at least one guidance scale and one repeat")
    campaign = set_up(system, Library.open(Path(library_path)), split, order, engine, spread)
    passes, clips = campaign.passes, campaign.clips
    if passes.runtime.generator is None:
        what = "tokenizer" if passes.runtime.codec is None else "generator"
        raise PlaygroundError(f"the system {system} has no {what}; there is nothing to sweep")
    plan = Plan(order.seed, 0, 0)
    repeats = campaign.repeat(
        order, {"scales": list(scales)}, 3 * len(clips), progress,
        lambda number: Repeat(passes, clips, plan, number).sweep(scales),
    )  # fmt: skip
    if not spread.first:
        return {}
    sampling = {key: value for key, value in campaign.settings["sampling"].items() if key != "guidance"}
    facts = {key: campaign.settings[key] for key in ("system", "checkpoint", "generator", "data", "split", "seed")}
    return {
        "item": "guidance_sweep",
        "provenance": facts
        | {"n": len(clips), "repeats": order.repeats, "sampling": sampling}
        | {"own_guidance": row_of(system).sampling.guidance, "evaluators": campaign.settings["evaluators"]},
        "real": summarise([repeat["real"] for repeat in repeats]),
        "rows": [{"g": g} | summarise([repeat[name_of(g)] for repeat in repeats]) for g in scales],
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its exit status."""
    parser = argparse.ArgumentParser(prog="python -m playground.evaluation.sweep", description=__doc__.splitlines()[0])
    parser.add_argument("--system", required=True, metavar="NAME")
    parser.add_argument("--library", type=Path, required=True, metavar="DIR")
    parser.add_argument("--split", default="test")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cfg", type=float, help="guidance of the generator (default: the system's own)")
    parser.add_argument(
        "--json", type=Path, required=True, metavar="OUT", help="the same call goes on where it stopped"
    )
    given = parser.parse_args(arguments)
    spread = join_spread()
    order = Order(given.repeats, seed=given.seed, cfg=given.cfg, out=given.json)
    try:
        with Progress(f"sweeping {given.system}") if spread.first else nullcontext() as progress:
            result = guidance_sweep(given.system, given.library, given.split, progress, order=order, spread=spread)
        if spread.first:
            call = f"--system {given.system} --library {given.library.name} --split {given.split}"
            call += f" --repeats {given.repeats} --seed {given.seed}" + (
                f" --cfg {given.cfg:g}" if given.cfg is not None else ""
            )
            made_by = {"made_by": f"python -m playground.evaluation.sweep {call}"}
            given.json.parent.mkdir(parents=True, exist_ok=True)
            given.json.write_text(json.dumps(result | made_by, indent=1) + "\n", encoding="utf-8")
    except (PlaygroundError, OSError) as error:
        sys.stderr.write(f"{' '.join(str(error).split())}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
