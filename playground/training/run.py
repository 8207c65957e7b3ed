"""`train CONFIG`: builds the data, the model and the task of a named run, and fits it."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import torch

from playground.architectures import build, caller, fitted
from playground.checkpoints import load_generator, load_tokenizer
from playground.data.batches import BatchConfig, BatchSource, library_samples, synthetic_samples, whole_batches
from playground.data.library import Library
from playground.engine import ASSETS
from playground.errors import PlaygroundError
from playground.evaluation.networks import build_evaluator
from playground.generators.refiner import build_refiner
from playground.motion.representation import Normaliser
from playground.motion.synthetic import corpus
from playground.progress import Progress
from playground.systems import checkpoint_path
from playground.text.encoders import check_same, load_encoder
from playground.text.store import FeatureStore
from playground.tokenizers.base import Tokenizer
from playground.training.configs import (
    EVALUATORS,
    GENERATORS,
    REFINERS,
    REFITS,
    TOKENIZERS,
    EvaluatorTraining,
    FeatureTraining,
    GeneratorTraining,
    RefinerTraining,
    RefitTraining,
    TokenizerTraining,
    with_steps,
)
from playground.training.evaluator import EvaluatorTask
from playground.training.family import FAMILY, SIZES
from playground.training.features import FeatureTask
from playground.training.generator import GeneratorTask, build_bank
from playground.training.loop import Fit, Launch, Task, fit, seeded, start_fabric
from playground.training.others import OTHERS
from playground.training.refiner import RefinerTask
from playground.training.refit import RefitTask, build_refit_bank
from playground.training.tokenizer import TokenizerTask

Training = TokenizerTraining | GeneratorTraining | FeatureTraining | RefitTraining | RefinerTraining | EvaluatorTraining


@dataclass(frozen=True)
class Order:
    """What was asked for besides the run itself."""

    library: Path
    out: Path
    resume: bool = False
    steps: int | None = None
    launch: Launch = field(default_factory=Launch)
    on_step: Callable[[int, float], None] | None = None
    deadline: float | None = None  # time.monotonic() at which the run stops, to be resumed
    about: dict[str, Any] = field(default_factory=dict)  # facts for the checkpoint

    def fit(self, fabric: Any, task: Task, config: Training, out: Path) -> dict[str, Any]:
        """Train, with the number of steps asked for."""
        schedule = with_steps(config.schedule, self.steps)
        return fit(Fit(fabric, task, schedule, out, config.seed, self.resume, self.deadline, self.about, self.on_step))


def train(
    config: str,
    library: Path,
    out: Path,
    *,
    size: str = "cpu",
    resume: bool = False,
    steps: int | None = None,
    minutes: float | None = None,
    launch: Launch | None = None,
    on_step: Callable[[int, float], None] | None = None,
) -> dict[str, Any]:
    """Run the training named `config` on a library into the folder `out`; returns the facts of the run.

    size: which of the sizes of the LG-Tok family ("cpu" or "gpu"). After so many minutes the run stops with its state
    saved, and `resume` goes on with it. PlaygroundError for an unknown name, a folder that is no library, or a run that
    exists while `resume` is not set.
    """
    training = find_training(config, size)
    deadline = None if minutes is None else time.monotonic() + 60 * minutes
    about = {"run": config} | ({"size": size} if config in FAMILY[size] else {})
    return run_training(training, Order(library, out, resume, steps, launch or Launch(), on_step, deadline, about))


def find_training(name: str, size: str = "cpu") -> Training:
    """The training with that name. PlaygroundError for an unknown name or size."""
    if size not in SIZES:
        raise PlaygroundError(f"unknown size {size!r}; accepted: {', '.join(SIZES)}")
    known: dict[str, Training] = {
        **TOKENIZERS, **GENERATORS, **REFITS, **FAMILY[size], **OTHERS, **REFINERS, **EVALUATORS
    }  # fmt: skip
    if name not in known:
        raise PlaygroundError(f"unknown training {name!r}; known are {', '.join(known)}")
    return known[name]


def run_training(training: Training, order: Order) -> dict[str, Any]:
    """Run a training; returns its facts."""
    with_steps(training.schedule, order.steps)
    if isinstance(training, TokenizerTraining | FeatureTraining):
        return _train_on_motions(training, order)
    if isinstance(training, GeneratorTraining):
        return _train_generator(training, order)
    if isinstance(training, RefitTraining):
        return _train_refit(training, order)
    if isinstance(training, RefinerTraining):
        return _train_refiner(training, order)
    return _train_evaluator(training, order)


def part_of(training: Training) -> str:
    """The folder of a run inside its output folder."""
    if isinstance(training, EvaluatorTraining):
        return training.model.kind
    if isinstance(training, RefitTraining):
        return "refit/tokenizer"
    if isinstance(training, RefinerTraining):
        return "refiner"
    return "tokenizer" if isinstance(training, TokenizerTraining) else "generator"


def training_batches(
    library: Library, config: Training, normaliser: Normaliser, device: torch.device | str = "cpu"
) -> BatchSource:
    """Batches over the training split, or what the training takes of it, plus a share of the synthetic corpus."""
    samples = library_samples(library, "train")
    if isinstance(config, TokenizerTraining):
        samples = [s for s in samples[: config.clips or None] if len(s.features) <= (config.longest or len(s.features))]
    if not samples:
        raise PlaygroundError(f"the library {library.path} has no clip for this in its train split")
    extra = round(len(samples) * config.synthetic)
    if extra:
        samples = samples + synthetic_samples(corpus(extra, seed=0))
    return BatchSource(samples, normaliser, config.batch, config.seed, device)


def _train_on_motions(config: TokenizerTraining | FeatureTraining, order: Order) -> dict[str, Any]:
    """A tokenizer, or a generator of features: what learns from the clips themselves."""
    library, out = Library.open(order.library), order.out / part_of(config)
    fabric = start_fabric(order.launch, out)
    encoder = load_encoder(config.text)
    batches = training_batches(library, config, library.normaliser, fabric.device)
    held_out = library_samples(library, "val")
    texts = [*batches.captions(), *(caption for sample in held_out for caption in sample.captions), ""]
    store = FeatureStore.cached(order.library, texts, encoder)
    validation = whole_batches(held_out, library.normaliser, config.batch.size) if held_out else []
    with seeded(config.seed, fabric.device):
        model = build(fitted(config.model, text_width=encoder.width))
    rest = (batches, validation, store, encoder, library.name, fabric.device)
    task: Task
    if isinstance(config, TokenizerTraining):
        task = TokenizerTask(model, config, *rest)
    else:
        task = FeatureTask(model, config, *rest)
    return order.fit(fabric, task, config, out)


def _train_generator(config: GeneratorTraining, order: Order) -> dict[str, Any]:
    tokenizer, card = load_tokenizer(tokenizer_of(config, order.out))
    library, out = Library.open(order.library), order.out / part_of(config)
    normaliser = card.normaliser or library.normaliser
    fabric = start_fabric(order.launch, out)
    encoder = load_encoder(config.text)
    check_same(card.encoder, encoder)
    batches = training_batches(library, config, normaliser, fabric.device)
    samples = library_samples(library, "val")
    whole = BatchConfig(size=config.batch.size, whole=1.0, shorter=0.0, mirror=0.0)
    held_out = BatchSource(samples, normaliser, whole, config.seed, fabric.device) if samples else None
    texts = [*batches.captions(), *(held_out.captions() if held_out else []), ""]
    store = FeatureStore.cached(order.library, texts, encoder)
    tokenizer = tokenizer.to(fabric.device)
    with Progress("tokenizing the training clips") as progress:
        bank = build_bank(tokenizer, batches, store, config.variants, fabric.device, progress)
    checked = build_bank(tokenizer, held_out, store, 1, fabric.device) if held_out else None
    with seeded(config.seed, fabric.device):
        model = build(generator_config(config, tokenizer, encoder.width))
    task = GeneratorTask(
        model, tokenizer.quantizer, config, bank, checked, store, encoder, library.name, card.hash[:12], fabric.device
    )
    return order.fit(fabric, task, config, out)


def tokenizer_of(config: GeneratorTraining, out: Path, assets: Path = ASSETS) -> Path:
    """The checkpoint whose tokens a generator run into `out` learns from: that of the run itself, or of the system that
    lends it, from its run beside this one or as it is shipped. PlaygroundError if there is none."""
    own = out / "tokenizer" / "checkpoint.safetensors"
    lender = config.tokenizer.removesuffix("-tokenizer")
    lent = (out.parent / lender / "tokenizer" / own.name, checkpoint_path(assets, lender, "tokenizer"))
    places = lent if config.lent else (own,)
    for path in places:
        if path.is_file():
            return path
    where = f"into {out.parent / lender}" if config.lent else "into the same folder"
    raise PlaygroundError(f"{places[0]} is absent; train {config.tokenizer} {where} first")


def _train_refit(config: RefitTraining, order: Order) -> dict[str, Any]:
    paths = [order.out / part / "checkpoint.safetensors" for part in ("tokenizer", "generator")]
    if not all(path.is_file() for path in paths):
        raise PlaygroundError(f"{order.out} holds no trained tokenizer and generator; train both there first")
    frozen, card = load_tokenizer(paths[0])
    network, generator_card = load_generator(paths[1])
    library, out = Library.open(order.library), order.out / "refit" / "tokenizer"
    normaliser = card.normaliser or library.normaliser
    fabric = start_fabric(order.launch, out)
    encoder = load_encoder(config.text)
    check_same(card.encoder, encoder)
    batches = training_batches(library, config, normaliser, fabric.device)
    held_out = library_samples(library, "val")
    texts = [*batches.captions(), *(caption for sample in held_out for caption in sample.captions), ""]
    store = FeatureStore.cached(order.library, texts, encoder).to(fabric.device)
    frozen, network = frozen.to(fabric.device), network.to(fabric.device)
    with Progress("drawing tokens of the training clips") as progress:
        bank = build_refit_bank(caller(network, frozen), frozen, batches, store, config, progress)
    with seeded(config.seed, fabric.device):
        model = build(replace(card.config, seam=config.seam or card.config.seam))
    model.load_state_dict(frozen.state_dict(), strict=False)
    validation = whole_batches(held_out, normaliser, config.batch.size) if held_out else []
    task = RefitTask(model, config, bank, batches, validation, store, card, (network, generator_card), fabric.device)
    return order.fit(fabric, task, config, out)


def _train_refiner(config: RefinerTraining, order: Order) -> dict[str, Any]:
    library, out = Library.open(order.library), order.out / part_of(config)
    fabric = start_fabric(order.launch, out)
    batches = training_batches(library, config, library.normaliser, fabric.device)
    held_out = library_samples(library, "val")
    validation = whole_batches(held_out, library.normaliser, config.batch.size) if held_out else []
    with seeded(config.seed, fabric.device):
        network = build_refiner(config.model)
    task = RefinerTask(network, config, batches, validation, library.name, fabric.device)
    return order.fit(fabric, task, config, out)


def _train_evaluator(config: EvaluatorTraining, order: Order) -> dict[str, Any]:
    library, out = Library.open(order.library), order.out / part_of(config)
    fabric = start_fabric(order.launch, out)
    encoder = load_encoder(config.text)
    clips = library.split("train") or list(range(len(library)))
    normaliser = Normaliser.fit((library.features(i) for i in clips), groups=())
    batches = training_batches(library, config, normaliser, fabric.device)
    held_out = {split: library_samples(library, split) for split in ("val", "test")}
    own = (caption for samples in held_out.values() for sample in samples for caption in sample.captions)
    store = FeatureStore.cached(order.library, [*batches.captions(), *own, ""], encoder)
    with seeded(config.seed, fabric.device):
        network = build_evaluator(replace(config.model, text_width=encoder.width))
    task = EvaluatorTask(network, config, batches, held_out, store, encoder, library.name, fabric.device)
    return order.fit(fabric, task, config, out)


def generator_config(config: GeneratorTraining, tokenizer: Tokenizer, text_width: int) -> Any:
    """The generator's config with the token shapes of its tokenizer and the width of its text encoder."""
    c = tokenizer.config
    return fitted(config.model, scales=c.scales, codes=c.codes, code_width=c.code_width, text_width=text_width)
