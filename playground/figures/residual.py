"""Energy by scale as bars: what is left of the latent after 0, 1, ... N scales (systems.md A6)."""

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from playground.analysis.residual import ScaleEnergy
from playground.figures.theme import HEIGHT, finish, listed, percent, scale_colors


def residual_bars(
    energy: ScaleEnergy, sizes: Sequence[int], *, title: str = "", caption: str = "", height: int = HEIGHT
) -> go.Figure:
    """Bars of the mean share left after each scale, with a whisker from the 10th to the 90th percentile over motions.

    sizes: tokens a scale, [N]. One motion alone has no whiskers. customdata of bar n is n, the scales kept.
    """
    levels = len(energy.gain_)
    light, dark = scale_colors(levels)
    grey = ("#80868e", "#80868e")
    left, low, high = (100.0 * values for values in (energy.left_, energy.low_, energy.high_))
    lost = ["", *(f"<br>this scale removes {percent(gain)}" for gain in energy.gain_)]
    hover = [
        f"after {n} of {levels} scales: {percent(s)} left{t}"
        for n, (s, t) in enumerate(zip(energy.left_, lost, strict=True))
    ]
    whiskers = {
        "type": "data", "symmetric": False, "thickness": 1, "width": 3, "color": "#80868e",
        "array": listed(high - left), "arrayminus": listed(left - low), "visible": energy.count_ > 1,
    }  # fmt: skip
    bars = go.Bar(
        x=list(range(levels + 1)), y=listed(left), customdata=list(range(levels + 1)), error_y=whiskers,
        marker={"color": [grey[0], *light], "line": {"width": 0}}, meta={"dark": {"marker.color": [grey[1], *dark]}},
        hovertext=hover, hovertemplate="%{hovertext}<extra></extra>", showlegend=False,
    )  # fmt: skip
    figure = go.Figure(bars)
    top = float(np.nanmax(high))
    for n, value in enumerate(energy.left_):
        figure.add_annotation(
            x=n,
            y=max(high[n], left[n]),
            text=percent(value).removesuffix(" %"),
            showarrow=False,
            yanchor="bottom",
            yshift=2,
            font_size=11,
        )
    ticks = ["none", *(f"{n + 1}<br>{size}" for n, size in enumerate(sizes))]
    figure.update_xaxes(
        title="last scale kept, and its tokens", tickvals=list(range(levels + 1)), ticktext=ticks, ticks=""
    )
    figure.update_yaxes(title="energy left, %", range=[0, top * 1.12], rangemode="tozero", nticks=6)
    if energy.count_ > 1:
        caption = f"{caption}. Whiskers: 10th to 90th percentile over {energy.count_} motions.".lstrip(". ")
    return finish(figure, title=title, caption=caption, height=height, tick_lines=2)
