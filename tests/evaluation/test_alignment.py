"""Attention to words as the stored item takes it: from every kind of generator, or a sentence that says why not."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from playground.errors import PlaygroundError
from playground.evaluation.published.alignment import attention_of
from playground.generators.autoregressive import GPT, GPTConfig, GPTGenerator
from playground.generators.diffusion import DiffusionConfig, DiffusionGenerator, build_denoiser
from playground.nn.sampling import Sampling
from playground.systems import SamplingDefaults
from playground.tokenizers.base import Tokens
from playground.tokenizers.token_file import LevelTokens
from tests.generators.lookup import Lookup
from tests.tiny import text_features

FRAMES, WORDS = 16, 5
TEXT = text_features((WORDS,), padded=3)
HOW = SamplingDefaults(cfg=1.0, top_k=1.0, top_p=1.0)
IDS = np.array([3, 1, 4, 1])


def asked(generator: Any = None, diffusion: Any = None) -> tuple[str, list[str], np.ndarray]:
    """The attention of a motion of FRAMES frames by a system that has these parts."""
    runtime = SimpleNamespace(generator=generator, diffusion=diffusion, prompt=lambda prompt: TEXT)
    levels = () if diffusion else (LevelTokens(len(IDS), 10, IDS),)
    made = SimpleNamespace(system="x", seed=7, sampling=HOW, levels=levels, motion=SimpleNamespace(frames=FRAMES))
    return attention_of(SimpleNamespace(runtime=lambda name: runtime), made, "a prompt")  # type: ignore[arg-type]


def denoiser(casim: str) -> DiffusionGenerator:
    config = DiffusionConfig(
        columns=6, width=16, depth=2, heads=2, hidden=24, dropout=0.0, text_width=20, steps=6, visited=3, casim=casim
    )
    with torch.random.fork_rng():
        torch.manual_seed(0)
        return DiffusionGenerator(build_denoiser(config).eval().requires_grad_(False))


def gpt(casim: bool) -> GPTGenerator:
    config = GPTConfig(
        width=16, depth=2, heads=2, hidden=24, dropout=0.0, text_width=20, scales=(12,), codes=(10,), code_width=6,
        casim=casim,
    )  # fmt: skip
    with torch.random.fork_rng():
        torch.manual_seed(1)
        return GPTGenerator(GPT(config).eval().requires_grad_(False), Lookup())


def test_frames_look_at_words_in_the_decoder_variant_averaged_over_steps() -> None:
    generator = denoiser("decoder")
    what, words, weights = asked(diffusion=generator)
    sampling = Sampling(cfg=1.0, top_k=1.0, top_p=1.0, seeds=(7,))
    steps = generator.alignment(TEXT, torch.tensor([FRAMES]), sampling)
    assert len(steps) == 3 and words == ["w"] * WORDS and "denoiser" in what
    assert weights == pytest.approx(sum(step.double().numpy() for step in steps)[:, :WORDS] / 3, abs=1e-6)
    assert weights.shape == (FRAMES, WORDS) and weights.sum(axis=1) == pytest.approx(1.0, abs=1e-5)


def test_tokens_look_at_words_in_gpt() -> None:
    generator = gpt(True)
    what, words, weights = asked(generator=generator)
    tokens = Tokens((torch.from_numpy(IDS)[None],), (10,))
    expected = generator.alignment(tokens, TEXT, torch.tensor([FRAMES]))[0, :, :WORDS]
    assert "generator" in what and words == ["w"] * WORDS and weights.shape == (len(IDS), WORDS)
    assert weights == pytest.approx(expected.double().numpy(), abs=1e-6)


@pytest.mark.parametrize("parts", [{"generator": gpt(False)}, {"diffusion": denoiser("none")},
                                   {"diffusion": denoiser("encoder")}], ids=["gpt", "mdm", "mdm encoder"])  # fmt: skip
def test_a_system_without_such_attention_says_so(parts: dict[str, Any]) -> None:
    with pytest.raises(PlaygroundError, match="single words"):
        asked(**parts)
