"""The state of a run on disk: weights, optimiser and random state in one safetensors file, written whole or not."""

import json
import os
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from playground.errors import PlaygroundError


def save_state(path: Path, model: nn.Module, optimizer: torch.optim.Optimizer, facts: dict[str, Any]) -> None:
    """Write everything that is needed to go on: `facts` is JSON-able (step, history)."""
    tensors: dict[str, Tensor] = {f"model.{k}": v for k, v in model.state_dict().items()}
    for index, values in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{index}.{k}": torch.as_tensor(v) for k, v in values.items()}
    tensors["random.cpu"] = torch.get_rng_state()
    if torch.cuda.is_available():
        tensors["random.gpu"] = torch.cuda.get_rng_state()
    partial = path.with_suffix(".partial")
    save_file({k: v.detach().cpu().contiguous() for k, v in tensors.items()}, partial, {"facts": json.dumps(facts)})
    os.replace(partial, path)


def read_facts(path: Path) -> dict[str, Any]:
    """The facts of a saved state without its weights; {} where there is none. PlaygroundError if it is broken."""
    if not path.is_file():
        return {}
    try:
        with safe_open(str(path), framework="pt") as file:
            facts: dict[str, Any] = json.loads((file.metadata() or {})["facts"])
        return facts
    except (OSError, SafetensorError, KeyError, ValueError) as error:
        raise PlaygroundError(f"{path} is not a state of a run; delete it or choose another folder") from error


def load_state(path: Path, model: nn.Module, optimizer: torch.optim.Optimizer) -> dict[str, Any]:
    """Put a saved state back; returns its facts. PlaygroundError if the file is broken or of another model."""
    try:
        with safe_open(str(path), framework="pt") as file:
            facts = json.loads((file.metadata() or {})["facts"])
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        model.load_state_dict({k[6:]: v for k, v in tensors.items() if k.startswith("model.")})
        inner: dict[int, dict[str, Tensor]] = {}
        for name, value in tensors.items():
            if name.startswith("optimizer."):
                _, index, key = name.split(".", 2)
                inner.setdefault(int(index), {})[key] = value
        optimizer.load_state_dict({"state": inner, "param_groups": optimizer.state_dict()["param_groups"]})
    except (OSError, SafetensorError, KeyError, ValueError, RuntimeError) as error:
        raise PlaygroundError(f"{path} is not a state of this run; delete it or choose another folder") from error
    torch.set_rng_state(tensors["random.cpu"])
    if torch.cuda.is_available() and "random.gpu" in tensors:
        torch.cuda.set_rng_state(tensors["random.gpu"])
    return facts
