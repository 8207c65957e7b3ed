"""Small ablations of the other papers' systems: `python -m playground.training.ablations_others` is their queue.

MOGO's Tables 1, 3 and 4 and its levels, SnapMoGen's figure on layers, its Table 4 and Fig 5. Every row is one training
with the same seed, steps, batches and clips as its base; what differs is what its name says. The held-out rows are
trained on the library without one source, normaliser included, and measured on all clips of that source.

The queue can be killed at any point, and go on elsewhere (record.py). After every run it is measured, and the results
are written whole; rows that are not trained say so.
"""

import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from playground.data.library import SPLITS, Library, LibraryClip, write_library
from playground.evaluation.evaluators import Evaluator
from playground.evaluation.trained import measure_generated, measure_rebuilt
from playground.systems import SYSTEMS
from playground.training.configs import GeneratorTraining, TokenizerTraining
from playground.training.others import OTHERS
from playground.training.queue import Job, Limits
from playground.training.record import (
    CLIPS,
    SEED,
    SPLIT,
    After,
    Record,
    Row,
    Table,
    ablation_job,
    in_order,
    judge,
    options_of,
    run_table,
)
from playground.training.run import Training, tokenizer_of

STEPS, DRAWN_STEPS = 1_200, 1_500  # of a tokenizer, of a generator
WIDTH = 96  # of the convolutions
REPEATS = 3
HELD_OUT = "HDM05"  # the source that the held-out rows have not seen
SIZES = ("small", "middle", "large")  # of Fig 5: width, feed-forward, layers, heads
_SHAPES = {"small": (96, 256, 3, 3), "middle": (192, 512, 5, 3), "large": (256, 768, 6, 4)}


MOGO, SNAP = "mogo-base", "snap-base"
ROWS: tuple[Row, ...] = (
    *(Row("mogo3", f"{n} level{'s' * (n > 1)}", MOGO if n == 6 else f"mogo-{n}") for n in (1, 3, 6, 7)),
    Row("mogo-levels", "affine and decorrelation", MOGO),
    Row("mogo-levels", "decorrelation alone", "mogo-rigid"),
    Row("mogo-levels", "affine alone", "mogo-correlated"),
    Row("mogo-levels", "neither", "mogo-plain"),
    Row("mogo4", "shrinking: 4, 2, 1, 1, 1, 1 layers", "mogo-shrinking"),
    Row("mogo4", "uniform: 2 layers each", "mogo-uniform"),
    Row("mogo4", "growing: 1, 1, 1, 1, 2, 4 layers", "mogo-growing"),
    *(
        Row("mogo1", title, f"{system}-heldout{part}", HELD_OUT)
        for system, title in (("mogo", "MOGO"), ("momask", "MoMask"), ("t2mgpt", "T2M-GPT"))
        for part in ("", "-generator")
    ),
    Row("snap-layers", "4 scales, one shared codebook", SNAP),
    Row("snap-layers", "5 scales, one shared codebook", "snap-5"),
    Row("snap-layers", "6 same-scale levels, a codebook each", "snap-same"),
    Row("snap4", "base", SNAP),
    Row("snap4", "half the codes", "snap-half"),
    Row("snap4", "a quarter of the codes", "snap-quarter"),
    *(Row("snap4", f"{n} scale{'s' * (n > 1)}", f"snap-{n}") for n in (1, 2, 3, 5)),
    Row("snap4", "full-scale levels", "snap-full"),
    Row("snap4", "no attention", "snap-no-attention"),
    Row("snap4-drawn", "in-context", "snap-in-context"),
    Row("snap4-drawn", "cross-attention", "snap-cross-middle"),
    Row("snap5", "in-context", "snap-in-context"),
    *(Row("snap5", f"cross-attention, {size}", f"snap-cross-{size}") for size in SIZES),
)


# ---- trainings ------------------------------------------------------------------------------------------------------


def _tokenizer(name: str, **changes: Any) -> TokenizerTraining:
    """A system's tokenizer at the size of these ablations, with other numbers in its config."""
    known = OTHERS[f"{name}-tokenizer"]
    assert isinstance(known, TokenizerTraining)
    model = replace(known.model, **({"width": WIDTH} | changes))
    batch, schedule = replace(known.batch, size=16), replace(known.schedule, steps=STEPS)
    return replace(known, model=model, batch=batch, schedule=schedule, clips=CLIPS)


def _generator(name: str, tokenizer: str, **changes: Any) -> GeneratorTraining:
    """A system's generator on the tokens of a tokenizer of this table."""
    known = OTHERS[f"{name}-generator"]
    assert isinstance(known, GeneratorTraining)
    model = replace(known.model, **changes)
    schedule = replace(known.schedule, steps=DRAWN_STEPS, validate_every=150)
    return replace(known, model=model, schedule=schedule, tokenizer=f"{tokenizer}-tokenizer", lent=True)


def trainings() -> dict[str, TokenizerTraining | GeneratorTraining]:
    """Every training of the table by name, tokenizers before the generators that draw from them."""
    found: dict[str, TokenizerTraining | GeneratorTraining] = {MOGO: _tokenizer("mogo")}
    codes = found[MOGO].model.codes[0]
    for n in (1, 3, 7):
        found[f"mogo-{n}"] = _tokenizer("mogo", divisors=(1,) * n, codes=(codes,) * n)
    found["mogo-rigid"] = _tokenizer("mogo", affine=False)
    found["mogo-correlated"] = _tokenizer("mogo", decorrelation=0.0)
    found["mogo-plain"] = _tokenizer("mogo", affine=False, decorrelation=0.0)
    layouts = {"shrinking": (4, 2, 1, 1, 1, 1), "uniform": (2,) * 6, "growing": (1, 1, 1, 1, 2, 4)}
    for layout, depths in layouts.items():
        found[f"mogo-{layout}"] = _generator("mogo", MOGO, depths=depths, heads=(4,) * 6)
    found |= _snap()
    for system in ("mogo", "momask", "t2mgpt"):
        found[f"{system}-heldout"] = replace(_tokenizer(system), clips=0)
        found[f"{system}-heldout-generator"] = _generator(system, f"{system}-heldout")
    return found


