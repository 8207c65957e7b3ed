"""What the generators share that draw one time step after the other: T2M-GPT's and MOGO's."""

from dataclasses import dataclass, field

import torch
from torch import Tensor, nn

from playground.generators.base import Edit, ScoredGenerator
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Tokenizer, Tokens
from playground.tokenizers.quantizers import MultiScaleQuantizer


@dataclass(frozen=True, eq=False)
class CausalGenerator(ScoredGenerator):
    """A network with the tokenizer whose tokens it draws, every level as long as the first; no state of a call."""

    network: nn.Module
    tokenizer: Tokenizer = field(repr=False)

    @property
    def quantizer(self) -> MultiScaleQuantizer:
        """Of the tokenizer whose tokens it draws."""
        return self.tokenizer.quantizer

    def counts(self, lengths: Tensor) -> Tensor:
        """Time steps of every row: lengths int64 [B] in frames -> int64 [B]."""
        sizes = {frames: self.tokenizer.sizes(frames)[0] for frames in set(lengths.tolist())}
        return torch.tensor([sizes[frames] for frames in lengths.tolist()], device=lengths.device)

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
