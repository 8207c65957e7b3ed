"""What a text encoder gives: TextFeatures, the TextEncoder protocol, and the identity that a checkpoint records."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import torch
from torch import Tensor

from playground.errors import PlaygroundError


@dataclass(frozen=True, eq=False)
class TextFeatures:
    """Frozen features of B texts, padded on the right to the longest of them.

    tokens: float32 [B, W, D], exactly 0 where padded. mask: bool [B, W], True where real. pooled: float32 [B, D].
    words: the word piece behind each real token, one list a text, for hover text (special tokens included).
    """

    tokens: Tensor
    mask: Tensor
    pooled: Tensor
    words: list[list[str]]

    @property
    def width(self) -> int:
        """D."""
        return self.tokens.shape[-1]

    def __len__(self) -> int:
        return self.tokens.shape[0]

    def to(self, device: torch.device | str) -> "TextFeatures":
        """The same features on another device."""
        return TextFeatures(self.tokens.to(device), self.mask.to(device), self.pooled.to(device), self.words)

    def select(self, rows: Sequence[int]) -> "TextFeatures":
        """The given texts, in the given order, cut to the longest of them."""
        index = torch.as_tensor(list(rows), dtype=torch.long, device=self.tokens.device)
        mask = self.mask[index]
        longest = int(mask.sum(dim=1).max()) if len(index) else 0
        tokens = self.tokens[index, :longest]
        return TextFeatures(tokens, mask[:, :longest], self.pooled[index], [self.words[row] for row in rows])


def pad(states: Sequence[Tensor], pooled: Sequence[Tensor], words: Sequence[list[str]], width: int) -> TextFeatures:
    """Unpadded states [w_i, D] of B texts, their pooled vectors [D] and word pieces -> TextFeatures."""
    longest = max((len(state) for state in states), default=0)
    tokens = torch.zeros(len(states), longest, width)
    mask = torch.zeros(len(states), longest, dtype=torch.bool)
    for row, state in enumerate(states):
        tokens[row, : len(state)] = state
        mask[row, : len(state)] = True
    stacked = torch.stack([vector.to(torch.float32) for vector in pooled]) if pooled else torch.zeros(0, width)
    return TextFeatures(tokens, mask, stacked, [list(pieces) for pieces in words])


def valid_text(texts: Sequence[str]) -> list[str]:
    """The texts as a list, without lone surrogates, which no tokenizer can read. PlaygroundError if one is no string."""
    for text in texts:
        if not isinstance(text, str):
            raise PlaygroundError(f"a text encoder takes a list of strings, got {type(text).__name__}")
    return [text.encode("utf-8", "ignore").decode("utf-8") for text in texts]


@dataclass(frozen=True)
class EncoderId:
    """What a checkpoint records about the encoder it was trained with."""

    name: str  # "minilm", "clip", "llama" or "t5"
    width: int  # D
    hash: str  # sha256 of the weights, hexadecimal


@runtime_checkable
class TextEncoder(Protocol):
    """Texts -> frozen features. Implementations are deterministic, hold no state of a call and may be shared by threads."""

    @property
    def name(self) -> str:
        """Short name, the same for every machine."""

    @property
    def width(self) -> int:
        """Width D of a token state."""

    @property
    def hash(self) -> str:
        """sha256 of the weights, hexadecimal."""

    def encode(self, texts: Sequence[str]) -> TextFeatures:
        """Features of B texts, at most LIMITS.max_text_positions tokens each. PlaygroundError if one is no string."""


def identify(encoder: TextEncoder) -> EncoderId:
    """The identity of an encoder."""
    return EncoderId(encoder.name, encoder.width, encoder.hash)


def check_same(recorded: EncoderId, encoder: TextEncoder) -> None:
    """PlaygroundError unless the encoder is the one recorded: same name, same width, same weights."""
    given = identify(encoder)
    if given != recorded:
        raise PlaygroundError(
            f"this checkpoint was trained with the text encoder {_describe(recorded)} and cannot read {_describe(given)};"
            " load the encoder it was trained with"
        )


def _describe(who: EncoderId) -> str:
    return f"{who.name} (width {who.width}, weights {who.hash[:12]})"
