"""What the ablations measure: how well a tokenizer file rebuilds a split, how well a contrastive evaluator pairs it.

Neither file has to be a system of the table or a shipped evaluator.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from playground.analysis.paired import weighted
from playground.analysis.passes import first_caption, rows_of
from playground.data.library import Library
from playground.evaluation.items import ITEMS, Item, draw_items, measurable, stream
from playground.evaluation.metrics import Missing, clip_score, fid
from playground.evaluation.passes import Passes
from playground.evaluation.run import reconstruct
from playground.evaluation.spread import Spread

if TYPE_CHECKING:
    from playground.evaluation.evaluators import Evaluator
    from playground.runtime import Runtime

LONG = 96  # rows; clips of more count as long (Table 7)


def measure_tokenizer(
    path: Path,
    name: str,
    library: Library,
    split: str,
    *,
    evaluator: "Evaluator | None",
    repeats: int = 5,
    seed: int = 0,
) -> dict[str, Any]:
    """Reconstruction of a split by the tokenizer in a file: what `reconstruct` gives, and some things more.

    mpjpe_mm_ci95: 1.96 standard errors over clips of that mean over frames. by_clip: {"mm", "frames"}, the error and
    the length of every clip in the order of the split, as words, so that two tokenizers can be compared clip by clip.
    mpjpe_mm_long: over clips of more than LONG rows, with their number n_long. fid: {"mean", "ci95", "n", "repeats",
    "evaluator"} of rebuilt against recorded motions, windows and captions drawn anew for every repeat; "why" in the
    place of a mean that does not exist.
    PlaygroundError if the file is no tokenizer or the split holds no clip to measure.
    """
    runtime = open_tokenizer(path, name)
    found = reconstruct(runtime, library, split, seed)
    clips = measurable(library, library.split(split))
    passes = Passes(runtime, library, {}, 0.0, {}, Spread())
    whole = [Item(i, first_caption(library.clips[i].captions), 0, rows_of(library.clips[i].frames), 0) for i in clips]
    errors, rows = passes.rebuilt(whole).errors_mm, np.array([item.rows for item in whole])
    long = rows > LONG
    return found | {
        "mpjpe_mm_ci95": weighted(errors, rows)[1],
        "by_clip": {
            "mm": " ".join(f"{error:.2f}" for error in errors),
            "frames": " ".join(str(count) for count in rows),
        },
        "mpjpe_mm_long": float(np.average(errors[long], weights=rows[long])) if long.any() else None,
        "n_long": int(long.sum()),
        "fid": reconstruction_fid(runtime, library, clips, evaluator, repeats, seed),
    }


def measure_contrastive(path: Path, library: Library, split: str, *, seed: int = 0) -> dict[str, Any]:
    """A CLIP-style evaluator on the recorded motions of a split: mean cosine of pairs, and R-Precision (Table 6).

    PlaygroundError if the file is no such evaluator or the split holds no clip to measure.
    """
    from playground.evaluation.evaluators import open_evaluator

    evaluator, card = open_evaluator(path, "clip")
    clips = measurable(library, library.split(split))
    motions = evaluator.embed_rows([library.features(i)[: rows_of(library.clips[i].frames)] for i in clips])
    texts = evaluator.embed_texts([first_caption(library.clips[i].captions) for i in clips])
    score = clip_score(texts, motions)
    return {
        "checkpoint": card.hash[:12],
        "data": library.name,
        "split": split,
        "n": len(clips),
        "seed": seed,
        "clip_score": None if isinstance(score, Missing) else score,
        "retrieval": card.facts.get("retrieval"),
    }


def open_tokenizer(path: Path, name: str) -> "Runtime":
    """A tokenizer file as a runtime without a generator. PlaygroundError if it is none or its encoder is missing."""
    from playground.checkpoints import load_tokenizer
    from playground.errors import PlaygroundError
    from playground.runtime import Runtime
    from playground.text.encoders import CachedEncoder, check_same, load_encoder

    tokenizer, card = load_tokenizer(path)
    if card.normaliser is None:
        raise PlaygroundError(f"{path} carries no normaliser; it is not a finished tokenizer checkpoint")
    encoder = load_encoder(card.encoder.name)
    check_same(card.encoder, encoder)
    cached = CachedEncoder(encoder, capacity=4096)
    return Runtime(name, tokenizer, None, cached, card.normaliser, card.hash[:12], card.data)


def reconstruction_fid(
    runtime: "Runtime", library: Library, clips: list[int], evaluator: "Evaluator | None", repeats: int, seed: int
) -> dict[str, Any]:
    """FID of rebuilt against recorded motions over repeats; a sentence where there is no evaluator."""
    about: dict[str, Any] = {"n": len(clips), "repeats": repeats}
    if evaluator is None:
        return about | {"mean": None, "ci95": None, "why": "no trained evaluator was there"}
    passes = Passes(runtime, library, {evaluator.name: evaluator}, 0.0, {}, Spread())
    values = []
    for repeat in range(repeats):
        items = draw_items(library, clips, stream(seed, repeat, ITEMS))
        recorded = passes.recorded(items).embeddings[evaluator.name]
        value = fid(recorded, passes.rebuilt(items).motions.embeddings[evaluator.name])
        if isinstance(value, Missing):
            return about | {"mean": None, "ci95": None, "why": value.why}
        values.append(value)
    spread = 1.96 * float(np.std(values)) / np.sqrt(len(values))
    return about | {"mean": float(np.mean(values)), "ci95": float(spread), "evaluator": evaluator.hash[:12]}