def _snap() -> dict[str, TokenizerTraining | GeneratorTraining]:
    """MoMask++'s."""

    def scaled(divisors: tuple[int, ...], **changes: Any) -> TokenizerTraining:
        return _tokenizer("momaskpp", divisors=divisors, codes=(codes,) * len(divisors), **changes)

    base = _tokenizer("momaskpp")
    codes, divisors = base.model.codes[0], base.model.divisors
    found: dict[str, TokenizerTraining | GeneratorTraining] = {SNAP: base}
    found["snap-half"] = _tokenizer("momaskpp", codes=(codes // 2,) * len(divisors))
    found["snap-quarter"] = _tokenizer("momaskpp", codes=(codes // 4,) * len(divisors))
    found |= {f"snap-{len(kept)}": scaled(kept) for kept in (divisors[3:], divisors[2:], divisors[1:])}
    found["snap-5"] = scaled((2 * divisors[0], *divisors))
    found["snap-full"] = scaled((1,) * len(divisors))
    found["snap-no-attention"] = _tokenizer("momaskpp", attention="none")
    found["snap-same"] = _tokenizer("momask")
    shapes = {size: dict(zip(("width", "hidden", "depth", "heads"), _SHAPES[size], strict=True)) for size in SIZES}
    found["snap-in-context"] = _generator("momaskpp", SNAP, **shapes["middle"])
    for size in SIZES:
        found[f"snap-cross-{size}"] = _generator("momaskpp-cross", SNAP, **shapes[size])
    return found


def system_of(name: str) -> str:
    """The system of the table whose sampling a run uses."""
    return {"snap": "momaskpp"}.get(name.split("-")[0], name.split("-")[0])


def held_out(name: str) -> bool:
    """Whether a run is trained without the held-out source."""
    return "-heldout" in name


def ablation_jobs(out: Path) -> list[Job]:
    """Every training of the table. A held-out system's tokenizer and generator lie side by side, as all do."""
    known: dict[str, Training] = dict(trainings())
    return [ablation_job(name, known, out) for name in known]


def library_without(library: Library, source: str, folder: Path) -> Path:
    """A copy of a library without the clips of one source; made once. PlaygroundError if nothing is left."""
    if not (folder / "library.json").is_file():
        kept = (index for index, clip in enumerate(library.clips) if clip.source != source)
        clips = (
            LibraryClip(clip.id, clip.source, clip.split, clip.action, clip.captions, library.joints(index))
            for index in kept
            for clip in (library.clips[index],)
        )
        write_library(folder, clips, f"{library.name} without {source}")
    return folder


# ---- results --------------------------------------------------------------------------------------------------------


def table_of(out: Path) -> Table:
    """The table, with its runs under `out`."""
    about = {
        "system": "small ablations of the other systems", "split": SPLIT, "seed": SEED, "steps": STEPS,
        "drawn_steps": DRAWN_STEPS, "training_clips": CLIPS, "repeats": REPEATS, "held_out": HELD_OUT,
        "training_seed": 0,
    }  # fmt: skip
    return Table("ablations_others", "make ablations-others", ROWS, tuple(ablation_jobs(out)), about, measure, how)


def how(job: Job) -> dict[str, Any]:
    """How a generator's tokens are drawn."""
    drawn = isinstance(job.training, GeneratorTraining)
    return {"sampling": asdict(SYSTEMS[system_of(job.name)].sampling)} if drawn else {}


def measure(job: Job, library: Library, evaluator: Evaluator | None) -> dict[str, Any]:
    """The figures of a finished training."""
    source = HELD_OUT if held_out(job.name) else None
    splits = SPLITS if source else (SPLIT,)
    clips = [index for split in splits for index in library.split(split)]
    clips = [index for index in clips if source in (None, library.clips[index].source)]
    if not isinstance(job.training, GeneratorTraining):
        return measure_rebuilt(job.checkpoint, job.name, library, clips, evaluator, repeats=REPEATS, seed=SEED)
    tokenizer, sampling = tokenizer_of(job.training, job.out), SYSTEMS[system_of(job.name)].sampling
    figures = measure_generated(
        tokenizer, job.checkpoint, job.name, library, clips, evaluator, sampling, repeats=REPEATS, seed=SEED
    )
    return figures | {"validation": job.facts().get("validation", [])}


def measure_again(library: str | Path, out: Path = Path("runs/ablations-others")) -> dict[str, Any]:
    """The result of the trainings that are finished under `out` alone; nothing is trained, nothing is stored."""
    return Record(table_of(out), Library.open(Path(library)), judge()).results()


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its exit status."""
    about = "Train and measure the other systems' ablations, one after another; call it again to go on."
    options = options_of("ablations_others", about, "runs/ablations-others", arguments, sizes=())

    def train(jobs: Sequence[Job], limits: Limits, after: After) -> bool:
        unseen = [job for job in jobs if held_out(job.name)]
        done = in_order([job for job in jobs if not held_out(job.name)], limits, after)
        if unseen and not limits.passed:
            folder = options.out / f"library-without-{HELD_OUT}"
            library_without(Library.open(limits.library), HELD_OUT, folder)
            done = in_order(unseen, replace(limits, library=folder), after) and done
        return done

    return run_table(options, table_of(options.out), train)


if __name__ == "__main__":
    sys.exit(main())
