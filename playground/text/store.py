"""Text features on disk for training: every caption of a library encoded once, batches read back in a millisecond."""

import json
import os
import uuid
from collections.abc import Callable, Iterable, Sequence
from copy import copy
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from playground.errors import PlaygroundError
from playground.nn.transfer import on_device
from playground.text.features import EncoderId, TextEncoder, TextFeatures, check_same, identify

FORMAT = "1"
BLOCK = 1024  # texts encoded before their states are narrowed to the stored type
DTYPES = {"float16": torch.float16, "float32": torch.float32}


class FeatureStore:
    """The features of a set of texts under one encoder, in one safetensors file that is mapped, not read.

    The file holds states [P, D] (the unpadded states of all texts back to back), offsets int64 [n + 1], mask bool [P],
    pooled float32 [n, D], and as metadata the encoder's identity, the texts and their word pieces.
    """

    def __init__(self, arrays: dict[str, Tensor], texts: Sequence[str], words: list[list[str]], who: EncoderId) -> None:
        self._states, self._mask, self._pooled = arrays["states"], arrays["mask"], arrays["pooled"]
        self._offsets = arrays["offsets"]
        self._rows = {text: row for row, text in enumerate(texts)}
        self._words = words
        self.encoder = who

    @classmethod
    def open(cls, path: Path | str, encoder: TextEncoder | None = None) -> "FeatureStore":
        """The store in a file. PlaygroundError if it is no store, or not of the encoder given."""
        try:
            with safe_open(str(path), framework="pt") as file:
                metadata = file.metadata() or {}
                arrays = {name: file.get_tensor(name) for name in ("states", "offsets", "mask", "pooled")}
            if metadata.get("format") != FORMAT:
                raise ValueError("format")
            who = EncoderId(**json.loads(metadata["encoder"]))
            store = cls(arrays, json.loads(metadata["texts"]), json.loads(metadata["words"]), who)
        except (OSError, SafetensorError, ValueError, KeyError, TypeError) as error:
            raise PlaygroundError(f"{path} is not a store of text features; delete it and build it again") from error
        if encoder is not None:
            check_same(who, encoder)
        return store

    @classmethod
    def build(
        cls,
        path: Path | str,
        texts: Iterable[str],
        encoder: TextEncoder,
        *,
        dtype: str = "float16",
        progress: Callable[[int, int], None] | None = None,
    ) -> "FeatureStore":
        """Encode every distinct text, write the file at once (never half of it), and open it.

        dtype: "float16" or "float32" of the stored states. progress: called with (texts done, texts in all).
        PlaygroundError if a state does not fit float16.
        """
        distinct = list(dict.fromkeys(texts))
        arrays, words = _encode(distinct, encoder, DTYPES[dtype], progress)
        who = identify(encoder)
        metadata = {
            "format": FORMAT,
            "encoder": json.dumps({"name": who.name, "width": who.width, "hash": who.hash}),
            "texts": json.dumps(distinct),
            "words": json.dumps(words),
        }
        _write(Path(path), arrays, metadata)
        return cls.open(path, encoder)

    @classmethod
    def cached(cls, folder: Path | str, texts: Iterable[str], encoder: TextEncoder, **options: Any) -> "FeatureStore":
        """The store of these texts in a folder, named by encoder and weights; built if missing or incomplete."""
        distinct = list(dict.fromkeys(texts))
        path = Path(folder) / f"text-{encoder.name}-{encoder.hash[:12]}.safetensors"
        if path.is_file():
            store = cls.open(path, encoder)
            if all(text in store for text in distinct):
                return store
            distinct = list(dict.fromkeys([*store._rows, *distinct]))
        return cls.build(path, distinct, encoder, **options)

    def to(self, device: torch.device | str) -> "FeatureStore":
        """The same store with its features on another device, where lookups then happen; itself if they are there."""
        if torch.device(device) == self._states.device:
            return self
        there = copy(self)
        there._states, there._mask, there._pooled = (x.to(device) for x in (self._states, self._mask, self._pooled))
        return there

    @property
    def width(self) -> int:
        """Width D of a token state."""
        return self._states.shape[1]

    def __len__(self) -> int:
        return len(self._rows)

    def __contains__(self, text: str) -> bool:
        return text in self._rows

    def lookup(self, texts: Sequence[str]) -> TextFeatures:
        """B stored texts -> TextFeatures, float32, padded to the longest. PlaygroundError if one is not stored."""
        absent = next((text for text in texts if text not in self._rows), None)
        if absent is not None:
            raise PlaygroundError(f'the store of text features lacks "{absent[:80]}"; build it for all captions')
        rows = torch.tensor([self._rows[text] for text in texts], dtype=torch.long)
        start, stop = self._offsets[rows], self._offsets[rows + 1]
        steps = torch.arange(int((stop - start).max()) if len(rows) else 0)
        inside = steps < (stop - start)[:, None]  # (B, W)
        index = (start[:, None] + steps) * inside
        words = [self._words[row] for row in rows.tolist()]
        index, inside, rows = (on_device(x, self._states.device) for x in (index, inside, rows))
        tokens = self._states[index].to(torch.float32) * inside[..., None]
        return TextFeatures(tokens, self._mask[index] & inside, self._pooled[rows], words)


def _encode(
    texts: list[str], encoder: TextEncoder, dtype: torch.dtype, progress: Callable[[int, int], None] | None
) -> tuple[dict[str, Tensor], list[list[str]]]:
    """The arrays of a store and the word pieces of its texts."""
    states, masks, pooled, words, lengths = [], [], [], [], [0]
    for start in range(0, len(texts), BLOCK):
        features = encoder.encode(texts[start : start + BLOCK])
        full = features.tokens.shape[1]
        for row, mask in enumerate(features.mask):
            # states behind the mask are padding, except where the encoder gives meaning to them (CLIP)
            beyond = bool(features.tokens[row, ~mask].any())
            length = full if beyond else int(mask.sum())
            states.append(features.tokens[row, :length].to(dtype))
            masks.append(mask[:length])
            lengths.append(length)
        pooled.append(features.pooled)
        words.extend(features.words)
        if progress is not None:
            progress(min(start + BLOCK, len(texts)), len(texts))
    flat = torch.cat(states) if states else torch.zeros(0, encoder.width, dtype=dtype)
    if not torch.isfinite(flat).all():
        raise PlaygroundError(f"states of {encoder.name} do not fit float16; build the store with dtype float32")
    arrays = {
        "states": flat,
        "mask": torch.cat(masks) if masks else torch.zeros(0, dtype=torch.bool),
        "pooled": torch.cat(pooled) if pooled else torch.zeros(0, encoder.width),
        "offsets": torch.tensor(lengths, dtype=torch.long).cumsum(0),
    }
    return arrays, words


def _write(path: Path, arrays: dict[str, Tensor], metadata: dict[str, str]) -> None:
    """Write next to the target, then move it there: readers see the old file or the whole new one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.{uuid.uuid4().hex}.part")
    try:
        save_file(arrays, part, metadata=metadata)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)
