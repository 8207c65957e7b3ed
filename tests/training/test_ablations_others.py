"""The other systems' ablations: a table whose rows differ in one thing, and its queue on models that train at once."""

import json
import shutil
from dataclasses import fields, replace
from pathlib import Path

import pytest

from playground.architectures import build, fitted
from playground.data.batches import BatchConfig
from playground.data.library import Library, LibraryClip, write_library
from playground.generators.hierarchical import HierarchicalConfig
from playground.tokenizers.convolutional import ConvConfig
from playground.training import ablations_others as table
from playground.training import record
from playground.training.configs import GeneratorTraining, Schedule, TokenizerTraining
from tests.conftest import drifting

PLAN = Schedule(steps=2, rate=1e-3, warmup=1, save_every=2, validate_every=1)
BATCH = BatchConfig(size=4, shortest=16, bucket=2)
TOKENIZER = TokenizerTraining(
    ConvConfig(width=8, blocks=1, dropout=0.0, divisors=(1, 1), codes=(6, 6), code_width=8), BATCH, PLAN, text="words",
    synthetic=0.0, language_drop=0.0,
)  # fmt: skip
NETWORK = HierarchicalConfig(
    width=16, depths=(1, 1), heads=(2, 2), hidden=24, dropout=0.0, text_width=1, scales=(49, 49), codes=(6, 6),
    code_width=8,
)  # fmt: skip
GENERATOR = GeneratorTraining(
    NETWORK, "mogo-base-tokenizer", BATCH, PLAN, size=4, variants=1, text="words", synthetic=0.0, lent=True
)


