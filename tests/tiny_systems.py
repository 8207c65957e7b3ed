"""Tiny checkpoints of every system that this repository trains: the real classes and kinds, a few thousand numbers."""

from pathlib import Path
from typing import Any

import torch

from playground.architectures import build, fitted
from playground.checkpoints import Card, read_card, save_checkpoint
from playground.motion.representation import Normaliser
from playground.systems import SYSTEMS, checkpoint_path
from playground.text.encoders import identify, load_encoder
from playground.training.family import FAMILY
from playground.training.others import OTHERS
from playground.training.run import generator_config

TRAINED = tuple(name for name, row in SYSTEMS.items() if row.command == "train")


def shrunk(config: Any) -> Any:
    """The same architecture and switches with next to no weights."""
    levels = len(getattr(config, "codes", ()))
    small = {"width": 16, "hidden": 24, "dropout": 0.0, "code_width": 12, "codes": (9,) * levels, "text_width": 384}
    small |= {"heads": 2, "depth": 3 if hasattr(config, "skips") else 2, "blocks": 1, "iterations": 3, "visited": 3}
    if hasattr(config, "depths"):
        small |= {"depths": (1,) * levels, "heads": (2,) * levels}
    return fitted(config, **small)


def random_model(config: Any, seed: int) -> Any:
    """A module with random weights larger than at the start, so that inputs matter, and filled codebooks."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        model = build(config).eval().requires_grad_(False)
        for parameter in model.parameters():
            if parameter.ndim > 1:
                parameter.mul_(4.0)
        for book in getattr(getattr(model, "quantizer", None), "codebooks", ()):
            book.vectors.normal_()
    return model


def tiny_system(assets: Path, name: str, normaliser: Normaliser) -> None:
    """Write a system's files, and those of the system that lends it its tokenizer."""
    row, who = SYSTEMS[name], identify(load_encoder("minilm"))
    trainings = {**FAMILY["cpu"], **OTHERS}
    tokenizer_path = checkpoint_path(assets, name, "tokenizer")
    tokenizer, facts = None, {"step": 1, "seconds": 1.0}
    if row.tokenizer is not None:
        owner = row.lends or name
        tokenizer = random_model(shrunk(trainings[f"{owner}-tokenizer"].model), 1)
        if not (row.lends and tokenizer_path.is_file()):
            card = Card("tokenizer", tokenizer.config, who, "tiny", facts, normaliser)
            save_checkpoint(tokenizer_path, tokenizer, card)
        facts = facts | {"tokenizer": read_card(tokenizer_path).hash[:12]}
    if row.generator is not None:
        training = trainings[f"{name}-generator"]
        config = shrunk(training.model)
        if tokenizer is not None:
            config = generator_config(training, tokenizer, 384)
            config = fitted(shrunk(config), scales=config.scales, codes=config.codes, code_width=config.code_width)
        card = Card("generator", config, who, "tiny", facts, None if tokenizer is not None else normaliser)
        save_checkpoint(checkpoint_path(assets, name, "generator"), random_model(config, 2), card)
