"""The ablations of LG-Tok's Tables 4, 6 and 7: a table, and its queue, `python -m playground.training.ablations`.

Every row is one training with the same seed, steps, batches and clips; what differs is what its name says. The base is
the paper's tiny model (systems.md A7) with MiniLM's token states: three blocks a side, post-norm, RMSNorm, SwiGLU,
U-shaped skips, RoPE of base 100, text on both sides, in-context in the tokenizer and by cross-attention in the
detokenizer. Ours alone, so that 3,000 steps say something: phi as half the input plus half a convolution, torch's own
first weights, the loss as a mean over real frames; on a CPU also smaller widths and 4 frames a motion token. Table 4g
switches motion (or latents) and text of a side together. No clip here is longer than a window, so Table 7 compares
short clips alone with all of them.

The queue can be killed at any point. After every run it is measured, and the results are written whole; rows that are
not trained say so.
"""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from playground.data.batches import BatchConfig
from playground.data.library import Library
from playground.engine import ASSETS
from playground.evaluation.evaluators import Evaluator, evaluator_path, load_evaluator
from playground.evaluation.reconstruction import LONG, measure_contrastive, measure_tokenizer
from playground.text.words import WORDS
from playground.tokenizers.transformer import FULL_SCALES, TokenizerConfig, linear_codes
from playground.training.configs import EVALUATORS, EvaluatorTraining, Schedule, TokenizerTraining
from playground.training.queue import Job, add_arguments, chosen, guarded, limits_of, run_queue, say, status

STEPS = 3_000
CLIPS = 1_000  # the first so many ids of the training list (5,000 in the paper)
SPLIT, SEED, REPEATS = "test", 0, 5
NOT_TRAINED = "not trained yet"
BATCHES = (8, 16, 32, 64, 128)  # of the contrastive evaluator (Table 6)


@dataclass(frozen=True)
class Row:
    """One row of one table. A training that stands in several tables has one name and is run once."""

    table: str  # of the paper
    label: str  # the row, as a notebook prints it
    name: str  # of the run


BASE = "base"
ROWS: tuple[Row, ...] = (
    Row("4a", "RMSNorm", BASE),
    Row("4a", "LayerNorm", "layer-norm"),
    Row("4b", "SwiGLU", BASE),
    Row("4b", "GELU", "gelu"),
    Row("4c", "U-shaped skips", BASE),
    Row("4c", "no skips", "no-skips"),
    Row("4d", "learned positions", "learned-positions"),
    Row("4d", "RoPE, base 10", "rope-10"),
    Row("4d", "RoPE, base 100", BASE),
    Row("4d", "RoPE, base 1,000", "rope-1000"),
    Row("4d", "RoPE, base 10,000", "rope-10000"),
    Row("4e", "no text", "text-none"),
    Row("4e", "text in the tokenizer", "text-tokenizer"),
    Row("4e", "text in the detokenizer", "text-detokenizer"),
    Row("4e", "text in both", BASE),
    Row("4f", "MiniLM tokens", BASE),
    Row("4f", "MiniLM pooled", "text-pooled"),
    Row("4f", "learned word table", "text-words"),
    Row("4f", "none", "text-none"),
    Row("4g", "in-context, in-context", "mix-context-context"),
    Row("4g", "in-context, cross-attention", BASE),
    Row("4g", "cross-attention, in-context", "mix-cross-context"),
    Row("4g", "cross-attention, cross-attention", "mix-cross-cross"),
    Row("7", f"clips of at most {LONG} rows alone", "short-clips"),
    Row("7", "short clips and long windows", BASE),
    *(Row("6", f"batch {size}", f"contrastive-{size}") for size in BATCHES),
)


def base(size: str) -> TokenizerTraining:
    """What all rows share. cpu: a quarter of an hour a core; gpu: the paper's tiny model with MiniLM text."""
    schedule = Schedule(steps=STEPS, rate=1e-3, warmup=200, save_every=250, validate_every=1_500)
    training = TokenizerTraining(
        model=TokenizerConfig(
            patch=4, width=128, depth=3, heads=2, hidden=384, dropout=0.0, scales=FULL_SCALES,
            codes=linear_codes(128, 384, 10), code_width=128, phi="residual", text_width=384, small_init=False,
        ),
        batch=BatchConfig(size=16, source_balance=0.5, action_balance=0.3),
        schedule=schedule,
        masked_mean=True,
        clips=CLIPS,
    )  # fmt: skip
    if size == "cpu":
        return training
    model = replace(training.model, patch=1, width=256, heads=4, hidden=1024, dropout=0.1, code_width=256)
    batch = replace(training.batch, size=64)
    return replace(training, model=model, batch=batch, schedule=replace(schedule, rate=5e-4, save_every=1_000))


def ablations(size: str) -> dict[str, TokenizerTraining]:
    """Every tokenizer training of the table by name."""
    start = base(size)

    def model(**changes: object) -> TokenizerTraining:
        return replace(start, model=replace(start.model, **changes))

    tokenizer = {"in": {}, "cross": {"text_mixing": "cross", "motion_mixing": "cross"}}
    detokenizer = {"in": {"text_mixing_out": "in-context", "latent_mixing_out": "in-context"}, "cross": {}}
    return {
        BASE: start,
        "layer-norm": model(norm="layer"),
        "gelu": model(feed="gelu"),
        "no-skips": model(skips=False),
        "learned-positions": model(positions="learned"),
        "rope-10": model(rope_base=10.0),
        "rope-1000": model(rope_base=1_000.0),
        "rope-10000": model(rope_base=10_000.0),
        "text-none": model(text_side="none"),
        "text-tokenizer": model(text_side="tokenizer"),
        "text-detokenizer": model(text_side="detokenizer"),
        "text-pooled": replace(start, text="minilm-pooled"),
        "text-words": replace(model(text_table=WORDS), text="words"),
        "mix-context-context": model(**tokenizer["in"], **detokenizer["in"]),
        "mix-cross-context": model(**tokenizer["cross"], **detokenizer["in"]),
        "mix-cross-cross": model(**tokenizer["cross"], **detokenizer["cross"]),
        "short-clips": replace(start, longest=LONG),
    }


