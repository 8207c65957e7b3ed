"""Several trainings one after another: finished ones are skipped, a stopped one is resumed, a time limit is kept."""

import argparse
import os
import sys
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from playground.data.library import Library
from playground.errors import PlaygroundError
from playground.launch import Launch, launched
from playground.training.configs import GeneratorTraining, RefitTraining
from playground.training.family import SIZES
from playground.training.run import Order, Training, part_of, run_training, tokenizer_of
from playground.training.state import read_facts

try:
    import fcntl
except ModuleNotFoundError:  # where files cannot be locked, one queue at a time is up to the user
    fcntl = None  # type: ignore[assignment]

Say = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Job:
    """One training of a queue and the folder that it fills."""

    name: str
    training: Training
    out: Path
    about: dict[str, Any] = field(default_factory=dict)  # facts for its checkpoint

    @property
    def checkpoint(self) -> Path:
        """What it makes."""
        return self.out / part_of(self.training) / "checkpoint.safetensors"

    @property
    def steps(self) -> int:
        """Steps in all."""
        return self.training.schedule.steps

    def facts(self) -> dict[str, Any]:
        """Facts of the saved state; {} before the first one."""
        return read_facts(self.checkpoint.with_name("state.safetensors"))

    @property
    def ready(self) -> bool:
        """Whether it can be begun: a generator needs its tokenizer, a refit both."""
        if isinstance(self.training, GeneratorTraining):
            try:
                return tokenizer_of(self.training, self.out).is_file()
            except PlaygroundError:
                return False
        parts = ("tokenizer", "generator") if isinstance(self.training, RefitTraining) else ()
        return all((self.out / part / "checkpoint.safetensors").is_file() for part in parts)

    @property
    def own(self) -> bool:
        """Whether the run in its folder, if there is one, is of the config that `about` tells."""
        facts = self.facts()
        return not facts or facts.get("config") == self.about.get("config")

    @property
    def done(self) -> bool:
        """Whether its checkpoint is there, has all the steps and is its own."""
        return self.checkpoint.is_file() and self.facts().get("step", 0) >= self.steps and self.own


@dataclass(frozen=True)
class Limits:
    """How far a queue goes this time, and where it computes."""

    library: Path
    launch: Launch = field(default_factory=Launch)
    deadline: float | None = None  # time.monotonic()

    @property
    def passed(self) -> bool:
        """Whether the time is up."""
        return self.deadline is not None and time.monotonic() > self.deadline


def run_queue(jobs: Sequence[Job], limits: Limits, say: Say, after: Callable[[Job], None] | None = None) -> bool:
    """Run every job that is not done, in order; `after` is called for every job, once it is done. True if all are.

    Killed at any point, a second call goes on where the last saved state was. Two calls at the same time share the
    work: a job that another process trains is passed over. False when the time is up or others are still at work.
    """
    waiting = list(jobs)
    while waiting:
        with ExitStack() as held:
            job = next((job for job in waiting if job.done or (job.ready and held.enter_context(alone(job)))), None)
            if job is None:
                say(f"{len(waiting)} of {len(jobs)} are left to other processes; call again when those are through")
                return False
            if not job.done and not _train(job, jobs, limits, say):
                return False
        waiting.remove(job)
        if after is not None:
            after(job)
    return True


def _train(job: Job, jobs: Sequence[Job], limits: Limits, say: Say) -> bool:
    """Train one job to its end; False if the time is up before."""
    if limits.passed:
        return False
    say(f"{jobs.index(job) + 1} of {len(jobs)}: {job.name}, {left(jobs)}")
    order = Order(limits.library, job.out, True, None, limits.launch, None, limits.deadline, job.about)
    facts = run_training(job.training, order)
    if facts["step"] < job.steps:
        say(f"stopped at step {facts['step']} of {job.steps}; call again to go on")
        return False
    return True


