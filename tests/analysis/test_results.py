"""Stored results: what is written is read; numbers, verdicts, quoted tables and packed motions; the files shipped."""

import json
import math
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.analysis.cited import cited
from playground.analysis.motions import packed, unpacked
from playground.analysis.results import (
    RESULTS,
    Estimate,
    Result,
    files_of,
    is_stale,
    read_result,
    result_path,
    verdict,
    why_absent,
    write_result,
)
from playground.errors import PlaygroundError
from playground.motion.skeleton import HUMAN22
from playground.systems import row_of

SYSTEM = "lgtok"
RESULT = Result(
    "evaluation",
    "python -m somewhere",
    {"system": SYSTEM, "checkpoint": "0123456789ab", "generator": "ba9876543210", "data": "tiny", "split": "test",
     "n": 5, "seed": 0, "repeats": 2},
    [{"of": "real", "fid": {"mean": 0.5, "ci95": 0.1, "n": 5}},
     {"of": "generated", "fid": {"mean": None, "ci95": None, "n": 0, "why": "too few"}, "g": 2.0}],
    {"real": {"fid": 1.0}},
)  # fmt: skip


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = write_result(RESULT, tmp_path / "new")
    assert path == result_path("evaluation", SYSTEM, tmp_path / "new") and not list(path.parent.glob("*.partial"))
    assert list(json.loads(path.read_text())) == ["item", "made_by", "provenance", "real", "rows"]
    assert read_result("evaluation", SYSTEM, tmp_path / "new") == RESULT
    assert read_result("evaluation", "lgtok-mid", tmp_path / "new") is None


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{}", "null", '{"item": "evaluation", "made_by": "", "provenance": {}, "rows": []}',
     '{"item": "evaluation", "made_by": "", "provenance": {"system": "lgtok"}, "rows": [1]}',
     '{"item": "other", "made_by": "", "provenance": {"system": "lgtok"}, "rows": []}',
     '{"item": "evaluation", "made_by": "", "provenance": [], "rows": []}'],
)  # fmt: skip
def test_a_broken_file_is_told(tmp_path: Path, text: str) -> None:
    result_path("evaluation", SYSTEM, tmp_path).write_text(text)
    with pytest.raises(PlaygroundError, match="make figures"):
        read_result("evaluation", SYSTEM, tmp_path)


def test_a_number_that_json_does_not_know_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(PlaygroundError, match="not finite"):
        write_result(Result("evaluation", "", {"system": SYSTEM}, [{"fid": math.nan}]), tmp_path)
    assert not list(tmp_path.iterdir())


def test_rows_numbers_and_the_caption() -> None:
    assert RESULT.estimate("fid", of="real") == Estimate(0.5, 0.1)
    assert RESULT.estimate("fid", of="generated") == Estimate(None, None, "too few")
    assert RESULT.estimate("g", of="generated") == Estimate(2.0)
    alone = Result("evaluation", "", RESULT.provenance | {"repeats": 1}, RESULT.rows)
    assert alone.estimate("fid", of="real") == Estimate(0.5) and alone.line.count("1 repeat,") == 1
    assert RESULT.estimate("nothing", of="real").mean is None and RESULT.row(of="nobody") == {}
    assert RESULT.line == f"{SYSTEM}, checkpoint 01234567, 5 test clips of tiny, 2 repeats, seed 0"


@pytest.mark.parametrize("entry", [None, True, "3", math.nan, math.inf, [], {}])
def test_what_is_no_number_is_none(entry: object) -> None:
    assert Estimate.of(entry).mean is None and math.isnan(Estimate.of(entry).low)


def test_absence_and_age_follow_the_files(tmp_path: Path) -> None:
    folder = tmp_path / "checkpoints" / SYSTEM
    folder.mkdir(parents=True)
    assert why_absent(SYSTEM, assets=tmp_path) == "not trained yet"
    (folder / "tokenizer.safetensors").write_bytes(b"one")
    assert why_absent(SYSTEM, assets=tmp_path) == "not trained yet"  # nothing to draw with
    assert why_absent(SYSTEM, draws=False, assets=tmp_path) == "trained, not measured yet"
    (folder / "generator.safetensors").write_bytes(b"two")
    assert why_absent(SYSTEM, assets=tmp_path) == "trained, not measured yet"
    assert why_absent("lgtok-rvq", assets=tmp_path) == "has no generator"
    fresh = Result("evaluation", "", {"system": SYSTEM} | files_of(SYSTEM, tmp_path), [])
    assert not is_stale(fresh, tmp_path)
    (folder / "generator.safetensors").write_bytes(b"three")
    assert is_stale(fresh, tmp_path)


