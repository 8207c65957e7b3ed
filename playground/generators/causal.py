"""What the generators share that draw one time step after the other: T2M-GPT's and MOGO's."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import ClassVar

import torch
from torch import Tensor, nn

from playground.generators.base import Edit, Step, redraw_masks
from playground.nn.sampling import Sampling
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Tokenizer, Tokens
from playground.tokenizers.quantizers import MultiScaleQuantizer


@dataclass(frozen=True, eq=False)
class CausalGenerator(ABC):
    """A network with the tokenizer whose tokens it draws, every level as long as the first; no state of a call."""

    likelihood: ClassVar[bool] = True
    network: nn.Module
    tokenizer: Tokenizer = field(repr=False)

    @property
    def quantizer(self) -> MultiScaleQuantizer:
        """Of the tokenizer whose tokens it draws."""
        return self.tokenizer.quantizer

    @abstractmethod
    def steps(
        self, text: TextFeatures | None, lengths: Tensor, sampling: Sampling, edit: Edit | None = None
    ) -> Iterator[Step]:
        """Yield once, with all levels, when the last time step is drawn. text None draws free-form."""

    @abstractmethod
    def logits(self, tokens: Tokens, text: TextFeatures | None, lengths: Tensor) -> list[Tensor]:
        """Logits [B, T, V_n] of every level, given what was drawn before, without guidance."""

    def counts(self, lengths: Tensor) -> Tensor:
        """Time steps of every row: lengths int64 [B] in frames -> int64 [B]."""
        sizes = {frames: self.tokenizer.sizes(frames)[0] for frames in set(lengths.tolist())}
        return torch.tensor([sizes[frames] for frames in lengths.tolist()], device=lengths.device)

    def generate(self, text: TextFeatures | None, lengths: Tensor, sampling: Sampling) -> Step:
        """All levels drawn. text None is free-form; lengths int64 [B] in frames."""
        *_, last = self.steps(text, lengths, sampling)
        return last

    def edit(
        self,
        tokens: Tokens,
        keep: Tensor,
        text: TextFeatures | None,
        lengths: Tensor,
        sampling: Sampling,
        forced: int = 0,
    ) -> Tokens:
        """Redraw the tokens where keep (bool [T]) is False, from left to right: what comes later is not seen.

        forced: so many coarse levels are taken from the source whole.
        """
        redraw = redraw_masks(keep, tokens.sizes, forced)
        *_, last = self.steps(text, lengths, sampling, Edit(tokens, redraw))
        return last.tokens

    @torch.no_grad()
    def score(self, tokens: Tokens, text: TextFeatures | None, lengths: Tensor) -> list[Tensor]:
        """Log-probability [B, T] of every given token, one array a level, teacher-forced, without guidance."""
        return [
            part.log_softmax(dim=-1).gather(-1, ids[..., None])[..., 0]
            for part, ids in zip(self.logits(tokens, text, lengths), tokens.ids, strict=True)
        ]

    def embed(self, ids: tuple[Tensor, ...], lengths: Tensor) -> tuple[Tokens, Tensor]:
        """Drawn ids [B, T] a level, T of the longest row -> tokens, 0 beyond each row's own; embedding [B, T, D]."""
        counts = self.counts(lengths)
        real = torch.arange(ids[0].shape[1], device=lengths.device) < counts[:, None]
        tokens = Tokens(tuple(torch.where(real, level, 0) for level in ids), self.quantizer.codes)
        return tokens, self.tokenizer.embed(tokens, lengths=lengths)


def kept(edit: Edit | None, level: int, place: int, drawn: Tensor) -> Tensor:
    """Drawn ids [B] of one time step, or the source's where the edit keeps them."""
    if edit is None or bool(edit.redraw[level][place]):
        return drawn
    return edit.tokens.ids[level][:, place].expand(len(drawn))


def without_text(text: TextFeatures) -> TextFeatures:
    """The null text: the states of a text multiplied by 0, its mask as it was."""
    return TextFeatures(text.tokens * 0, text.mask, text.pooled * 0, text.words)
