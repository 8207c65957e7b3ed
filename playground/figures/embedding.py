"""Maps of motions: one point a motion, coloured and marked by action (Fig 6 of LG-Tok)."""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike, NDArray
from plotly.subplots import make_subplots

from playground.errors import PlaygroundError
from playground.figures.actions import action_style
from playground.figures.theme import finish, listed, percent

_NAMED_SHARE = 0.04  # groups with a larger share of the points get their name on the map
_NEAR = 0.06  # radius of "near", as a share of the map's width


def embedding_maps(
    panels: Mapping[str, ArrayLike],
    actions: Sequence[str],
    ids: Sequence[str],
    *,
    notes: Sequence[str] | None = None,
    explained: Mapping[str, ArrayLike] | None = None,
    title: str = "",
    caption: str = "",
    height: int = 460,
) -> go.Figure:
    """One scatter plot a panel, side by side, of the same n motions.

    panels: name of a map -> points [n, 2]; actions: the group of every motion; ids: what a click reports, its
    customdata; notes: one hover line a motion; explained: name of a PCA map -> share of the variance
    of its two axes (maps without it have no scale on their axes, because t-SNE's has no meaning).
    PlaygroundError if the lengths differ or a point is not finite.
    """
    maps = {name: np.asarray(points, np.float64) for name, points in panels.items()}
    n = len(ids)
    fits = all(points.shape == (n, 2) and np.isfinite(points).all() for points in maps.values())
    if not maps or not fits or len(actions) != n or (notes is not None and len(notes) != n):
        raise PlaygroundError(f"a map of {n} motions needs {n} finite points, {n} actions and a note for each or none")
    heads = list(maps) if len(maps) > 1 else None
    figure = make_subplots(1, len(maps), horizontal_spacing=0.09 if explained else 0.03, subplot_titles=heads)
    figure.update_annotations(font={"size": 12}, yshift=2)
    groups = sorted(set(actions), key=lambda action: (action_style(action).rank, action))
    for column, (name, points) in enumerate(maps.items(), start=1):
        for group in groups:
            chosen = [i for i, action in enumerate(actions) if action == group]
            hover = [notes[i] if notes else group for i in chosen]
            names = [ids[i] for i in chosen]
            figure.add_trace(_cloud(group, points[chosen], names, hover, column == 1), 1, column)
        name_groups(figure, points, actions, column)
        equal_axes(figure, points, (explained or {}).get(name), column)
    figure.update_layout(legend={"x": 1.01, "y": 1, "yanchor": "top", "tracegroupgap": 0})
    left, lines = (56, 1) if explained else (16, 0)
    return finish(
        figure,
        title=title,
        caption=caption,
        height=height,
        left=left,
        right=130,
        heads=int(len(maps) > 1),
        tick_lines=lines,
    )


def _cloud(group: str, points: NDArray[np.float64], ids: list[str], hover: list[str], legend: bool) -> go.Scatter:
    """The points of one action group."""
    style = action_style(group)
    return go.Scatter(
        x=listed(points[:, 0]), y=listed(points[:, 1]), customdata=ids, mode="markers", name=group,
        legendgroup=group, showlegend=legend, hovertext=hover, hovertemplate="%{hovertext}<extra></extra>",
        marker={"color": style.light, "symbol": style.symbol, "size": 7, "opacity": 0.85,
                "line": {"width": 0.5, "color": "#ffffff"}},
        meta={"dark": {"marker.color": style.dark, "marker.line.color": "#121518"}},
    )  # fmt: skip


def name_groups(figure: go.Figure, points: NDArray[np.float64], actions: Sequence[str], column: int) -> None:
    """Writes the name of every large group above its densest place, names pushed apart where they would meet."""
    n = len(points)
    if n < 10:
        return
    span = np.maximum(np.ptp(points, axis=0), 1e-12)
    places: list[tuple[str, NDArray[np.float64]]] = []
    for group, count in Counter(actions).most_common():
        if count >= _NAMED_SHARE * n:
            own = points[[action == group for action in actions]] / span
            distance = np.linalg.norm(own[:, None] - own[None], axis=-1)
            near = distance < _NEAR
            densest = own[near[near.sum(axis=1).argmax()]]
            places.append((group, np.array([densest[:, 0].mean(), densest[:, 1].max() + 0.012])))
    for group, place in _apart(places):
        figure.add_annotation(
            x=place[0] * span[0], y=place[1] * span[1], text=f"<b>{group}</b>", showarrow=False, yanchor="bottom",
            font={"size": 12, "shadow": "auto"}, row=1, col=column,
        )  # fmt: skip


def _apart(places: list[tuple[str, NDArray[np.float64]]]) -> list[tuple[str, NDArray[np.float64]]]:
    """Moves names up where two would overlap, and drops those that would end up far from their place.

    Places are in shares of the map; a name takes 0.013 a letter by 0.05.
    """
    moved: list[tuple[str, NDArray[np.float64]]] = []
    for name, place in sorted(places, key=lambda entry: float(entry[1][1])):
        spot = place.copy()
        for other, taken in moved:
            wide = 0.0065 * (len(name) + len(other)) + 0.01
            if abs(spot[0] - taken[0]) < wide and abs(spot[1] - taken[1]) < 0.05:
                spot[1] = taken[1] + 0.05
        if spot[1] - place[1] <= 0.1:
            moved.append((name, spot))
    return moved


def equal_axes(figure: go.Figure, points: NDArray[np.float64], explained: ArrayLike | None, column: int) -> None:
    """Equal units on both axes; scales and titles for PCA alone."""
    middle = (points.max(axis=0) + points.min(axis=0)) / 2
    half = max(float(np.ptp(points, axis=0).max()) / 2 * 1.06, 1e-6)
    low, high = middle - half, middle + half
    plain = {"showticklabels": False, "ticks": ""} if explained is None else {"nticks": 6}
    shares = [] if explained is None else listed(explained)
    names = [f"axis {axis}, {percent(share)} of the variance" for axis, share in enumerate(shares, 1)] or ["", ""]
    common = plain | {"mirror": True, "row": 1, "col": column}
    figure.update_xaxes(range=[low[0], high[0]], title=names[0], **common)
    anchor = f"x{column if column > 1 else ''}"
    figure.update_yaxes(range=[low[1], high[1]], title=names[1], scaleanchor=anchor, **common)
