"""The guidance sweep, small enough to stand beside the slider that it is about. The page marks the slider's g on it."""

import plotly.graph_objects as go

from playground.analysis.results import Result
from playground.figures.language import sweep_plot

HEIGHT = 104  # pixels
_TITLES = ("FID (low is good)", "R-Precision (high is good)")


def small_sweep(result: Result) -> go.Figure:
    """FID and R-Precision (top 3 of 32) against g with 95 % intervals, one small panel each."""
    figure = sweep_plot({result.system: result}, title="", height=HEIGHT)
    figure.layout.annotations = [note for note in figure.layout.annotations if note.text == "real motion"]
    figure.update_traces(
        mode="lines+markers", text=None, marker={"size": 5}, hovertemplate="g = %{x}: %{y:.3f}<extra></extra>"
    )
    figure.update_layout(margin={"l": 36, "r": 6, "t": 18, "b": 20}, dragmode=False)
    figure.update_xaxes(title="", dtick=1, fixedrange=True)
    figure.update_yaxes(title="", nticks=4, fixedrange=True)
    for number, title in enumerate(_TITLES, 1):
        axis = str(number) if number > 1 else ""
        figure.add_annotation(
            text=title, showarrow=False, xref=f"x{axis} domain", yref=f"y{axis} domain", x=0, y=1, xanchor="left",
            yanchor="bottom", yshift=2, font={"size": 11},
        )  # fmt: skip
    return figure
