"""The speed curve of a take: dots at the minima, lines at the cuts."""

import numpy as np
import pytest

from playground.data.segment import Segmentation
from playground.figures.segments import segments_plot

FOUND = Segmentation(
    20.0, np.linspace(0.0, 1.0, 400), np.array([100, 220]), np.array([1.0, 0.25]), np.array([100, 240]),
    np.array([False, True]),
)  # fmt: skip


def test_curve_minima_and_cuts_are_drawn() -> None:
    figure = segments_plot(FOUND, caption="a take, seed 0.")
    curve, dots = figure.data
    assert list(curve.x)[-1] == pytest.approx(399 / 20) and list(curve.y) == pytest.approx(FOUND.speed, abs=1e-3)
    assert list(dots.x) == [5.0, 11.0] and list(dots.customdata) == [100, 220]
    assert dots.marker.size[0] > dots.marker.size[1] and "25 %" in dots.hovertext[1]
    lines = figure.layout.shapes
    assert [line.x0 for line in lines] == [5.0, 12.0] and [line.line.dash for line in lines] == ["solid", "dash"]
    caption = " ".join(note.text for note in figure.layout.annotations).replace("<br>", " ")
    assert "a take, seed 0. 3 parts of 5.0 to 8.0 s" in caption


def test_a_take_without_minima_is_a_curve_alone() -> None:
    none = np.zeros(0, np.int64)
    figure = segments_plot(Segmentation(20.0, np.ones(50), none, np.zeros(0), none, np.zeros(0, bool)))
    assert not figure.layout.shapes and len(figure.data[1].x) == 0
