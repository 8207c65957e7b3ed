"""`train CONFIG`: builds the data, the model and the task of a named run, and fits it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch

from playground.data.batches import BatchSource, library_samples, synthetic_samples, whole_batches
from playground.data.library import Library
from playground.errors import PlaygroundError
from playground.motion.synthetic import corpus
from playground.text.encoders import load_encoder
from playground.text.store import FeatureStore
from playground.tokenizers.transformer import build_tokenizer
from playground.training.configs import TOKENIZERS, TokenizerTraining, with_steps
from playground.training.loop import Launch, fit, start_fabric
from playground.training.tokenizer import TokenizerTask


def train(
    config: str,
    library: Path,
    out: Path,
    *,
    resume: bool = False,
    steps: int | None = None,
    launch: Launch | None = None,
    on_step: Callable[[int, float], None] | None = None,
) -> dict[str, Any]:
    """Run the training named `config` on a library into the folder `out`; returns the facts of the run.

    PlaygroundError for an unknown name, a folder that is no library, or a run that exists while `resume` is not set.
    """
    launch = launch or Launch()
    if config in TOKENIZERS:
        return _train_tokenizer(TOKENIZERS[config], library, out / "tokenizer", resume, steps, launch, on_step)
    known = ", ".join([*TOKENIZERS])
    raise PlaygroundError(f"unknown training {config!r}; known are {known}")


def training_batches(library: Library, config: Any, synthetic: float) -> BatchSource:
    """Batches over the training split plus a share of the synthetic corpus."""
    samples = library_samples(library, "train")
    if not samples:
        raise PlaygroundError(f"the library {library.path} has no clip in its train split")
    extra = round(len(samples) * synthetic)
    if extra:
        samples = samples + synthetic_samples(corpus(extra, seed=0))
    return BatchSource(samples, library.normaliser, config.batch, config.seed)


def _train_tokenizer(
    config: TokenizerTraining,
    library_path: Path,
    out: Path,
    resume: bool,
    steps: int | None,
    launch: Launch,
    on_step: Callable[[int, float], None] | None,
) -> dict[str, Any]:
    library = Library.open(library_path)
    config = replace(config, schedule=with_steps(config.schedule, steps))
    fabric = start_fabric(launch, out)
    encoder = load_encoder(config.text)
    batches = training_batches(library, config, config.synthetic)
    held_out = library_samples(library, "val")
    texts = [*batches.captions(), *(c for s in held_out for c in s.captions), ""]
    store = FeatureStore.cached(library_path, texts, encoder)
    validation = whole_batches(held_out, library.normaliser, config.batch.size) if held_out else []
    with torch.random.fork_rng():
        torch.manual_seed(config.seed)
        model = build_tokenizer(replace(config.model, text_width=encoder.width))
    task = TokenizerTask(model, config, batches, validation, store, encoder, library.name, fabric.device)
    return fit(fabric, task, config.schedule, out, resume=resume, on_step=on_step)
