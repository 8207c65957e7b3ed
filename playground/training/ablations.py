"""The ablations of LG-Tok's Tables 4, 6 and 7: a table, and its queue, `python -m playground.training.ablations`.

Every row is one training with the same seed, steps, batches and clips; what differs is what its name says. The base is
the paper's tiny model (systems.md A7) with MiniLM's token states: three blocks a side, post-norm, RMSNorm, SwiGLU,
U-shaped skips, RoPE of base 100, text on both sides, in-context in the tokenizer and by cross-attention in the
detokenizer. Ours alone, so that 3,000 steps say something: phi as half the input plus half a convolution, torch's own
first weights, the loss as a mean over real frames; on a CPU also smaller widths and 4 frames a motion token. Table 4g
switches motion (or latents) and text of a side together. No clip here is longer than a window, so Table 7 compares
short clips alone with all of them.

The queue can be killed at any point, and go on elsewhere (record.py). After every run it is measured, and the results
are written whole; rows that are not trained say so.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from playground.data.batches import BatchConfig
from playground.data.library import Library
from playground.evaluation.evaluators import Evaluator
from playground.evaluation.reconstruction import LONG, measure_contrastive, measure_tokenizer
from playground.text.words import WORDS
from playground.tokenizers.transformer import FULL_SCALES, TokenizerConfig, linear_codes
from playground.training.configs import EVALUATORS, EvaluatorTraining, Schedule, TokenizerTraining
from playground.training.queue import Job
from playground.training.record import (
    CLIPS,
    SEED,
    SPLIT,
    Record,
    Row,
    Table,
    ablation_job,
    judge,
    options_of,
    run_table,
)
from playground.training.run import Training

STEPS = 3_000  # on the first CLIPS ids of the training list (5,000 in the paper)
REPEATS = 5
BATCHES = (8, 16, 32, 64, 128)  # of the contrastive evaluator (Table 6)


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
    """What all rows share. cpu: some eight minutes a core; gpu: the paper's tiny model with MiniLM text."""
    schedule = Schedule(steps=STEPS, rate=1e-3, warmup=200, save_every=250, validate_every=1_500)
    training = TokenizerTraining(
        model=TokenizerConfig(
            patch=4, width=96, depth=3, heads=2, hidden=288, dropout=0.0, scales=FULL_SCALES,
            codes=linear_codes(128, 384, 10), code_width=64, phi="residual", text_width=384, small_init=False,
        ),
        batch=BatchConfig(size=8, source_balance=0.5, action_balance=0.3),
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


def contrastive(batch: int, size: str) -> EvaluatorTraining:
    """The CLIP-style evaluator with another contrastive batch (Table 6); a smaller network on a CPU."""
    known = EVALUATORS["clip-evaluator"]
    known = replace(known, batch=replace(known.batch, size=batch), schedule=replace(known.schedule, steps=STEPS))
    if size == "gpu":
        return known
    return replace(known, model=replace(known.model, width=128, hidden=320, motion_depth=3, text_depth=1))


def ablation_jobs(out: Path, size: str) -> list[Job]:
    """Every training of the table, the base first, the contrastive ones last."""
    trainings: dict[str, Training] = dict(ablations(size))
    trainings |= {f"contrastive-{batch}": contrastive(batch, size) for batch in BATCHES}
    return [ablation_job(name, trainings, out / size, {"size": size}) for name in trainings]


# ---- results --------------------------------------------------------------------------------------------------------


def table_of(out: Path, size: str) -> Table:
    """The table, with its runs under `out`."""
    start = base(size)
    about = {
        "system": "tiny tokenizers of the ablations", "split": SPLIT, "seed": SEED, "size": size, "steps": STEPS,
        "batch": start.batch.size, "training_clips": CLIPS, "training_seed": start.seed, "repeats": REPEATS,
    }  # fmt: skip
    return Table("ablations", "make ablations", ROWS, tuple(ablation_jobs(out, size)), about, measure)


def measure(job: Job, library: Library, evaluator: Evaluator | None) -> dict[str, Any]:
    """The figures of a finished training."""
    if isinstance(job.training, EvaluatorTraining):
        return measure_contrastive(job.checkpoint, library, SPLIT, seed=SEED)
    return measure_tokenizer(job.checkpoint, job.name, library, SPLIT, evaluator=evaluator, repeats=REPEATS, seed=SEED)


def measure_again(library: Path, size: str = "cpu", out: Path = Path("runs/ablations")) -> dict[str, Any]:
    """The result of the trainings that are finished under `out` alone; nothing is trained, nothing is stored."""
    return Record(table_of(out, size), Library.open(library), judge()).results()


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its exit status."""
    about = "Train and measure the ablations, one after another; call it again to go on."
    options = options_of("ablations", about, "runs/ablations", arguments)
    return run_table(options, table_of(options.out, options.size))


if __name__ == "__main__":
    sys.exit(main())
