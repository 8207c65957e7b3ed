"""The systems of the other papers as data: every training at a size that one CPU core finishes in half an hour.

All train on the 67 columns with MiniLM's text, on the same clips, windows and mirrored copies as LG-Tok, so that rows
compare; each keeps what makes it itself: its tokenizer's layers and quantizer, its generator, its losses. Ours in all:
a small loss on the accumulated heading, the mean over real frames, sources drawn by the square root of their size.
"""

from dataclasses import replace

from playground.data.batches import BatchConfig
from playground.generators.autoregressive import GPT_PRESETS
from playground.generators.diffusion import PRESETS as DIFFUSION_PRESETS
from playground.generators.hierarchical import HIERARCHICAL_PRESETS
from playground.generators.masked import MASKED_PRESETS
from playground.generators.masked_scales import MASKED_SCALES_PRESETS
from playground.generators.scalewise import GENERATOR_PRESETS
from playground.tokenizers.convolutional import CONV_PRESETS
from playground.training.configs import FeatureTraining, GeneratorTraining, Schedule, TokenizerTraining

_TOKENIZER = TokenizerTraining(
    model=CONV_PRESETS["momask-lite"],
    batch=BatchConfig(size=32, speed=0.3, source_balance=0.5, action_balance=0.3),
    schedule=Schedule(steps=2_400, rate=1e-3, warmup=100),
    language_drop=0.0,  # they read no text
    heading=0.02,
    masked_mean=True,
    joints=0.5,
)
_GENERATOR = GeneratorTraining(
    model=MASKED_PRESETS["lite"],
    tokenizer="momask-tokenizer",
    batch=BatchConfig(size=64, whole=0.8, source_balance=0.5, action_balance=0.6),
    schedule=Schedule(steps=2_000, rate=8e-4, weight_decay=1e-5, clip=1.0, fall=0.35),
)
_DIFFUSION = FeatureTraining(
    model=DIFFUSION_PRESETS["lite"],
    batch=BatchConfig(size=64, whole=0.8, source_balance=0.5, action_balance=0.6),
    schedule=Schedule(steps=1_400, rate=1e-3, clip=1.0, fall=0.35),
)

TOKENIZERS: dict[str, TokenizerTraining] = {
    "mosa-tokenizer": replace(_TOKENIZER, model=CONV_PRESETS["mosa-lite"]),
    "momask-tokenizer": _TOKENIZER,
    "momaskpp-tokenizer": replace(_TOKENIZER, model=CONV_PRESETS["momaskpp-lite"]),
    "t2mgpt-tokenizer": replace(_TOKENIZER, model=CONV_PRESETS["t2mgpt-lite"], joints=0.0, velocity=0.5),
    "mogo-tokenizer": replace(_TOKENIZER, model=CONV_PRESETS["mogo-lite"]),
}
_SCALES, _GPT = MASKED_SCALES_PRESETS["lite"], GPT_PRESETS["lite"]
GENERATORS: dict[str, GeneratorTraining] = {
    "mosa-generator": replace(
        _GENERATOR, model=replace(GENERATOR_PRESETS["lite"], width=128, depth=5, heads=2, hidden=256), keep=0.8,
        tokenizer="mosa-tokenizer", schedule=replace(_GENERATOR.schedule, steps=1_200),  # 236 tokens a motion: slow
    ),
    "momask-generator": _GENERATOR,
    "momask-lgtok-generator": replace(
        _GENERATOR, tokenizer="lgtok-rvq-tokenizer", lent=True, schedule=replace(_GENERATOR.schedule, steps=1_200)
    ),
    "momaskpp-generator": replace(_GENERATOR, model=_SCALES, tokenizer="momaskpp-tokenizer"),
    "momaskpp-cross-generator": replace(
        _GENERATOR, model=replace(_SCALES, variant="cross"), tokenizer="momaskpp-tokenizer", lent=True
    ),
    "t2mgpt-generator": replace(_GENERATOR, model=_GPT, tokenizer="t2mgpt-tokenizer"),
    "t2mgpt-casim-generator": replace(
        _GENERATOR, model=replace(_GPT, casim=True), tokenizer="t2mgpt-tokenizer", lent=True
    ),
    "mogo-generator": replace(_GENERATOR, model=HIERARCHICAL_PRESETS["lite"], tokenizer="mogo-tokenizer"),
}  # fmt: skip
DIFFUSIONS: dict[str, FeatureTraining] = {
    "mdm-generator": _DIFFUSION,
    "mdm-casim-generator": replace(_DIFFUSION, model=replace(_DIFFUSION.model, casim="encoder")),
    "mdm-casim-decoder-generator": replace(_DIFFUSION, model=replace(_DIFFUSION.model, casim="decoder", depth=4)),
}

Rows = dict[str, TokenizerTraining | GeneratorTraining | FeatureTraining]
OTHERS: Rows = {**TOKENIZERS, **GENERATORS, **DIFFUSIONS}
