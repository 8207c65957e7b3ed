"""Seconds a motion: our side of Table 9 of LG-Tok, from stored results."""

import plotly.graph_objects as go

from playground.analysis.cited import cited
from playground.analysis.results import Estimate, Result, why_absent
from playground.figures.colors import system_color
from playground.figures.tables import DASH, Results, Table, measured_on, number, significant
from playground.figures.theme import finish
from playground.systems import SYSTEMS

_ALONE = ("median", "best")


def table9(results: Results) -> Table:
    """Mean, median and best of single generations, and what of it is the decoder."""
    rows = []
    for system, result in results.items():
        title = SYSTEMS[system].title
        if result is None:
            rows.append((title, why_absent(system), *[DASH] * 3))
        else:
            rows += [
                (title, row["what"], number(Estimate.of(row["seconds"])), *(significant(row[k]) for k in _ALONE))
                for row in result.rows
            ]  # fmt: skip
    machines = "\n".join(dict.fromkeys(machine_line(result) for result in results.values() if result is not None))
    heads = ("system", "part", "mean, s", "median, s", "best, s")
    return Table(heads, tuple(rows), "Ours: one motion at a time", f"{measured_on(results)}\n{machines}".strip())


def machine_line(result: Result) -> str:
    """Where the seconds were taken."""
    machine, frames = result.provenance["machine"], result.provenance["frames"]
    return (
        f"{frames} frames on {machine['processor']}, {machine['device']}, {machine['threads']} of {machine['cores']}"
        f" cores, load {machine['load']:.1f}, torch {machine['torch']}"
    )


def times_plot(results: Results) -> go.Figure:
    """Seconds a motion on a logarithmic axis, the paper's on its machine and ours on ours."""
    bars = [(str(name), float(seconds), str(name), False) for name, seconds in cited("table9").rows if seconds]
    for system, result in results.items():
        mean = result.estimate("seconds", what="text to motion").mean if result else None
        if mean is not None:
            bars.append((f"{SYSTEMS[system].title}, here", mean, system, True))
    bars.sort(key=lambda bar: bar[1])
    colors = [system_color(name) for _, _, name, _ in bars]
    figure = go.Figure(
        go.Bar(
            x=[seconds for _, seconds, _, _ in bars], y=[label for label, _, _, _ in bars], orientation="h",
            marker={"color": [color.light for color in colors], "opacity": [1.0 if own else 0.55 for *_, own in bars]},
            meta={"dark": {"marker.color": [color.dark for color in colors]}}, showlegend=False,
            text=[significant(seconds, 2) for _, seconds, _, _ in bars], textposition="outside", cliponaxis=False,
            hovertemplate="%{y}: %{x:.3f} s<extra></extra>",
        )
    )  # fmt: skip
    figure.update_xaxes(type="log", title="seconds a motion, batch 1")
    caption = "Pale: the paper's, on one RTX 4090. " + "; ".join(
        machine_line(result) for result in results.values() if result is not None
    )
    return finish(figure, title="Inference time", caption=caption, height=130 + 26 * len(bars), left=170, right=60,
                  tick_lines=2)  # fmt: skip
