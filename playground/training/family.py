"""The LG-Tok family as data, in two sizes: what a CPU trains in hours, and what a GPU trains in minutes.

`lgtok` is the flagship. `lgtok-lite` is a smaller one, and what the others are compared with: they have its
transformer, batches and number of steps, and each differs from it in the one thing that its name says; they are as
large in both sizes, so that all of them fit into a repository. Ours alone in all: pre-norm blocks, phi as half the
input plus half a convolution, latents on the frames' rotary axis, a small loss on the accumulated heading, the mean
over real frames, motions at changed speed in some samples, sources drawn by the square root of their size, MiniLM for
all text, and a refit of the detokenizer (refit.py).
"""

from dataclasses import replace

from playground.data.batches import BatchConfig
from playground.generators.scalewise import GENERATOR_PRESETS
from playground.systems import BASE_SYSTEM
from playground.tokenizers.transformer import (
    FULL_SCALES,
    MID_SCALES,
    MINI_SCALES,
    PRESETS,
    residual_levels,
)
from playground.training.configs import (
    GENERATORS,
    REFITS,
    TOKENIZERS,
    GeneratorTraining,
    RefitTraining,
    Schedule,
    TokenizerTraining,
    refit_of,
)

SIZES = ("cpu", "gpu")

Rows = dict[str, TokenizerTraining | GeneratorTraining | RefitTraining]

# 2.4 M numbers, 4.9 MB: six tokenizers and five generators of this size fit into a repository beside the flagship.
_TOKENIZER = TokenizerTraining(
    model=replace(PRESETS["lite"], scales=FULL_SCALES, width=96, heads=2, hidden=320, code_width=96),
    batch=BatchConfig(size=32, speed=0.3, source_balance=0.5, action_balance=0.3),
    schedule=Schedule(steps=1_800, rate=1.2e-3),
    heading=0.02,
    masked_mean=True,
)
_GENERATOR = GeneratorTraining(  # 1.6 M
    model=replace(GENERATOR_PRESETS["lite"], width=128, depth=5, heads=2, hidden=256),
    tokenizer="lgtok-lite-tokenizer",
    batch=BatchConfig(size=64, whole=0.8, source_balance=0.5, action_balance=0.6),
    schedule=Schedule(steps=2_000, rate=1e-3, weight_decay=1e-5, clip=1.0, fall=0.35),
    keep=0.8,
)
_REFIT = 2_000  # steps
_LONG = Schedule(steps=4_000, rate=8e-4, save_every=1_000, validate_every=1_000)  # on a GPU

# On a GPU the flagship has 13.2 M and 6.4 M numbers: 39 MB, close to the largest that it may have.
_GPU_TOKENIZER = replace(
    _TOKENIZER,
    model=replace(
        _TOKENIZER.model, width=224, depth=7, heads=4, hidden=512, dropout=0.05, code_width=192,
    ),
    batch=replace(_TOKENIZER.batch, size=128),
    schedule=_LONG,
)  # fmt: skip
_GPU_GENERATOR = replace(
    _GENERATOR,
    model=replace(GENERATOR_PRESETS["lite"], dropout=0.1),
    tokenizer="lgtok-tokenizer",
    schedule=replace(_LONG, weight_decay=1e-5, clip=1.0, fall=0.35),
    size=128,
    variants=10,
)


def compared(tokenizer: TokenizerTraining, generator: GeneratorTraining) -> Rows:
    """Every training of the systems that are compared with each other, the base first."""
    model = tokenizer.model
    tokenizers = {
        BASE_SYSTEM: tokenizer,
        "lgtok-notext": replace(tokenizer, model=replace(model, text_side="none")),
        "lgtok-nodrop": replace(tokenizer, language_drop=0.0),
        "lgtok-mid": replace(tokenizer, model=replace(model, scales=MID_SCALES)),
        "lgtok-mini": replace(tokenizer, model=replace(model, scales=MINI_SCALES)),
        "lgtok-rvq": replace(tokenizer, model=residual_levels(model)),
    }
    rows: Rows = {f"{name}-tokenizer": row for name, row in tokenizers.items()}
    drawn = [name for name in tokenizers if name != "lgtok-rvq"]  # plain residual levels: no scales to draw in turn
    rows |= {f"{name}-generator": replace(generator, tokenizer=f"{name}-tokenizer") for name in drawn}
    return rows | {f"{name}-refit": refit_of(tokenizers[name], _REFIT) for name in drawn}


def flagship(tokenizer: TokenizerTraining, generator: GeneratorTraining, again: RefitTraining) -> Rows:
    """The flagship's trainings."""
    return {"lgtok-tokenizer": tokenizer, "lgtok-generator": generator, "lgtok-refit": again}


FAMILY: dict[str, Rows] = {
    "cpu": flagship(TOKENIZERS["lgtok-tokenizer"], GENERATORS["lgtok-generator"], REFITS["lgtok-refit"])
    | compared(_TOKENIZER, _GENERATOR),
    "gpu": flagship(_GPU_TOKENIZER, _GPU_GENERATOR, refit_of(_GPU_TOKENIZER, _REFIT))
    | compared(
        replace(_TOKENIZER, batch=_GPU_TOKENIZER.batch, schedule=_GPU_TOKENIZER.schedule),
        replace(_GENERATOR, schedule=_GPU_GENERATOR.schedule, size=128),
    ),
}
