"""One benchmark case a process: `python -m benchmarks.cases CASE [BATCH THREADS]` prints one JSON object.

Cases at the paper's size have random weights: time does not depend on what the weights say. The text is a caption of
13 word pieces for the tokenizer (LLaMA-size states) and 77 CLIP-size states for the generator, as in the released code.
"""

import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor
from torch.nn import functional

from benchmarks.timing import Timing, interleave, peak_bytes, resident_bytes
from playground.generators.scalewise import GeneratorConfig, ScalewiseGenerator, build_generator, running_sums
from playground.nn.sampling import Sampling
from playground.text.features import TextFeatures
from playground.tokenizers.base import Tokens
from playground.tokenizers.transformer import LGTok, TokenizerConfig, build_tokenizer

FRAMES, COLUMNS, PIECES, CLIP_POSITIONS = 196, 67, 13, 77
BUDGET = {1: (15, 20.0), 32: (3, 90.0), 8: (3, 60.0)}  # batch -> (turns, seconds)


@dataclass(frozen=True)
class Setup:
    """Full-size models with random weights, and a batch for them."""

    tokenizer: LGTok
    generator: ScalewiseGenerator
    features: Tensor  # [B, 196, 67]
    lengths: Tensor  # [B]
    caption: TextFeatures  # LLaMA-size
    prompt: TextFeatures  # CLIP-size
    ids: Tensor  # [B, 77], token ids for the CLIP-size encoder


def build(batch: int, seed: int = 0) -> Setup:
    """Everything a case may need; the weights are torch's own draw, the batch is `seed`'s."""
    rng = torch.Generator().manual_seed(seed)
    tokenizer = build_tokenizer(TokenizerConfig()).eval()
    for book in tokenizer.quantizer.codebooks:
        book.vectors.normal_(0.0, 0.1, generator=rng)
    generator = ScalewiseGenerator(build_generator(GeneratorConfig()).eval(), tokenizer.quantizer)
    return Setup(
        tokenizer,
        generator,
        torch.randn(batch, FRAMES, COLUMNS, generator=rng),
        torch.full((batch,), FRAMES),
        _text(batch, PIECES, PIECES, 2048, rng),
        _text(batch, CLIP_POSITIONS, PIECES, 512, rng),
        torch.randint(0, 49_000, (batch, CLIP_POSITIONS), generator=rng),
    )


def _text(batch: int, positions: int, real: int, width: int, rng: torch.Generator) -> TextFeatures:
    mask = (torch.arange(positions) < real).expand(batch, -1)
    tokens = torch.randn(batch, positions, width, generator=rng)
    return TextFeatures(tokens, mask, tokens[:, 0], [["piece"] * real] * batch)


def tokenize(setup: Setup) -> Callable[[], object]:
    """Features to tokens."""
    return lambda: setup.tokenizer.encode(setup.features, setup.lengths, setup.caption)


def detokenize(setup: Setup) -> Callable[[], object]:
    """Embedding to features, both branches of guidance."""
    embedding = torch.randn(len(setup.lengths), 49, 512, generator=torch.Generator().manual_seed(1))
    return lambda: setup.tokenizer.decode(embedding, setup.lengths, setup.caption, guidance=2.0)


def generate(setup: Setup) -> Callable[[], object]:
    """Ten scales with guidance, text features given."""
    return lambda: setup.generator.generate(setup.prompt, setup.lengths, Sampling())


def text_to_motion(setup: Setup) -> Callable[[], object]:
    """A CLIP-size text encoder, ten scales, the detokenizer with guidance; the caption's features are given."""
    from transformers import CLIPTextConfig, CLIPTextModel

    clip = CLIPTextModel(CLIPTextConfig()).eval().requires_grad_(False)

    def call() -> object:
        with torch.no_grad():
            states = clip(input_ids=setup.ids).last_hidden_state
        prompt = TextFeatures(states, setup.prompt.mask, setup.prompt.pooled, setup.prompt.words)
        drawn = setup.generator.generate(prompt, setup.lengths, Sampling())
        return setup.tokenizer.decode(drawn.embedding, setup.lengths, setup.caption, guidance=2.0)

    return call


