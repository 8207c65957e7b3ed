"""Tiny models made on the spot: the real classes with a few thousand random weights."""

from dataclasses import replace
from pathlib import Path

import torch

from playground.checkpoints import Card, save_checkpoint
from playground.engine.refining import refiner_path
from playground.generators.refiner import RefinerConfig, RootRefiner
from playground.generators.scalewise import GeneratorConfig, ScalewiseGenerator, build_generator
from playground.motion.representation import Normaliser
from playground.text.encoders import TextFeatures
from playground.tokenizers.transformer import LGTok, TokenizerConfig, build_tokenizer
from playground.training.refiner import NO_TEXT

TINY = TokenizerConfig(
    max_frames=48, width=16, depth=3, heads=2, hidden=24, dropout=0.0, scales=(1, 3, 6), codes=(8, 10, 12),
    code_width=12, text_width=20,
)  # fmt: skip
TINY_GENERATOR = GeneratorConfig(
    width=16, depth=2, heads=2, hidden=24, dropout=0.0, text_width=20, text_mask=True, lengths=12, scales=(1, 3, 6),
    codes=(8, 10, 12), code_width=12,
)  # fmt: skip


def tiny_tokenizer(seed: int = 0, **changes) -> LGTok:
    """A tokenizer in evaluation mode with filled codebooks; weights larger than at the start, so that inputs matter."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        model = build_tokenizer(replace(TINY, **changes)).eval().requires_grad_(False)
        for parameter in model.parameters():
            if parameter.ndim > 1:
                parameter.mul_(8.0)
        for book in model.quantizer.codebooks:
            book.vectors.normal_()
    return model


def tiny_generator(seed: int = 0, **changes) -> ScalewiseGenerator:
    """A generator with the quantizer of `tiny_tokenizer`."""
    with torch.random.fork_rng():
        torch.manual_seed(seed + 100)
        network = build_generator(replace(TINY_GENERATOR, **changes)).eval().requires_grad_(False)
        for parameter in network.parameters():
            if parameter.ndim > 1:
                parameter.mul_(8.0)
    return ScalewiseGenerator(network, tiny_tokenizer(seed).quantizer)


def tiny_refiner(assets: Path, normaliser: Normaliser) -> RootRefiner:
    """A root refiner, shipped to the assets."""
    with torch.random.fork_rng():
        torch.manual_seed(3)
        network = RootRefiner(RefinerConfig(width=8, blocks=2)).eval().requires_grad_(False)
    card = Card("refiner", network.config, NO_TEXT, "tiny library", {"step": 0, "seconds": 0.0}, normaliser)
    save_checkpoint(refiner_path(assets), network, card, torch.float32)
    return network


def text_features(lengths: tuple[int, ...] = (4, 2), seed: int = 0, width: int = 20, padded: int = 0) -> TextFeatures:
    """Random features of texts of the given lengths; `padded` adds so many empty positions. Padding holds 0."""
    rng = torch.Generator().manual_seed(seed)
    longest = max(lengths) + padded
    mask = torch.arange(longest)[None] < torch.tensor(lengths)[:, None]
    tokens = torch.zeros(len(lengths), longest, width)
    for row, count in enumerate(lengths):
        tokens[row, :count] = torch.randn(count, width, generator=rng)
    return TextFeatures(tokens, mask, tokens.sum(1) / mask.sum(1, keepdim=True), [["w"] * n for n in lengths])
