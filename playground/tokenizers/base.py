"""The nouns of tokenization: Tokens, Quantized, and what every tokenizer can do (architecture: nouns and verbs)."""

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import torch
from torch import Tensor

from playground.errors import PlaygroundError
from playground.text.encoders import TextFeatures

if TYPE_CHECKING:
    from playground.tokenizers.quantizers import MultiScaleQuantizer


@dataclass(frozen=True, eq=False)
class Tokens:
    """Token ids of a batch, one int64 array [B, s_n] a level, coarse to fine, with the codebook size of each level."""

    ids: tuple[Tensor, ...]
    codes: tuple[int, ...]

    def __post_init__(self) -> None:
        if len(self.ids) > len(self.codes):
            raise PlaygroundError(f"{len(self.ids)} token levels were given for {len(self.codes)} codebooks")
        for level, (ids, codes) in enumerate(zip(self.ids, self.codes, strict=False), start=1):
            if ids.numel() and not (int(ids.min()) >= 0 and int(ids.max()) < codes):
                raise PlaygroundError(f"token ids of level {level} must lie in 0..{codes - 1}")

    @property
    def sizes(self) -> tuple[int, ...]:
        """Number of tokens a level."""
        return tuple(ids.shape[1] for ids in self.ids)

    def __len__(self) -> int:
        return len(self.ids)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Tokens) or self.codes != other.codes or len(self) != len(other):
            return False
        return all(torch.equal(a, b) for a, b in zip(self.ids, other.ids, strict=True))

    def __hash__(self) -> int:
        return hash((self.codes, self.sizes))

    def __str__(self) -> str:
        rows = [
            f"level {n} ({c} codes): {i.tolist()}"
            for n, (i, c) in enumerate(zip(self.ids, self.codes, strict=False), 1)
        ]
        return "\n".join(rows)

    def to_json(self) -> str:
        """JSON text with one object a level: codes, ids."""
        levels = [{"codes": c, "ids": i.tolist()} for i, c in zip(self.ids, self.codes, strict=False)]
        return json.dumps({"levels": levels})

    @classmethod
    def from_json(cls, text: str) -> "Tokens":
        """Inverse of `to_json`. PlaygroundError if the text is not that."""
        try:
            levels = json.loads(text)["levels"]
            ids = tuple(torch.tensor(level["ids"], dtype=torch.int64) for level in levels)
            return cls(ids, tuple(int(level["codes"]) for level in levels))
        except (KeyError, TypeError, ValueError) as error:
            raise PlaygroundError("the token text must be JSON with one object of codes and ids a level") from error


@dataclass(frozen=True, eq=False)
class Quantized:
    """What encoding a motion gives."""

    tokens: Tokens
    embedding: Tensor  # [B, T, D], the sum over all levels
    per_level: Tensor  # [N, B, T, D], each level's share of the embedding
    residual_norm: Tensor  # [N + 1, B], mean squared residual before the first level and after each one


@dataclass(frozen=True, eq=False)
class TrainingOutput:
    """What one training step of a tokenizer needs."""

    features: Tensor  # [B, F, C] reconstruction, zero beyond each length
    commitment: Tensor  # scalar
    ids: tuple[Tensor, ...]  # [B, s_n] a level


class Tokenizer(Protocol):
    """Features <-> tokens. Text may be None where a tokenizer does not use it.

    config states at least columns, heading, max_frames, scales (tokens a level at full length), codes, code_width and
    latents (T at full length). In a batch of several lengths ids are padded with 0 on the right.
    """

    config: Any
    quantizer: "MultiScaleQuantizer"

    def sizes(self, frames: int) -> tuple[int, ...]:
        """Tokens a level of a motion of so many frames."""
        ...

    def encode(self, features: Tensor, lengths: Tensor, text: TextFeatures | None) -> Quantized:
        """features [B, F, C] normalised, lengths int64 [B] -> Quantized."""
        ...

    def latents(
        self, features: Tensor, lengths: Tensor, text: TextFeatures | None, dropped: Tensor | None = None
    ) -> Tensor:
        """What is quantized: z [B, T, D]. Rows dropped (bool [B]) see no text."""
        ...

    def embed(self, tokens: Tokens, levels: int | None = None, lengths: Tensor | None = None) -> Tensor:
        """Tokens -> embedding [B, T, D]; levels=3 keeps the three coarsest. lengths: frames, None: all full length."""
        ...

    def decode(
        self,
        embedding: Tensor,
        lengths: Tensor,
        text: TextFeatures | None,
        guidance: float = 0.0,
        edit_mask: Tensor | None = None,
    ) -> Tensor:
        """Embedding [B, T, D] -> normalised features [B, F, C], zero beyond each length."""
        ...

    def branches(self, embedding: Tensor, lengths: Tensor, text: TextFeatures | None) -> tuple[Tensor, Tensor]:
        """The decodes with text and with the null text, [B, F, C] each; the same one twice where text changes none."""
        ...

    def detokenize(
        self, embedding: Tensor, lengths: Tensor, text: TextFeatures | None, dropped: Tensor | None, frames: int
    ) -> Tensor:
        """The second half of a training pass: embedding [B, T, D] -> features [B, frames, C]."""
        ...


def level_masks(tokenizer: Tokenizer, lengths: Tensor) -> tuple[Tensor, ...]:
    """Which tokens of a batch are real: lengths int64 [B] in frames -> bool [B, s_n of the longest] a level."""
    sizes = [tokenizer.sizes(frames) for frames in lengths.tolist()]
    counts = torch.tensor(sizes, device=lengths.device)  # (B, N)
    return tuple(
        torch.arange(max(level), device=lengths.device)[None] < counts[:, n, None]
        for n, level in enumerate(zip(*sizes, strict=True))
    )
