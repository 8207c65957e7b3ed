"""The nouns of generation and what every generator can do (architecture: nouns and verbs)."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import torch
from torch import Tensor
from torch.nn import functional as F

from playground.nn.sampling import Sampling
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Tokens
from playground.tokenizers.quantizers import MultiScaleQuantizer


@dataclass(frozen=True, eq=False)
class TokenBatch:
    """Tokens of a training batch.

    noisy: what teacher forcing is fed with, some codes replaced by others; None: the tokens themselves. Networks that
    corrupt or mask their input in another way do so themselves and do not read it.
    """

    ids: tuple[Tensor, ...]  # int64 [B, s_n] a level, padded with 0 on the right
    masks: tuple[Tensor, ...]  # bool [B, s_n], which tokens are real
    lengths: Tensor  # int64 [B], frames
    text: TextFeatures
    dropped: Tensor  # bool [B], no text
    noisy: tuple[Tensor, ...] | None = None


@dataclass(frozen=True, eq=False)
class FeatureBatch:
    """Motions of a training batch, for generators without tokens."""

    features: Tensor  # float32 [B, F, C] normalised, 0 beyond each length
    lengths: Tensor  # int64 [B], frames
    text: TextFeatures
    dropped: Tensor  # bool [B], no text


@dataclass(frozen=True, eq=False)
class Step:
    """What one step of a generator gives.

    A step that finishes several levels at once holds their entropies and logits one after the other, coarse to fine. In
    a batch of several lengths tokens are padded with 0 beyond each row's own.
    """

    level: int  # number of levels drawn so far, from 1
    tokens: Tokens  # all levels drawn so far
    embedding: Tensor  # [B, T, D], the sum of their shares
    entropy: Tensor  # [B, s] in bits, of the guided distributions that the new levels were drawn from
    logits: Tensor  # [B, s, V], guided, before any filter


@dataclass(frozen=True, eq=False)
class Edit:
    """What a generation keeps: the source's tokens [1 or B, s_n] wherever redraw (bool [s_n] a level) is False."""

    tokens: Tokens
    redraw: tuple[Tensor, ...]

    def mix(self, level: int, drawn: Tensor) -> Tensor:
        """Drawn ids [B, s_n] with the kept positions put back."""
        return torch.where(self.redraw[level], drawn, self.tokens.ids[level])


def redraw_masks(keep: Tensor, sizes: Sequence[int], forced: int = 0) -> tuple[Tensor, ...]:
    """Latents to keep (bool [T]) -> tokens to draw anew, bool [s_n] a level.

    The mask is resized linearly, threshold 0.5 (A10); of the first `forced` scales nothing is drawn anew.
    """
    redraw = (~keep).float()[None, None]
    masks = []
    for level, size in enumerate(sizes):
        here = redraw if len(keep) == size else F.interpolate(redraw, size, mode="linear", align_corners=False)
        masks.append((here[0, 0] > 0.5) & (level >= forced))
    return tuple(masks)


def null_text(rows: int, width: int, words: int) -> TextFeatures:
    """A text of zeros for every row, so many words long: what free-form generation reads."""
    mask = torch.ones(rows, words, dtype=torch.bool)
    return TextFeatures(torch.zeros(rows, words, width), mask, torch.zeros(rows, width), [[] for _ in range(rows)])