@contextmanager
def alone(job: Job) -> Iterator[bool]:
    """Whether this process may train the job; until the block ends no other process may. The system frees a dead one's.

    Processes of one run (torchrun) work on the same job and do not ask.
    """
    if launched() or fcntl is None:
        yield True
        return
    job.checkpoint.parent.mkdir(parents=True, exist_ok=True)
    with open(job.checkpoint.with_name("lock"), "w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
        else:
            yield True


def left(jobs: Sequence[Job]) -> str:
    """How much is left to train, in words: steps, and time where a finished or begun job says how long a step takes."""
    steps, seconds, rates = 0, 0.0, _rates(jobs)
    for job in jobs:
        missing = 0 if job.done else job.steps - (job.facts().get("step", 0) if job.own else 0)
        steps += missing
        rate = rates.get(part_of(job.training))
        seconds = float("nan") if missing and rate is None else seconds + missing * (rate or 0.0)
    if seconds != seconds:
        return f"{steps:,} steps left in all"
    return f"{steps:,} steps left in all, about {_duration(seconds)}"


def _rates(jobs: Sequence[Job]) -> dict[str, float]:
    """Seconds a step, by the part that is trained, over everything trained so far."""
    totals: dict[str, list[float]] = {}
    for job in jobs:
        facts = job.facts()
        if facts.get("step"):
            total = totals.setdefault(part_of(job.training), [0.0, 0.0])
            total[0] += facts["seconds"]
            total[1] += facts["step"]
    return {part: seconds / steps for part, (seconds, steps) in totals.items()}


def _duration(seconds: float) -> str:
    hours, minutes = divmod(round(seconds / 60), 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min"


# ---- what the commands share ----------------------------------------------------------------------------------------


def add_arguments(parser: argparse.ArgumentParser, out: str, sizes: Sequence[str] = SIZES) -> None:
    """The options of a command that runs a queue; --size where there are several."""
    parser.add_argument("--library", type=Path, default=Path("library"), metavar="DIR")
    parser.add_argument("--out", type=Path, default=Path(out), metavar="DIR", help=f"where runs are kept ({out})")
    if len(sizes) > 1:
        parser.add_argument("--size", choices=sizes, default="cpu", help="the size that a CPU or a GPU trains (cpu)")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="these alone")
    parser.add_argument("--minutes", type=float, help="stop after so many minutes, everything saved")
    parser.add_argument("--accelerator", default="auto", choices=("auto", "cpu", "gpu"))
    parser.add_argument("--devices", type=int, help="GPUs or processes to use (default: one; torchrun decides itself)")
    parser.add_argument("--precision", choices=("auto", "bf16-mixed", "16-mixed", "32-true"), default="auto")
    parser.add_argument("--list", action="store_true", help="say how far everything is, and train nothing")


def limits_of(options: argparse.Namespace) -> Limits:
    """From the options. PlaygroundError if the library is none or a number makes no sense."""
    Library.open(options.library)
    if options.minutes is not None and not 0 < options.minutes < float("inf"):
        raise PlaygroundError(f"--minutes is {options.minutes:g}; more than 0 is accepted")
    if options.devices is not None and options.devices < 1:
        raise PlaygroundError(f"--devices is {options.devices}; at least 1 is needed")
    deadline = None if options.minutes is None else time.monotonic() + 60 * options.minutes
    launch = Launch(options.accelerator, options.devices or "auto", precision=options.precision)
    return Limits(options.library, launch, deadline)


def run_command(options: argparse.Namespace, jobs: list[Job], runs: Path) -> int:
    """List or run a queue as the options say; runs: the folder of its systems. Returns the exit status."""

    def run() -> None:
        wanted = chosen(jobs, options.only)
        if options.list:
            say("\n".join(status(wanted)))
        elif run_queue(wanted, limits_of(options), say):
            say(f"all trained; python -m playground.training.ship {runs}/NAME --system NAME")

    return guarded(run)


def chosen(jobs: Sequence[Job], only: Sequence[str]) -> list[Job]:
    """The jobs with the names given, all of them for none. PlaygroundError for an unknown name."""
    known = {job.name for job in jobs}
    unknown = next((name for name in only if name not in known), None)
    if unknown is not None:
        raise PlaygroundError(f"unknown name {unknown[:80]!r}; one of {', '.join(sorted(known))} is accepted")
    return [job for job in jobs if not only or job.name in only]


def status(jobs: Sequence[Job], stored: Collection[str] = ()) -> list[str]:
    """A line a job: done, stored (measured, without a run here), how far, or not begun. stored: names of jobs."""
    lines = []
    for job in jobs:
        step = job.facts().get("step", 0)
        state = f"step {step} of {job.steps}" if step else "not begun"
        state = "done" if job.done else "stored" if job.name in stored else state
        lines.append(f"{job.name:<28} {state if job.own else f'{state}, its folder holds a run of another config'}")
    return [*lines, left([job for job in jobs if job.done or job.name not in stored])]


def say(text: str) -> None:
    """One line on stdout, from the first process alone."""
    if os.environ.get("RANK", "0") == "0":
        sys.stdout.write(text + "\n")
        sys.stdout.flush()


def guarded(run: Callable[[], None]) -> int:
    """Run a command; its exit status: bad input is one line and 2, Ctrl+C 130."""
    try:
        run()
    except PlaygroundError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    except KeyboardInterrupt:
        sys.stderr.write("stopped; what was saved is kept\n")
        return 130
    return 0
