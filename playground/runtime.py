"""The loaded models of one system behind numpy arrays: what the engine calls. The one place where torch meets numpy."""

import copy
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from playground.checkpoints import load_generator, load_tokenizer
from playground.errors import PlaygroundError
from playground.generators.base import Step
from playground.generators.scalewise import ScalewiseGenerator
from playground.motion.representation import Normaliser
from playground.nn.sampling import Sampling
from playground.systems import SystemRow, checkpoint_path
from playground.text.encoders import CachedEncoder, TextFeatures, check_same, load_encoder
from playground.tokenizers.base import Tokens
from playground.tokenizers.token_file import LevelTokens
from playground.tokenizers.transformer import LGTok

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class QuantizedArrays:
    """The numbers of one quantized motion."""

    energy: Floats  # [N + 1]
    embedding: Floats  # [T, D]
    per_level: Floats  # [N, T, D]


@dataclass(frozen=True, eq=False)
class Runtime:
    """Tokenizer, generator and text encoders of one system; stateless, safe to share between threads."""

    name: str
    tokenizer: LGTok
    generator: ScalewiseGenerator | None
    encoder: CachedEncoder
    normaliser: Normaliser
    checkpoint: str
    data: str
    prompt_encoder: CachedEncoder | None = None  # of the generator, where it reads another one than the tokenizer

    def text(self, caption: str) -> TextFeatures | None:
        """Features of a caption; None for the empty one: no text at all."""
        return self.encoder.encode([caption]) if caption else None

    def prompt(self, prompt: str) -> TextFeatures | None:
        """Features of a prompt for the generator; None for the empty one."""
        return self._prompt_encoder.encode([prompt]) if prompt else None

    def codebooks(self) -> list[Floats]:
        """Code vectors [V, D] of every scale."""
        return [book.vectors.numpy().copy() for book in self.tokenizer.quantizer.codebooks]

    def encode(self, features: Floats, caption: str) -> tuple[tuple[LevelTokens, ...], QuantizedArrays]:
        """Un-normalised rows [F, 67] -> tokens, and the numbers behind them."""
        x = torch.from_numpy(self.normaliser.apply(features))[None]
        quantized = self.tokenizer.encode(x, torch.tensor([len(features)]), self.text(caption))
        norm = quantized.residual_norm[:, 0]
        numbers = QuantizedArrays(
            (norm / norm[0].clamp(min=1e-12)).numpy(), quantized.embedding[0].numpy(), quantized.per_level[:, 0].numpy()
        )
        return level_tokens(quantized.tokens), numbers

    def embedding(self, levels: Sequence[LevelTokens], count: int | None = None) -> Tensor:
        """Embedding [1, T, D] of the coarsest `count` scales. PlaygroundError if the tokens do not fit this system."""
        quantizer = self.tokenizer.quantizer
        expected = list(zip(quantizer.scales, quantizer.codes, strict=True))
        given = [(level.size, level.codes) for level in levels]
        if given != expected:
            raise PlaygroundError(
                f"these tokens do not fit {self.name}, which has {len(expected)} levels of"
                f" {', '.join(str(size) for size, _ in expected)} tokens"
            )
        tokens = Tokens(tuple(torch.from_numpy(level.ids.copy())[None] for level in levels), quantizer.codes)
        return self.tokenizer.embed(tokens, count)

    def decode(self, levels: Sequence[LevelTokens], frames: int, caption: str, guidance: float, count: int) -> Floats:
        """Tokens of one motion -> normalised rows [frames, 67]."""
        return self.decode_embedding(self.embedding(levels, count), frames, caption, guidance)

    def decode_embedding(self, embedding: Tensor, frames: int, caption: str, guidance: float) -> Floats:
        """Embedding [1, T, D] -> normalised rows [frames, 67]."""
        return self.tokenizer.decode(embedding, torch.tensor([frames]), self.text(caption), guidance)[0].numpy()

    def branches(self, levels: Sequence[LevelTokens], frames: int, caption: str) -> tuple[Floats, Floats]:
        """Normalised rows [frames, 67] decoded with the caption and with the null text."""
        pair = self.tokenizer.branches(self.embedding(levels), torch.tensor([frames]), self.text(caption))
        return pair[0][0].numpy(), pair[1][0].numpy()

    # ---- many at once, for evaluation -----------------------------------------------------------------------------

    def texts(self, captions: Sequence[str], *, prompts: bool = False) -> TextFeatures | None:
        """Features of the captions of one batch; None where all are empty. PlaygroundError if only some are.

        prompts: for the generator, not for the tokenizer.
        """
        if any(captions) != all(captions):
            raise PlaygroundError("a batch holds captions or none; some of these are empty")
        encoder = self._prompt_encoder if prompts else self.encoder
        return encoder.encode(captions).to(self.device) if any(captions) else None

    def generate_batch(
        self, captions: Sequence[str], frames: Sequence[int], seeds: Sequence[int], sampling: dict[str, Any]
    ) -> Step:
        """Draw a batch, all scales; a motion's draws follow its own seed. Empty captions draw free-form.

        PlaygroundError if the system has no generator.
        """
        if self.generator is None:
            raise PlaygroundError(f"the system {self.name} has no generator; it can tokenize and decode only")
        how = Sampling(**sampling, seeds=tuple(seeds))
        return self.generator.generate(
            self.texts(captions, prompts=True), torch.tensor(frames, device=self.device), how
        )

    def decode_batch(
        self, embedding: Tensor, frames: Sequence[int], captions: Sequence[str], guidance: float
    ) -> list[Floats]:
        """Embedding [B, T, D] -> un-normalised rows [F_b, 67] of every motion."""
        lengths = torch.tensor(frames, device=self.device)
        decoded = self.tokenizer.decode(embedding, lengths, self.texts(captions), guidance).cpu().numpy()
        return [self.normaliser.invert(rows[:count]) for rows, count in zip(decoded, frames, strict=True)]

    @property
    def _prompt_encoder(self) -> CachedEncoder:
        return self.encoder if self.prompt_encoder is None else self.prompt_encoder

    @property
    def device(self) -> torch.device:
        """Where the models compute."""
        return self.tokenizer.quantizer.codebooks[0].vectors.device

    def to(self, device: torch.device) -> "Runtime":
        """The same system with its models copied to another device, for the batch calls; itself if it is there."""
        if device == self.device:
            return self
        tokenizer = copy.deepcopy(self.tokenizer).to(device)
        generator = self.generator
        if generator is not None:
            generator = ScalewiseGenerator(copy.deepcopy(generator.transformer).to(device), tokenizer.quantizer)
        return replace(self, tokenizer=tokenizer, generator=generator)


