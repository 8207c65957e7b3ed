"""The two plain encoders of the text ablation (LG-Tok, Table 4f): word numbers for a learned table, and MiniLM pooled.

Neither is a good text encoder; they are there to be compared with MiniLM's token states.
"""

import hashlib
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import torch

from playground.limits import LIMITS
from playground.text.features import TextFeatures, pad, valid_text

if TYPE_CHECKING:
    from playground.text.features import TextEncoder

WORDS = 2_048  # rows of the learned table; whole numbers up to this are exact in float16
_WORD = re.compile(r"[^\W_]+")


class WordNumbers:
    """Every word as a number from 1 to WORDS - 1, by hashing: tokens [B, W, 1]; 0 stands for a text without words.

    The vectors behind the numbers are learned by the model that reads them (TokenizerConfig.text_table). With some 500
    different words about one in five shares its number with another one. pooled is the mean number and means nothing.
    """

    name = "words"
    width = 1
    hash = hashlib.sha256(f"lower-case words, sha256 modulo {WORDS - 1}".encode()).hexdigest()

    def encode(self, texts: Sequence[str]) -> TextFeatures:
        """Numbers of the words of B texts. PlaygroundError if one is no string."""
        rows = []
        for text in valid_text(texts):
            words = _WORD.findall(text.lower())[: LIMITS.max_text_positions] or [""]
            numbers = torch.tensor([[float(number_of(word))] for word in words])
            rows.append((numbers, torch.ones(len(words), dtype=torch.bool), numbers.mean(dim=0), words))
        return pad(rows, self.width)


def number_of(word: str) -> int:
    """The row of a lower-case word in the learned table; 0 for the empty one."""
    if not word:
        return 0
    return 1 + int.from_bytes(hashlib.sha256(word.encode()).digest()[:8], "big") % (WORDS - 1)


class PooledEncoder:
    """Another encoder's pooled vector as the only token: tokens [B, 1, D]."""

    def __init__(self, encoder: "TextEncoder") -> None:
        self._encoder = encoder
        self.name = f"{encoder.name}-pooled"
        self.width = encoder.width
        self.hash = encoder.hash

    def encode(self, texts: Sequence[str]) -> TextFeatures:
        """One token a text. PlaygroundError if a text is no string."""
        pooled = self._encoder.encode(texts).pooled
        mask = torch.ones(len(pooled), 1, dtype=torch.bool)
        return TextFeatures(pooled[:, None], mask, pooled, [["(pooled)"]] * len(pooled))
