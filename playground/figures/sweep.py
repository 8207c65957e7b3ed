"""The guidance sweep small enough to stand beside the slider that it is about, with the slider's g marked on it."""

import plotly.graph_objects as go

from playground.analysis.results import Result
from playground.figures.language import sweep_plot

HEIGHT = 112  # pixels
NOW = "now"  # the name of the lines that stand at the slider's g; the browser moves them
_TITLES = ("FID, lower is better", "R-Precision top 3, higher is better")


def small_sweep(result: Result, g: float) -> go.Figure:
    """FID and R-Precision against g with 95 % intervals, one small panel each, and a line at g in both."""
    figure = sweep_plot({result.system: result}, title="", height=HEIGHT)
    figure.layout.annotations = [note for note in figure.layout.annotations if note.text == "real motion"]
    figure.update_traces(mode="lines+markers", text=None, marker={"size": 5})
    figure.update_layout(margin={"l": 36, "r": 6, "t": 18, "b": 20}, dragmode=False)
    figure.update_xaxes(title="", dtick=1, fixedrange=True)
    figure.update_yaxes(title="", nticks=4, fixedrange=True)
    for number, title in enumerate(_TITLES, 1):
        axis = str(number) if number > 1 else ""
        figure.add_annotation(
            text=title, showarrow=False, xref=f"x{axis} domain", yref=f"y{axis} domain", x=0, y=1, xanchor="left",
            yanchor="bottom", yshift=2, font={"size": 11},
        )  # fmt: skip
        figure.add_shape(
            type="line", name=NOW, xref=f"x{axis}", yref=f"y{axis} domain", x0=g, x1=g, y0=0, y1=1,
            line={"color": "#d55e00", "width": 2},
        )  # fmt: skip
    return figure
