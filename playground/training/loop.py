"""The one training loop, on Lightning Fabric: CPU, one GPU or several machines, resumable at any saved step."""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
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
from playground.training.state import load_state, random_state, save_state

LOG_EVERY = 20  # steps


class Task(Protocol):
    """What is trained: a model, its loss on the batch of a step, its validation figures, its shipped form."""

    @property
    def model(self) -> nn.Module:
        """The trained module; calling it runs one pass."""
        ...

    def loss(self, model: nn.Module, step: int, rank: int, world: int) -> tuple[Tensor, dict[str, Tensor]]:
        """Loss of this process's slice of the batch of `step`, and figures to show, scalars that nobody waits for."""
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


@dataclass(frozen=True, eq=False)
class Fit:
    """What a run is and how far it goes this time."""

    fabric: Fabric
    task: Task
    schedule: Schedule
    out: Path  # state.safetensors, and at the end checkpoint.safetensors and facts.json
    seed: int = 0
    resume: bool = False
    deadline: float | None = None  # time.monotonic() at which it stops, its state saved; None: never
    about: dict[str, Any] = field(default_factory=dict)  # facts that the checkpoint is to state
    on_step: Callable[[int, float], None] | None = None

    def due(self, step: int) -> bool:
        """Whether the deadline has passed, asked after every step; all processes get the same answer."""
        if self.deadline is None:
            return False
        if self.fabric.world_size > 1:
            if (step + 1) % LOG_EVERY:
                return False
            return bool(self.fabric.broadcast(time.monotonic() > self.deadline))
        return time.monotonic() > self.deadline


def fit(run: Fit) -> dict[str, Any]:
    """Train to the last step of the schedule and export; returns the facts of the run (steps, figures, time).

    A run whose deadline passes first saves its state and exports nothing; `resume` goes on with it.
    PlaygroundError if the folder holds a state and `resume` is not set.
    """
    # The random state is the run's own, and a part of what is saved.
    with seeded(run.seed + run.fabric.global_rank, run.fabric.device):
        return _fit(run)


@contextmanager
def seeded(seed: int, device: torch.device) -> Iterator[None]:
    """Torch draws from `seed` within the block, on the CPU and on `device`; after it the caller's state is back."""
    with torch.random.fork_rng(devices=[device] if device.type == "cuda" else []):
        torch.manual_seed(seed)
        yield


def _fit(run: Fit) -> dict[str, Any]:
    state_path, task, schedule = run.out / "state.safetensors", run.task, run.schedule
    if state_path.exists() and not run.resume:
        raise PlaygroundError(f"{run.out} already holds a run; add --resume to go on with it, or name another folder")
    run.out.mkdir(parents=True, exist_ok=True)
    task.model.to(run.fabric.device)  # before the optimiser's saved moments are put back: they follow the weights
    optimizer = torch.optim.AdamW(
        task.model.parameters(), lr=schedule.rate, betas=schedule.betas, weight_decay=schedule.weight_decay
    )
    facts: dict[str, Any] = {"step": 0, "seconds": 0.0, "validation": []}
    if state_path.exists():
        facts = load_state(state_path, task.model, optimizer, run.fabric.global_rank, run.fabric.device)
        if facts["step"] >= schedule.steps and (run.out / "checkpoint.safetensors").is_file():
            return facts  # nothing to do; written again, the file would have another hash
    facts |= {"steps": schedule.steps, "device": device_name(run.fabric.device)} | run.about
    model, wrapped = run.fabric.setup(task.model, optimizer)
    _steps(run, model, wrapped, facts)
    if run.fabric.is_global_zero and facts["step"] >= schedule.steps:
        task.export(run.out / "checkpoint.safetensors", facts)
        (run.out / "facts.json").write_text(json.dumps(facts, indent=1) + "\n")
    run.fabric.barrier()
    return facts


def device_name(device: torch.device) -> str:
    """What a card calls the device: the name of the GPU, or CPU."""
    return torch.cuda.get_device_name(device) if device.type == "cuda" else device.type.upper()


def _steps(run: Fit, model: Any, optimizer: Any, facts: dict[str, Any]) -> None:
    fabric, schedule, main = run.fabric, run.schedule, run.fabric.is_global_zero
    bar = tqdm(total=schedule.steps, initial=facts["step"], disable=not main, mininterval=2.0)
    model.train()
    for step in range(facts["step"], schedule.steps):
        began = time.perf_counter()
        for group in optimizer.param_groups:
            group["lr"] = rate_at(step, schedule)
        loss, figures = run.task.loss(model, step, fabric.global_rank, fabric.world_size)
        optimizer.zero_grad()
        fabric.backward(loss)
        fabric.clip_gradients(model, optimizer, max_norm=schedule.clip, error_if_nonfinite=False)
        optimizer.step()
        facts["step"] = step + 1
        last = step + 1 == schedule.steps
        if last or step % LOG_EVERY == 0:  # reading a number waits for a GPU, so it is done now and then
            shown = {"loss": float(loss.detach()), **{name: float(value) for name, value in figures.items()}}
            fabric.log_dict({**shown, "rate": rate_at(step, schedule)}, step=step)
            bar.set_postfix({name: f"{value:.4g}" for name, value in shown.items()}, refresh=False)
        facts["seconds"] += time.perf_counter() - began
        if run.on_step:
            run.on_step(step, float(loss.detach()))
        bar.update(1)
        due = run.due(step)
        if main and (last or (step + 1) % schedule.validate_every == 0):
            _validate(run, facts, bar)
            model.train()
        if last or due or (step + 1) % schedule.save_every == 0:
            random = _of_all(fabric)
            if main:
                save_state(run.out / "state.safetensors", run.task.model, optimizer.optimizer, facts, random)
        if due:
            break
    bar.close()


def _of_all(fabric: Fabric) -> dict[str, Tensor]:
    """The random states of all processes, a row each."""
    own = random_state(fabric.device).items()
    return {place: torch.atleast_2d(fabric.all_gather(state).cpu()) for place, state in own}  # type: ignore[union-attr]


def _validate(run: Fit, facts: dict[str, Any], bar: Any) -> None:
    run.task.model.eval()
    measured = run.task.validate()
    facts["validation"].append({"step": facts["step"], **measured})
    run.fabric.log_dict(measured, step=facts["step"] - 1)
    bar.write(f"step {facts['step']}: " + ", ".join(f"{k} {v:.4g}" for k, v in measured.items()))
