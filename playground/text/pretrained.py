"""CLIP, LLaMA and T5 text encoders from a local folder, through transformers, behind the TextEncoder interface.

Conventions of systems.md: CLIP as in A9 and D2, LLaMA as in A5, T5 (v1.1, encoder half) as in E4. Nothing is fetched,
no pickle is read.
"""

import hashlib
import json
import threading
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.text.features import EncoderId, TextFeatures, length_mask, masked_mean, run_by_length, valid_text

MODEL_TYPES = {"clip": ("clip", "clip_text_model"), "llama": ("llama",), "t5": ("t5",)}
EXPECTED = "config.json, tokenizer files and *.safetensors weights as transformers saves them"
CLIP_PAD = 0  # CLIP's own padding id; states behind EOT depend on it


def load_pretrained(family: str, folder: str) -> "PretrainedEncoder":
    """The encoder of a family ("clip", "llama", "t5") from a local folder.

    The folder needs config.json, the tokenizer's files and safetensors weights; the width D is the config's.
    PlaygroundError if it is not there or holds something else.
    """
    path = Path(folder).expanduser()
    _check_folder(family, path)
    try:
        import transformers
    except ImportError as error:
        raise PlaygroundError(f"the {family} text encoder needs transformers: pip install transformers") from error
    options: dict[str, Any] = {"local_files_only": True, "trust_remote_code": False}
    try:
        tokenizer = transformers.AutoTokenizer.from_pretrained(path, **options)
        weights = {**options, "use_safetensors": True, "dtype": torch.float32, "output_loading_info": True}
        loaders: dict[str, Any] = {
            "clip": transformers.CLIPTextModelWithProjection,
            "llama": transformers.LlamaModel,
            "t5": transformers.T5EncoderModel,
        }
        model, info = loaders[family].from_pretrained(path, **weights)
    except Exception as error:  # transformers raises many kinds; the visitor needs one sentence
        raise PlaygroundError(f"the {family} encoder in {path} could not be read; expected are {EXPECTED}") from error
    missing = set(info["missing_keys"])
    kind = {"clip": ClipEncoder, "llama": LlamaEncoder, "t5": T5Encoder}[family]
    if missing - kind.optional:
        raise PlaygroundError(f"the {family} weights in {path} lack {len(missing)} arrays, among them {min(missing)}")
    return kind(path, tokenizer, model.eval().requires_grad_(False), missing)


def identify_folder(family: str, folder: str) -> EncoderId:
    """The identity of the encoder in a folder, without loading it. PlaygroundError as in `load_pretrained`."""
    path = Path(folder).expanduser()
    config = _check_folder(family, path)
    text: Any = config.get("text_config")
    inner = text if isinstance(text, dict) else config
    width = inner.get("hidden_size", inner.get("d_model"))
    if not isinstance(width, int):
        raise PlaygroundError(
            f"{path / 'config.json'} states no width of the {family} encoder; expected are {EXPECTED}"
        )
    return EncoderId(family, width, _hash(path))


def _check_folder(family: str, path: Path) -> dict[str, Any]:
    """The config of a folder. PlaygroundError unless it is of that family and safetensors weights are there."""
    if not path.is_dir():
        raise PlaygroundError(f"there is no folder {path} for the {family} text encoder; expected are {EXPECTED}")
    try:
        config: dict[str, Any] = json.loads((path / "config.json").read_text(encoding="utf-8"))
        kind = str(config.get("model_type"))
    except (OSError, ValueError, AttributeError) as error:
        raise PlaygroundError(f"{path} has no readable config.json; expected are {EXPECTED}") from error
    if kind not in MODEL_TYPES[family]:
        raise PlaygroundError(f'{path} holds a model of type "{kind[:40]}", the {family} text encoder needs "{family}"')
    if not _weight_files(path):
        raise PlaygroundError(f"{path} has no *.safetensors weights; expected are {EXPECTED}")
    return config


def _weight_files(path: Path) -> list[Path]:
    """The weights of a folder: model.safetensors, or all its parts in order of name."""
    whole = path / "model.safetensors"
    return [whole] if whole.is_file() else sorted(path.glob("model-*.safetensors"))


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _hash(path: Path) -> str:
    """sha256 of the weights file; of the files' digests, in order of name, if the weights come in parts."""
    digests = [_sha256(file) for file in _weight_files(path)]
    return digests[0] if len(digests) == 1 else hashlib.sha256("".join(digests).encode()).hexdigest()


