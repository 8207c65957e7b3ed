"""Self-describing checkpoints: one safetensors file holds half-precision weights, and its metadata says the rest.

Metadata: format, kind (tokenizer | generator | evaluator), architecture (a row of architectures.py; absent in old files
and of evaluators), config, scales (of a tokenizer: tokens a level at full length; absent in old files), encoder (name,
width, hash of the text encoder), data, facts (steps, seconds, seed, validation figures). Loading needs no other file
and runs no pickle.
"""

import hashlib
import json
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from playground.architectures import FIRST, architecture, build, name_of
from playground.errors import PlaygroundError
from playground.motion.representation import Normaliser
from playground.nn.linear import pack
from playground.text.features import EncoderId

Model = TypeVar("Model", bound=nn.Module)
FORMAT = "1"
TRAINING_ONLY = ("sums", "counts", "started")  # state of the EMA codebooks, not shipped


@dataclass(frozen=True, eq=False)
class Card:
    """What a checkpoint says of itself."""

    kind: str  # tokenizer | generator | evaluator
    config: Any  # of the architecture, or an EvaluatorConfig
    encoder: EncoderId
    data: str  # name of the library it saw
    facts: dict[str, Any]  # step, seconds, seed, last validation figures
    normaliser: Normaliser | None = None  # of the features that are read or, without a tokenizer, made
    hash: str = ""  # sha256 of the file, filled by loading


def save_checkpoint(path: Path, model: nn.Module, card: Card, dtype: torch.dtype = torch.float16) -> None:
    """Write weights in `dtype` and the card, whole or not at all."""
    tensors: dict[str, Tensor] = {
        f"model.{name}": value.detach().cpu().to(dtype).contiguous()
        for name, value in model.state_dict().items()
        if name.rsplit(".", 1)[-1] not in TRAINING_ONLY
    }
    if card.normaliser is not None:
        tensors["normaliser.mean"] = torch.from_numpy(card.normaliser.mean.copy())
        tensors["normaliser.std"] = torch.from_numpy(card.normaliser.std.copy())
    facts = {key: value for key, value in card.facts.items() if key != "validation"}
    facts["validation"] = card.facts.get("validation", [])[-1:]
    metadata = {
        "format": FORMAT,
        "kind": card.kind,
        "config": json.dumps(asdict(card.config)),
        "encoder": json.dumps(asdict(card.encoder)),
        "data": card.data,
        "facts": json.dumps(facts),
    }
    if card.kind in FIRST:
        metadata["architecture"] = name_of(card.config)
    if card.kind == "tokenizer":  # for readers that know no config class
        metadata["scales"] = json.dumps(card.config.scales)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    save_file(tensors, partial, metadata)
    os.replace(partial, path)


def read_card(path: Path) -> Card:
    """The card of a checkpoint without its weights. PlaygroundError if the file is not one."""
    return _read(path)[0]


def load_tokenizer(path: Path) -> tuple[Any, Card]:
    """A tokenizer in evaluation mode, float32, with its card. PlaygroundError if the file is not one."""
    return _load(path, "tokenizer")


def load_generator(path: Path) -> tuple[Any, Card]:
    """The network of a generator in evaluation mode, float32, with its card. PlaygroundError if the file is not one."""
    return _load(path, "generator")


def _load(path: Path, kind: str) -> tuple[Any, Card]:
    card, tensors = _read(path, kind, weights=True)
    return _fill(_built(path, build, card), tensors, path), card


def load_model(path: Path, kind: str, config: type, build: Callable[[Any], Model]) -> tuple[Model, Card]:
    """A model of a kind from a floor above: the class of its config, and what builds it. Errors as above."""
    card, tensors = _read(path, kind, weights=True, config=config)
    return _fill(_built(path, build, card), tensors, path), card


def _built(path: Path, build: Callable[[Any], Model], card: Card) -> Model:
    try:
        return build(card.config)
    except (TypeError, ValueError, RuntimeError) as error:
        raise PlaygroundError(f"{path} asks for a model that this version cannot build") from error


def _fill(model: Model, tensors: dict[str, Tensor], path: Path) -> Model:
    weights = {name[6:]: value.float() for name, value in tensors.items() if name.startswith("model.")}
    try:
        missing, unexpected = model.load_state_dict(weights, strict=False)
    except RuntimeError:  # other shapes
        missing, unexpected = [], list(weights)
    if unexpected or any(name.rsplit(".", 1)[-1] not in TRAINING_ONLY for name in missing):
        raise PlaygroundError(f"the weights in {path} do not fit their own config; the file is damaged or too new")
    model.eval().requires_grad_(False)
    pack(model)
    return model


def _read(
    path: Path, kind: str | None = None, weights: bool = False, config: type | None = None
) -> tuple[Card, dict[str, Tensor]]:
    try:
        with safe_open(str(path), framework="pt") as file:
            metadata = file.metadata() or {}
            if metadata["format"] != FORMAT:
                raise PlaygroundError(f"{path} has checkpoint format {metadata['format']}, this version reads {FORMAT}")
            names = [name for name in file.keys() if weights or name.startswith("normaliser.")]  # noqa: SIM118
            tensors = {name: file.get_tensor(name) for name in names}
        if kind is not None and metadata["kind"] != kind:
            raise PlaygroundError(f"{path} is no {kind} checkpoint but one of kind {metadata['kind']}")
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        card = _card(metadata, tensors, digest, config or _config_of(metadata))
    except (OSError, SafetensorError, KeyError, TypeError, ValueError) as error:
        if isinstance(error, PlaygroundError):
            raise
        raise PlaygroundError(
            f"{path} is not a checkpoint of the playground (a .safetensors file with a card)"
        ) from error
    return card, tensors


def _config_of(metadata: dict[str, str]) -> type:
    """The config class of a tokenizer's or a generator's file. KeyError for another kind."""
    kind = metadata["kind"]
    return architecture(metadata.get("architecture", FIRST[kind]), kind).config


def _card(metadata: dict[str, str], tensors: dict[str, Tensor], digest: str, config_type: type) -> Card:
    raw = json.loads(metadata["config"])
    known = {field.name for field in fields(config_type)}
    config = config_type(**{k: tuple(v) if isinstance(v, list) else v for k, v in raw.items() if k in known})
    normaliser = None
    if "normaliser.mean" in tensors:
        normaliser = Normaliser(tensors["normaliser.mean"].numpy(), tensors["normaliser.std"].numpy())
    encoder = EncoderId(**json.loads(metadata["encoder"]))
    facts = json.loads(metadata["facts"])
    return Card(metadata["kind"], config, encoder, metadata["data"], facts, normaliser, digest)
