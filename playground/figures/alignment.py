"""Words by time: where a model looks in "A then B" and in "B then A", and whether motions keep the order (CASIM)."""

from collections.abc import Mapping
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from playground.analysis.results import NOT_MEASURED, Estimate, why_absent
from playground.figures.tables import DASH, Results, Table, measured_on, number
from playground.figures.theme import finish, scale_colors
from playground.systems import SYSTEMS


def order_table(results: Results) -> Table:
    """One row a system: share of motions that keep the order, over all sentences and by pair; mean lag of attention."""
    pairs = list(dict.fromkeys(
        (row["first"], row["second"]) for result in results.values() if result for row in result.rows
    ))  # fmt: skip
    heads = ("system", "order kept, %", *(f"{first}, {second}" for first, second in pairs), "lag of attention")
    rows: list[tuple[str, ...]] = []
    for system, result in results.items():
        title = SYSTEMS[system].title
        if result is None:
            rows.append((title, why_absent(system), *[DASH] * (len(pairs) + 1)))
            continue
        found = [result.row(first=first, second=second) for first, second in pairs]
        kept = [Estimate.of(row.get("kept")) for row in found]
        means = [value.mean for value in kept if value.mean is not None]
        lags = [row["lag"] for row in result.rows if row["lag"] is not None]
        rows.append((
            title,
            number(Estimate(sum(means) / len(means) if means else None), 100),
            *(number(Estimate(value.mean), 100) for value in kept),
            number(Estimate(sum(lags) / len(lags) if lags else None)),
        ))  # fmt: skip
    note = "Half of all motions would keep the order by chance. Lag: how much later the words of the second clause are"
    note += " looked at, as a share of the motion; 0 where time plays no part."
    return Table(heads, tuple(rows), "Ours: A then B", f"{note}\n{measured_on(results)}".strip())


def alignment_maps(results: Results, system: str, first: str, second: str) -> go.Figure:
    """Two heat maps of one system: the sentence with the action `first` first, and the other way round.

    Every word is drawn on its own ramp, because some words (full stops, marks) take most of the attention whatever the
    motion does. Where there is no attention to words, the figure says why.
    """
    orders = ((first, second), (second, first))
    found = results.get(system)
    rows = [found.row(first=one, second=other) if found else {} for one, other in orders]
    heads = [str(row.get("prompt", f"{one}, then {other}")) for row, (one, other) in zip(rows, orders, strict=True)]
    figure = make_subplots(1, 2, horizontal_spacing=0.16, subplot_titles=heads)
    figure.update_annotations(font={"size": 12}, yshift=2)
    for column, row in enumerate(rows, 1):
        if row.get("weights"):
            _map(figure, row, column)
    if not figure.data:
        why = rows[0].get("why") or (why_absent(system) if found is None else NOT_MEASURED)
        figure.add_annotation(text=why, showarrow=False, xref="paper", yref="paper", x=0.5, y=0.5)
    lines = [SYSTEMS[system].title, str(rows[0].get("what") or ""), found.line if found else ""]
    caption = "; ".join(line for line in lines if line)
    return finish(figure, title="Where it looks, word by word", caption=caption, left=90, heads=1)


def _map(figure: go.Figure, row: Mapping[str, Any], column: int) -> None:
    light, dark = ([[n / 8, color] for n, color in enumerate(ramp)] for ramp in scale_colors(9))
    words, weights = row["words"], row["weights"]
    names = [f"{place + 1} {word}" for place, word in enumerate(words)]
    step = row["seconds"] / len(weights)
    lines = list(zip(*weights, strict=True))  # [W][steps]
    figure.add_trace(
        go.Heatmap(
            z=[[value / (max(line) or 1.0) for value in line] for line in lines], x0=step / 2, dx=step, y=names,
            zmin=0.0, zmax=1.0, colorscale=light, showscale=False, meta={"dark": {"colorscale": dark}},
            customdata=lines, hovertemplate="%{y}, %{x:.1f} s: %{customdata:.4f}<extra></extra>",
        ), 1, column,
    )  # fmt: skip
    figure.update_xaxes(title="seconds", row=1, col=column)
    figure.update_yaxes(autorange="reversed", type="category", row=1, col=column)
