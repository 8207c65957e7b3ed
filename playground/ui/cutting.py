"""Where a long recording would be cut (systems.md E2), for the panel of Tokenize: its speed, its parts, the window.

Parts lie between still moments and fit into what a tokenizer sees at once. They are counted from 1; part 0 stands for
a window that begins anywhere.
"""

from typing import TYPE_CHECKING

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.motion import Motion
from playground.ui.uploads import WINDOW

if TYPE_CHECKING:
    from playground.data.segment import Segmentation

SEED, LONGEST = 0, WINDOW / LIMITS.fps  # of the cuts; seconds of the longest part
HEIGHT = 104  # pixels of the curve
POINTS = 1500  # of the curve at most
LABEL = "Mean speed, m/s, cut at still moments: click a part"
ANYWHERE = "0"
_SHADE = "rgba(91, 110, 225, 0.24)"  # reads on a light and on a dark page


def cut(motion: Motion) -> "Segmentation":
    """The cuts of a recording of at least two poses; the same ones every time."""
    from playground.data.segment import segment

    return segment(motion.joints, motion.fps, SEED, longest=LONGEST)


def part_of(motion: Motion, part: int) -> tuple[int, int]:
    """First pose of a part and the pose after its last. PlaygroundError if there is no such part."""
    spans = cut(motion).spans
    if not 1 <= part <= len(spans):
        raise PlaygroundError(f"part {part} was asked for; this recording has the parts 1 to {len(spans)}")
    return spans[part - 1]


def part_choices(found: "Segmentation") -> list[tuple[str, str]]:
    """(what the menu says, value) of a window anywhere and of every part."""
    parts = [
        (f"{n}: {start / found.fps:.1f} to {stop / found.fps:.1f} s", str(n))
        for n, (start, stop) in enumerate(found.spans, 1)
    ]
    return [("by the slider", ANYWHERE), *parts]


def cuts_figure(found: "Segmentation", window: tuple[int, int]) -> str:
    """Plotly JSON text: the speed curve with its cuts, made to fit the panel; the window (poses) is shaded.

    customdata is everywhere the number of the part, so that a click anywhere chooses one.
    """
    from playground.figures.segments import segments_plot

    figure = segments_plot(found, title="", height=HEIGHT)
    curve, dots = figure.data
    top, every = float(found.speed.max()) * 1.08 or 1.0, -(-len(found.speed) // POINTS)
    part_at = [n for n, (start, stop) in enumerate(found.spans, 1) for _ in range(start, stop)]
    curve.update(x=curve.x[::every], y=curve.y[::every], customdata=part_at[::every])
    dots.customdata = [part_at[frame] for frame in found.minima.tolist()]
    edges = [(start / found.fps, stop / found.fps) for start, stop in found.spans]
    figure.add_bar(
        x=[(low + high) / 2 for low, high in edges], width=[high - low for low, high in edges], y=[top] * len(edges),
        opacity=0.0, customdata=list(range(1, len(edges) + 1)), name="part",
        hovertext=[f"part {n}, {low:.1f} to {high:.1f} s" for n, (low, high) in enumerate(edges, 1)],
        hovertemplate="%{hovertext}<extra></extra>",
    )  # fmt: skip
    for trace in figure.data:
        trace.meta = {**(trace.meta or {}), "ring": False}
    start, stop = (edge / found.fps for edge in window)
    figure.add_vrect(x0=start, x1=stop, fillcolor=_SHADE, line_width=0, layer="below", name="window")
    figure.layout.annotations = ()
    figure.update_layout(margin={"l": 30, "r": 2, "t": 4, "b": 22}, bargap=0, dragmode=False)
    figure.update_xaxes(title="", ticksuffix=" s", nticks=8)
    figure.update_yaxes(title="", nticks=3, range=[0, top])
    return str(figure.to_json())