@pytest.fixture
def library(tmp_path: Path) -> Path:
    clips = []
    for n in range(9):
        split = ("train", "train", "test")[n % 3]
        source = ("A", "B", table.HELD_OUT)[n // 3]
        clips.append(LibraryClip(f"c{n}", source, split, "walk", ("walks left",), drifting(40 + 8 * n, n)))
    write_library(tmp_path / "library", clips, "tiny library")
    return tmp_path / "library"


def test_every_row_has_a_training_and_every_training_a_row() -> None:
    found = table.trainings()
    assert {row.name for row in table.ROWS} == set(found)
    assert all((row.split == table.HELD_OUT) == table.held_out(row.name) for row in table.ROWS)
    assert len({(row.table, row.label, row.name) for row in table.ROWS}) == len(table.ROWS)
    names = list(found)
    for name, training in found.items():
        if isinstance(training, GeneratorTraining):
            assert names.index(training.tokenizer.removesuffix("-tokenizer")) < names.index(name)
            assert table.system_of(name) in table.SYSTEMS


@pytest.mark.parametrize("base", [table.MOGO, table.SNAP])
def test_a_tokenizer_differs_from_its_base_in_one_thing_and_can_be_built(base: str) -> None:
    found = table.trainings()
    start = found[base]
    family = [name for name in found if name.startswith(base.split("-")[0] + "-") and not table.held_out(name)]
    for name in family:
        training = found[name]
        if not isinstance(training, TokenizerTraining) or name == "snap-same":
            continue
        assert replace(training, model=start.model) == start, name
        changed = {
            f.name for f in fields(start.model) if getattr(training.model, f.name) != getattr(start.model, f.name)
        }
        allowed = ({"divisors", "codes"}, {"codes"}, {"affine"}, {"decorrelation"}, {"affine", "decorrelation"},
                   {"attention"}, {"divisors"}, set())  # fmt: skip
        assert changed in allowed and (name == base) == (not changed), name
        assert build(fitted(replace(training.model, width=8), code_width=8)) is not None


def test_text_in_front_and_across_differ_in_that_alone() -> None:
    found = table.trainings()
    front, across = found["snap-in-context"], found["snap-cross-middle"]
    assert front.model.variant != across.model.variant and replace(front.model, variant="cross") == across.model
    assert replace(front, model=across.model) == across


def test_a_library_without_a_source(library: Path, tmp_path: Path) -> None:
    whole = Library.open(library)
    left = Library.open(table.library_without(whole, table.HELD_OUT, tmp_path / "left"))
    assert {clip.source for clip in left.clips} == {"A", "B"} and len(left) == 6
    assert (left.joints(4) == whole.joints(4)).all() and left.clips[4].captions == whole.clips[4].captions
    assert (left.normaliser.mean != whole.normaliser.mean).any()  # nothing is learned from the source
    stamp = (tmp_path / "left" / "joints.f32").stat().st_mtime_ns
    table.library_without(whole, table.HELD_OUT, tmp_path / "left")
    assert (tmp_path / "left" / "joints.f32").stat().st_mtime_ns == stamp


def test_the_queue_measures_what_it_has_trained(
    library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    trainings = {
        "mogo-base": TOKENIZER,
        "mogo-uniform": GENERATOR,
        "mogo-heldout": TOKENIZER,
        "snap-base": replace(TOKENIZER, seed=1),
    }
    rows = (
        record.Row("mogo3", "6 levels", "mogo-base"), record.Row("mogo4", "uniform", "mogo-uniform"),
        record.Row("mogo1", "MOGO", "mogo-heldout", table.HELD_OUT), record.Row("snap4", "base", "snap-base"),
    )  # fmt: skip
    monkeypatch.setattr(table, "trainings", lambda: trainings)
    monkeypatch.setattr(table, "ROWS", rows)
    monkeypatch.setattr(record, "evaluator_path", lambda name: tmp_path / "absent")
    where = ["--library", str(library), "--out", str(tmp_path / "runs"), "--results", str(tmp_path / "a.json")]
    where += ["--accelerator", "cpu", "--precision", "32-true"]
    assert table.main([*where, "--only", "mogo-base", "mogo-uniform", "mogo-heldout"]) == 0
    found = json.loads((tmp_path / "a.json").read_text())
    first, drawn, unseen, absent = found["rows"]
    assert [row["status"] for row in found["rows"]] == ["trained"] * 3 + ["not trained yet"]
    assert first["n"] == 3 and [row["kept"] for row in first["levels"]] == [0, 1, 2] and len(first["between"]) == 2
    assert first["mpjpe_mm"] == first["levels"][-1]["mpjpe_mm"] and "evaluator" in first["rfid"]["why"]
    assert [point["step"] for point in drawn["validation"]] == [1, 2] and drawn["parameters"] > 0
    assert unseen["n"] == 3 and unseen["measured_on"] == table.HELD_OUT and "mpjpe_mm" not in absent
    assert "walks" not in (tmp_path / "a.json").read_text()  # no captions of the data
    kept = tmp_path / "runs" / "mogo-base" / "measured.json"
    stamp = kept.stat().st_mtime_ns
    again = table.measure_again(library, tmp_path / "runs")
    assert again["rows"] == found["rows"] and kept.stat().st_mtime_ns == stamp
    assert again["made_by"] == "make ablations-others" and drawn["tokenizer"] == first["checkpoint"]
    assert drawn["sampling"] == vars(table.SYSTEMS["mogo"].sampling) and first["config"] != drawn["config"]
    shutil.rmtree(tmp_path / "runs")  # another machine, where a generator is missing and its tokenizer is stored
    lost = [row | {"status": record.NOT_TRAINED} if row["run"] == "mogo-uniform" else row for row in found["rows"]]
    (tmp_path / "a.json").write_text(json.dumps(found | {"rows": lost}))
    assert table.main([*where, "--only", "mogo-uniform", "mogo-heldout"]) == 0
    later = json.loads((tmp_path / "a.json").read_text())["rows"]
    assert later[1]["tokenizer"] == later[0]["checkpoint"] and later[1]["gfid"] == drawn["gfid"]
    assert later[2] == unseen and not (tmp_path / "runs" / "mogo-heldout").exists()
    assert "mogo-base is stored as measured" in capsys.readouterr().out


def test_bad_calls_are_told(library: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert table.main(["--library", str(tmp_path)]) == 2
    assert table.main(["--library", str(library), "--out", str(tmp_path / "runs"), "--only", "nobody"]) == 2
    assert "unknown name" in capsys.readouterr().err
    assert table.main(["--library", str(library), "--out", str(tmp_path / "runs"), "--list"]) == 0
    assert "steps left in all" in capsys.readouterr().out