def test_age_follows_the_evaluators_and_the_usual_sampling(tmp_path: Path) -> None:
    usual = asdict(row_of(SYSTEM).sampling)
    made = {"system": SYSTEM, "sampling": usual, "evaluators": {"tmr": "0" * 12}} | files_of(SYSTEM, tmp_path)
    assert not is_stale(Result("evaluation", "", made, []), tmp_path, {"tmr": "0" * 12, "clip": "1" * 12})
    assert is_stale(Result("evaluation", "", made, []), tmp_path, {"tmr": "2" * 12})
    assert is_stale(Result("evaluation", "", made, []), tmp_path)  # the shipped one is another
    some = {key: value for key, value in usual.items() if key != "guidance"}
    for sampling, stale in ((some, False), (usual | {"guidance": 9.0}, True)):
        result = Result("evaluation", "", made | {"sampling": sampling, "evaluators": {}}, [])
        assert is_stale(result, tmp_path) is stale


numbers = st.floats(-1e6, 1e6)
halves = st.one_of(st.none(), st.floats(0, 1e3))


@given(numbers, numbers, halves, halves, st.booleans())
def test_a_verdict_says_what_the_intervals_say(
    a: float, b: float, da: float | None, db: float | None, lower: bool
) -> None:
    said = verdict(Estimate(a, da), Estimate(b, db), lower=lower)
    overlap = max(a - (da or 0), b - (db or 0)) <= min(a + (da or 0), b + (db or 0))
    better = a < b if lower else a > b
    if a == b:
        assert said == "not seen: both are equal"
    elif overlap:
        assert said.startswith("undecided") and said.endswith("as the paper has it" if better else "way round")
    else:
        assert said.startswith("seen" if better else "not seen: it is the other way round")
        assert ("intervals are apart" in said) == (da is not None and db is not None)


def test_a_verdict_on_a_missing_number_says_why() -> None:
    assert verdict(Estimate(None, why="too few"), Estimate(1.0)) == "cannot be said: too few"
    assert verdict(Estimate(1.0), Estimate(None)) == "cannot be said: a number is missing"


def test_quoted_tables_are_whole_and_printed_evenly() -> None:
    items = json.loads((Path(__file__).parents[2] / "playground" / "analysis" / "cited.json").read_text())
    for item in items:
        found = cited(item)
        assert found.title and "arXiv" in found.where
        for row in found.printed:
            assert len(row) == len(found.columns)
        for column in zip(*found.printed, strict=True):
            places = {len(cell.partition(".")[2]) for cell in column if cell.replace(".", "").isdigit() and "." in cell}
            assert len(places) <= 1
    assert cited("table1").printed[1] == ("mid", "160", "0.110", "0.205")
    assert cited("table2_humanml3d").printed[0][:3] == ("real motion", "–", "0.501")
    assert cited("table9").value("LG-Tok", "seconds") == 0.121


def test_an_unknown_quotation_is_told() -> None:
    with pytest.raises(PlaygroundError, match="nothing is quoted"):
        cited("table99")
    with pytest.raises(PlaygroundError, match="no number is quoted"):
        cited("table1").value("huge", "tokens")


@given(st.integers(1, 5), st.integers(0, 2**31))
def test_a_packed_motion_comes_back_to_the_millimetre(frames: int, seed: int) -> None:
    joints = np.random.default_rng(seed).uniform(-32.7, 32.7, (frames, HUMAN22.size, 3))
    back = unpacked(json.loads(json.dumps(packed(joints))))
    assert back.dtype == np.float32 and np.abs(back - joints).max() <= 0.0005 + 1e-5


@pytest.mark.parametrize("joints", [np.zeros((0, 22, 3)), np.zeros((2, 21, 3)), np.full((1, 22, 3), 40.0),
                                    np.full((1, 22, 3), np.nan)])  # fmt: skip
def test_what_cannot_be_packed_is_told(joints: np.ndarray) -> None:
    with pytest.raises(PlaygroundError, match="stored motion"):
        packed(joints)


@pytest.mark.parametrize("stored", [None, [], {}, {"frames": 2, "mm": ""}, {"frames": "x", "mm": ""},
                                    {"frames": 1, "mm": "???"}, {"frames": -1, "mm": "AAAA"}])  # fmt: skip
def test_a_broken_packed_motion_is_told(stored: object) -> None:
    with pytest.raises(PlaygroundError, match="broken"):
        unpacked(stored)


@pytest.mark.parametrize("path", sorted(RESULTS.glob("*.json")), ids=lambda path: path.stem)
def test_a_shipped_result_says_where_it_comes_from(path: Path) -> None:
    held = json.loads(path.read_text(encoding="utf-8"))
    found = read_result(held["item"], Result.of(held).system)
    assert found is not None and result_path(found.item, found.system) == path
    assert found.made_by and found.rows and "/" not in found.made_by.replace("playground/", "")
    assert "seed" in found.provenance and found.line
    for row in found.rows:
        for entry in row.values():
            if isinstance(entry, dict) and "mean" in entry:
                assert entry["mean"] is not None or entry["why"]
