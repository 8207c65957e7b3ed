"""Energy bars: one a scale and one before the first, with whiskers where there is more than one motion."""

import numpy as np
import pytest

from playground.analysis.residual import ScaleEnergy
from playground.figures.residual import residual_bars


def test_bars_are_the_shares() -> None:
    energy = ScaleEnergy().fit([[1.0, 0.4, 0.1], [1.0, 0.6, 0.3]])
    figure = residual_bars(energy, (3, 6), caption="2 clips, seed 0")
    bars = figure.data[0]
    assert list(bars.y) == pytest.approx([100, 50, 20])
    assert list(bars.customdata) == [0, 1, 2]
    assert np.add(bars.y, bars.error_y.array) == pytest.approx(100 * energy.high_, abs=1e-3)
    assert np.subtract(bars.y, bars.error_y.arrayminus) == pytest.approx(100 * energy.low_, abs=1e-3)
    assert bars.error_y.visible and len(set(bars.marker.color)) == 3
    assert "removes 50 %" in bars.hovertext[1]
    assert {"100", "50", "20"} <= {note.text for note in figure.layout.annotations}


def test_one_motion_has_no_whiskers() -> None:
    assert not residual_bars(ScaleEnergy().fit([[1.0, 0.5]]), (4,)).data[0].error_y.visible


def test_a_scale_that_adds_error_stays_inside_the_axis() -> None:
    figure = residual_bars(ScaleEnergy().fit([[1.0, 1.8, 0.2]]), (3, 6))
    assert figure.layout.yaxis.range[1] > 180
    assert "removes -80 %" in figure.data[0].hovertext[1]