class TokenNetwork(Protocol):
    """A module that learns to draw tokens."""

    config: Any

    def training_loss(
        self, batch: TokenBatch, quantizer: MultiScaleQuantizer, rng: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        """Loss, and the share of right arg-maxes among the predicted tokens; scalars. Draws come from `rng` alone."""
        ...


class FeatureNetwork(Protocol):
    """A module that learns to make features without tokens."""

    config: Any

    def training_loss(self, batch: FeatureBatch, rng: torch.Generator) -> tuple[Tensor, Tensor]:
        """Loss, and the mean squared error of the predicted motion; scalars. Draws come from `rng` alone."""
        ...


class Generator(Protocol):
    """Text -> tokens. `likelihood` says whether `score` and `logits` are there (LikelihoodGenerator)."""

    likelihood: ClassVar[bool]

    @property
    def quantizer(self) -> MultiScaleQuantizer:
        """Of the tokenizer whose tokens it draws."""
        ...

    def steps(
        self, text: TextFeatures | None, lengths: Tensor, sampling: Sampling, edit: Edit | None = None
    ) -> Iterator[Step]:
        """Yield after every finished level. text None is free-form; lengths int64 [B] in frames."""
        ...

    def generate(self, text: TextFeatures | None, lengths: Tensor, sampling: Sampling) -> Step:
        """The last step: all levels drawn."""
        ...

    def edit(
        self, tokens: Tokens, keep: Tensor, text: TextFeatures | None, lengths: Tensor, sampling: Sampling
    ) -> Tokens:
        """Redraw the tokens where keep (bool [T] over the latents) is False."""
        ...


class StepGenerator(ABC):
    """What follows for a generator of tokens from its steps."""

    likelihood: ClassVar[bool] = False

    @abstractmethod
    def steps(
        self, text: TextFeatures | None, lengths: Tensor, sampling: Sampling, edit: Edit | None = None
    ) -> Iterator[Step]:
        """Yield after every finished level, or once for all. text None draws free-form."""

    def generate(self, text: TextFeatures | None, lengths: Tensor, sampling: Sampling) -> Step:
        """The last step: all levels drawn. text None is free-form; lengths int64 [B] in frames."""
        *_, last = self.steps(text, lengths, sampling)
        return last


class ScoredGenerator(StepGenerator):
    """What follows besides where the generator has logits of given tokens."""

    likelihood: ClassVar[bool] = True

    @abstractmethod
    def logits(self, tokens: Tokens, text: TextFeatures | None, lengths: Tensor) -> list[Tensor]:
        """Logits [B, s_n, V_n] of every level, given what was drawn before, without guidance."""

    def edit(
        self,
        tokens: Tokens,
        keep: Tensor,
        text: TextFeatures | None,
        lengths: Tensor,
        sampling: Sampling,
        forced: int = 0,
    ) -> Tokens:
        """Redraw the tokens where keep (bool [T]) is False; kept positions hold their codes at every level (A10).

        A causal generator goes from left to right: what comes later is not seen. forced: so many coarse levels are
        taken from the source whole.
        """
        redraw = redraw_masks(keep, tokens.sizes, forced)
        *_, last = self.steps(text, lengths, sampling, Edit(tokens, redraw))
        return last.tokens

    @torch.no_grad()
    def score(self, tokens: Tokens, text: TextFeatures | None, lengths: Tensor) -> list[Tensor]:
        """Log-probability [B, s_n] of every given token, one array a level, teacher-forced, without guidance."""
        return [
            part.log_softmax(dim=-1).gather(-1, ids[..., None])[..., 0]
            for part, ids in zip(self.logits(tokens, text, lengths), tokens.ids, strict=True)
        ]


class LikelihoodGenerator(Generator, Protocol):
    """A generator that says how likely given tokens are."""

    def score(self, tokens: Tokens, text: TextFeatures | None, lengths: Tensor) -> list[Tensor]:
        """Log-probability [B, s_n] of every given token, one array a level, teacher-forced."""
        ...

    def logits(self, tokens: Tokens, text: TextFeatures | None, lengths: Tensor) -> list[Tensor]:
        """Logits [B, s_n, V_n] of every level that those log-probabilities come from."""
        ...


class FeatureGenerator(Protocol):
    """Text -> features, without tokens."""

    def sample(self, text: TextFeatures | None, lengths: Tensor, sampling: Sampling) -> Tensor:
        """Normalised features [B, F, C], 0 beyond each length. text None is free-form."""
        ...

    def steps_of(
        self, text: TextFeatures | None, lengths: Tensor, sampling: Sampling
    ) -> Iterator[tuple[int, int, Tensor]]:
        """After every denoising step: steps done, steps in all, and the motion as it is guessed so far [B, F, C]."""
        ...
