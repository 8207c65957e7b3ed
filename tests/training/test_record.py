"""The stored result as the record of a queue: rows outlive their runs, as long as they are of the same numbers."""

import json
import os
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from safetensors.torch import save_file

from playground.analysis.results import RESULTS
from playground.data.library import LibraryClip, write_library
from playground.errors import PlaygroundError
from playground.training import ablations, ablations_others, record
from playground.training.configs import GeneratorTraining, TokenizerTraining
from playground.training.queue import Job, Limits
from playground.training.record import Record, Row, Table, ablation_job, config_hash, finished, judge
from playground.training.run import Training
from tests.conftest import drifting
from tests.training.test_queue import GENERATOR, TOKENIZER

DRAWS = replace(GENERATOR, tokenizer="base-tokenizer", lent=True)
TRAININGS: dict[str, Training] = {
    "base": TOKENIZER, "other": replace(TOKENIZER, seed=1), "draws": DRAWS, "draws-more": replace(DRAWS, seed=1)
}  # fmt: skip
ROWS = (Row("1", "base", "base"), Row("1", "other", "other"), Row("2", "the same", "base"),
        Row("3", "drawn", "draws"), Row("3", "drawn more", "draws-more"))  # fmt: skip
OLD, NEW = 1_000_000_000, 2_000_000_000  # seconds
SYSTEM = "a test"


class Machine:
    """A machine with folders of its own, where training takes no time."""

    def __init__(self, library: Path, stored: Path, runs: Path, when: int = OLD) -> None:
        self.library, self.stored, self.runs, self.when = library, stored, runs, when
        self.trained: list[str] = []

    def table(self, trainings: dict[str, Training], **about: Any) -> Table:
        """The table as it is on this machine."""
        jobs = tuple(ablation_job(name, trainings, self.runs) for name in trainings)
        facts = {"system": SYSTEM, "split": "test", "seed": 0, "steps": 4} | about
        return Table("a", "make a", ROWS, jobs, facts, lambda job, *_: {"score": self.when, "checkpoint": job.name})

    def finish(self, job: Job) -> None:
        """What a run leaves."""
        job.checkpoint.parent.mkdir(parents=True, exist_ok=True)
        facts = {"step": job.steps, "seconds": 2.4} | job.about
        save_file({"x": torch.zeros(1)}, job.checkpoint.with_name("state.safetensors"), {"facts": json.dumps(facts)})
        job.checkpoint.write_bytes(b"weights")
        os.utime(job.checkpoint, (self.when, self.when))

    def train(self, jobs: Sequence[Job], limits: Limits, after: record.After) -> bool:
        """In the place of run_queue."""
        for job in jobs:
            if not job.done:
                assert job.ready
                self.finish(job)
                self.trained.append(job.name)
            after(job)
        return True

    def queue(self, *only: str, trainings: dict[str, Training] = TRAININGS, **about: Any) -> list[dict[str, Any]]:
        """Run the queue; the rows that are stored afterwards."""
        options = SimpleNamespace(library=self.library, only=only, list=False, results=self.stored, minutes=None,
                                  devices=None, accelerator="cpu", precision="32-true")  # fmt: skip
        assert record.run_table(options, self.table(trainings, **about), self.train) == 0  # type: ignore[arg-type]
        rows: list[dict[str, Any]] = json.loads(self.stored.read_text())["rows"]
        return rows

    def listed(self, trainings: dict[str, Training] = TRAININGS) -> int:
        """`--list`."""
        options = SimpleNamespace(library=self.library, only=[], list=True, results=self.stored)
        return record.run_table(options, self.table(trainings))  # type: ignore[arg-type]


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Machine:
    """One with a library and nothing trained."""
    monkeypatch.setattr(record, "evaluator_path", lambda name: tmp_path / "absent")
    clips = [LibraryClip("c0", "A", "test", "walk", ("walks left",), drifting(40, 0))]
    write_library(tmp_path / "library", clips, "tiny library")
    return Machine(tmp_path / "library", tmp_path / "a.json", tmp_path / "runs")


