"""Edits and their borders, and pose strips: Figs 4, 9, 10 and 11 of LG-Tok from stored results."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go

from playground.analysis.motions import unpacked
from playground.analysis.results import NOT_MEASURED, Estimate, why_absent
from playground.figures.colors import ORIGINAL, system_color
from playground.figures.pictures import Actor
from playground.figures.tables import DASH, Results, Table, error_bars, measured_on, number
from playground.figures.theme import finish
from playground.figures.video import write_strip
from playground.limits import LIMITS
from playground.systems import SYSTEMS

KINDS = {
    "inpaint": "in-painting (the middle half)",
    "outpaint": "out-painting (the first and last quarter)",
    "prefix": "prefix kept (the second half is drawn)",
    "suffix": "suffix kept (the first half is drawn)",
}
BORDERS = {"source_mm": "recorded motion", "seam_mm": "edited", "unblended_mm": "edited, no blend"}


@dataclass(frozen=True)
class Picture:
    """A PNG as a notebook shows it."""

    png: bytes

    def _repr_png_(self) -> bytes:
        return self.png


def edits_table(results: Results) -> Table:
    """Every benchmark mask: how rough the borders are, and what stays exactly as it was."""
    rows = []
    for system, result in results.items():
        title = SYSTEMS[system].title
        if result is None:
            rows.append((title, why_absent(system), *[DASH] * 6))
            continue
        for row in result.rows:
            keys = (*BORDERS, "kept_mm", "plain_error_mm", "gap_m")
            cells = [number(Estimate.of(row.get(key))) for key in keys]
            rows.append((title, KINDS.get(row["kind"], row["kind"]), *cells))
    heads = ("system", "mask", *(f"jolt, {words}, mm" for words in BORDERS.values()),
             "kept frames moved by, mm", "error in them if decoded, mm", "gap closed, m")  # fmt: skip
    note = (
        "A jolt is the mean over joints of |x[f+1] - 2 x[f] + x[f-1]| at a border; a recorded motion has jolts of its"
        " own at the same place. The gap is how far on the floor the drawn frames missed the kept ones that follow."
    )
    return Table(heads, tuple(rows), "Ours: the benchmark masks", f"{measured_on(results)}\n{note}")


def seams_plot(results: Results) -> go.Figure:
    """Jolt at the borders by mask, with 95 % intervals over clips."""
    figure = go.Figure()
    result = next((found for found in results.values() if found is not None), None)
    if result is None:
        figure.add_annotation(text=NOT_MEASURED, showarrow=False, xref="paper", yref="paper", x=0.5, y=0.5)
        return finish(figure, title="Borders of edits")
    own = system_color(result.system)
    colors = {"source_mm": ORIGINAL, "seam_mm": own, "unblended_mm": system_color("momask")}
    for key, words in BORDERS.items():
        values = [Estimate.of(row.get(key)) for row in result.rows]
        figure.add_trace(
            go.Bar(
                x=[row["kind"] for row in result.rows], y=[value.mean for value in values], name=words,
                error_y=error_bars(values),
                marker={"color": colors[key].light}, meta={"dark": {"marker.color": colors[key].dark}},
                hovertemplate="%{y:.1f} mm" + f"<extra>{words}</extra>",
            )
        )  # fmt: skip
    figure.update_layout(barmode="group", legend={"orientation": "h", "y": 1.02, "yanchor": "bottom"})
    figure.update_yaxes(title="jolt at a border, mm")
    return finish(figure, title="Borders of edits", caption=result.line, heads=2)


def edit_strip(results: Results, kind: str) -> Picture | str:
    """The stored example of a kind: the motion before and after, pose by pose; a sentence where there is none."""
    result = next((found for found in results.values() if found is not None), None)
    if result is None:
        return NOT_MEASURED
    example = next((entry for entry in result.more["examples"] if entry["kind"] == kind), None)
    if example is None:
        return f"no example of {kind} is stored"
    spans = " and ".join(f"{start / LIMITS.fps:g} to {stop / LIMITS.fps:g} s" for start, stop in example["drawn"])
    rows = (
        (f"before: {example['caption']}", unpacked(example["source"]), ORIGINAL.light),
        (f"drawn anew, {spans}: {example['prompt']}", unpacked(example["motion"]), system_color(result.system).light),
    )
    facts = result.provenance
    note = f"{result.system}, checkpoint {facts['checkpoint'][:8]}, seed {example['seed']}; both motions are generated"
    return strip([Actor(name, joints.astype(np.float64), color) for name, joints, color in rows], note)


def prompt_strip(results: Results, prompt: str) -> Picture | str:
    """One row a system: the stored motion of a prompt; a sentence where there is none."""
    actors = []
    for system, result in results.items():
        row: Mapping[str, Any] = result.row(prompt=prompt) if result else {}
        if row:
            actors.append(_actor(system, row["motion"], prompt))
    if not actors:
        return f"{prompt}: {NOT_MEASURED}"
    line = next(result.line for result in results.values() if result is not None)
    return strip(actors[: LIMITS.max_figures], line)


def prompts_of(results: Results) -> list[tuple[str, bool]]:
    """(prompt, is it frequent in the training data) of the stored strips, each once."""
    found = [(row["prompt"], row["known"]) for result in results.values() if result for row in result.rows]
    return list(dict.fromkeys(found))


def _actor(system: str, motion: object, caption: str) -> Actor:
    joints = unpacked(motion).astype(np.float64)
    return Actor(SYSTEMS[system].title, joints, system_color(system).light, caption)


def strip(actors: Sequence[Actor], note: str) -> Picture:
    """A pose strip as a picture."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "strip.png"
        write_strip(actors, path, note=note)
        return Picture(path.read_bytes())
