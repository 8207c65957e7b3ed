"""What each level of a tokenizer carries: error, energy and coupling against the levels kept, several side by side."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from playground.analysis.results import NOT_TRAINED, Estimate, Result, why_absent
from playground.figures.colors import SystemColor, system_color
from playground.figures.tables import DASH, Results, Table, error_bars, number
from playground.figures.theme import finish, scale_colors
from playground.systems import SYSTEMS

KEYS = {  # column of a stored result -> name of an axis
    "mpjpe_mm": "MPJPE, mm", "energy": "energy of the latent left, share", "fid": "FID of rebuilt motions",
}  # fmt: skip
AGAINST = {"kept": "levels kept", "tokens": "tokens kept, of the longest motion"}
_HUES = ("#0072b2", "#d55e00", "#009e73", "#a3860a"), ("#3b9fe0", "#f0843c", "#2fc296", "#d3c93c")
_DASHES = ("solid", "dash", "dot", "dashdot")


@dataclass(frozen=True, eq=False)
class Carried:
    """Levels of one tokenizer as stored results hold them; rows and between are empty where there is none, and `why`
    then says so."""

    title: str
    color: SystemColor
    rows: Sequence[dict[str, Any]] = ()
    between: Sequence[Sequence[float | None]] = ()
    why: str = ""


def of_systems(results: Results) -> list[Carried]:
    """From the stored item `levels`, one system each."""
    return [
        Carried(SYSTEMS[system].title, system_color(system), why=why_absent(system, draws=False))
        if result is None
        else Carried(SYSTEMS[system].title, system_color(system), result.rows, result.more["between"])
        for system, result in results.items()
    ]


def of_runs(stored: Result | None, table: str) -> list[Carried]:
    """From the rows of one table of the stored ablations."""
    found = []
    for place, row in enumerate(row for row in (stored.rows if stored else []) if row["table"] == table):
        color = SystemColor(_HUES[0][place % 4], _HUES[1][place % 4], _DASHES[place % 4])
        if row["status"] == NOT_TRAINED:
            found.append(Carried(row["label"], color, why=NOT_TRAINED))
        else:
            found.append(Carried(row["label"], color, row["levels"], row["between"]))
    return found


def kept_plot(
    tokenizers: Sequence[Carried], key: str = "mpjpe_mm", against: str = "kept", caption: str = ""
) -> go.Figure:
    """A line a tokenizer: `key` (of KEYS) against the number of levels or of tokens kept. Absent ones are named."""
    figure = go.Figure()
    for one in tokenizers:
        if not one.rows:
            continue
        values = [Estimate.of(row[key]) for row in one.rows]
        figure.add_trace(
            go.Scatter(
                x=[row[against] for row in one.rows], y=[value.mean for value in values],
                error_y=error_bars(values), mode="lines+markers", name=one.title, showlegend=True,
                line={"color": one.color.light, "dash": one.color.dash, "width": 1.5},
                meta={"dark": {"line.color": one.color.dark}},
                hovertemplate="%{x}: %{y:.4g}<extra>" + one.title + "</extra>",
            )
        )  # fmt: skip
    if not figure.data:
        figure.add_annotation(text=NOT_TRAINED, showarrow=False, xref="paper", yref="paper", x=0.5, y=0.5)
    figure.update_xaxes(title=AGAINST[against], rangemode="tozero")
    figure.update_yaxes(title=KEYS[key], rangemode="tozero")
    return finish(figure, title=f"{KEYS[key]} against {against}", caption=_with_absent(caption, tokenizers), right=24)


def levels_table(tokenizers: Sequence[Carried], caption: str = "") -> Table:
    """Every level of every tokenizer: tokens so far, error, energy left, FID, and coupling with what it leaves."""
    rows: list[tuple[str, ...]] = []
    for one in tokenizers:
        if not one.rows:
            rows.append((one.title, one.why, *[DASH] * 5))
        for row in one.rows:
            cells = [number(Estimate.of(row[key])) for key in ("mpjpe_mm", "energy", "fid", "coupling")]
            rows.append((one.title, str(row["kept"]), str(row["tokens"]), *cells))
    heads = ("tokenizer", "levels kept", "tokens", "MPJPE, mm", "energy left", "FID", "coupling with what is left")
    note = "Coupling: size of the cross-covariance of a level and the residual after it, 0 to 1."
    return Table(heads, tuple(rows), "Level by level", f"{note}\n{caption}".strip())


def between_maps(tokenizers: Sequence[Carried], caption: str = "") -> go.Figure:
    """A square a tokenizer: the coupling of every level with every other one, on one colour ramp from 0 to 1."""
    shown = [one for one in tokenizers if one.rows]
    figure = make_subplots(1, max(len(shown), 1), subplot_titles=[one.title for one in shown], horizontal_spacing=0.06)
    figure.update_annotations(font={"size": 12}, yshift=2)
    light, dark = ([[n / 8, color] for n, color in enumerate(ramp)] for ramp in scale_colors(9))
    for column, one in enumerate(shown, 1):
        names = [str(level) for level in range(1, len(one.between) + 1)]
        values = [[None if value is None else round(value, 4) for value in line] for line in one.between]
        figure.add_trace(
            go.Heatmap(
                z=values, x=names, y=names, zmin=0.0, zmax=1.0, colorscale=light, showscale=column == len(shown),
                meta={"dark": {"colorscale": dark}}, colorbar={"thickness": 8, "outlinewidth": 0, "ticks": ""},
                hovertemplate="levels %{x} and %{y}: %{z:.3f}<extra></extra>",
            ), 1, column,
        )  # fmt: skip
        figure.update_xaxes(title="level", type="category", row=1, col=column)
        figure.update_yaxes(
            title="level" if column == 1 else "", type="category", autorange="reversed", row=1, col=column
        )
    if not shown:
        figure.add_annotation(text=NOT_TRAINED, showarrow=False, xref="paper", yref="paper", x=0.5, y=0.5)
    return finish(figure, title="Coupling of the levels", caption=_with_absent(caption, tokenizers), heads=1)


def _with_absent(caption: str, tokenizers: Sequence[Carried]) -> str:
    absent = [f"{one.title}: {one.why}" for one in tokenizers if not one.rows]
    return "; ".join(part for part in (caption, *absent) if part)
