"""Measure a system on a split of a library: reconstruction error and code usage, and all metrics of F2 over repeats."""

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from playground.analysis.passes import ClipPass, clip_passes, first_caption, rows_of
from playground.analysis.results import digest
from playground.analysis.usage import CodeUsage
from playground.data.library import Library
from playground.engine import Engine, check_guidance, default_engine
from playground.errors import PlaygroundError
from playground.evaluation.items import measurable
from playground.evaluation.passes import Passes
from playground.evaluation.repeats import CLIP, MAIN, Plan, Repeat, Table, summarise
from playground.evaluation.spread import Spread, Tally
from playground.evaluation.state import State, state_path
from playground.limits import LIMITS
from playground.systems import SamplingDefaults, checkpoint_path, row_of

if TYPE_CHECKING:
    from playground.evaluation.evaluators import Evaluator
    from playground.runtime import Runtime

Progress = Callable[[int, int], None]
TEXTS_KEPT = 20_000  # captions whose features are kept during an evaluation
TABLES = ("metrics", "real", "reconstruction")


@dataclass(frozen=True)
class Order:
    """What is asked beyond reconstruction; nothing with repeats = 0.

    guidance, cfg: of the decoder and of the generator, the system's own by default. out: the file of the result, beside
    which the state is kept. evaluators: the shipped ones by default. refine: generated motions go through the shipped
    root refiner.
    """

    repeats: int = 0
    mm_texts: int = 96
    mm_samples: int = 30
    seed: int = 0
    guidance: float | None = None
    cfg: float | None = None
    out: Path | None = None
    evaluators: dict[str, "Evaluator"] | None = None
    refine: bool = False

    def check(self) -> None:
        """PlaygroundError for a number out of range."""
        for name, value in (("repeats", self.repeats), ("mm-texts", self.mm_texts), ("mm-samples", self.mm_samples)):
            if not 0 <= value <= 1000:
                raise PlaygroundError(f"--{name} is {value}; 0 to 1000 is accepted")
        if not 0 <= self.seed <= LIMITS.max_seed:
            raise PlaygroundError(f"the seed must be a whole number from 0 to {LIMITS.max_seed}")
        check_guidance(self.guidance or 0.0)
        check_guidance(self.cfg or 0.0, "cfg")
        if self.refine and not self.repeats:
            raise PlaygroundError("--refine is of generated motions; ask for at least one repeat of them: --repeats 1")

    def sampling(self, system: str) -> SamplingDefaults:
        """How motions are generated: the system's own settings but for those asked for."""
        asked = {"guidance": self.guidance, "cfg": self.cfg}
        return replace(row_of(system).sampling, **{key: value for key, value in asked.items() if value is not None})


def evaluate(
    system: str,
    library_path: Path,
    split: str = "test",
    progress: Progress | None = None,
    *,
    engine: Engine | None = None,
    seed: int = 0,
    order: Order | None = None,
    spread: Spread | None = None,
) -> dict[str, Any]:
    """Reconstruction and code usage of a system, true first caption at both ends, g = 0; and the metrics of the order.

    Clips are floored to 4 rows and measured on their first 196; too short ones are left out, n counts the others.
    Errors are pelvis-relative millimetres pooled over frames (F2); the mean over sources weighs every source alike.
    Numbers that do not exist (no token) are None. An order of at least one repeat adds "repeats", "sampling",
    "evaluators" and the tables "metrics" (of generated motions and of tokens), "real" and "reconstruction", each
    {metric: {"mean", "ci95", "n"}}; there windows, captions and motions are drawn, from (seed, repeat) alone. With a
    `spread` the processes share the work, and the first one returns the result, the others {}.
    PlaygroundError if the system has no checkpoint, the library is none, the split holds no clip to measure, or the
    state beside order.out is another evaluation's.
    """
    order, spread, engine = order or Order(seed=seed), spread or Spread(), engine or default_engine()
    order.check()
    library = Library.open(Path(library_path))
    library.split(split)
    if not order.repeats:
        return reconstruct(engine.runtime(system), library, split, order.seed, progress) if spread.first else {}
    campaign = set_up(system, library, split, order, engine, spread)
    base = reconstruct(engine.runtime(system), library, split, order.seed) if spread.first else {}
    plan = Plan(order.seed, order.mm_texts, order.mm_samples)
    motions = plan.motions(len(campaign.clips), campaign.passes.runtime.generates)
    repeats = campaign.repeat(
        order, {"mm_texts": plan.mm_texts, "mm_samples": plan.mm_samples}, motions, progress,
        lambda number: Repeat(campaign.passes, campaign.clips, plan, number).run(),
    )  # fmt: skip
    if not spread.first:
        return {}
    shown = {
        key: campaign.settings[key]
        for key in ("generator", "sampling", "evaluators", "refiner")
        if key in campaign.settings
    }
    asked = {"repeats": order.repeats, "mm_texts": plan.mm_texts, "mm_samples": plan.mm_samples}
    return base | asked | shown | {name: summarise([repeat[name] for repeat in repeats]) for name in TABLES}


