"""What every plot shares: template, heights, captions, the ramp of scales, light and dark (ui.md, "Visual language").

A figure is built for a light page. A trace says in `meta["dark"]` what changes on a dark one ({"marker.color": ...}),
and text without a colour of its own takes the page's; so page, notebook and `on_dark` all dress the same figure.
Arrays enter figures as lists (`listed`), because the browser half reads them as such.
"""

import textwrap
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike

from playground.figures.colors import FONTS, TOKENS, contrast, oklch_to_rgb, rgb_to_hex

HEIGHT = 360  # pixels of an ordinary plot; plots in a row share it
FONT_SIZE = 12
CAPTION_WIDTH = 110  # characters a caption line
_LINE = 15  # pixels a caption line
_GREY = "#80868e"  # reference lines: reads on both grounds


def template(mode: str = "light") -> go.layout.Template:
    """The plotly template of a light or dark page."""
    tokens = {name: pair[mode == "dark"] for name, pair in TOKENS.items()}
    family = ", ".join(FONTS)
    axis = {
        "showgrid": False, "zeroline": False, "showline": True, "ticks": "outside", "ticklen": 4,
        "linecolor": tokens["line-strong"], "tickcolor": tokens["line-strong"], "gridcolor": tokens["line"],
        "tickfont": {"color": tokens["muted"], "size": FONT_SIZE - 1},
        "title": {"standoff": 8, "font": {"size": FONT_SIZE}}, "linewidth": 1,
    }  # fmt: skip
    layout = {
        "font": {"family": family, "size": FONT_SIZE, "color": tokens["text"]},
        "title": {"font": {"size": FONT_SIZE + 2}, "x": 0, "xref": "container", "xanchor": "left", "pad": {"l": 8}},
        "paper_bgcolor": tokens["surface"], "plot_bgcolor": tokens["surface"],
        "xaxis": axis, "yaxis": axis, "hovermode": "closest", "dragmode": "zoom", "bargap": 0.25,
        "hoverlabel": {
            "bgcolor": tokens["surface"], "bordercolor": tokens["line-strong"], "align": "left",
            "font": {"family": family, "size": FONT_SIZE, "color": tokens["text"]},
        },
        "legend": {"bgcolor": "rgba(0,0,0,0)", "borderwidth": 0, "font": {"size": FONT_SIZE}, "itemsizing": "constant"},
    }  # fmt: skip
    return go.layout.Template(layout=layout)


def finish(
    figure: go.Figure,
    *,
    title: str = "",
    caption: str = "",
    height: int = HEIGHT,
    left: int = 56,
    right: int = 16,
    heads: int = 0,
    tick_lines: int = 1,
) -> go.Figure:
    """Template, height, margins, title and the caption under the plot, in place; returns the figure.

    left, right: margins in pixels; heads: lines written above the panels; tick_lines: lines of the x labels.
    """
    lines = textwrap.wrap(caption, CAPTION_WIDTH)
    bottom = 34 + _LINE * (len(lines) + tick_lines)
    top = 14 + 28 * bool(title) + 16 * heads
    figure.update_layout(
        template=template(), height=height, margin={"l": left, "r": right, "t": top, "b": bottom},
        title={"text": title, "yref": "container", "y": 1, "yanchor": "top", "pad": {"t": 10, "l": 8}},
    )  # fmt: skip
    if lines:
        figure.add_annotation(
            name="caption", text="<br>".join(lines), showarrow=False, align="left", opacity=0.75,
            font={"size": FONT_SIZE - 1}, xref="paper", yref="paper", x=0, xanchor="left", xshift=-left + 8,
            y=0, yanchor="bottom", yshift=-bottom + 4,
        )  # fmt: skip
    return figure


def on_dark(figure: go.Figure) -> go.Figure:
    """A copy of a figure dressed for a dark page."""
    copy = go.Figure(figure)
    copy.update_layout(template=template("dark"))
    for trace in copy.data:
        for path, value in ((trace.meta or {}).get("dark") or {}).items():
            trace.update({path.replace(".", "_"): value})
    return copy


def scale_colors(levels: int) -> tuple[list[str], list[str]]:
    """One step of the sequential ramp for each of `levels` scales, dark = coarse: on a light page, on a dark page.

    The hue runs from violet through rose to amber while lightness rises evenly; every step keeps a contrast of 3.
    """
    place = np.linspace(0.0, 1.0, levels) if levels > 1 else np.array([0.5])
    hue = np.deg2rad(305.0 + 105.0 * place)  # violet 305, rose 360, amber 410
    ramps = []
    for low, high in ((0.32, 0.66), (0.54, 0.88)):
        rgb = oklch_to_rgb(low + (high - low) * place, np.full(place.shape, 0.14), hue)
        ramps.append([rgb_to_hex(color) for color in rgb])
    return ramps[0], ramps[1]


def reference_line() -> dict[str, Any]:
    """The look of a line that only helps to read: thin, dashed, grey on both pages."""
    return {"color": _GREY, "width": 1, "dash": "dash"}


def listed(values: ArrayLike, digits: int = 4) -> list[Any]:
    """An array as plain lists, rounded to `digits` significant places behind the point; nan becomes None."""
    array = np.asarray(values)
    if array.dtype.kind != "f":
        return list(array.tolist())
    rounded = np.round(array, digits).astype(object)
    rounded[~np.isfinite(array)] = None
    return list(rounded.tolist())


def readable(value: float) -> str:
    """A number with two to three significant digits: 312, 31, 4.2, 0.35; a dash for nan."""
    if not np.isfinite(value):
        return "–"
    size = abs(value)
    if size >= 10:
        return f"{value:,.0f}"
    return f"{value:.1f}" if size >= 1 else f"{value:.2g}"


def percent(share: float) -> str:
    """A share as a percentage that never rounds to a full 100 % or to 0 % by mistake; a dash for nan."""
    if not np.isfinite(share):
        return "–"
    if 0 < share < 0.01 or 0.99 < share < 1:
        return f"{100 * share:.2g} %" if share < 0.5 else f"{min(100 * share, 99.9):.1f} %"
    return f"{100 * share:.0f} %"


def label_color(fill: str) -> str:
    """Black or white, whichever reads better on the colour `fill`."""
    return max(("#000000", "#ffffff"), key=lambda ink: contrast(ink, fill))
