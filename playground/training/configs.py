"""Every training run by name: what is trained, on how much, with which numbers. Rows of a table, not code."""

from dataclasses import dataclass, field, replace
from typing import Any

from playground.data.batches import BatchConfig
from playground.errors import PlaygroundError
from playground.evaluation.networks import EvaluatorConfig
from playground.generators.refiner import RefinerConfig
from playground.generators.scalewise import GENERATOR_PRESETS
from playground.tokenizers.transformer import PRESETS


@dataclass(frozen=True)
class Schedule:
    """Optimiser and learning-rate plan: warm-up, constant, then a linear fall over the last part."""

    steps: int = 20_000
    rate: float = 4e-4
    betas: tuple[float, float] = (0.9, 0.99)
    weight_decay: float = 0.0
    warmup: int = 300
    fall: float = 0.3  # share of the steps over which the rate falls
    floor: float = 0.05  # last rate as a share of `rate`
    clip: float = 0.5  # gradient norm
    save_every: int = 250
    validate_every: int = 500


@dataclass(frozen=True)
class TokenizerTraining:
    """One tokenizer run (systems.md A7; of the others A9, B1, C1, D3, E3)."""

    model: Any  # config of a tokenizer of architectures.py
    batch: BatchConfig = field(default_factory=BatchConfig)
    schedule: Schedule = field(default_factory=Schedule)
    text: str = "minilm"  # text encoder
    synthetic: float = 0.1  # synthetic clips as a share of the training clips
    language_drop: float = 0.1  # share of samples without text (A5)
    commitment: float = 0.02
    heading: float = 0.0  # weight of smoothL1 on the accumulated heading; not in the papers, 0 there
    joints: float = 0.0  # weight of smoothL1 on the joint positions, columns 4 to 66 (A9, B1)
    velocity: float = 0.0  # weight of smoothL1 on differences of successive rows (D3)
    masked_mean: bool = False  # True: mean over real frames only; the released code counts padded frames as zeros
    clips: int = 0  # the first so many clips of the training list; 0: all
    longest: int = 0  # clips of more rows are left out; 0: none
    seed: int = 0


TOKENIZERS: dict[str, TokenizerTraining] = {
    "lgtok-tokenizer": TokenizerTraining(
        model=PRESETS["lite"],
        batch=BatchConfig(size=32, speed=0.3, source_balance=0.5, action_balance=0.3),
        schedule=Schedule(steps=2_600, rate=1e-3),
        heading=0.02,
        masked_mean=True,
    ),
}


@dataclass(frozen=True)
class GeneratorTraining:
    """One generator run (systems.md A10; of the others B2, B3, C2, D3, E4)."""

    model: Any  # config of a generator of architectures.py
    tokenizer: str  # the tokenizer run whose checkpoint it draws from
    batch: BatchConfig = field(default_factory=BatchConfig)
    schedule: Schedule = field(default_factory=Schedule)
    size: int = 32  # motions a batch
    variants: int = 5  # windows tokenized of every clip
    text: str = "minilm"
    synthetic: float = 0.1
    keep: float = 0.5  # scale-wise only: share of the input tokens kept; the others become random codes
    caption_drop: float = 0.1
    seed: int = 0
    lent: bool = False  # is the tokenizer another system's, from its run beside this one or shipped?


GENERATORS: dict[str, GeneratorTraining] = {
    "lgtok-generator": GeneratorTraining(
        model=GENERATOR_PRESETS["lite"],
        tokenizer="lgtok-tokenizer",
        batch=BatchConfig(size=64, whole=0.8, source_balance=0.5, action_balance=0.6),
        schedule=Schedule(steps=5_400, rate=8e-4, weight_decay=1e-5, clip=1.0, fall=0.35),
        synthetic=0.4,  # 0.1 in the first 4,400 steps of the shipped one
        keep=0.8,  # 0.5 in its first 1,500 steps
    ),
}


@dataclass(frozen=True)
class FeatureTraining:
    """One run of a generator without tokens (systems.md D4)."""

    model: Any  # config of a generator of architectures.py
    batch: BatchConfig = field(default_factory=BatchConfig)
    schedule: Schedule = field(default_factory=Schedule)
    text: str = "minilm"
    synthetic: float = 0.1
    caption_drop: float = 0.1
    seed: int = 0