@dataclass(frozen=True, eq=False)
class Campaign:
    """A system ready to be measured on some clips again and again. settings: what every number depends on."""

    passes: Passes
    clips: list[int]
    settings: dict[str, Any]

    def repeat(
        self,
        order: Order,
        settings: dict[str, Any],
        motions: int,
        progress: Progress | None,
        run: Callable[[int], dict[str, Table]],
    ) -> list[dict[str, Table]]:
        """Tables of order.repeats repeats, those of the state beside order.out included; every new one is added there.

        settings: what the numbers depend on besides. motions: what a repeat works on, for the progress. run: number of
        a repeat -> its tables. Processes but the first get what was computed now. PlaygroundError if the state is
        another evaluation's.
        """
        spread = self.passes.spread
        path = state_path(order.out) if order.out and spread.first else None
        state = State(path, self.settings | settings)
        done = spread.tell(len(state.repeats))
        self.passes.tally = Tally(progress, (order.repeats - done) * motions // spread.size)
        for number in range(done, order.repeats):
            state.add(run(number))
        return state.repeats[: order.repeats]


def set_up(system: str, library: Library, split: str, order: Order, engine: Engine, spread: Spread) -> Campaign:
    """Load everything; models go to this process's device, and the features of every caption are kept.

    PlaygroundError if the system has no checkpoint or the split no clip that is long enough.
    """
    from playground.text.encoders import CachedEncoder

    runtime = engine.runtime(system)
    clips = measurable(library, library.split(split))
    evaluators = shipped_evaluators() if order.evaluators is None else order.evaluators
    sampling = order.sampling(system)
    refiner = engine.refiner() if order.refine else None
    settings = {
        "system": system,
        "checkpoint": runtime.checkpoint,
        "generator": digest(checkpoint_path(engine.assets, system, "generator")),
        "data": library.name,
        "clips": digest(library.path / "clips.jsonl"),
        "split": split,
        "seed": order.seed,
        "sampling": asdict(sampling),
        "evaluators": {name: one.hash[:12] for name, one in evaluators.items()},
    }
    if refiner is not None:
        settings["refiner"] = refiner.checkpoint
    captions, prompts = CachedEncoder(runtime.encoder, capacity=TEXTS_KEPT), runtime.prompt_encoder
    prompts = None if prompts is None else CachedEncoder(prompts, capacity=TEXTS_KEPT)
    local = replace(runtime.to(spread.device), encoder=captions, prompt_encoder=prompts)
    drawing = asdict(sampling)
    guidance = drawing.pop("guidance")
    return Campaign(Passes(local, library, evaluators, guidance, drawing, spread, refiner), clips, settings)


def shipped_evaluators() -> dict[str, "Evaluator"]:
    """The evaluators that have a checkpoint here, by name."""
    from playground.evaluation.evaluators import evaluator_path, load_evaluator

    return {name: load_evaluator(name) for name in (MAIN, CLIP) if evaluator_path(name).is_file()}


def reconstruct(
    runtime: "Runtime", library: Library, split: str, seed: int, progress: Progress | None = None
) -> dict[str, Any]:
    """The quick part: reconstruction and code usage, first captions. Nothing is drawn; seed is only written down.

    Of a system without a tokenizer it says what would be measured on; the numbers are None.
    """
    chosen = library.split(split)
    count = sum(rows_of(library.clips[i].frames) > 0 for i in chosen)
    if not count:
        raise PlaygroundError(f"the split {split} of {library.path} holds no clip long enough to be measured")
    about = {
        "system": runtime.name,
        "checkpoint": runtime.checkpoint,
        "data": library.name,
        "split": split,
        "n": count,
        "seed": seed,
    }
    if runtime.codec is None:
        none = dict.fromkeys(("mpjpe_mm", "mpjpe_mm_source_mean", "usage_all"))
        return about | none | {"by_source": {}, "usage": [], "perplexity": []}
    captions = [first_caption(library.clips[i].captions) for i in chosen]
    passes = list(clip_passes(runtime, library, chosen, captions, progress=progress))
    by_source = errors_by_source(passes, [library.clips[one.index].source for one in passes])
    levels = [np.concatenate(level) for level in zip(*(one.ids for one in passes), strict=True)]
    usage = CodeUsage().fit(levels, runtime.tokenizer.quantizer.codes)
    return about | {
        "mpjpe_mm": float(np.concatenate([one.errors_mm for one in passes]).mean()),
        "mpjpe_mm_source_mean": float(np.mean([row["mpjpe_mm"] for row in by_source.values()])),
        "by_source": by_source,
        "usage": [float(share) for share in usage.used_],
        "usage_all": usage.used_all_,
        "perplexity": [float(value) if math.isfinite(value) else None for value in usage.perplexity_],
    }


def errors_by_source(passes: list[ClipPass], sources: list[str]) -> dict[str, dict[str, Any]]:
    """{source: {"n": clips, "mpjpe_mm": error pooled over frames}}, sources in the order of their names."""
    rows: dict[str, list[ClipPass]] = {}
    for one, source in zip(passes, sources, strict=True):
        rows.setdefault(source, []).append(one)
    return {
        source: {"n": len(rows[source]), "mpjpe_mm": float(np.concatenate([c.errors_mm for c in rows[source]]).mean())}
        for source in sorted(rows)
    }
