"""How often each code is used: histograms a scale, and the summary over scales (Fig 7 of LG-Tok)."""

from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from playground.analysis.results import Estimate
from playground.analysis.usage import CodeUsage
from playground.errors import PlaygroundError
from playground.figures.colors import system_color
from playground.figures.tables import Claim, Table, claims_table
from playground.figures.theme import HEIGHT, finish, listed, percent, readable, reference_line, scale_colors

_UNIT = "times even use"


def usage_histogram(
    usage: CodeUsage, scale: int, *, order: str = "sorted", title: str = "", caption: str = "", height: int = HEIGHT
) -> go.Figure:
    """One bar a code of scale `scale` (0-based), 1 being even use. customdata of a bar is its code id.

    order: "sorted" or "index", as in `CodeUsage.relative`.
    """
    _checked(usage, scale)
    values, codes = usage.relative(scale, order), _codes(usage, scale, order)
    light, dark = scale_colors(len(usage.counts_))
    counts = usage.counts_[scale][codes]
    figure = go.Figure(
        go.Bar(
            x=list(range(len(values))), y=listed(values), customdata=codes.tolist(), width=1.05, showlegend=False,
            marker={"color": light[scale], "line": {"width": 0}}, meta={"dark": {"marker.color": dark[scale]}},
            hovertext=[f"code {code}: {count} tokens" for code, count in zip(codes, counts, strict=True)],
            hovertemplate="%{hovertext}<br>%{y:.2f} times even use<extra></extra>",
        )
    )  # fmt: skip
    figure.add_hline(y=1, line=reference_line())
    figure.add_annotation(x=1, xref="paper", xanchor="left", xshift=4, y=1, text="even", showarrow=False, font_size=11)
    facts = f"{_facts(usage, scale)} of {len(values)}, {len(usage.dead_[scale])} dead"
    figure.add_annotation(
        x=1, xref="paper", xanchor="right", y=1, yref="paper", yanchor="bottom", text=facts, showarrow=False
    )
    words = "codes, most used first" if order == "sorted" else "code id"
    figure.update_xaxes(title=words, range=[-0.5, len(values) - 0.5], nticks=8)
    figure.update_yaxes(title=f"frequency, {_UNIT}", range=[0, max(1.2, float(values.max()) * 1.08)], nticks=6)
    return finish(figure, title=title, caption=caption, height=height, right=40, heads=1)