class PretrainedEncoder:
    """A frozen transformers model and its tokenizer. Subclasses say how ids become states; float32, deterministic."""

    name = ""
    optional: frozenset[str] = frozenset()  # weights that a folder may lack

    def __init__(self, path: Path, tokenizer: Any, model: Any, missing: set[str]) -> None:
        self._path, self._tokenizer, self._model, self._missing = path, tokenizer, model, missing
        self._lock = threading.Lock()  # transformers tokenizers keep the truncation of a call as state

    @property
    def width(self) -> int:
        """Width D of the hidden states, from the model's config."""
        return int(self._model.config.hidden_size)

    @cached_property
    def hash(self) -> str:
        """sha256 of the weights (`identify_folder`)."""
        return _hash(self._path)

    def encode(self, texts: Sequence[str]) -> TextFeatures:
        """B texts -> TextFeatures of at most LIMITS.max_text_positions tokens. PlaygroundError if one is no string."""
        texts = valid_text(texts)
        ids = self._ids(texts) if texts else []
        words = [[str(word) for word in self._tokenizer.convert_ids_to_tokens(row)] for row in ids]
        with torch.no_grad():
            return self._features(ids, words)

    def _ids(self, texts: list[str]) -> list[list[int]]:
        with self._lock:
            found = self._tokenizer(texts, truncation=True, max_length=LIMITS.max_text_positions, padding=False)
        return [list(row) for row in found["input_ids"]]

    def _features(self, ids: list[list[int]], words: list[list[str]]) -> TextFeatures:
        tokens, mask = run_by_length(ids, self._pad_id(), self.width, self._states), length_mask(ids)
        return TextFeatures(tokens, mask, masked_mean(tokens, mask), words)

    def _pad_id(self) -> int:
        return 0

    def _states(self, ids: Tensor, mask: Tensor) -> Tensor:
        states: Tensor = self._model(input_ids=ids, attention_mask=mask.long()).last_hidden_state
        return states


class T5Encoder(PretrainedEncoder):
    """T5 v1.1's encoder half: last hidden states, the end token included; pooled = mean over the real tokens (E4)."""

    name = "t5"
    optional = frozenset({"encoder.embed_tokens.weight"})  # the same array as shared.weight


class LlamaEncoder(PretrainedEncoder):
    """LLaMA: BOS included, right padding with EOS, last hidden states; pooled = mean over the real tokens (A5)."""

    name = "llama"

    def _pad_id(self) -> int:
        return int(self._tokenizer.eos_token_id)

    def _ids(self, texts: list[str]) -> list[list[int]]:
        bos = int(self._tokenizer.bos_token_id)
        rows = super()._ids(texts)
        return [(row if row[:1] == [bos] else [bos, *row])[: LIMITS.max_text_positions] for row in rows]


class ClipEncoder(PretrainedEncoder):
    """CLIP's text tower: always all positions (77), states after the final LayerNorm and before the projection (A9).

    mask is True up to and including EOT (D2); the states behind it are kept, because A9 attends to all of them without
    a mask. pooled is the projected EOT state, or that state itself where the folder has no projection.
    """

    name = "clip"
    optional = frozenset({"text_projection.weight"})

    def _features(self, ids: list[list[int]], words: list[list[str]]) -> TextFeatures:
        positions = min(LIMITS.max_text_positions, int(self._model.config.max_position_embeddings))
        full = [row + [CLIP_PAD] * (positions - len(row)) for row in ids]
        tokens = run_by_length(full, CLIP_PAD, self.width, self._all_states)
        lengths = torch.tensor([len(row) for row in ids], dtype=torch.long)
        mask = torch.arange(positions) < lengths[:, None]
        pooled = tokens[torch.arange(len(ids)), lengths - 1] if ids else tokens.new_zeros(0, self.width)
        if not self._missing:
            pooled = self._model.text_projection(pooled)
        return TextFeatures(tokens, mask, pooled, words)

    def _all_states(self, ids: Tensor, mask: Tensor) -> Tensor:
        states: Tensor = self._model.text_model(input_ids=ids).last_hidden_state
        return states

    def _ids(self, texts: list[str]) -> list[list[int]]:
        positions = int(self._model.config.max_position_embeddings)
        eot = int(self._tokenizer.eos_token_id)
        rows = [row[:positions] for row in super()._ids(texts)]
        return [[*row[:-1], eot] for row in rows]
