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


def random_state(device: torch.device) -> dict[str, Tensor]:
    """What this process draws from next, on the CPU and on a GPU of its own."""
    states = {"cpu": torch.get_rng_state()}
    return states | ({"gpu": torch.cuda.get_rng_state(device)} if device.type == "cuda" else {})


def save_state(
    path: Path,
    model: nn.Module,
    optimizer: torch.optim.Optimizer,
    facts: dict[str, Any],
    random: dict[str, Tensor],
) -> None:
    """Write everything that is needed to go on: `facts` is JSON-able (step, history).

    random: the states of `random_state` of all processes, a row each.
    """
    tensors: dict[str, Tensor] = {f"model.{k}": v for k, v in model.state_dict().items()}
    for index, values in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{index}.{k}": torch.as_tensor(v) for k, v in values.items()}
    tensors |= {f"random.{place}": states for place, states in random.items()}
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


def load_state(
    path: Path, model: nn.Module, optimizer: torch.optim.Optimizer, rank: int, device: torch.device
) -> dict[str, Any]:
    """Put a saved state back, with the random state of the process `rank`; returns its facts.

    With more processes than before the further ones draw as they were seeded. PlaygroundError if the file is broken or
    of another model.
    """
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
    states = {place: torch.atleast_2d(tensors.get(f"random.{place}", torch.empty(0, 0))) for place in ("cpu", "gpu")}
    if rank < len(states["cpu"]):
        torch.set_rng_state(states["cpu"][rank].clone())  # of a row inside a tensor torch reads from the wrong place
    if device.type == "cuda" and rank < len(states["gpu"]):
        torch.cuda.set_rng_state(states["gpu"][rank].clone(), device)
    return facts