def contrastive(batch: int) -> EvaluatorTraining:
    """The CLIP-style evaluator with another contrastive batch (Table 6)."""
    known = EVALUATORS["clip-evaluator"]
    return replace(known, batch=replace(known.batch, size=batch), schedule=replace(known.schedule, steps=STEPS))


def ablation_jobs(out: Path, size: str) -> list[Job]:
    """Every training of the table, the base first, the contrastive ones last."""
    trainings: dict[str, TokenizerTraining | EvaluatorTraining] = dict(ablations(size))
    trainings |= {f"contrastive-{batch}": contrastive(batch) for batch in BATCHES}
    return [
        Job(name, training, out / size / name, {"run": f"ablation {name}", "size": size})
        for name, training in trainings.items()
    ]


# ---- results --------------------------------------------------------------------------------------------------------


def measured(job: Job, library: Library, evaluator: Evaluator | None) -> dict[str, Any] | None:
    """What a finished job measures; None for another one. Kept beside its checkpoint until either file changes."""
    if not job.done:
        return None
    kept = job.out / "measured.json"
    judge = evaluator.hash[:12] if evaluator else None
    settings = {"data": library.name, "split": SPLIT, "seed": SEED, "repeats": REPEATS, "evaluator": judge}
    settings["changed"] = job.checkpoint.stat().st_mtime_ns
    if kept.is_file():
        found: dict[str, Any] = json.loads(kept.read_text())
        if found["settings"] == settings:
            return dict(found["figures"])
    if isinstance(job.training, EvaluatorTraining):
        figures = measure_contrastive(job.checkpoint, library, SPLIT, seed=SEED)
    else:
        figures = measure_tokenizer(
            job.checkpoint, job.name, library, SPLIT, evaluator=evaluator, repeats=REPEATS, seed=SEED
        )
    write_json(kept, {"settings": settings, "figures": figures})
    return figures


def results(jobs: Sequence[Job], library: Library, size: str, evaluator: Evaluator | None) -> dict[str, Any]:
    """The stored result: every row of every table with its figures, or with the status "not trained yet"."""
    by_name = {job.name: job for job in jobs}
    figures = {job.name: measured(job, library, evaluator) for job in jobs}
    rows = []
    for row in ROWS:
        found = figures.get(row.name)
        facts = by_name[row.name].facts() if found else {}
        trained = {"status": "trained", "step": facts.get("step"), "seconds": round(facts.get("seconds", 0.0))}
        head = {"table": row.table, "label": row.label, "run": row.name}
        rows.append(head | (trained | found if found else {"status": NOT_TRAINED}))
    start = base(size)
    provenance = {
        "system": "tiny tokenizers of the ablations", "data": library.name, "split": SPLIT, "seed": SEED, "size": size,
        "steps": STEPS, "batch": start.batch.size, "training_clips": CLIPS, "training_seed": start.seed,
        "evaluator": evaluator.hash[:12] if evaluator else None,
    }  # fmt: skip
    return {"item": "ablations", "made_by": "make ablations", "provenance": provenance, "rows": rows}


def measure_again(library: Path, size: str = "cpu", out: Path = Path("runs/ablations")) -> dict[str, Any]:
    """What `results` gives for the trainings that are finished under `out`; nothing is trained, nothing is stored."""
    evaluator = load_evaluator("tmr") if evaluator_path("tmr").is_file() else None
    return results(ablation_jobs(out, size), Library.open(library), size, evaluator)


def write_json(path: Path, value: dict[str, Any]) -> None:
    """Whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps(value, indent=1) + "\n")
    os.replace(partial, path)


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its exit status."""
    about = "Train and measure the ablations, one after another; call it again to go on."
    parser = argparse.ArgumentParser(prog="python -m playground.training.ablations", description=about)
    add_arguments(parser, "runs/ablations")
    stored = ASSETS / "results" / "ablations.json"
    parser.add_argument("--results", type=Path, default=stored, metavar="FILE", help="where the figures are written")
    options = parser.parse_args(arguments)

    def run() -> None:
        jobs = ablation_jobs(options.out, options.size)
        wanted = chosen(jobs, options.only)
        if options.list:
            say("\n".join(status(wanted)))
            return
        limits, library = limits_of(options), Library.open(options.library)
        evaluator = load_evaluator("tmr") if evaluator_path("tmr").is_file() else None

        def after(job: Job) -> None:
            if os.environ.get("RANK", "0") == "0":
                write_json(options.results, results(jobs, library, options.size, evaluator))

        done = run_queue(wanted, limits, say, after)
        after(wanted[0])
        say(f"{options.results}: {'all rows that were asked for' if done else 'the rows trained so far'}")

    return guarded(run)


if __name__ == "__main__":
    sys.exit(main())
