"""Maps of the app: every point once with its id, groups or numbers as colours, new points apart."""

import json

import numpy as np
import pytest

from playground.errors import PlaygroundError
from playground.figures.maps import Cloud, maps_figure


def cloud(n: int = 12, title: str = "t-SNE", **settings: object) -> Cloud:
    rng = np.random.default_rng(n)
    colours = settings or {"groups": ["walk", "run", "SIE"] * (n // 3)}
    return Cloud(
        title, rng.normal(size=(n, 2)), [f"c{i}" for i in range(n)], [f"note {i}" for i in range(n)], **colours
    )  # type: ignore[arg-type]


def test_every_point_stands_once_at_its_place() -> None:
    made = cloud()
    figure = maps_figure([made], caption="12 clips, seed 0")
    seen = {id: (x, y) for trace in figure.data for id, x, y in zip(trace.customdata, trace.x, trace.y, strict=True)}
    assert {id: pytest.approx(place) for id, place in seen.items()} == {
        id: tuple(np.round(point, 4)) for id, point in zip(made.ids, made.points, strict=True)
    }
    assert "12 clips, seed 0" in json.dumps(figure.to_dict(), default=str)


def test_groups_without_a_style_look_different() -> None:
    figure = maps_figure([cloud(groups=["CMU", "SIE", "ASE"] * 4)])
    looks = {(trace.marker.color, trace.marker.symbol) for trace in figure.data}
    assert len(looks) == 3 and all(trace.meta["dark"]["marker.color"] for trace in figure.data)


def test_panels_may_hold_different_points() -> None:
    figure = maps_figure([cloud(12), cloud(6, "PCA")])
    count = {axis: sum(len(trace.x) for trace in figure.data if trace.xaxis == axis) for axis in ("x", "x2")}
    assert count == {"x": 12, "x2": 6}
    assert sum(bool(trace.showlegend) for trace in figure.data) == 3  # names once, for all panels


def test_numbers_share_one_bar_and_turn_with_the_page() -> None:
    values = np.linspace(0, 9, 12)
    figure = maps_figure([cloud(values=values), cloud(values=values, title="PCA")], unit="length, s")
    assert [trace.marker.showscale for trace in figure.data] == [True, False]
    assert list(figure.data[0].marker.color) == pytest.approx(np.round(values, 4).tolist())
    assert figure.data[0].meta["dark"]["marker.colorscale"] != figure.data[0].marker.colorscale


def test_a_new_point_widens_the_map() -> None:
    far = np.array([[50.0, -40.0]])
    figure = maps_figure([cloud(groups=["walk"] * 12, placed=far)])
    low, high = figure.layout.xaxis.range
    assert figure.data[-1].name == "yours" and low < 50 < high


@pytest.mark.parametrize(
    "broken",
    [
        Cloud("a", np.zeros((2, 2)), ["x"], ["y"], groups=["walk"]),
        Cloud("a", np.full((1, 2), np.nan), ["x"], ["y"], groups=["walk"]),
        Cloud("a", np.zeros((1, 2)), ["x"], ["y"]),
        Cloud("a", np.zeros((0, 2)), [], []),
    ],
)
def test_what_does_not_fit_is_refused(broken: Cloud) -> None:
    with pytest.raises(PlaygroundError):
        maps_figure([broken])
    with pytest.raises(PlaygroundError):
        maps_figure([])
