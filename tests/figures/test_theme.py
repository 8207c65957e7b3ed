"""What plots share: ramps and action styles that read on both pages, numbers for people, the dark copy."""

import math

import numpy as np
import plotly.graph_objects as go
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.data.actions import GROUPS
from playground.figures.actions import action_style, known_actions
from playground.figures.colors import TOKENS, contrast
from playground.figures.theme import finish, label_color, listed, on_dark, percent, readable, scale_colors

LIGHT, DARK = TOKENS["surface"]


def luminance(color: str) -> float:
    channels = [int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize("levels", [1, 2, 10, 16])
def test_scale_ramp_grows_lighter_and_reads_on_both_pages(levels: int) -> None:
    for ramp, page in zip(scale_colors(levels), (LIGHT, DARK), strict=True):
        assert len(ramp) == levels
        steps = [luminance(color) for color in ramp]
        assert all(second > first for first, second in zip(steps, steps[1:], strict=False))
        assert all(contrast(color, page) >= 3 for color in ramp)


def test_every_action_group_has_a_look_of_its_own() -> None:
    groups = [name for name, _ in GROUPS] + ["other"]
    assert set(groups) == set(known_actions())
    looks = [(action_style(group).light, action_style(group).symbol) for group in groups]
    assert len(set(looks)) == len(groups)
    for group in groups:
        assert contrast(action_style(group).light, LIGHT) >= 3 and contrast(action_style(group).dark, DARK) >= 3


def test_a_new_action_looks_like_other_and_comes_last() -> None:
    strange, other = action_style("juggle"), action_style("other")
    assert (strange.light, strange.symbol) == (other.light, other.symbol)
    assert strange.rank > other.rank


@pytest.mark.parametrize(
    "value, text",
    [(1234.6, "1,235"), (312.4, "312"), (31.0, "31"), (4.25, "4.2"), (0.347, "0.35"), (math.nan, "–"), (0.0, "0")],
)
def test_numbers_for_people(value: float, text: str) -> None:
    assert readable(value) == text


@given(st.floats(0, 1))
def test_a_percentage_is_full_or_nothing_only_if_it_is(share: float) -> None:
    text = percent(share)
    assert (text == "100 %") == (share == 1.0)
    assert (text == "0 %") == (share == 0.0)


def test_lists_hold_no_numpy_and_no_nan() -> None:
    assert listed(np.array([1.23456, np.nan, np.inf])) == [1.2346, None, None]
    assert listed(np.array([1, 2])) == [1, 2] and type(listed(np.array([1]))[0]) is int


def test_dark_copy_changes_colours_and_leaves_the_original() -> None:
    trace = go.Bar(
        y=[1], marker={"color": "#000000", "line": {"color": "#111111"}},
        meta={"dark": {"marker.color": "#ffffff", "marker.line.color": "#eeeeee"}},
    )  # fmt: skip
    figure = finish(go.Figure([trace, go.Scatter(y=[1])]), title="Title", caption="seed 0 " * 40)
    dark = on_dark(figure)
    assert (dark.data[0].marker.color, dark.data[0].marker.line.color) == ("#ffffff", "#eeeeee")
    assert figure.data[0].marker.color == "#000000"
    assert figure.layout.template.layout.paper_bgcolor == LIGHT and dark.layout.template.layout.paper_bgcolor == DARK
    caption = next(figure.select_annotations({"name": "caption"}))
    assert "<br>" in caption.text and figure.layout.margin.b > -caption.yshift


@pytest.mark.parametrize("fill, ink", [("#ffffff", "#000000"), ("#000000", "#ffffff"), ("#332288", "#ffffff")])
def test_labels_on_a_colour(fill: str, ink: str) -> None:
    assert label_color(fill) == ink