def states(rows: Sequence[dict[str, Any]]) -> list[bool]:
    return [row["status"] == "trained" for row in rows]


def moved(machine: Machine, when: int = NEW) -> Machine:
    """The same stored file on another machine."""
    shutil.rmtree(machine.runs, ignore_errors=True)
    return Machine(machine.library, machine.stored, machine.runs, when)


def test_stored_rows_survive_without_runs_and_count_as_done(
    machine: Machine, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = machine.queue()
    assert machine.trained == list(TRAININGS) and all(states(rows))
    first = rows[0]
    assert (first["step"], first["seconds"], first["finished"]) == (4, 2, "2001-09-09T01:46:40Z")
    assert first["config"] == config_hash(TOKENIZER) and first["score"] == OLD and first["measured_on"] == "test"
    other = moved(machine)
    assert other.queue() == rows and not other.trained  # everything is stored: nothing is trained
    capsys.readouterr()
    assert other.listed() == 0
    told = capsys.readouterr().out
    assert told.count(" stored\n") == 4 and "0 steps left in all" in told
    shutil.rmtree(machine.library)
    assert other.listed() == 0 and capsys.readouterr().out == told  # a list needs no library
    again = Record(other.table(TRAININGS), None, None).results()
    assert not any(states(again["rows"]))  # measured again from the runs alone, and there are none


def test_what_is_missing_is_trained_beside_what_is_stored(machine: Machine) -> None:
    machine.queue("base")
    other = moved(machine)
    rows = other.queue("other")
    assert other.trained == ["other"] and states(rows) == [True, True, True, False, False]
    assert [row.get("score") for row in rows] == [OLD, NEW, OLD, None, None]


def test_a_changed_training_gives_up_its_row_and_those_drawn_from_it(
    machine: Machine, capsys: pytest.CaptureFixture[str]
) -> None:
    machine.queue()
    changed = TRAININGS | {"base": replace(TOKENIZER, commitment=0.5)}
    other = moved(machine)
    rows = other.queue("other", trainings=changed)
    assert not other.trained and states(rows) == [False, True, False, False, False]
    assert "trainings have changed: base, draws, draws-more" in capsys.readouterr().out
    assert rows[0] == Row("1", "base", "base").head | {"status": "not trained yet"}


@pytest.mark.parametrize("about", [{"seed": 1}, {"repeats": 5}, {"split": "val"}])
def test_rows_of_another_provenance_are_given_up(
    machine: Machine, about: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    machine.queue()
    other = moved(machine)
    rows = other.queue("other", **about)
    assert other.trained == ["other"] and states(rows) == [False, True, False, False, False]
    assert f"another {next(iter(about))}: base, draws, draws-more, other" in capsys.readouterr().out


def test_another_library_is_another_provenance(machine: Machine, tmp_path: Path) -> None:
    machine.queue()
    clips = [LibraryClip("c0", "A", "test", "walk", ("walks left",), drifting(40, 0))]
    write_library(tmp_path / "library 2", clips, "another library")
    other = Machine(tmp_path / "library 2", machine.stored, tmp_path / "runs 2")
    other.queue("other")
    assert other.trained == ["other"]


def test_a_generator_that_is_missing_brings_its_tokenizer_along(
    machine: Machine, capsys: pytest.CaptureFixture[str]
) -> None:
    machine.queue("base", "other", "draws")
    other = moved(machine)
    capsys.readouterr()
    rows = other.queue()
    assert other.trained == ["base", "draws-more"]
    said = capsys.readouterr().out
    assert "base is stored as measured, but its checkpoint is not on this machine: it is trained again" in said
    assert "for draws-more to draw from" in said
    assert [row["score"] for row in rows] == [NEW, OLD, NEW, OLD, NEW]  # the newer run of the tokenizer is told
    third = moved(machine)
    third.stored.unlink()
    third.queue("draws")
    assert third.trained == ["base", "draws"] and "base is trained first" in capsys.readouterr().out


def test_the_newer_one_of_a_run_and_a_stored_row_is_told(machine: Machine, tmp_path: Path) -> None:
    machine.queue()
    newer = Machine(machine.library, machine.stored, tmp_path / "elsewhere", NEW)
    newer.finish(newer.table(TRAININGS).jobs[0])
    assert [row["score"] for row in newer.queue()] == [NEW, OLD, NEW, OLD, OLD] and not newer.trained
    rows = machine.queue()  # whose run of base is the older one now
    assert [row["score"] for row in rows] == [NEW, OLD, NEW, OLD, OLD] and machine.trained == list(TRAININGS)


def test_a_run_of_another_config_is_neither_told_nor_gone_on_with(
    machine: Machine, capsys: pytest.CaptureFixture[str]
) -> None:
    machine.queue()
    changed = TRAININGS | {"other": replace(TOKENIZER, seed=2)}
    options = SimpleNamespace(library=machine.library, only=["other"], list=False, results=machine.stored,
                              minutes=None, devices=None, accelerator="cpu", precision="32-true")  # fmt: skip
    table = machine.table(changed)
    assert finished(table.jobs[0]) and not finished(table.jobs[1])
    assert record.run_table(options, table, machine.train) == 2  # type: ignore[arg-type]
    assert "another config than other has now" in capsys.readouterr().err
    assert machine.listed(changed) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[2].split(maxsplit=1) == ["other", "step 4 of 4, its folder holds a run of another config"]
    assert told[-1].startswith("4 steps left in all")
    rows = Record(table, record.Library.open(machine.library), None, machine.stored).results()["rows"]
    assert states(rows) == [True, False, True, True, True]


def test_a_broken_file_is_told_and_left_as_it_is(machine: Machine, capsys: pytest.CaptureFixture[str]) -> None:
    for text in ("<<<<<<< ours", '{"item": "b", "rows": [], "provenance": {}}', '{"item": "a", "rows": [{}]}'):
        machine.stored.write_text(text)
        with pytest.raises(PlaygroundError, match="no stored result of a"):
            Record(machine.table(TRAININGS), None, None, machine.stored).kept()
        assert machine.listed() == 2 and machine.stored.read_text() == text
        assert "mend it" in capsys.readouterr().err


def test_a_hash_changes_with_every_number_and_with_the_tokenizer_of_a_generator() -> None:
    hashes = {
        config_hash(TOKENIZER), config_hash(replace(TOKENIZER, seed=1)), config_hash(DRAWS),
        config_hash(replace(TOKENIZER, model=replace(TOKENIZER.model, depth=1))),
        config_hash(replace(TOKENIZER, schedule=replace(TOKENIZER.schedule, rate=2e-3))),
        config_hash(DRAWS, TOKENIZER), config_hash(DRAWS, replace(TOKENIZER, seed=1)),
        config_hash(replace(TOKENIZER, model=replace(TOKENIZER.model, seam=8))),
    }  # fmt: skip
    assert len(hashes) == 8 and all(len(one) == 12 for one in hashes)
    assert isinstance(TRAININGS["base"], TokenizerTraining) and isinstance(TRAININGS["draws"], GeneratorTraining)
    jobs = {name: ablation_job(name, TRAININGS, Path("x"), {"size": "cpu"}) for name in TRAININGS}
    assert jobs["draws"].about["config"] == config_hash(DRAWS, TOKENIZER) and jobs["draws"].about["size"] == "cpu"


@pytest.mark.parametrize("table", [ablations.table_of(Path("x"), "cpu"), ablations_others.table_of(Path("x"))])
def test_every_shipped_row_still_holds(table: Table) -> None:
    shipped = Record(table, None, judge(), RESULTS / f"{table.item}.json")
    assert shipped.notes() == [] and len(shipped.kept()) > 1