def usage_panels(
    usages: Mapping[str, CodeUsage],
    sizes: Sequence[int | None],
    *,
    order: str = "sorted",
    titles: Mapping[str, str] | None = None,
    title: str = "",
    caption: str = "",
    columns: int = 5,
) -> go.Figure:
    """A small panel a scale on one frequency axis. One system has the colours of the scales, several have their own.

    usages: system name -> usage, all with the same number of scales; sizes: tokens a scale, None where they differ;
    titles: system name -> the name to print. customdata of a point begins with "system.scale.code", scale from 1.
    Several systems are drawn over shares of the codebook, so that codebooks of different size compare.
    """
    names = list(usages)
    levels = len(sizes)
    if not names or any(len(usage.counts_) != levels for usage in usages.values()):
        raise PlaygroundError(f"usage panels need systems of {levels} scales each, one token count a scale")
    columns = min(columns, levels)
    rows = -(-levels // columns)
    tokens = ["" if size is None else f" · {size} token{'s' if size > 1 else ''}" for size in sizes]
    heads = [f"scale {n + 1}{words}" for n, words in enumerate(tokens)]
    if len(names) == 1:
        heads = [f"{head}<br>{_facts(usages[names[0]], n, 'perpl.')}" for n, head in enumerate(heads)]
    figure = make_subplots(
        rows, columns, shared_yaxes=True, horizontal_spacing=0.02, vertical_spacing=0.2, subplot_titles=heads
    )
    figure.update_annotations(font={"size": 11}, yshift=2)
    for level in range(levels):
        row, column = level // columns + 1, level % columns + 1
        for name in names:
            figure.add_trace(_curve(usages[name], level, order, name, len(names) == 1), row, column)
        figure.add_hline(y=1, line=reference_line(), row=row, col=column)
    if len(names) > 1:
        _name_curves(figure, usages, order, titles or {})
    _panel_axes(figure, list(usages.values()), order, rows, columns)
    return finish(figure, title=title, caption=caption, height=80 + 175 * rows, heads=2)


def usage_summary(
    usages: Mapping[str, CodeUsage],
    sizes: Sequence[int],
    *,
    titles: Mapping[str, str] | None = None,
    title: str = "",
    caption: str = "",
    height: int = HEIGHT,
) -> go.Figure:
    """Two panels over the scales: share of codes used, and perplexity as a share of the codebook."""
    figure = make_subplots(1, 2, horizontal_spacing=0.1, subplot_titles=("codes used, %", "perplexity / codes, %"))
    figure.update_annotations(font={"size": 12}, yshift=2)
    ticks = list(range(1, len(sizes) + 1))
    for name, usage in usages.items():
        color, label = system_color(name), (titles or {}).get(name, name)
        even = usage.perplexity_ / np.array(usage.codes_)
        for column, values in ((1, usage.used_), (2, even)):
            figure.add_trace(
                go.Scatter(
                    x=ticks, y=listed(100 * values), mode="lines+markers", name=label, showlegend=False,
                    line={"color": color.light, "dash": color.dash, "width": 2},
                    marker={"size": 7, "color": color.light},
                    meta={"dark": {"line.color": color.dark, "marker.color": color.dark}},
                    hovertemplate="scale %{x}: %{y:.1f} %" + f"<extra>{label}</extra>",
                ),
                1,
                column,
            )  # fmt: skip
            if np.isfinite(values[-1]):
                _end_label(figure, len(sizes), 100 * values[-1], label, column)
    figure.update_xaxes(
        title="scale, coarse to fine, and its tokens", tickvals=ticks, range=[0.6, len(sizes) + 0.4],
        ticktext=[f"{n}<br>{size}" for n, size in zip(ticks, sizes, strict=True)], ticks="",
    )  # fmt: skip
    for column in (1, 2):
        figure.update_yaxes(range=[0, 104], nticks=6, row=1, col=column)
    return finish(figure, title=title, caption=caption, height=height, heads=1, tick_lines=2)


def usage_claims(usages: Mapping[str, CodeUsage], titles: Mapping[str, str]) -> Table:
    """Fig. 7 in numbers: does the first system use its codes more evenly than each of the others?

    Evenness is the perplexity of the codes as a share of the codebook, mean over scales: of all, of the coarse half and
    of the fine half.
    """
    first, *others = usages
    half = len(usages[first].codes_) // 2
    parts = (("all scales", slice(None)), ("the coarse half", slice(half)), ("the fine half", slice(half, None)))

    def evenness(name: str, scales: slice) -> Estimate:
        shares = (usages[name].perplexity_ / np.asarray(usages[name].codes_))[scales]
        counted = shares.size and np.isfinite(shares).all()
        return Estimate(float(shares.mean())) if counted else Estimate(None, why="no token was counted")

    claims = [
        Claim(
            f"{titles[first]} uses its codes more evenly than {titles[other]}, {words}",
            evenness(first, scales), evenness(other, scales), lower=False,
        )
        for other in others
        for words, scales in parts
    ]  # fmt: skip
    note = "Perplexity of the codes as a share of the codebook, mean over scales; 1 is even use. One training each."
    return claims_table(claims, caption=note)


def _end_label(figure: go.Figure, x: int, y: float, text: str, column: int) -> None:
    figure.add_annotation(
        x=x, y=y, text=text, showarrow=False, xanchor="right", yanchor="top", yshift=-6, row=1, col=column
    )


def _checked(usage: CodeUsage, scale: int) -> None:
    if not 0 <= scale < len(usage.counts_):
        raise PlaygroundError(f"scales 0 to {len(usage.counts_) - 1} have a histogram; got {scale}")


def _codes(usage: CodeUsage, scale: int, order: str) -> NDArray[np.int64]:
    """The code ids in drawing order; equal counts stay in the order of their ids."""
    count = usage.counts_[scale]
    return np.argsort(-count, kind="stable") if order == "sorted" else np.arange(len(count))


def _facts(usage: CodeUsage, scale: int, word: str = "perplexity") -> str:
    """Used share and perplexity of one scale, on one line."""
    if not usage.totals_[scale]:
        return "no tokens counted"
    return f"{percent(usage.used_[scale])} used, {word} {readable(usage.perplexity_[scale])}"


def _curve(usage: CodeUsage, level: int, order: str, name: str, alone: bool) -> go.Scatter:
    """The frequencies of one scale as a stepped curve; over ids or ranks if alone, else over shares of the codebook."""
    values, codes = usage.relative(level, order), _codes(usage, level, order)
    x = np.arange(len(values), dtype=np.float64) if alone else 100.0 * (np.arange(len(values)) + 0.5) / len(values)
    if alone:
        light, dark = (ramp[level] for ramp in scale_colors(len(usage.counts_)))
        dash = "solid"
    else:
        color = system_color(name)
        light, dark, dash = color.light, color.dark, color.dash
    return go.Scatter(
        x=listed(x), y=listed(values), mode="lines", showlegend=False, name=name,
        customdata=[[f"{name}.{level + 1}.{code}", code] for code in codes.tolist()],
        line={"color": light, "width": 1.5, "shape": "hvh", "dash": dash}, fill="tozeroy" if alone else "none",
        fillcolor=_faded(light), meta={"dark": {"line.color": dark, "fillcolor": _faded(dark)}},
        hovertemplate="code %{customdata[1]}: %{y:.2f} times even use<extra></extra>",
    )  # fmt: skip


def _faded(color: str) -> str:
    red, green, blue = (int(color[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},0.35)"


def _name_curves(figure: go.Figure, usages: Mapping[str, CodeUsage], order: str, titles: Mapping[str, str]) -> None:
    """Names at the curves of the first panel, in the curves' colours and one below the other."""
    for n, name in enumerate(usages):
        figure.add_trace(
            go.Scatter(
                x=[98], y=[0], mode="text", text=[titles.get(name, name)], textposition="middle left", showlegend=False,
                hoverinfo="skip", name=name, textfont={"color": system_color(name).light},
                meta={"label": n, "dark": {"textfont.color": system_color(name).dark}},
            ),
            1,
            1,
        )  # fmt: skip


def _panel_axes(figure: go.Figure, usages: list[CodeUsage], order: str, rows: int, columns: int) -> None:
    """One frequency range for all panels, titles on the outer axes alone."""
    highest = max(float(usage.relative(n, order).max()) for usage in usages for n in range(len(usage.counts_)))
    top = max(1.5, highest * 1.05)
    labels = [trace for trace in figure.data if isinstance(trace.meta, dict) and "label" in trace.meta]
    for trace in labels:
        trace.y = [top * (0.92 - 0.12 * trace.meta["label"])]
    figure.update_yaxes(range=[0, top], nticks=4)
    figure.update_xaxes(nticks=4, showticklabels=True)
    several = len(usages) > 1
    words = "share of the codebook, %" if several else ("codes, most used first" if order == "sorted" else "code id")
    for column in range(1, columns + 1):
        figure.update_xaxes(title=words if column == (columns + 1) // 2 else "", row=rows, col=column)
    figure.update_yaxes(title=_UNIT, col=1)
