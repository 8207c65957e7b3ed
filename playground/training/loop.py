"""The one training loop, on Lightning Fabric: CPU, one GPU or several machines, resumable at any saved step."""

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import torch
from lightning.fabric import Fabric
from lightning.fabric.loggers import TensorBoardLogger
from torch import Tensor, nn
from tqdm import tqdm

from playground.errors import PlaygroundError
from playground.launch import Launch, launch_fabric
from playground.training.configs import Schedule, rate_at
from playground.training.state import load_state, save_state


class Task(Protocol):
    """What is trained: a model, its loss on the batch of a step, its validation figures, its shipped form."""

    @property
    def model(self) -> nn.Module:
        """The trained module; calling it runs one pass."""
        ...

    def loss(self, model: nn.Module, step: int, rank: int, world: int) -> tuple[Tensor, dict[str, float]]:
        """Loss of this process's slice of the batch of `step`, and figures to show."""
        ...

    def validate(self) -> dict[str, float]:
        """Figures on the validation split, in evaluation mode."""
        ...

    def export(self, path: Path, facts: dict[str, Any]) -> None:
        """Write the self-describing checkpoint."""
        ...


def start_fabric(launch: Launch, out: Path) -> Fabric:
    """A launched Fabric that logs to TensorBoard under `out`."""
    return launch_fabric(launch, [TensorBoardLogger(out, name="tensorboard", version="")])


def fit(
    fabric: Fabric,
    task: Task,
    schedule: Schedule,
    out: Path,
    *,
    seed: int = 0,
    resume: bool = False,
    on_step: Callable[[int, float], None] | None = None,
) -> dict[str, Any]:
    """Train to the last step of the schedule and export; returns the facts of the run (steps, figures, time).

    Saved states stand in `out`/state.safetensors. PlaygroundError if there is one and `resume` is not set.
    """
    # The random state is the run's own, and a part of what is saved; the caller's is given back.
    with torch.random.fork_rng(devices=[fabric.device] if fabric.device.type == "cuda" else []):
        torch.manual_seed(seed + fabric.global_rank)
        return _fit(fabric, task, schedule, out, resume, on_step)


def _fit(
    fabric: Fabric,
    task: Task,
    schedule: Schedule,
    out: Path,
    resume: bool,
    on_step: Callable[[int, float], None] | None,
) -> dict[str, Any]:
    state_path = out / "state.safetensors"
    if state_path.exists() and not resume:
        raise PlaygroundError(f"{out} already holds a run; add --resume to go on with it, or name another folder")
    out.mkdir(parents=True, exist_ok=True)
    optimizer = torch.optim.AdamW(
        task.model.parameters(), lr=schedule.rate, betas=schedule.betas, weight_decay=schedule.weight_decay
    )
    facts: dict[str, Any] = {"step": 0, "seconds": 0.0, "validation": []}
    if state_path.exists():
        facts = load_state(state_path, task.model, optimizer)
    model, wrapped = fabric.setup(task.model, optimizer)
    _run(fabric, task, model, wrapped, schedule, facts, out, on_step)
    if fabric.is_global_zero:
        task.export(out / "checkpoint.safetensors", facts)
        (out / "facts.json").write_text(json.dumps(facts, indent=1) + "\n")
    fabric.barrier()
    return facts


def _run(
    fabric: Fabric,
    task: Task,
    model: Any,
    optimizer: Any,
    schedule: Schedule,
    facts: dict[str, Any],
    out: Path,
    on_step: Callable[[int, float], None] | None,
) -> None:
    bar = tqdm(total=schedule.steps, initial=facts["step"], disable=not fabric.is_global_zero, mininterval=2.0)
    for step in range(facts["step"], schedule.steps):
        began = time.perf_counter()
        for group in optimizer.param_groups:
            group["lr"] = rate_at(step, schedule)
        model.train()
        loss, figures = task.loss(model, step, fabric.global_rank, fabric.world_size)
        optimizer.zero_grad()
        fabric.backward(loss)
        fabric.clip_gradients(model, optimizer, max_norm=schedule.clip, error_if_nonfinite=False)
        optimizer.step()
        facts["step"] = step + 1
        facts["seconds"] += time.perf_counter() - began
        value = float(loss.detach())
        if on_step:
            on_step(step, value)
        bar.set_postfix({"loss": f"{value:.4f}", **{k: f"{v:.3g}" for k, v in figures.items()}}, refresh=False)
        bar.update(1)
        if step % 20 == 0:
            fabric.log_dict({"loss": value, "rate": rate_at(step, schedule), **figures}, step=step)
        last = step + 1 == schedule.steps
        if fabric.is_global_zero and (last or (step + 1) % schedule.validate_every == 0):
            task.model.eval()
            measured = task.validate()
            facts["validation"].append({"step": step + 1, **measured})
            fabric.log_dict(measured, step=step)
            bar.write(f"step {step + 1}: " + ", ".join(f"{k} {v:.4g}" for k, v in measured.items()))
        if fabric.is_global_zero and (last or (step + 1) % schedule.save_every == 0):
            save_state(out / "state.safetensors", task.model, optimizer.optimizer, facts)
    bar.close()
