"""The nouns of generation and what every generator can do (architecture: nouns and verbs)."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from torch import Tensor

from playground.nn.sampling import Sampling
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Tokens


@dataclass(frozen=True, eq=False)
class Step:
    """What one step of a generator gives."""

    level: int  # number of levels drawn so far, from 1
    tokens: Tokens  # all levels drawn so far
    embedding: Tensor  # [B, T, D], the sum of their shares
    entropy: Tensor  # [B, s_level] in bits, of the guided distribution that the level was drawn from
    logits: Tensor  # [B, s_level, V], guided, before any filter


class Generator(Protocol):
    """Text -> tokens."""

    def steps(self, text: TextFeatures | None, lengths: Tensor, sampling: Sampling) -> Iterator[Step]:
        """Yield after every level. text None is free-form; lengths int64 [B] in frames."""
        ...

    def edit(
        self, tokens: Tokens, keep: Tensor, text: TextFeatures | None, lengths: Tensor, sampling: Sampling
    ) -> Tokens:
        """Redraw the tokens where keep (bool [T] over the latents) is False."""
        ...

    def score(self, tokens: Tokens, text: TextFeatures | None, lengths: Tensor) -> list[Tensor]:
        """Log-probability [B, s_n] of every given token, one array a level, teacher-forced."""
        ...