def level_tokens(tokens: Tokens) -> tuple[LevelTokens, ...]:
    """The tokens of a batch of one as arrays."""
    return tuple(
        LevelTokens(ids.shape[1], codes, ids[0].numpy().astype(np.int64))
        for ids, codes in zip(tokens.ids, tokens.codes, strict=False)
    )


def load_runtime(assets: Path, row: SystemRow) -> Runtime:
    """Load a system's files. PlaygroundError if they are absent, broken, or made for another text encoder."""
    torch.set_num_threads(int(os.environ.get("OMP_NUM_THREADS") or os.cpu_count() or 1))
    path = checkpoint_path(assets, row.name, "tokenizer")
    if not path.is_file():
        raise PlaygroundError(row.absent)
    tokenizer, card = load_tokenizer(path)
    if card.normaliser is None:
        raise PlaygroundError(f"{path} carries no normaliser; it is not a finished tokenizer checkpoint")
    encoder = load_encoder(row.text)
    check_same(card.encoder, encoder)
    generator, prompt_encoder = None, None
    generator_path = checkpoint_path(assets, row.name, "generator")
    if row.generator is not None and generator_path.is_file():
        network, generator_card = load_generator(generator_path)
        prompt_encoder = load_encoder(row.prompts or row.text)
        check_same(generator_card.encoder, prompt_encoder)
        drawn_from = generator_card.facts.get("tokenizer")
        if drawn_from is not None and drawn_from != card.hash[:12]:
            raise PlaygroundError(f"{generator_path} was trained on the tokens of another tokenizer; train it again")
        generator = ScalewiseGenerator(network, tokenizer.quantizer)
    captions, prompts = CachedEncoder(encoder), None
    if prompt_encoder is not None and prompt_encoder is not encoder:
        prompts = CachedEncoder(prompt_encoder)
    return Runtime(row.name, tokenizer, generator, captions, card.normaliser, card.hash[:12], card.data, prompts)
