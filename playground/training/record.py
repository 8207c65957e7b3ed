"""What both queues of ablations share: the stored result is the record of what is trained and measured.

A row that is stored as trained stays, and its training counts as done, on whatever machine the queue goes on: as long
as the provenance of the file and the row's training are what they were. A run of this machine that is newer takes its
place. Checkpoints do not travel with the file: a tokenizer is trained again where a generator that is missing draws
from it.
"""

import argparse
import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from playground.analysis.results import NOT_TRAINED, RESULTS
from playground.data.library import Library
from playground.errors import PlaygroundError
from playground.evaluation.evaluators import Evaluator, evaluator_path, load_evaluator
from playground.training.configs import GeneratorTraining
from playground.training.family import SIZES
from playground.training.queue import Job, Limits, add_arguments, chosen, guarded, limits_of, run_queue, say, status
from playground.training.run import Training

CLIPS = 1_000  # of the training list, that most rows learn from
SPLIT, SEED = "test", 0  # of the measurement
LATER: dict[str, Any] = {"seam": 0}  # fields younger than the first stored rows: the value that changes nothing

Facts = dict[str, Any]
After = Callable[[Job], None]
Train = Callable[[Sequence[Job], Limits, After], bool]  # what run_queue does with its answer


@dataclass(frozen=True)
class Row:
    """One row of one table. A training that stands in several tables has one name and is run once."""

    table: str  # of the paper
    label: str  # the row, as a notebook prints it; as the cited table has it, where there is one
    name: str  # of the run
    split: str = SPLIT  # what it is measured on: a split, or a source that is held out

    @property
    def head(self) -> Facts:
        """What it is called in the stored result."""
        return {"table": self.table, "label": self.label, "run": self.name, "measured_on": self.split}


def _nothing(job: Job) -> Facts:
    return {}


@dataclass(frozen=True)
class Table:
    """What a queue fills: rows, the trainings that they name, and how a finished one is measured."""

    item: str  # the stored result, and the module of the queue
    made_by: str
    rows: tuple[Row, ...]
    jobs: tuple[Job, ...]
    about: Facts  # what else determines the figures of all rows; stands in the provenance
    measure: Callable[[Job, Library, Evaluator | None], Facts]
    how: Callable[[Job], Facts] = field(default=_nothing)  # what else determines the figures of one training


def config_hash(training: Training, lender: Training | None = None) -> str:
    """12 digits that change with any number of a training, or of that of the tokenizer which it draws from.

    A field of LATER at the value there is left out, so that rows stored before it came stay what they are.
    """
    told = [[type(one).__name__, _told(asdict(one))] for one in (training, lender) if one is not None]
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:12]


def _told(numbers: Facts) -> Facts:
    """The numbers of a training, and of its model within, without those of LATER that change nothing."""
    kept = {key: _told(value) if isinstance(value, dict) else value for key, value in numbers.items()}
    return {key: value for key, value in kept.items() if key not in LATER or value != LATER[key]}


def ablation_job(name: str, trainings: Mapping[str, Training], out: Path, about: Mapping[str, Any] = {}) -> Job:
    """One training of a table in its folder under `out`; its checkpoint will say of which config it is."""
    training = trainings[name]
    config = config_hash(training, trainings.get(lender_of(training)))
    return Job(name, training, out / name, {"run": f"ablation {name}", "config": config} | dict(about))


def lender_of(training: Training) -> str:
    """The name of the training whose tokens a generator draws; "" for what is none."""
    return training.tokenizer.removesuffix("-tokenizer") if isinstance(training, GeneratorTraining) else ""


