"""The queue, shipping and the table of ablations, on models that train in a second."""

import json
import os
import shutil
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.torch import save_file

from playground.checkpoints import Card, save_checkpoint
from playground.data.batches import BatchConfig
from playground.data.library import Library, LibraryClip, write_library
from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.evaluation.reconstruction import measure_tokenizer
from playground.evaluation.run import reconstruct
from playground.limits import LIMITS
from playground.motion.representation import Normaliser
from playground.systems import checkpoint_path
from playground.text.encoders import identify, load_encoder
from playground.tokenizers.transformer import build_tokenizer
from playground.training import ablations, record, ship, train_family
from playground.training.configs import GeneratorTraining, Schedule, TokenizerTraining
from playground.training.loop import Launch
from playground.training.queue import Job, Limits, alone, chosen, left, run_queue, status
from tests.conftest import drifting
from tests.tiny import TINY, TINY_GENERATOR

PLAN = Schedule(steps=4, rate=1e-3, warmup=2, save_every=2, validate_every=4)
BATCH = BatchConfig(size=4, shortest=16, bucket=2)
MODEL = replace(TINY, max_frames=196, text_table=2048, text_width=1)
TOKENIZER = TokenizerTraining(MODEL, BATCH, PLAN, text="words", synthetic=0.0)
NETWORK = replace(TINY_GENERATOR, lengths=49)
GENERATOR = GeneratorTraining(NETWORK, "x-tokenizer", BATCH, PLAN, size=4, variants=1, text="words", synthetic=0.0)
CPU = Launch(accelerator="cpu", precision="32-true")


