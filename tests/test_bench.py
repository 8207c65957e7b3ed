"""The bench command: rows, goals, the written report. Times are made up here; real ones are never asserted."""

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks.timing import ROOT
from playground import bench
from playground.errors import PlaygroundError

ENDLESS = {
    "note": "", "seconds": 300, "first": 0.5, "speed": {"mean": 9.0, "worst": 2.0, "worst_at": 20}, "switches": 14,
    "bytes": {"settled": 4e8, "most": 4.1e8, "end": 4.05e8}, "held": {"settled": 5e5, "most": 6e5, "end": 5e5},
    "jerk": {"at_switches": 30.0, "elsewhere": 20.0},
}  # fmt: skip


def test_a_row_says_goal_and_ratio_to_the_reference() -> None:
    line = bench.Row("s", "tokenize, batch 1", "s", 0.021, goal=0.035, reference=0.07).line()
    assert "0.021 s" in line and "goal   0.035 ok" in line and "ratio 0.30" in line
    assert "over" in bench.Row("s", "generate", "s", 1.5, goal=1.0).line()
    assert "goal" not in bench.Row("s", "peak memory", "MB", 812.4).line()
    assert "ok" in bench.Row("s", "speed", "x", 1.5, goal=1.0, least=True).line()
    assert "under" in bench.Row("s", "speed", "x", 0.5, goal=1.0, least=True).line()


def test_every_goal_and_cited_figure_has_a_row(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    calls: list[tuple[str, ...]] = []

    def fake(module: str, *arguments: str) -> dict[str, Any]:
        calls.append(arguments)
        if arguments == ("shipped",):
            seconds = {"load": 1.0, "tokenize and reconstruct": 0.1, "generate": 0.4, "scale scrubber": 0.02}
            return {"seconds": seconds, "peak": 5e8}
        if module == "benchmarks.endless":
            return ENDLESS | {"threads": int(arguments[0])}
        return {"best": 0.01, "median": 0.02, "turns": 3, "loaded": 4e8, "peak": 6e8}

    monkeypatch.setattr(bench, "fresh", fake)
    monkeypatch.setattr(bench, "page_ready", lambda: 2.5)
    out = tmp_path / "new" / "bench.json"
    bench.run(out)
    report = json.loads(out.read_text())
    names = {row["what"]: row for row in report["rows"]}
    for what, goal in bench.GOALS.items():
        assert names[what]["goal"] == goal and names[what]["value"] > 0
    reference = json.loads((ROOT / "benchmarks" / "reference.json").read_text())
    for case, settings in reference["seconds"].items():
        for label, seconds in settings.items():
            row = names.get(f"{case}, {label}", names.get(case))
            assert row is not None and row["reference"] == seconds and row["goal"] == seconds / 2
    for threads in bench.ENDLESS:
        endless = {row["what"].strip(): row for row in report["rows"] if row["section"].endswith(f"threads: {threads}")}
        assert endless["the worst single second"]["note"] == "second 21" and endless["at the end"]["goal"] == 408
        assert endless["the largest after that"]["value"] == 410 and endless["jerk at switches"]["value"] == 30
    assert ("generate", "32", "2") in calls and ("tokenize", "1", "1") in calls
    assert report["machine"]["cores"] >= 1 and report["reference"] == reference


def test_a_failed_case_is_one_sentence_and_keeps_what_was_measured(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def fake(module: str, *arguments: str) -> dict[str, Any]:
        if arguments == ("shipped",):
            return {"seconds": {"generate": 0.4}, "peak": 5e8}
        raise RuntimeError("no memory left")

    monkeypatch.setattr(bench, "fresh", fake)
    monkeypatch.setattr(bench, "page_ready", lambda: 2.5)
    with pytest.raises(PlaygroundError, match="no memory left"):
        bench.run(tmp_path / "bench.json")
    assert [row["what"] for row in json.loads((tmp_path / "bench.json").read_text())["rows"]][:1] == ["generate"]


def test_every_case_named_in_the_bench_exists() -> None:
    from benchmarks.cases import BUDGET, CASES

    assert set(CASES) == {*bench.FULL, *bench.TRAINING}
    assert {batch for _, batch, _ in bench.SETTINGS} <= set(BUDGET)
