"""The LG-Tok family as data, in two sizes: what a CPU trains in hours, and what a GPU trains in minutes.

Inside a size all rows have the same transformer, batches and number of steps; each differs from the flagship, `lgtok`,
in the one thing that its name says. Ours alone in both sizes, as in lgtok-lite: pre-norm blocks, phi as half the input
plus half a convolution, latents on the frames' rotary axis, a small loss on the accumulated heading, the mean over real
frames, motions at changed speed in some samples, sources drawn by the square root of their size, MiniLM for all text.
"""

from dataclasses import replace

from playground.data.batches import BatchConfig
from playground.generators.scalewise import GENERATOR_PRESETS
from playground.tokenizers.transformer import (
    FULL_SCALES,
    MID_SCALES,
    MINI_SCALES,
    PRESETS,
    residual_levels,
)
from playground.training.configs import GeneratorTraining, RefitTraining, Schedule, TokenizerTraining

SIZES = ("cpu", "gpu")

# 2.4 M numbers, 4.9 MB: six tokenizers and five generators of this size, 44 MB, fit into a repository.
_CPU_TOKENIZER = TokenizerTraining(
    model=replace(PRESETS["lite"], scales=FULL_SCALES, width=96, heads=2, hidden=320, code_width=96),
    batch=BatchConfig(size=32, speed=0.3, source_balance=0.5, action_balance=0.3),
    schedule=Schedule(steps=1_800, rate=1.2e-3),
    heading=0.02,
    masked_mean=True,
)
_CPU_GENERATOR = GeneratorTraining(  # 1.6 M
    model=replace(GENERATOR_PRESETS["lite"], width=128, depth=5, heads=2, hidden=256),
    tokenizer="lgtok-tokenizer",
    batch=BatchConfig(size=64, whole=0.8, source_balance=0.5, action_balance=0.6),
    schedule=Schedule(steps=2_000, rate=1e-3, weight_decay=1e-5, clip=1.0, fall=0.35),
    keep=0.8,
)
# 13.2 M and 6.4 M: 39 MB together, close to the largest that a flagship may have.
_GPU_TOKENIZER = replace(
    _CPU_TOKENIZER,
    model=replace(
        _CPU_TOKENIZER.model, width=224, depth=7, heads=4, hidden=512, dropout=0.05, code_width=192,
    ),
    batch=replace(_CPU_TOKENIZER.batch, size=128),
    schedule=Schedule(steps=4_000, rate=8e-4, save_every=1_000, validate_every=1_000),
)  # fmt: skip
_GPU_GENERATOR = replace(
    _CPU_GENERATOR,
    model=replace(GENERATOR_PRESETS["lite"], dropout=0.1),
    schedule=replace(_CPU_GENERATOR.schedule, steps=4_000, rate=8e-4, save_every=1_000, validate_every=1_000),
    size=128,
    variants=10,
)

_REFIT = Schedule(steps=2_000, rate=5e-4, warmup=100, fall=0.5)

Rows = dict[str, TokenizerTraining | GeneratorTraining | RefitTraining]


def family(tokenizer: TokenizerTraining, generator: GeneratorTraining, refit: Schedule) -> Rows:
    """Every training of one size, in the order in which they are run: the flagship first, then the comparisons."""
    model = tokenizer.model
    tokenizers = {
        "lgtok": tokenizer,
        "lgtok-notext": replace(tokenizer, model=replace(model, text_side="none")),
        "lgtok-nodrop": replace(tokenizer, language_drop=0.0),
        "lgtok-mid": replace(tokenizer, model=replace(model, scales=MID_SCALES)),
        "lgtok-mini": replace(tokenizer, model=replace(model, scales=MINI_SCALES)),
        "lgtok-rvq": replace(tokenizer, model=residual_levels(model)),
    }
    generators = {
        name: replace(generator, tokenizer=f"{name}-tokenizer") for name in tokenizers if name != "lgtok-rvq"
    }  # the plain residual tokenizer has no scales to draw one after the other
    rows: Rows = {"lgtok-tokenizer": tokenizers["lgtok"], "lgtok-generator": generators["lgtok"]}
    refits = {
        name: RefitTraining(tokenizers[name], replace(tokenizer.batch, whole=0.8, speed=0.0), refit, feet=0.1)
        for name in generators
    }
    rows["lgtok-refit"] = refits["lgtok"]
    rows |= {f"{name}-tokenizer": row for name, row in tokenizers.items()}
    rows |= {f"{name}-generator": row for name, row in generators.items()}
    return rows | {f"{name}-refit": row for name, row in refits.items()}


FAMILY: dict[str, Rows] = {
    "cpu": family(_CPU_TOKENIZER, _CPU_GENERATOR, _REFIT),
    "gpu": family(_GPU_TOKENIZER, _GPU_GENERATOR, _REFIT),
}
