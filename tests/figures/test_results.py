"""The table of all systems: what it says of stored results, and that the README shows it as it is."""

from pathlib import Path

import pytest

from playground.analysis.results import Result
from playground.figures.results import HEADS, results_table, stored_evaluations
from playground.figures.tables import Table
from playground.systems import SYSTEMS, checkpoint_path, header

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def result(**more: object) -> Result:
    facts = {"system": "momask", "checkpoint": "abc", "generator": "def", "tokens": 294, "parameters": 4_300_000}
    facts |= {"data": "some", "split": "val", "n": 7, "repeats": 2, "seed": 3, "evaluators": {"tmr": "e"}, **more}
    drawn = {"fid": {"mean": 0.5, "ci95": 0.25}, "r_precision_top3_pool32": {"mean": None, "why": "too few"}}
    rows = [
        {"of": "generated", **drawn, "prompts_obeyed": {"mean": 0.5}, "foot_sliding": {"mean": 301.4}},
        {"of": "real", **drawn, "foot_sliding": {"mean": 99.0}},
        {"of": "every clip once", "mpjpe_mm": 31.26},
    ]
    return Result("evaluation", "by hand", facts, rows)


def test_a_row_says_what_was_measured_and_a_dash_where_nothing_was() -> None:
    table = results_table({"momask": result()})
    assert table.columns == HEADS and len(table.rows) == 2
    expected = ("`momask`", "294", "4.30", "`abc`, `def`", "31.3", "–", "0.500 ± 0.250", "–", "50 %", "301")
    assert table.rows[1] == expected
    assert table.rows[0][0] == "recorded motion" and table.rows[0][6:] == ("0.500 ± 0.250", "–", "–", "99.0")
    assert table.caption == "some, val split, 7 clips, 2 repeats (mean and 95 % interval), seed 3, evaluator tmr e"


def test_what_differs_in_how_it_was_measured_is_said_by_name() -> None:
    said = results_table({"momask": result(), "mogo": result(), "mosa": result(repeats=5)}).caption.split("; ")
    assert [one.split(":")[0] for one in said] == ["momask, mogo", "mosa"]
    assert "2 repeats" in said[0] and "5 repeats" in said[1]


def test_the_guidance_that_was_drawn_with_is_shown() -> None:
    row = results_table({"lgtok-mid": result(system="lgtok-mid", sampling={"guidance": 2.5})}).rows[1]
    assert row[HEADS.index("g")] == "2.5"


def test_a_system_without_tokens_has_dashes() -> None:
    facts = {"tokens": 0, "generator": None, "checkpoint": "abc"}
    assert results_table({"mdm": result(**facts)}).rows[1][:4] == ("`mdm`", "–", "4.30", "`abc`")
    assert results_table({}).rows == ()


def test_markdown_has_a_line_a_row_and_bars_do_not_end_a_cell() -> None:
    lines = Table(("a", "b"), (("1|2", "3"),)).markdown.splitlines()
    assert lines == ["| a | b |", "| --- | --- |", r"| 1\|2 | 3 |"]


def test_the_readme_shows_the_stored_results() -> None:
    table = results_table(stored_evaluations())
    assert table.markdown in README, "python -m playground.figures.results prints what the README must show"
    for sentence in table.caption.split("; "):
        assert sentence in " ".join(README.split())


@pytest.mark.parametrize("name", list(stored_evaluations()))
def test_results_are_of_the_checkpoints_that_are_shipped(name: str) -> None:
    import hashlib

    facts, root = stored_evaluations()[name].provenance, Path(__file__).parents[2] / "assets"
    part = SYSTEMS[name].parts[0]
    path = checkpoint_path(root, name, part)
    assert header(path) is not None
    assert facts["checkpoint"] == hashlib.sha256(path.read_bytes()).hexdigest()[:12]