@pytest.fixture
def library(tmp_path) -> Path:
    clips = []
    for n in range(8):
        split = ("train", "train", "val", "test")[n % 4]
        clips.append(LibraryClip(f"c{n}", "AB"[n // 4], split, "walk", ("walks left",), drifting(40 + 20 * n, n)))
    write_library(tmp_path / "library", clips, "tiny library")
    return tmp_path / "library"


class Short(Limits):
    """A queue whose time is up one step after it began."""

    @property
    def passed(self) -> bool:
        return False


def jobs(out: Path) -> list[Job]:
    return [
        Job("x-tokenizer", TOKENIZER, out / "x", {"run": "x-tokenizer"}),
        Job("x-generator", GENERATOR, out / "x"),
        Job("y-tokenizer", replace(TOKENIZER, seed=1), out / "y"),
    ]


def test_a_queue_stops_in_time_goes_on_and_does_nothing_twice(library, tmp_path):
    said: list[str] = []
    todo = jobs(tmp_path / "runs")
    assert left(todo) == "12 steps left in all"
    over = Limits(library, CPU, deadline=time.monotonic() - 1)
    assert not run_queue(todo, over, said.append) and not said  # no time at all: nothing is begun
    assert not run_queue(todo[:1], Short(library, CPU, deadline=0.0), said.append) and "call again" in said[-1]
    assert todo[0].facts()["step"] == 1 and not todo[0].done  # one step, saved
    finished: list[str] = []
    assert run_queue(todo, Limits(library, CPU), said.append, lambda job: finished.append(job.name))
    assert finished == ["x-tokenizer", "x-generator", "y-tokenizer"] and all(job.done for job in todo)
    assert "about" in said[-1] and status(todo)[-1].startswith("0 steps left")
    before = [job.checkpoint.stat().st_mtime_ns for job in todo]
    assert run_queue(todo, Limits(library, CPU), said.append)
    assert before == [job.checkpoint.stat().st_mtime_ns for job in todo]
    with safe_open(str(todo[0].checkpoint), framework="pt") as file:
        facts = json.loads(file.metadata()["facts"])
    assert facts["run"] == "x-tokenizer" and (facts["step"], facts["steps"], facts["device"]) == (4, 4, "CPU")


def test_a_stopped_run_has_the_weights_of_one_that_never_stopped(library, tmp_path):
    whole, parts = jobs(tmp_path / "whole")[:1], jobs(tmp_path / "parts")[:1]
    assert run_queue(whole, Limits(library, CPU), lambda text: None)
    for step in range(1, 4):
        assert not run_queue(parts, Short(library, CPU, deadline=0.0), lambda text: None)
        assert parts[0].facts()["step"] == step
    assert run_queue(parts, Limits(library, CPU), lambda text: None)
    with (
        safe_open(str(whole[0].checkpoint), framework="pt") as one,
        safe_open(str(parts[0].checkpoint), framework="pt") as other,
    ):
        for name in one.keys():  # noqa: SIM118
            assert (one.get_tensor(name) == other.get_tensor(name)).all(), name


def test_two_queues_share_the_work(library, tmp_path):
    todo, said = jobs(tmp_path / "runs"), []
    with alone(todo[0]) as mine:
        assert mine
        with alone(todo[0]) as again:
            assert not again
        assert not run_queue(todo, Limits(library, CPU), said.append)  # y alone: x is taken, its generator must wait
        assert [job.done for job in todo] == [False, False, True] and "2 of 3 are left" in said[-1]
    assert run_queue(todo, Limits(library, CPU), said.append)


def test_unknown_names_are_refused_and_the_family_is_listed(tmp_path, capsys):
    with pytest.raises(PlaygroundError, match="unknown name 'z'"):
        chosen(jobs(tmp_path), ["z"])
    assert train_family.main(["--list", "--out", str(tmp_path), "--only", "lgtok-rvq-tokenizer"]) == 0
    assert "lgtok-rvq-tokenizer          not begun" in capsys.readouterr().out
    assert train_family.main(["--library", str(tmp_path)]) == 2
    assert train_family.main(["--only", "nothing"]) == 2
    assert ablations.main(["--library", str(tmp_path)]) == 2
    assert "not a motion library" in capsys.readouterr().err


# ---- shipping -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    """A finished tokenizer of MiniLM text, without training."""
    folder = tmp_path_factory.mktemp("run")
    model = build_tokenizer(replace(TINY, max_frames=196, text_width=384))
    for book in model.quantizer.codebooks:
        book.vectors.normal_()
    normaliser = Normaliser(np.zeros(67, np.float32), np.ones(67, np.float32))
    card = Card("tokenizer", model.config, identify(load_encoder()), "nothing", {"step": 4}, normaliser)
    save_checkpoint(folder / "tokenizer" / "checkpoint.safetensors", model, card)
    return folder


def test_shipping_copies_whole_files_and_removes_a_generator_of_other_tokens(run, tmp_path):
    old = checkpoint_path(tmp_path, "lgtok-mini", "generator")
    old.parent.mkdir(parents=True)
    old.write_bytes(b"tokens of another tokenizer")
    notes = ship.ship(run, "lgtok-mini", tmp_path)
    shipped = checkpoint_path(tmp_path, "lgtok-mini", "tokenizer")
    assert shipped.read_bytes() == (run / "tokenizer" / "checkpoint.safetensors").read_bytes()
    assert not old.exists() and "removed" in notes[1] and not list(tmp_path.rglob("*.partial"))
    info = next(info for info in Engine(tmp_path).systems() if info.name == "lgtok-mini")
    assert (info.checkpoint, info.generator, info.data) == ("shipped", None, "nothing")


def changed(path: Path, **dtypes) -> None:
    """Rewrite a checkpoint with other numbers in its first weight."""
    with safe_open(str(path), framework="pt") as file:
        metadata, tensors = file.metadata(), {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    name = "model.latent_tokens"
    tensors[name] = dtypes["change"](tensors[name])
    save_file(tensors, path, metadata)


@pytest.mark.parametrize(
    ("change", "words"),
    [(lambda w: w.float(), "is shipped is float16"), (lambda w: w / 0, "not finite")],
    ids=["float32", "infinite"],
)
def test_what_cannot_be_shipped_is_refused(run, tmp_path, change, words):
    target = tmp_path / "run" / "tokenizer" / "checkpoint.safetensors"
    target.parent.mkdir(parents=True)
    target.write_bytes((run / "tokenizer" / "checkpoint.safetensors").read_bytes())
    changed(target, change=change)
    with pytest.raises(PlaygroundError, match=words):
        ship.ship(tmp_path / "run", "lgtok", tmp_path / "assets")
    assert not (tmp_path / "assets").exists()


def test_sizes_and_names_are_checked_before_anything_is_written(run, tmp_path, monkeypatch):
    with pytest.raises(PlaygroundError, match="unknown system"):
        ship.ship(run, "nobody", tmp_path)
    with pytest.raises(PlaygroundError, match="is absent"):
        ship.ship(tmp_path / "nowhere", "lgtok", tmp_path)
    size = (run / "tokenizer" / "checkpoint.safetensors").stat().st_size
    monkeypatch.setattr(ship, "LIMITS", replace(LIMITS, max_system_bytes=size - 1))
    with pytest.raises(PlaygroundError, match="a system may have"):
        ship.ship(run, "lgtok", tmp_path)
    (tmp_path / "other").write_bytes(b"12345")
    monkeypatch.setattr(ship, "LIMITS", replace(LIMITS, max_asset_bytes=size + 4))
    assert ship.main([str(run), "--system", "lgtok", "--assets", str(tmp_path)]) == 2
    assert [path.name for path in tmp_path.rglob("*")] == ["other"]
    monkeypatch.setattr(ship, "LIMITS", replace(LIMITS, max_asset_bytes=size + 5))
    assert ship.main([str(run), "--system", "lgtok", "--assets", str(tmp_path)]) == 0


# ---- ablations ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", ["cpu", "gpu"])
def test_every_ablation_differs_from_the_base_in_one_thing_and_can_be_built(size):
    table, start = ablations.ablations(size), ablations.base(size)
    assert start.schedule.steps >= 3_000
    names = {row.name for row in ablations.ROWS if not row.name.startswith("contrastive")}
    assert names == set(table)
    for name, row in table.items():
        assert (row.schedule, row.batch, row.seed, row.clips) == (start.schedule, start.batch, start.seed, start.clips)
        changes = [
            key
            for key in start.model.__dict__
            if getattr(row.model, key) != getattr(start.model, key) and not key.endswith("mixing_out")
        ]
        assert len(changes) <= 2 and (name == "base") == (row == start), name
        small = replace(row.model, width=16, heads=2, hidden=24, code_width=12)
        assert build_tokenizer(small) is not None
    assert {job.name for job in ablations.ablation_jobs(Path("x"), size)} == {row.name for row in ablations.ROWS}


def test_results_say_what_is_trained_and_what_is_not(library, tmp_path, monkeypatch):
    table = {"base": TOKENIZER, "gelu": replace(TOKENIZER, model=replace(MODEL, feed="gelu"))}
    rows = (record.Row("4b", "SwiGLU", "base"), record.Row("4b", "GELU", "gelu"), record.Row("4c", "skips", "base"))
    monkeypatch.setattr(ablations, "ROWS", rows)
    monkeypatch.setattr(ablations, "BATCHES", ())
    monkeypatch.setattr(ablations, "ablations", lambda size: table)
    monkeypatch.setattr(record, "evaluator_path", lambda name: tmp_path / "absent")
    where = ["--library", str(library), "--out", str(tmp_path / "runs"), "--results", str(tmp_path / "r" / "a.json")]
    where += ["--accelerator", "cpu", "--precision", "32-true"]
    assert ablations.main([*where, "--only", "base"]) == 0
    found = json.loads((tmp_path / "r" / "a.json").read_text())
    assert [row["status"] for row in found["rows"]] == ["trained", "not trained yet", "trained"]
    first = found["rows"][0]
    assert (
        first["n"] == 2 and first["step"] == 4 and first["fid"]["mean"] is None and "evaluator" in first["fid"]["why"]
    )
    assert first["mpjpe_mm"] > 0 and first["n_long"] == 1 and first["by_source"].keys() == {"A", "B"}
    assert "walks" not in (tmp_path / "r" / "a.json").read_text()  # no captions of the data
    kept = tmp_path / "runs" / "cpu" / "base" / "measured.json"
    os.utime(kept, (1, 1))
    assert ablations.main(where) == 0
    found = json.loads((tmp_path / "r" / "a.json").read_text())
    assert [row["status"] for row in found["rows"]] == ["trained"] * 3 and kept.stat().st_mtime == 1  # not again
    assert found["provenance"]["data"] == "tiny library" and found["made_by"] == "make ablations"
    shutil.rmtree(tmp_path / "runs")  # another machine
    assert ablations.main(where) == 0
    assert json.loads((tmp_path / "r" / "a.json").read_text()) == found and not (tmp_path / "runs").exists()


def test_measured_errors_are_those_of_evaluate(library, tmp_path):
    from playground.evaluation.reconstruction import open_tokenizer

    (job,) = jobs(tmp_path)[:1]
    assert run_queue([job], Limits(library, CPU), lambda text: None)
    opened = Library.open(library)
    found = measure_tokenizer(job.checkpoint, "x", opened, "test", evaluator=None)
    plain = reconstruct(open_tokenizer(job.checkpoint, "x"), opened, "test", 0)
    assert {key: found[key] for key in plain} == plain
    assert found["mpjpe_mm_long"] == pytest.approx(plain["by_source"]["B"]["mpjpe_mm"], rel=1e-4)  # the longer clip
    assert found["n_long"] == 1
    errors, frames = ([float(word) for word in found["by_clip"][key].split()] for key in ("mm", "frames"))
    assert sum(e * f for e, f in zip(errors, frames, strict=True)) / sum(frames) == pytest.approx(
        plain["mpjpe_mm"], rel=1e-3
    )
