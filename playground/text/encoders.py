"""Text -> features, whichever encoder: load_encoder, and a cache in memory around any of them."""

import os
import threading
from collections import OrderedDict
from collections.abc import Sequence
from functools import lru_cache

from torch import Tensor

from playground.errors import PlaygroundError
from playground.text.features import EncoderId, TextEncoder, TextFeatures, check_same, identify, pad, valid_text

__all__ = ["CachedEncoder", "EncoderId", "TextEncoder", "TextFeatures", "check_same", "identify", "load_encoder"]

KNOWN = '"minilm", "minilm-pooled", "words", "clip:FOLDER", "llama:FOLDER" or "t5:FOLDER"'
FAMILIES = ("clip", "llama", "t5")  # encoders that a folder of the user's brings
_LOADING = threading.Lock()


def load_encoder(spec: str = "minilm") -> TextEncoder:
    """The encoder named by spec, loaded once a process and shared.

    spec: "minilm" (the default), "clip:FOLDER", "llama:FOLDER" or "t5:FOLDER"; "minilm-pooled" and "words" are those of
    the text ablation (words.py).
    A FOLDER holds a model as transformers saves it; nothing is ever fetched. "clip", "llama" and "t5" alone stand for
    the folder that the environment variable PLAYGROUND_CLIP, PLAYGROUND_LLAMA or PLAYGROUND_T5 names.
    PlaygroundError if the name is unknown, or the files are missing or not the expected ones.
    """
    if spec in FAMILIES:
        variable = f"PLAYGROUND_{spec.upper()}"
        folder = os.environ.get(variable)
        if not folder:
            raise PlaygroundError(
                f"the {spec} text encoder is needed and its folder is not known; set {variable} to a folder with the"
                " model as transformers saves it"
            )
        spec = f"{spec}:{folder}"
    with _LOADING:
        return _load(spec)


@lru_cache(maxsize=4)
def _load(spec: str) -> TextEncoder:
    family, colon, folder = spec.partition(":")
    if spec == "minilm":
        from playground.text.minilm import MiniLMEncoder

        return MiniLMEncoder()
    if spec in ("minilm-pooled", "words"):
        from playground.text.words import PooledEncoder, WordNumbers

        return WordNumbers() if spec == "words" else PooledEncoder(_load("minilm"))
    if colon and family in FAMILIES:
        from playground.text.pretrained import load_pretrained

        return load_pretrained(family, folder)
    raise PlaygroundError(f'unknown text encoder "{spec[:100]}"; accepted are {KNOWN}')


class CachedEncoder:
    """An encoder that remembers the features of the last `capacity` texts; a TextEncoder itself, safe for threads.

    A text that is not remembered is encoded alone, so its features never depend on the texts beside it and a hit equals
    a miss bit for bit. For thousands of texts at once use the encoder itself or a FeatureStore: batches are faster.
    """

    def __init__(self, encoder: TextEncoder, capacity: int = 256) -> None:
        if capacity < 1:
            raise ValueError(f"capacity is {capacity}, it must be at least 1")
        self._encoder = encoder
        self._capacity = capacity
        self._lock = threading.Lock()
        self._known: OrderedDict[str, tuple[Tensor, Tensor, Tensor, list[str]]] = OrderedDict()

    @property
    def name(self) -> str:
        """Name of the encoder inside."""
        return self._encoder.name

    @property
    def width(self) -> int:
        """Width D of the encoder inside."""
        return self._encoder.width

    @property
    def hash(self) -> str:
        """Weights hash of the encoder inside."""
        return self._encoder.hash

    def __len__(self) -> int:
        return len(self._known)

    def __contains__(self, text: str) -> bool:
        return text in self._known

    def encode(self, texts: Sequence[str]) -> TextFeatures:
        """B texts -> TextFeatures, remembered ones without a new run. PlaygroundError if one is no string."""
        rows = [self._one(text) for text in valid_text(texts)]
        return pad(rows, self._encoder.width)

    def _one(self, text: str) -> tuple[Tensor, Tensor, Tensor, list[str]]:
        with self._lock:
            row = self._known.get(text)
            if row is not None:
                self._known.move_to_end(text)
                return row
        features = self._encoder.encode([text])
        row = (features.tokens[0], features.mask[0], features.pooled[0], features.words[0])
        with self._lock:
            self._known[text] = row
            self._known.move_to_end(text)
            while len(self._known) > self._capacity:
                self._known.popitem(last=False)
        return row
