"""What the ablations of the other papers' systems measure: files that need be no system of the table.

A tokenizer file alone is measured on rebuilt motions and level by level, with a generator file on generated ones.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from playground.analysis.passes import first_caption
from playground.data.library import Library
from playground.evaluation.items import ITEMS, POOLS, Item, draw_items, measurable, stream
from playground.evaluation.levels import measure_levels
from playground.evaluation.metrics import Missing, Value, fid, mm_dist, r_precision
from playground.evaluation.passes import Passes
from playground.evaluation.published.base import measured
from playground.evaluation.published.levels import summed
from playground.evaluation.reconstruction import open_tokenizer
from playground.evaluation.repeats import MAIN
from playground.evaluation.spread import Spread
from playground.systems import SamplingDefaults

if TYPE_CHECKING:
    from playground.evaluation.evaluators import Evaluator
    from playground.runtime import Runtime

Entry = dict[str, Any]  # {"mean", "ci95", "n", and "why" without a mean}
POOL = 32


def measure_rebuilt(
    path: Path,
    name: str,
    library: Library,
    indices: Sequence[int],
    evaluator: "Evaluator | None",
    *,
    repeats: int,
    seed: int,
) -> dict[str, Any]:
    """A tokenizer file on clips of a library: rebuilt motions, true captions, g = 0.

    {"checkpoint", "parameters", "n", "mpjpe_mm" over whole clips, "rfid", "rtop1", "rmm_dist" over repeats (other
    windows and captions each), "levels", "between": as evaluation/levels.py tells, summed up}.
    PlaygroundError if the file is no finished tokenizer or no clip is long enough.
    """
    runtime = open_tokenizer(path, name)
    clips = measurable(library, indices)
    captions = [first_caption(library.clips[index].captions) for index in clips]
    found = summed(measure_levels(runtime, library, clips, captions, evaluator))
    passes = _passes(runtime, library, evaluator, None)
    repeated = _repeated(
        passes, clips, evaluator, repeats, seed, lambda items: passes.rebuilt(items).motions.embeddings
    )
    return {
        "checkpoint": runtime.checkpoint,
        "parameters": _size(runtime.tokenizer),
        "n": len(clips),
        "mpjpe_mm": found["rows"][-1]["mpjpe_mm"],
        "levels": found["rows"],
        "between": found["between"],
    } | {f"r{key}": value for key, value in repeated.items()}


def measure_generated(
    tokenizer: Path,
    generator: Path,
    name: str,
    library: Library,
    indices: Sequence[int],
    evaluator: "Evaluator | None",
    sampling: SamplingDefaults,
    *,
    repeats: int,
    seed: int,
) -> dict[str, Any]:
    """A generator file with its tokenizer on the captions of clips: motions as long as the recorded ones.

    {"checkpoint", "tokenizer" (its checkpoint), "parameters" of the generator, "n", "gfid", "gtop1", "gmm_dist" over
    repeats}. PlaygroundError if a file is not what it should be or no clip is long enough.
    """
    from playground.architectures import caller
    from playground.checkpoints import load_generator

    network, card = load_generator(generator)
    bare = open_tokenizer(tokenizer, name)
    runtime = replace(bare, generator=caller(network, bare.tokenizer))
    clips = measurable(library, indices)
    passes = _passes(runtime, library, evaluator, sampling)
    repeated = _repeated(passes, clips, evaluator, repeats, seed, lambda items: passes.generated(items).embeddings)
    about = {"checkpoint": card.hash[:12], "tokenizer": bare.checkpoint, "parameters": _size(network), "n": len(clips)}
    return about | {f"g{key}": value for key, value in repeated.items()}


def _passes(
    runtime: "Runtime", library: Library, evaluator: "Evaluator | None", sampling: SamplingDefaults | None
) -> Passes:
    drawing = {} if sampling is None else asdict(sampling)
    guidance = drawing.pop("guidance", 0.0)
    judges = {} if evaluator is None else {MAIN: evaluator}
    return Passes(runtime, library, judges, guidance, drawing, Spread())


def _repeated(
    passes: Passes,
    clips: list[int],
    evaluator: "Evaluator | None",
    repeats: int,
    seed: int,
    make: Callable[[list[Item]], dict[str, Any]],
) -> dict[str, Entry]:
    """FID against the recorded windows, Top 1 (own motion only, pool of 32) and MM-Dist, means over repeats."""
    values: dict[str, list[Value]] = {"fid": [], "top1": [], "mm_dist": []}
    for repeat in range(repeats if evaluator is not None else 0):
        items = draw_items(passes.library, clips, stream(seed, repeat, ITEMS))
        there = [place for place, item in enumerate(items) if item.caption]
        texts, made = passes.texts(items)[MAIN][there], make(items)[MAIN]
        values["fid"].append(fid(passes.recorded(items).embeddings[MAIN], made))
        values["top1"].append(r_precision(texts, made[there], POOL, 1, stream(seed, repeat, POOLS)))
        values["mm_dist"].append(mm_dist(texts, made[there]))
    return {key: _entry(found) for key, found in values.items()}


def _entry(values: Sequence[Value]) -> Entry:
    """Mean over repeats; why there is none where it does not exist."""
    missing = next((value.why for value in values if isinstance(value, Missing)), None)
    if missing is not None or not values:
        return {"mean": None, "ci95": None, "n": 0, "why": missing or "no trained evaluator was there"}
    return measured(np.array(values, np.float64))


def _size(model: Any) -> int:
    """Numbers in a module: parameters and codebooks, as the table of systems counts them."""
    return int(sum(tensor.numel() for tensor in model.state_dict().values()))
