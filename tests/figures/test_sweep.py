"""The small sweep: both metrics with their intervals, and lines at g that the browser can find."""

import json

import pytest

from playground.analysis.results import Result
from playground.figures.sweep import HEIGHT, NOW, small_sweep

TOP = "r_precision_top3_pool32"


def swept() -> Result:
    rows = [{"g": g, "fid": {"mean": 1 + (g - 2) ** 2, "ci95": 0.1, "n": 5}, TOP: {"mean": 0.5 + g / 20, "ci95": 0.02}}
            for g in (0.0, 1.0, 2.0, 3.0)]  # fmt: skip
    facts = {"system": "lgtok-lite", "data": "made up", "split": "test", "n": 40, "repeats": 5, "seed": 0}
    return Result("guidance_sweep", "a test", facts, rows, {"real": {"fid": {"mean": 0.2, "ci95": 0.0}}})


@pytest.mark.parametrize("g", [0.0, 1.25, 6.0])
def test_both_curves_with_their_intervals_and_a_line_at_g(g: float) -> None:
    figure = json.loads(small_sweep(swept(), g).to_json())
    first, second = figure["data"]
    assert first["y"] == [5.0, 2.0, 1.0, 2.0] and second["y"] == pytest.approx([0.5, 0.55, 0.6, 0.65])
    assert first["error_y"]["array"] == [0.1] * 4 and second["error_y"]["visible"]
    lines = [shape for shape in figure["layout"]["shapes"] if shape.get("name") == NOW]
    assert [(line["x0"], line["x1"], line["xref"]) for line in lines] == [(g, g, "x"), (g, g, "x2")]
    assert figure["layout"]["height"] == HEIGHT
    words = [note["text"] for note in figure["layout"]["annotations"]]
    assert any("lower is better" in text for text in words) and any("higher is better" in text for text in words)
