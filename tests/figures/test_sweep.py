"""The small sweep: both metrics with their intervals, each panel saying which way is good."""

import json

import pytest

from playground.analysis.results import Result
from playground.figures.sweep import HEIGHT, small_sweep

TOP = "r_precision_top3_pool32"


def swept() -> Result:
    rows = [{"g": g, "fid": {"mean": 1 + (g - 2) ** 2, "ci95": 0.1, "n": 5}, TOP: {"mean": 0.5 + g / 20, "ci95": 0.02}}
            for g in (0.0, 1.0, 2.0, 3.0)]  # fmt: skip
    facts = {"system": "lgtok", "data": "made up", "split": "test", "n": 40, "repeats": 5, "seed": 0}
    return Result("guidance_sweep", "a test", facts, rows, {"real": {"fid": {"mean": 0.2, "ci95": 0.0}}})


def test_both_curves_with_their_intervals() -> None:
    figure = json.loads(small_sweep(swept()).to_json())
    first, second = figure["data"]
    assert first["y"] == [5.0, 2.0, 1.0, 2.0] and second["y"] == pytest.approx([0.5, 0.55, 0.6, 0.65])
    assert first["error_y"]["array"] == [0.1] * 4 and second["error_y"]["visible"]
    assert figure["layout"]["height"] == HEIGHT
    words = [note["text"] for note in figure["layout"]["annotations"]]
    assert any("low is good" in text for text in words) and any("high is good" in text for text in words)
