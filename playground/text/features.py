"""What a text encoder gives: TextFeatures, the TextEncoder protocol, and the identity that a checkpoint records."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import torch
from torch import Tensor

from playground.errors import PlaygroundError

CHUNK = 64  # texts of similar length that one pass of an encoder takes


@dataclass(frozen=True, eq=False)
class TextFeatures:
    """Frozen features of B texts, padded on the right to the longest of them.

    tokens: float32 [B, W, D], 0 where padded (CLIP alone keeps its states there: systems.md A9 attends to all 77).
    mask: bool [B, W], True where real. pooled: float32 [B, D] (CLIP: the width of its projection).
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


def pad(rows: Sequence[tuple[Tensor, Tensor, Tensor, list[str]]], width: int) -> TextFeatures:
    """B single texts, each (tokens [w, D], mask [w], pooled, words) -> TextFeatures of all of them."""
    longest = max((len(row[0]) for row in rows), default=0)
    tokens = torch.zeros(len(rows), longest, width)
    mask = torch.zeros(len(rows), longest, dtype=torch.bool)
    for line, (states, real, _, _) in enumerate(rows):
        tokens[line, : len(states)] = states
        mask[line, : len(real)] = real
    pooled = torch.stack([row[2] for row in rows]) if rows else torch.zeros(0, width)
    return TextFeatures(tokens, mask, pooled, [list(row[3]) for row in rows])


def run_by_length(ids: Sequence[list[int]], pad_id: int, width: int, run: Callable[[Tensor, Tensor], Tensor]) -> Tensor:
    """Token ids of B texts -> states float32 [B, W, D], 0 where padded; texts of similar length run together.

    run: (ids int64 [b, w], mask bool [b, w]) -> states [b, w, D].
    """
    lengths = torch.tensor([len(row) for row in ids], dtype=torch.long)
    states = torch.zeros(len(ids), int(lengths.max()) if len(ids) else 0, width)
    order = lengths.argsort(stable=True)
    for start in range(0, len(ids), CHUNK):
        rows = order[start : start + CHUNK]
        widest = int(lengths[rows].max())
        part = torch.full((len(rows), widest), pad_id, dtype=torch.long)
        for line, row in enumerate(rows.tolist()):
            part[line, : len(ids[row])] = torch.tensor(ids[row], dtype=torch.long)
        mask = torch.arange(widest) < lengths[rows, None]  # (b, w)
        states[rows, :widest] = run(part, mask) * mask[..., None]
    return states


def length_mask(ids: Sequence[list[int]]) -> Tensor:
    """Token ids of B texts -> bool [B, W], True where real."""
    lengths = torch.tensor([len(row) for row in ids], dtype=torch.long)
    return torch.arange(int(lengths.max()) if len(ids) else 0) < lengths[:, None]


def masked_mean(tokens: Tensor, mask: Tensor) -> Tensor:
    """tokens [B, W, D], 0 where padded; mask [B, W] -> mean over the real ones [B, D]."""
    return tokens.sum(dim=1) / mask.sum(dim=1, keepdim=True).clamp(min=1)


def valid_text(texts: Sequence[str]) -> list[str]:
    """The texts as a list, without lone surrogates (no tokenizer reads them). PlaygroundError if one is no string."""
    for text in texts:
        if not isinstance(text, str):
            raise PlaygroundError(f"a text encoder takes a list of strings, got {type(text).__name__}")
    return [text.encode("utf-8", "ignore").decode("utf-8") for text in texts]


@dataclass(frozen=True)
class EncoderId:
    """What a checkpoint records about the encoder it was trained with."""

    name: str  # "minilm", "clip", "llama" or "t5"
    width: int  # D
    hash: str  # sha256 of the weights, hexadecimal; "" where they are not known


@runtime_checkable
class TextEncoder(Protocol):
    """Texts -> frozen features. Implementations are deterministic, keep no state of a call, serve threads at once."""

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
    """PlaygroundError unless the encoder is the one recorded: same name, same width, same weights where known."""
    given = identify(encoder) if recorded.hash else EncoderId(encoder.name, encoder.width, "")
    if given != recorded:
        raise PlaygroundError(
            f"this checkpoint was trained with the text encoder {_describe(recorded)} and cannot read"
            f" {_describe(given)}; load the encoder it was trained with"
        )


def _describe(who: EncoderId) -> str:
    return f"{who.name} (width {who.width}, weights {who.hash[:12] or 'unknown'})"
