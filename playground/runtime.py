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
from torch import Tensor, nn

from playground.architectures import caller
from playground.checkpoints import Card, load_generator, load_tokenizer
from playground.errors import PlaygroundError
from playground.generators.base import FeatureGenerator, Generator, Step
from playground.motion.representation import Normaliser
from playground.nn.sampling import Sampling
from playground.systems import SystemRow, check_here, checkpoint_path, row_of
from playground.text.encoders import CachedEncoder, TextFeatures, check_same, load_encoder
from playground.tokenizers.base import Tokenizer, Tokens
from playground.tokenizers.token_file import LevelTokens

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class QuantizedArrays:
    """The numbers of one quantized motion."""

    energy: Floats  # [N + 1]
    embedding: Floats  # [T, D]
    per_level: Floats  # [N, T, D]


@dataclass(frozen=True, eq=False)
class Runtime:
    """Tokenizer, generator and text encoders of one system; stateless, safe to share between threads.

    A system has a codec (its tokenizer) and perhaps a generator of tokens, or else a diffusion, which makes features
    without tokens.
    """

    name: str
    codec: Tokenizer | None
    generator: Generator | None
    encoder: CachedEncoder
    normaliser: Normaliser
    checkpoint: str
    data: str
    prompt_encoder: CachedEncoder | None = None  # of the generator, where it reads another one than the tokenizer
    diffusion: FeatureGenerator | None = None

    @property
    def tokenizer(self) -> Tokenizer:
        """The tokenizer. PlaygroundError in one sentence if the system has none."""
        if self.codec is None:
            raise PlaygroundError(row_of(self.name).no_tokenizer)
        return self.codec

    @property
    def drawing(self) -> Generator:
        """The generator of tokens. PlaygroundError in one sentence if the system has none."""
        if self.generator is None:
            row = row_of(self.name)
            raise PlaygroundError(row.no_generator if self.diffusion is None else row.no_tokenizer)
        return self.generator

    @property
    def generates(self) -> bool:
        """Whether it makes motions from text."""
        return self.generator is not None or self.diffusion is not None

    @property
    def heading(self) -> str:
        """The rule by which the features' heading is read off the body."""
        return "body" if self.codec is None else str(self.codec.config.heading)

    def latents(self, frames: int) -> int:
        """Latents of a motion of so many frames: the tokens of its finest level."""
        return self.tokenizer.sizes(frames)[-1]

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

    def embedding(self, levels: Sequence[LevelTokens], frames: int, count: int | None = None) -> Tensor:
        """Embedding [1, T, D] of the coarsest `count` scales of a motion of so many frames.

        PlaygroundError if the tokens do not fit this system.
        """
        codes = self.tokenizer.quantizer.codes
        expected = list(zip(self.tokenizer.sizes(frames), codes, strict=True))
        given = [(level.size, level.codes) for level in levels]
        if given != expected:
            raise PlaygroundError(
                f"these tokens do not fit {self.name}, which has {len(expected)} levels of"
                f" {', '.join(str(size) for size, _ in expected)} tokens for {frames} frames"
            )
        tokens = Tokens(tuple(torch.from_numpy(level.ids.copy())[None] for level in levels), codes)
        return self.tokenizer.embed(tokens, count, torch.tensor([frames]))

    def decode(self, levels: Sequence[LevelTokens], frames: int, caption: str, guidance: float, count: int) -> Floats:
        """Tokens of one motion -> normalised rows [frames, 67]."""
        return self.decode_embedding(self.embedding(levels, frames, count), frames, caption, guidance)

    def decode_embedding(self, embedding: Tensor, frames: int, caption: str, guidance: float) -> Floats:
        """Embedding [1, T, D] -> normalised rows [frames, 67]."""
        return self.tokenizer.decode(embedding, torch.tensor([frames]), self.text(caption), guidance)[0].numpy()

    def branches(self, levels: Sequence[LevelTokens], frames: int, caption: str) -> tuple[Floats, Floats]:
        """Normalised rows [frames, 67] decoded with the caption and with the null text."""
        pair = self.tokenizer.branches(self.embedding(levels, frames), torch.tensor([frames]), self.text(caption))
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

        PlaygroundError if the system has no generator of tokens.
        """
        how = Sampling(**sampling, seeds=tuple(seeds))
        text = self.texts(captions, prompts=True)
        return self.drawing.generate(text, torch.tensor(frames, device=self.device), how)

    def make_batch(
        self,
        captions: Sequence[str],
        frames: Sequence[int],
        seeds: Sequence[int],
        sampling: dict[str, Any],
        guidance: float,
    ) -> list[Floats]:
        """Un-normalised rows [F_b, 67] of motions made from captions, each after its own seed, with or without tokens.

        PlaygroundError if the system has no generator.
        """
        if self.diffusion is None:
            drawn = self.generate_batch(captions, frames, seeds, sampling)
            return self.decode_batch(drawn.embedding, frames, captions, guidance)
        text, lengths = self.texts(captions, prompts=True), torch.tensor(frames, device=self.device)
        made = self.diffusion.sample(text, lengths, Sampling(**sampling, seeds=tuple(seeds))).cpu().numpy()
        return [self.normaliser.invert(rows[:count]) for rows, count in zip(made, frames, strict=True)]

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
        return next(next(module.parameters()).device for part in self._parts for module in modules_of(part))

    @property
    def _parts(self) -> tuple[Any, ...]:
        return tuple(part for part in (self.codec, self.generator, self.diffusion) if part is not None)

    def to(self, device: torch.device) -> "Runtime":
        """The same system with its models copied to another device, for the batch calls; itself if it is there."""
        if device == self.device:
            return self
        codec, generator, diffusion = copy.deepcopy((self.codec, self.generator, self.diffusion))
        moved = replace(self, codec=codec, generator=generator, diffusion=diffusion)
        for part in moved._parts:
            for module in modules_of(part):
                module.to(device)
        return moved


def modules_of(part: Any) -> list[nn.Module]:
    """The modules of a tokenizer or of what draws with a network and a tokenizer."""
    if isinstance(part, nn.Module):
        return [part]
    return [value for value in vars(part).values() if isinstance(value, nn.Module)]


def level_tokens(tokens: Tokens) -> tuple[LevelTokens, ...]:
    """The tokens of a batch of one as arrays."""
    return tuple(
        LevelTokens(ids.shape[1], codes, ids[0].numpy().astype(np.int64))
        for ids, codes in zip(tokens.ids, tokens.codes, strict=False)
    )


def load_runtime(assets: Path, row: SystemRow) -> Runtime:
    """Load a system's files. PlaygroundError if they are absent, broken, or made for another text encoder."""
    torch.set_num_threads(int(os.environ.get("OMP_NUM_THREADS") or os.cpu_count() or 1))
    paths = {part: checkpoint_path(assets, row.name, part) for part in row.parts}
    check_here(assets, row)
    tokenizer, network = None, None
    cards: dict[str, Card] = {}
    if row.tokenizer is not None:
        tokenizer, cards["tokenizer"] = load_tokenizer(paths["tokenizer"])
    if row.generator is not None and paths["generator"].is_file():
        network, cards["generator"] = load_generator(paths["generator"])
    first = row.parts[0]
    card, normaliser = cards[first], cards[first].normaliser
    if normaliser is None:
        made = (
            "convert it again with --statistics"
            if row.command == "convert"
            else f"it is no finished {first} checkpoint"
        )
        raise PlaygroundError(f"{paths[first]} carries no mean and std of its data; {made}")
    encoder = prompt_encoder = load_encoder(row.text)
    if tokenizer is not None:
        check_same(card.encoder, encoder)
    if network is not None:
        prompt_encoder = load_encoder(row.prompts or row.text)
        check_same(cards["generator"].encoder, prompt_encoder)
        drawn_from = cards["generator"].facts.get("tokenizer")
        if drawn_from is not None and drawn_from != card.hash[:12]:
            path = paths["generator"]
            raise PlaygroundError(f"{path} was trained on the tokens of another tokenizer; train it again")
    drawing = None if network is None else caller(network, tokenizer)
    return Runtime(
        name=row.name,
        codec=tokenizer,
        generator=None if tokenizer is None else drawing,
        encoder=CachedEncoder(encoder),
        normaliser=normaliser,
        checkpoint=card.hash[:12],
        data=card.data,
        prompt_encoder=None if prompt_encoder is encoder else CachedEncoder(prompt_encoder),
        diffusion=drawing if tokenizer is None else None,
    )
