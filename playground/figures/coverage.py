"""How codebooks are used over the scales, several systems on one axis: codes used, perplexity, share of the top k."""

from collections.abc import Mapping

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from playground.analysis.usage import CodeUsage
from playground.errors import PlaygroundError
from playground.figures.colors import system_color
from playground.figures.theme import HEIGHT, finish, listed


def usage_lines(
    usages: Mapping[str, CodeUsage],
    k: int,
    *,
    titles: Mapping[str, str] | None = None,
    caption: str = "",
    height: int = HEIGHT,
) -> go.Figure:
    """Three panels over the scales, all in per cent: codes used, perplexity / codes, tokens that the k most used codes
    make up.

    usages: system name -> usage. Systems of one number of scales share its numbers as axis; others share the way from
    the coarsest scale (0) to the finest (1). PlaygroundError without a system or for k below 1.
    """
    if not usages or k < 1:
        raise PlaygroundError(f"code usage over the scales needs a system and a k of at least 1, got k {k}")
    counts = {len(usage.counts_) for usage in usages.values()}
    shared = counts.pop() if len(counts) == 1 else None
    heads = ("codes used, %", "perplexity / codes, %", f"tokens of the {k} most used codes, %")
    figure = make_subplots(1, 3, horizontal_spacing=0.06, subplot_titles=heads)
    figure.update_annotations(font={"size": 12}, yshift=2)
    for place, (name, usage) in enumerate(usages.items()):
        _lines(figure, name, usage, k, shared is not None, (titles or {}).get(name, name))
        if len(usages) > 1:
            _name(figure, place, name, (titles or {}).get(name, name))
    if shared is not None:
        ticks = list(range(1, shared + 1))
        figure.update_xaxes(title="scale, coarse to fine", tickvals=ticks, range=[0.6, shared + 0.4], ticks="")
    else:
        figure.update_xaxes(title="scale, coarse (0) to fine (1)", range=[-0.04, 1.04], nticks=5)
    figure.update_yaxes(range=[0, 104], nticks=6)
    return finish(figure, caption=caption, height=height, heads=1)


def _lines(figure: go.Figure, name: str, usage: CodeUsage, k: int, numbered: bool, label: str) -> None:
    color, count = system_color(name), len(usage.counts_)
    scales = np.arange(1, count + 1)
    x = scales if numbered else (scales - 1) / max(count - 1, 1)
    sizes = np.array(usage.codes_)
    values = (usage.used_, usage.perplexity_ / sizes, usage.coverage(k))
    for column, share in enumerate(values, start=1):
        figure.add_trace(
            go.Scatter(
                x=listed(x), y=listed(100 * share), mode="lines+markers", name=label, showlegend=False,
                customdata=scales.tolist(), line={"color": color.light, "dash": color.dash, "width": 2},
                marker={"size": 7, "color": color.light},
                meta={"dark": {"line.color": color.dark, "marker.color": color.dark}},
                hovertemplate="scale %{customdata}: %{y:.1f} %" + f"<extra>{label}</extra>",
            ),
            1,
            column,
        )  # fmt: skip


def _name(figure: go.Figure, place: int, name: str, label: str) -> None:
    """Names one below the other in the first panel, in the systems' colours."""
    color = system_color(name)
    figure.add_trace(
        go.Scatter(
            x=[figure.data[0].x[0]], y=[6 + 11 * place], mode="text", text=[label], textposition="middle right",
            hoverinfo="skip", showlegend=False, xaxis="x", yaxis="y", textfont={"color": color.light},
            meta={"dark": {"textfont.color": color.dark}},
        )
    )  # fmt: skip
