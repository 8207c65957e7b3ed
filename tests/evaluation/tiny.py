"""Tiny evaluators made on the spot."""

import zlib
from collections.abc import Sequence

import numpy as np
import torch

from playground.evaluation.evaluators import Evaluator
from playground.evaluation.networks import EvaluatorConfig, build_evaluator
from playground.motion.representation import Normaliser, to_features67
from playground.text.features import TextFeatures, pad
from tests.conftest import drifting

TINY_EVALUATOR = EvaluatorConfig(
    latent=12, width=16, heads=2, hidden=24, motion_depth=2, text_depth=1, decoder_depth=1, dropout=0.0, text_width=20
)


def tiny_network(kind: str, seed: int = 0, **changes):
    """A network in evaluation mode; weights larger than at the start, so that inputs matter."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        network = build_evaluator(EvaluatorConfig(**{**vars(TINY_EVALUATOR), "kind": kind, **changes}))
    network.eval().requires_grad_(False)
    for parameter in network.parameters():
        if parameter.ndim > 1:
            parameter.mul_(3.0)
    return network


def invented_states(texts: Sequence[str], width: int = 20) -> TextFeatures:
    """Random states that depend on each text alone, one a word."""
    rows = []
    for text in texts:
        words = text.split() or ["?"]
        rng = torch.Generator().manual_seed(zlib.crc32(text.encode()))
        states = torch.randn(len(words), width, generator=rng)
        rows.append((states, torch.ones(len(words), dtype=torch.bool), states.mean(0), words))
    return pad(rows, width)


def tiny_evaluator(kind: str = "tmr") -> Evaluator:
    """An evaluator of random weights and invented text states."""
    normaliser = Normaliser.fit([to_features67(drifting(60, seed)) for seed in range(4)], groups=())
    return Evaluator(kind, tiny_network(kind), normaliser, invented_states)


def moving(frames: int, seed: int) -> np.ndarray:
    """Joints [frames, 22, 3] that differ clearly from seed to seed."""
    joints = drifting(frames, seed)
    rng = np.random.default_rng(seed)
    time = np.linspace(0, rng.uniform(2, 9), frames)[:, None, None]
    return joints + (0.2 * np.sin(time + rng.uniform(0, 6, (1, 22, 3)))).astype(np.float32)
