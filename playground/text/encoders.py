"""Text -> features, whichever encoder: load_encoder, and a cache in memory around any of them."""

import threading
from functools import lru_cache

from playground.errors import PlaygroundError
from playground.text.features import EncoderId, TextEncoder, TextFeatures, check_same, identify

__all__ = ["EncoderId", "TextEncoder", "TextFeatures", "check_same", "identify", "load_encoder"]

_LOADING = threading.Lock()


def load_encoder(spec: str = "minilm") -> TextEncoder:
    """The encoder named by spec, loaded once a process and shared: "minilm" (the default).

    PlaygroundError if the name is unknown or the files are missing or not the expected ones.
    """
    with _LOADING:
        return _load(spec)


@lru_cache(maxsize=4)
def _load(spec: str) -> TextEncoder:
    if spec == "minilm":
        from playground.text.minilm import MiniLMEncoder

        return MiniLMEncoder()
    raise PlaygroundError(f'unknown text encoder "{spec}"; known are minilm')
