"""Maps side by side for the app: points coloured by a group or a number, some of them new; one panel a map.

The figure of the paper is figures/embedding.py; here panels may hold different points (of several systems), a point may
be a token, and what a visitor places stands out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike, NDArray
from plotly.subplots import make_subplots

from playground.errors import PlaygroundError
from playground.figures.actions import action_style
from playground.figures.embedding import equal_axes, name_groups
from playground.figures.theme import finish, listed, scale_colors

_RAMP = 9  # steps of the colour ramp of a number
_HUES = (("#0072b2", "#3b9fe0"), ("#d55e00", "#f0843c"), ("#009e73", "#2fc296"), ("#c065a0", "#e09cc2"),
         ("#7d7600", "#d3c93c"), ("#3a9bce", "#8fd0f5"), ("#882255", "#e0709c"), ("#80868e", "#9ca7b3"))  # fmt: skip
_SYMBOLS = ("circle", "square", "diamond", "triangle-up", "cross", "pentagon", "x", "star")


@dataclass(frozen=True, eq=False)
class Cloud:
    """The points of one panel. Either `groups` or `values` colours them."""

    title: str
    points: NDArray[np.floating]  # [n, 2]
    ids: Sequence[str]  # what a click reports
    notes: Sequence[str]  # a hover line each
    groups: Sequence[str] = ()
    values: ArrayLike = ()
    placed: ArrayLike = field(default_factory=lambda: np.zeros((0, 2)))  # [m, 2] new points


def maps_figure(
    clouds: Sequence[Cloud], *, unit: str = "", caption: str = "", height: int = 420, small: bool = False
) -> go.Figure:
    """One scatter plot a cloud, side by side. unit: of the values, at the colour bar; small: smaller points.

    PlaygroundError where lengths differ, points are not finite or there is no cloud.
    """
    for cloud in clouds:
        n = len(cloud.ids)
        colours = len(cloud.groups) or len(np.asarray(cloud.values))
        if np.shape(cloud.points) != (n, 2) or not np.isfinite(cloud.points).all() or len(cloud.notes) != n or not n:
            raise PlaygroundError(f"the map {cloud.title!r} needs as many finite points and notes as ids, at least one")
        if colours != n:
            raise PlaygroundError(f"the map {cloud.title!r} needs a group or a value for each of its {n} points")
    if not clouds:
        raise PlaygroundError("there is no map to draw")
    figure = make_subplots(1, len(clouds), horizontal_spacing=0.03, subplot_titles=[cloud.title for cloud in clouds])
    figure.update_annotations(font={"size": 12}, yshift=2)
    size = 5 if small else 7
    for column, cloud in enumerate(clouds, start=1):
        points = np.asarray(cloud.points, np.float64)
        if len(cloud.groups):
            _groups(figure, cloud, points, column, size)
            name_groups(figure, points, cloud.groups, column)
        else:
            _values(figure, cloud, points, column, size, unit)
        placed = np.asarray(cloud.placed, np.float64).reshape(-1, 2)
        if len(placed):
            _placed(figure, placed, column)
        equal_axes(figure, np.concatenate([points, placed]), None, column)
    finish(figure, caption=caption, height=height, left=8, right=8, heads=1, tick_lines=0)
    bottom = 96 if any(len(cloud.groups) for cloud in clouds) else 84
    figure.update_layout(
        margin={"t": 28, "b": bottom},
        legend={"orientation": "h", "x": 0, "y": -0.03, "xanchor": "left", "yanchor": "top", "tracegroupgap": 0},
    )
    figure.update_annotations({"yshift": -bottom + 4}, selector={"name": "caption"})
    return figure


def _groups(figure: go.Figure, cloud: Cloud, points: NDArray[np.float64], column: int, size: int) -> None:
    """A trace a group: actions in their own style, other names in turn."""
    names = sorted(set(cloud.groups), key=lambda group: (action_style(group).rank, group))
    for place, group in enumerate(names):
        own = [i for i, other in enumerate(cloud.groups) if other == group]
        light, dark, symbol = _style(group, place)
        figure.add_trace(
            go.Scatter(
                x=listed(points[own, 0]), y=listed(points[own, 1]), customdata=[cloud.ids[i] for i in own],
                mode="markers", name=group, legendgroup=group, showlegend=column == 1,
                hovertext=[cloud.notes[i] for i in own], hovertemplate="%{hovertext}<extra></extra>",
                marker={"color": light, "symbol": symbol, "size": size, "opacity": 0.85, "line": {"width": 0}},
                meta={"dark": {"marker.color": dark}},  # no outlines: they make painting four times as slow
            ),
            1,
            column,
        )  # fmt: skip


def _style(group: str, place: int) -> tuple[str, str, str]:
    style = action_style(group)
    if style != action_style("other") and style.rank < action_style("\0").rank:
        return style.light, style.dark, style.symbol
    light, dark = _HUES[place % len(_HUES)]
    return light, dark, _SYMBOLS[(place + place // len(_HUES)) % len(_SYMBOLS)]


def _values(figure: go.Figure, cloud: Cloud, points: NDArray[np.float64], column: int, size: int, unit: str) -> None:
    """One trace along the ramp of the scales: dark for little, light for much; the bar lies under the first map."""
    light, dark = ([[n / (_RAMP - 1), color] for n, color in enumerate(ramp)] for ramp in scale_colors(_RAMP))
    values = np.asarray(cloud.values, np.float64)
    bar = {"orientation": "h", "title": {"text": unit, "side": "top"}, "thickness": 8, "len": 0.4, "x": 0,
           "y": -0.02, "xanchor": "left", "yanchor": "top", "outlinewidth": 0, "ticks": "", "nticks": 6}  # fmt: skip
    figure.add_trace(
        go.Scatter(
            x=listed(points[:, 0]), y=listed(points[:, 1]), customdata=list(cloud.ids), mode="markers",
            name=cloud.title, showlegend=False,
            hovertext=list(cloud.notes), hovertemplate="%{hovertext}<extra></extra>",
            marker={"color": listed(values), "colorscale": light, "size": size, "opacity": 0.85, "colorbar": bar,
                    "showscale": column == 1, "line": {"width": 0}},
            meta={"dark": {"marker.colorscale": dark}},
        ),
        1,
        column,
    )  # fmt: skip


def _placed(figure: go.Figure, points: NDArray[np.float64], column: int) -> None:
    figure.add_trace(
        go.Scatter(
            x=listed(points[:, 0]), y=listed(points[:, 1]), mode="markers", name="yours", showlegend=column == 1,
            hovertemplate="what you placed<extra></extra>", legendgroup="yours", cliponaxis=False,
            marker={"color": "#000000", "symbol": "star", "size": 17 if len(points) == 1 else 8,
                    "line": {"width": 1.5, "color": "#ffffff"}},
            meta={"dark": {"marker.color": "#ffffff", "marker.line.color": "#000000"}},
        ),
        1,
        column,
    )  # fmt: skip
