"""The speed curve of a long take with its minima and its cuts (systems.md E2)."""

import numpy as np
import plotly.graph_objects as go

from playground.data.segment import LONGEST, SHORTEST, Segmentation
from playground.figures.theme import HEIGHT, finish, listed, percent, reference_line

_LINE, _DOT = ("#5b6ee1", "#9aa7ff"), ("#c2410c", "#fb923c")  # on a light page, on a dark page


def segments_plot(
    found: Segmentation, *, title: str = "Where the take is cut", caption: str = "", height: int = HEIGHT
) -> go.Figure:
    """Speed against time, a dot a minimum (the larger the likelier a cut), a line a cut; dashed: cut for length alone.

    customdata of a dot is its frame.
    """
    time = np.arange(len(found.speed)) / found.fps
    figure = go.Figure()
    figure.add_scatter(
        x=listed(time), y=listed(found.speed), mode="lines", line={"color": _LINE[0], "width": 1.5}, name="speed",
        meta={"dark": {"line.color": _LINE[1]}}, hovertemplate="%{x:.2f} s: %{y:.2f} m/s<extra></extra>",
    )  # fmt: skip
    marker = {"color": _DOT[0], "size": listed(4.0 + 6.0 * found.chance), "opacity": 0.85}
    hover = [f"chance of a cut {percent(chance)}" for chance in found.chance]
    figure.add_scatter(
        x=listed(time[found.minima]), y=listed(found.speed[found.minima]), mode="markers", marker=marker,
        name="minimum", customdata=found.minima.tolist(), hovertext=hover, meta={"dark": {"marker.color": _DOT[1]}},
        hovertemplate="%{x:.2f} s: %{y:.2f} m/s, %{hovertext}<extra></extra>",
    )  # fmt: skip
    for cut, forced in zip(found.cuts, found.forced, strict=True):
        line = reference_line() | {"dash": "dash" if forced else "solid"}
        figure.add_vline(x=float(time[cut]), line=line, layer="below")
    figure.update_xaxes(title="seconds", range=[0, float(time[-1])])
    figure.update_yaxes(title="mean speed of hip, head, hands and feet, m/s", rangemode="tozero")
    figure.update_layout(showlegend=False)
    seconds = [(stop - start) / found.fps for start, stop in found.spans]
    counted = (
        f"{len(seconds)} parts of {min(seconds):.1f} to {max(seconds):.1f} s, {SHORTEST:g} to {LONGEST:g} s wanted. "
        f"A dot is a minimum, the larger the likelier a cut; dashed lines only keep parts below {LONGEST:g} s."
    )
    return finish(figure, title=title, caption=f"{caption} {counted}".strip(), height=height)