def train_tokenizer(setup: Setup) -> Callable[[], object]:
    """One forward and backward pass of the tokenizer, dropout and codebook update included."""
    model = setup.tokenizer.train()

    def call() -> None:
        model.zero_grad()
        out = model(setup.features, setup.lengths, setup.caption)
        loss = functional.smooth_l1_loss(out.features, setup.features) + 0.02 * out.commitment
        loss.backward()

    return call


def train_generator(setup: Setup) -> Callable[[], object]:
    """One forward and backward pass of the generator on random tokens."""
    net, quantizer = setup.generator.transformer.train(), setup.tokenizer.quantizer.requires_grad_(False)
    sizes = list(zip(quantizer.scales, quantizer.codes, strict=True))
    ids = tuple(torch.randint(0, codes, (len(setup.lengths), size)) for size, codes in sizes)

    def call() -> None:
        net.zero_grad()
        logits = net(running_sums(quantizer, Tokens(ids, quantizer.codes)), net.remember(setup.prompt, setup.lengths))
        pairs = [(scores.flatten(0, 1), real.flatten()) for scores, real in zip(logits, ids, strict=True)]
        torch.stack([functional.cross_entropy(*pair) for pair in pairs]).sum().backward()

    return call


CASES: dict[str, Callable[[Setup], Callable[[], object]]] = {
    "tokenize": tokenize,
    "detokenize": detokenize,
    "generate": generate,
    "text-to-motion": text_to_motion,
    "train-tokenizer": train_tokenizer,
    "train-generator": train_generator,
}


def full_size(case: str, batch: int, threads: int) -> dict[str, Any]:
    """Time and memory of one case at the paper's size."""
    torch.set_num_threads(threads)
    setup = build(batch)
    if not case.startswith("train"):
        setup.tokenizer.requires_grad_(False)
        setup.generator.transformer.requires_grad_(False)
    call = CASES[case](setup)
    loaded = resident_bytes()
    turns, seconds = BUDGET[batch]
    timing = interleave({case: call}, turns=turns, budget=seconds)[case]
    return {"best": timing.best, "median": timing.median, "turns": timing.turns, "loaded": loaded, "peak": peak_bytes()}


def shipped() -> dict[str, Any]:
    """The shipped checkpoint through the engine, as a visitor uses it: 196 frames in, 9.8 s out. Empty without one."""
    import numpy as np

    from playground.engine import default_engine
    from playground.motion.motion import Motion
    from playground.motion.synthetic import corpus

    engine = default_engine()
    name = next((system.name for system in engine.systems() if system.checkpoint == "shipped"), None)
    if name is None:
        return {"seconds": {}, "peak": 0}
    longest = max(corpus(40, seed=0), key=lambda item: item.motion.frames).motion
    held = np.minimum(np.arange(FRAMES + 1), longest.frames - 1)  # the last pose is held where the motion is shorter
    motion = Motion(longest.joints[held])
    caption = "a person steadily walks forward and waves with the left hand"
    start = time.perf_counter()
    engine.runtime(name)
    seconds = {"load": time.perf_counter() - start}
    calls: dict[str, Callable[[], object]] = {
        "tokenize and reconstruct": lambda: engine.reconstruct(engine.tokenize(motion, caption, name)),
        "generate": lambda: engine.generate(caption, 9.8, name),
    }
    tokenized = engine.tokenize(motion, caption, name)
    calls |= {
        "scale scrubber": lambda: engine.reconstruct(tokenized, scales=5),
        "every prefix of scales": lambda: engine.scale_study(tokenized),
        "swap a token": lambda: engine.swap(tokenized, 5, 3, "opposite"),
        "governed spans, finest scale": lambda: engine.governed(tokenized, len(tokenized.levels)),
        "edit": lambda: engine.edit(tokenized, None, caption),
        "place in the stored map": lambda: engine.place(tokenized),
    }
    timings: dict[str, Timing] = interleave(calls, turns=9, budget=30.0)
    return {"seconds": {**seconds, **{what: timing.best for what, timing in timings.items()}}, "peak": peak_bytes()}


if __name__ == "__main__":
    name, *numbers = sys.argv[1:]
    print(json.dumps(shipped() if name == "shipped" else full_size(name, *map(int, numbers))))
