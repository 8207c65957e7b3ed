"""The table of architectures: what a tokenizer or a generator can be. A checkpoint names its row, old ones imply it.

An architecture is a frozen config dataclass, a function that builds its module from a config, and for generators the
class that draws with a trained module. Adding one is a module of its own and a row here (docs/adding-a-system.md).
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

from torch import nn

from playground.errors import PlaygroundError
from playground.generators.autoregressive import GPT, GPTConfig, GPTGenerator
from playground.generators.diffusion import DiffusionConfig, DiffusionGenerator, build_denoiser
from playground.generators.hierarchical import HierarchicalConfig, HierarchicalGenerator, RQHCTransformer
from playground.generators.masked import MaskedConfig, MaskedGenerator, MaskedResidual
from playground.generators.masked_scales import MaskedScales, MaskedScalesConfig, MaskedScalesGenerator
from playground.generators.scalewise import GeneratorConfig, ScalewiseGenerator, build_generator
from playground.tokenizers.convolutional import ConvConfig, build_conv
from playground.tokenizers.transformer import TokenizerConfig, build_tokenizer

Config = TypeVar("Config")
FIRST = {"tokenizer": "lgtok", "generator": "scalewise"}  # what a checkpoint holds that names no architecture


@dataclass(frozen=True)
class Architecture:
    """One row. caller: network and tokenizer -> the generator that the engine calls; a tokenizer has none.

    tokens: False for a generator that makes features without a tokenizer; its caller is given None.
    """

    part: str  # tokenizer | generator
    config: type
    build: Callable[[Any], nn.Module]
    caller: Callable[[Any, Any], Any] | None = None
    tokens: bool = True


ARCHITECTURES: dict[str, Architecture] = {
    "lgtok": Architecture("tokenizer", TokenizerConfig, build_tokenizer),
    "scalewise": Architecture(
        "generator",
        GeneratorConfig,
        build_generator,
        lambda network, tokenizer: ScalewiseGenerator(network, tokenizer.quantizer),
    ),
    "conv": Architecture("tokenizer", ConvConfig, build_conv),
    "masked": Architecture("generator", MaskedConfig, MaskedResidual, MaskedGenerator),
    "masked-scales": Architecture("generator", MaskedScalesConfig, MaskedScales, MaskedScalesGenerator),
    "gpt": Architecture("generator", GPTConfig, GPT, GPTGenerator),
    "rqhc": Architecture("generator", HierarchicalConfig, RQHCTransformer, HierarchicalGenerator),
    "diffusion": Architecture(
        "generator", DiffusionConfig, build_denoiser, lambda network, tokenizer: DiffusionGenerator(network), False
    ),
}


def architecture(name: str, part: str) -> Architecture:
    """The row of a tokenizer or a generator. PlaygroundError if this version has none of that name."""
    row = ARCHITECTURES.get(name)
    if row is None or row.part != part:
        known = ", ".join(key for key, one in ARCHITECTURES.items() if one.part == part)
        raise PlaygroundError(f"unknown {part} architecture {name[:80]!r}; this version knows {known}")
    return row


def name_of(config: Any) -> str:
    """The name of the row that a config belongs to. PlaygroundError for a config of no architecture."""
    for name, row in ARCHITECTURES.items():
        if type(config) is row.config:
            return name
    raise PlaygroundError(f"{type(config).__name__} belongs to no architecture of the table")


def build(config: Any) -> Any:
    """The module for a config of any architecture, randomly initialised, in training mode."""
    return ARCHITECTURES[name_of(config)].build(config)


def caller(network: Any, tokenizer: Any) -> Any:
    """What draws with a trained network; tokenizer: the one whose tokens it draws, None where it needs none.

    PlaygroundError if the network draws tokens and there is no tokenizer.
    """
    row = ARCHITECTURES[name_of(network.config)]
    if row.tokens and tokenizer is None:
        raise PlaygroundError("this generator draws tokens, and there is no tokenizer to decode them")
    assert row.caller is not None
    return row.caller(network, tokenizer if row.tokens else None)


def fitted(config: Config, **values: Any) -> Config:
    """A config with those of the values that it has a field for (text_width, scales, codes, ...)."""
    known = {field.name for field in fields(config)}  # type: ignore[arg-type]
    return replace(config, **{key: value for key, value in values.items() if key in known})  # type: ignore[type-var]