@dataclass(frozen=True)
class RefitTraining:
    """One refit of a detokenizer on imperfect tokens (training/refit.py); ours, not in the paper."""

    tokenizer_training: TokenizerTraining  # the run whose losses are used
    batch: BatchConfig
    schedule: Schedule = field(default_factory=Schedule)
    variants: int = 2  # windows of every clip
    text: str = "minilm"
    synthetic: float = 0.1
    language_drop: float = 0.1
    velocity: float = 2.0  # weight of smoothL1 on differences of successive rows
    smooth: float = 0.0  # weight of smoothL1 on second differences of rows (tokenizer.jump_loss)
    feet: float = 0.0  # weight of the toes' speed over the ground, where the true ones stand on it
    redrawn: float = 0.45  # share of motions whose fine scales the generator drew anew
    coarse: float = 0.2  # share of motions of which the coarse scales alone are given
    true_scales: int = 3  # at least so many scales are true
    cfg: float = 3.0  # guidance of the generator
    seam: int = 0  # width of convolutions over the frames that are added (nn/seams.py); 0 adds none
    seed: int = 0


def refit_of(tokenizer: TokenizerTraining, steps: int) -> RefitTraining:
    """The refit that follows a tokenizer's training. The flagship's shipped one had feet, smooth and seam in its third
    round alone."""
    batch = replace(tokenizer.batch, whole=0.8, speed=0.0)
    schedule = Schedule(steps=steps, rate=5e-4, warmup=100, fall=0.5)
    return RefitTraining(tokenizer, batch, schedule, feet=0.1, smooth=1.0, seam=96)


REFITS: dict[str, RefitTraining] = {"lgtok-refit": refit_of(TOKENIZERS["lgtok-tokenizer"], 2_700)}


@dataclass(frozen=True)
class RefinerTraining:
    """One run of the root refiner (systems.md E1); what its input is perturbed by is in normalised units."""

    model: RefinerConfig = field(default_factory=RefinerConfig)
    batch: BatchConfig = field(default_factory=BatchConfig)
    schedule: Schedule = field(default_factory=Schedule)
    synthetic: float = 0.1
    feet: float = 2.0  # weight of the toes' speed over the ground, where the true ones stand on it
    true: float = 0.25  # share of motions that are shown as they are
    smoothing: int = 4  # at most so often a motion is averaged with its neighbours
    tremble: float = 0.15  # most noise from frame to frame, standard deviation
    drift: float = 0.4  # most slow noise
    slowness: int = 12  # times that the slow noise is averaged with its neighbours
    seed: int = 0


REFINERS: dict[str, RefinerTraining] = {
    "root-refiner": RefinerTraining(
        batch=BatchConfig(size=32, whole=0.5, speed=0.3, source_balance=0.5, action_balance=0.3),
        schedule=Schedule(steps=1_400, rate=1e-3, warmup=100, clip=1.0, fall=0.5),
    ),
}


@dataclass(frozen=True)
class EvaluatorTraining:
    """One evaluator run (systems.md E5, F1); the size of the contrastive batch is `batch.size` (LG-Tok, Table 6)."""

    model: EvaluatorConfig
    batch: BatchConfig = field(default_factory=BatchConfig)
    schedule: Schedule = field(default_factory=Schedule)
    text: str = "minilm"
    synthetic: float = 0.0
    reconstruction: float = 1.0  # the four weights of E5, TMR style only
    divergence: float = 1e-5
    latent: float = 1e-5
    contrast: float = 0.1
    temperature: float = 0.1  # of the TMR style; the CLIP style learns its own
    alike: float = 0.999  # captions with a cosine of at least this are no negatives; above 1 every other one is
    seed: int = 0


EVALUATORS: dict[str, EvaluatorTraining] = {
    "tmr-evaluator": EvaluatorTraining(
        model=EvaluatorConfig(kind="tmr"),
        batch=BatchConfig(size=64, whole=0.9, source_balance=0.3, action_balance=0.0, bucket=2),
        schedule=Schedule(steps=1_500, rate=5e-4, weight_decay=1e-2, clip=1.0, warmup=100, fall=0.6),
    ),
    "clip-evaluator": EvaluatorTraining(
        model=EvaluatorConfig(kind="clip"),
        batch=BatchConfig(size=64, whole=0.9, source_balance=0.3, action_balance=0.0, bucket=2),
        schedule=Schedule(steps=1_500, rate=5e-4, weight_decay=1e-2, clip=1.0, warmup=100, fall=0.6),
    ),
}


def with_steps(schedule: Schedule, steps: int | None) -> Schedule:
    """The schedule with another number of steps, unchanged for None. PlaygroundError for less than one step."""
    if steps is None:
        return schedule
    if steps < 1:
        raise PlaygroundError(f"a run needs at least 1 step, got {steps}")
    return replace(schedule, steps=steps)


def rate_at(step: int, schedule: Schedule) -> float:
    """Learning rate of a step (from 0)."""
    warm = min(1.0, (step + 1) / max(schedule.warmup, 1))
    first = schedule.steps * (1 - schedule.fall)
    fallen = max(0.0, (step - first) / max(schedule.steps - first, 1))
    return schedule.rate * warm * (1 - (1 - schedule.floor) * min(fallen, 1.0))