@dataclass(frozen=True)
class Record:
    """A table with what is known of its rows: from the stored result, and from the runs of this machine."""

    table: Table
    library: Library | None  # None: what is stored is taken to be of the library that it names
    evaluator: Evaluator | None
    path: Path | None = None  # the stored result; None: the runs of this machine alone

    @property
    def provenance(self) -> Facts:
        """What all rows were trained and measured on."""
        data = {} if self.library is None else {"data": self.library.name}
        return self.table.about | data | {"evaluator": self.evaluator.hash[:12] if self.evaluator else None}

    def kept(self) -> dict[str, Facts]:
        """What the stored rows that still hold say, by run. PlaygroundError if the file is broken."""
        held = self._held()
        if held is None or self._differs(held):
            return {}
        found: dict[str, Facts] = {}
        jobs = {job.name: job for job in self.table.jobs}
        for row in self.table.rows:
            facts = self._settings(jobs[row.name])
            for stored in held["rows"]:
                same = (stored.get("run"), stored.get("measured_on")) == (row.name, row.split)
                if same and all(stored.get(key) == value for key, value in facts.items()) and "finished" in stored:
                    found[row.name] = {key: value for key, value in stored.items() if key not in row.head}
        return found

    def notes(self) -> list[str]:
        """What is to be said of stored rows that do not hold any more."""
        held = self._held()
        trained = {row["run"] for row in held["rows"] if row["status"] != NOT_TRAINED} if held else set()
        lost = sorted(trained - set(self.kept()))
        if held is None or not lost:
            return []
        other = self._differs(held)
        why = f"the file has another {', '.join(other)}" if other else "their trainings have changed"
        return [f"{self.path}: stored rows are given up, {why}: {', '.join(lost)}"]

    def results(self) -> Facts:
        """The stored result: every row of every table with its figures, or with the status "not trained yet"."""
        kept = self.kept()
        bodies = {job.name: self._body(job, kept.get(job.name)) for job in self.table.jobs}
        rows = [row.head | bodies[row.name] for row in self.table.rows]
        head = {"item": self.table.item, "made_by": self.table.made_by, "provenance": self.provenance}
        return head | {"rows": rows}

    def write(self) -> None:
        """Write the stored result, from the first process alone."""
        if self.path is not None and os.environ.get("RANK", "0") == "0":
            write_json(self.path, self.results())

    def to_train(self, wanted: Sequence[Job]) -> list[Job]:
        """The jobs for a queue, in the order of the table: those wanted that are not stored, and what they draw from.

        Jobs that are done here are among them. PlaygroundError if a folder holds a run of another config.
        """
        kept = self.kept()
        names = {job.name for job in wanted if job.name not in kept or finished(job)}
        jobs = {job.name: job for job in self.table.jobs}
        missing = [job for job in wanted if job.name in names and not finished(job)]
        for lender in dict.fromkeys(lender_of(job.training) for job in missing):
            if lender not in jobs or lender in names or finished(jobs[lender]):
                continue
            names.add(lender)
            who = ", ".join(job.name for job in missing if lender_of(job.training) == lender)
            if lender in kept:
                say(f"{lender} is stored as measured, but its checkpoint is not on this machine: it is trained again, "
                    f"for {who} to draw from")  # fmt: skip
            else:
                say(f"{lender} is trained first, for {who} to draw from")
        todo = [job for job in self.table.jobs if job.name in names]
        other = next((job for job in todo if not job.own), None)
        if other is not None:
            raise PlaygroundError(
                f"{other.out} holds a run of another config than {other.name} has now; delete it, or choose another "
                "folder with --out"
            )
        return todo

    def _held(self) -> Facts | None:
        """What the file holds; None without one."""
        if self.path is None or not self.path.is_file():
            return None
        try:
            held: Facts = json.loads(self.path.read_text(encoding="utf-8"))
            if held["item"] != self.table.item or not all(row["run"] and row["status"] for row in held["rows"]):
                raise ValueError("item")
            return held | {"provenance": dict(held["provenance"])}
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise PlaygroundError(
                f"{self.path} is no stored result of {self.table.item}; mend it, or delete it to train everything anew"
            ) from error

    def _differs(self, held: Facts) -> list[str]:
        """The keys of the provenance in which the file is another one."""
        mine, theirs = self.provenance, held["provenance"]
        known = {"data": theirs.get("data")} if self.library is None else {}
        return sorted(key for key in mine | theirs if (mine | known).get(key) != theirs.get(key))

    def _settings(self, job: Job) -> Facts:
        return {"status": "trained", "config": job.about["config"]} | self.table.how(job)

    def _body(self, job: Job, stored: Facts | None) -> Facts:
        """A row without its head: the newer one of the run here and what is stored."""
        here = finished(job)
        if here is None or (stored is not None and stored["finished"] > here):
            return stored or {"status": NOT_TRAINED}
        facts = job.facts()
        trained = self._settings(job) | {"finished": here, "step": facts["step"], "seconds": round(facts["seconds"])}
        return trained | self._measured(job)

    def _measured(self, job: Job) -> Facts:
        """What a finished job measures. Kept beside its checkpoint until that, or what it is measured by, changes."""
        assert self.library is not None
        kept = job.out / "measured.json"
        settings = self.provenance | self._settings(job) | {"changed": job.checkpoint.stat().st_mtime_ns}
        if kept.is_file():
            found: Facts = json.loads(kept.read_text())
            if found["settings"] == settings:
                return dict(found["figures"])
        figures = self.table.measure(job, self.library, self.evaluator)
        write_json(kept, {"settings": settings, "figures": figures})
        return figures


def finished(job: Job) -> str | None:
    """When the run of a job ended on this machine (UTC); None if it has not."""
    if not job.done:
        return None
    return datetime.fromtimestamp(int(job.checkpoint.stat().st_mtime), UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def write_json(path: Path, value: Facts) -> None:
    """Whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    half = path.with_suffix(".partial")
    half.write_text(json.dumps(value, indent=1) + "\n", encoding="utf-8")
    os.replace(half, path)


# ---- what the commands share ----------------------------------------------------------------------------------------


def judge() -> Evaluator | None:
    """The shipped evaluator, where there is one."""
    return load_evaluator("tmr") if evaluator_path("tmr").is_file() else None


def options_of(
    item: str, about: str, out: str, arguments: Sequence[str] | None, sizes: Sequence[str] = SIZES
) -> argparse.Namespace:
    """The options of a queue of ablations."""
    parser = argparse.ArgumentParser(prog=f"python -m playground.training.{item}", description=about)
    add_arguments(parser, out, sizes)
    stored = RESULTS / f"{item}.json"
    parser.add_argument("--results", type=Path, default=stored, metavar="FILE", help="where the figures are written")
    return parser.parse_args(arguments)


def in_order(jobs: Sequence[Job], limits: Limits, after: After) -> bool:
    """Run the jobs one after another on the library of the limits; True if all are done."""
    return run_queue(jobs, limits, say, after)


def run_table(options: argparse.Namespace, table: Table, train: Train = in_order) -> int:
    """List or run the queue of a table as the options say; returns the exit status. train: how jobs are run."""

    def run() -> None:
        wanted = chosen(table.jobs, options.only)
        if options.list:
            library = Library.open(options.library) if (options.library / "library.json").is_file() else None
            record = Record(table, library, judge(), options.results)
            say("\n".join([*record.notes(), *status(wanted, record.kept())]))
            return
        limits, library = limits_of(options), Library.open(options.library)
        record = Record(table, library, judge(), options.results)
        for line in record.notes():
            say(line)
        todo = record.to_train(wanted)
        record.write()
        done = train(todo, limits, lambda job: record.write())
        record.write()
        say(f"{options.results}: {'all rows that were asked for' if done else 'the rows trained so far'}")

    return guarded(run)
