"""Room 1: a motion becomes tokens, scale by scale, and comes back."""

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import gradio as gr

from playground.analysis.residual import ScaleEnergy
from playground.errors import PlaygroundError
from playground.figures.residual import residual_bars
from playground.ui.chart import chart
from playground.ui.errors import Noted, attach, message_place
from playground.ui.layout import LEAVE_AFTER, panel, room_frame, stage_and_score, words
from playground.ui.scenes import error_fact, token_facts, tokenized_scene
from playground.ui.services import Services
from playground.ui.uploads import SUFFIXES, Source, read_upload
from playground.ui.view import View

if TYPE_CHECKING:
    from playground.engine import Tokenized

NAME = "tokenize"
LEAD = (
    "Left, the motion. Below, the same motion as tokens: one row a scale, coarse on top. Right, what comes back from "
    "those tokens alone."
)
CHART_HEIGHT = 104
ENERGY = "Energy still missing after 0, 1, 2 ... scales; click a bar to stop there"
DOING = "Tokenizing"
MARK_SCALES = """(n) => {
  const stage = window.MotionStage?.get('tokenize');
  stage?.setScale(n < (stage.data?.tracks[0]?.levels.length ?? 0) ? n : null, 'upto');
  return n;
}"""


@dataclass
class Session:
    """What one visitor is looking at. Without a `source` it is the stored opening, known by its example id."""

    example: str = ""
    source: Source | None = None
    start: float = 0.0
    caption: str = ""
    tokenized: "Tokenized | None" = None


def open_session(services: Services, session: Session | None, opening: View) -> Session:
    """The session with its source loaded; a forgotten or fresh one starts at the opening example."""
    found = session or Session()
    if found.source is None:
        wanted = found.example or str(opening.controls["example"])
        example = services.example(wanted)
        found = replace(found, example=wanted, source=Source(example.motion(), example.title))
        found.caption = found.caption or str(opening.controls["caption"])
    return found


def run(services: Services, session: Session, scales: int | None = None) -> tuple[Session, View]:
    """Tokenize what the session holds (unless it is already) and rebuild it from the first `scales` scales."""
    began = time.perf_counter()
    engine, system = services.engine(), services.default_system()
    if session.source is None:
        raise PlaygroundError("choose a motion or upload one first")
    tokenized = session.tokenized
    if tokenized is None:
        tokenized = engine.tokenize(session.source.window(session.start), session.caption, system=system.name)
    decoded = engine.reconstruct(tokenized, guidance=0.0, scales=scales)
    count = len(tokenized.levels)
    used = count if scales is None else min(scales, count)
    view = View(
        stage=tokenized_scene(system, tokenized, decoded, services.palettes(system.name)),
        facts=(error_fact(decoded), *token_facts(tokenized.levels, used)),
        charts={"energy": energy_bars(tokenized)},
        controls={"example": session.example, "caption": tokenized.caption, "scales": used, "count": count},
        seconds=time.perf_counter() - began,
    )
    return replace(session, tokenized=tokenized, caption=tokenized.caption), view


def energy_bars(tokenized: "Tokenized") -> str:
    """Bars of the energy left after each scale, without axes to fit the panel, as Plotly JSON text."""
    sizes = [level.size for level in tokenized.levels]
    figure = residual_bars(ScaleEnergy().fit([tokenized.residual_energy]), sizes, height=CHART_HEIGHT)
    figure.update_layout(margin={"l": 0, "r": 0, "t": 14, "b": 18})
    figure.update_xaxes(title="", ticktext=[str(n) for n in range(len(sizes) + 1)], showline=False)
    figure.update_yaxes(visible=False)
    return str(figure.to_json())


def opening_view(services: Services) -> View:
    """The room's first result: the first example, all scales."""
    example = services.opening_example()
    session = Session(example.id, Source(example.motion(), example.title), 0.0, example.caption)
    return run(services, session)[1]


def room(services: Services) -> None:
    """Build the room inside the current tab."""
    opening = services.first_view(NAME, opening_view)
    session = gr.State(Session(), time_to_live=LEAVE_AFTER)
    with room_frame("tokenize"):
        stage = stage_and_score("tokenize", opening)
        with panel("A motion becomes tokens, and comes back", LEAD):
            with gr.Row(elem_classes=["mtp-line"]):
                example = gr.Dropdown(
                    services.example_choices(), value=opening.controls.get("example"), label="Motion",
                    elem_id="tokenize-example", scale=1, min_width=160,
                )  # fmt: skip
                upload = gr.UploadButton(
                    "Upload", file_types=list(SUFFIXES), file_count="single", size="sm", scale=0, min_width=84,
                    elem_id="tokenize-upload",
                )  # fmt: skip
            with gr.Row(elem_classes=["mtp-line"]):
                caption = gr.Textbox(
                    opening.controls.get("caption", ""), label="Caption (the tokenizer reads it; may be empty)",
                    max_lines=1, elem_id="tokenize-caption", scale=1, min_width=160,
                )  # fmt: skip
                go = gr.Button("Tokenize", variant="primary", size="sm", scale=0, min_width=84, elem_id="tokenize-go")
            start = gr.Slider(
                0, 1, value=0, step=0.1, visible=False, elem_id="tokenize-start",
                label="This motion is longer than 9.8 s; the window that is tokenized starts at second",
            )  # fmt: skip
            count = int(opening.controls.get("count", 1))
            scales = gr.Slider(
                1, max(count, 2), value=count, step=1, label="Rebuild from scales 1 to", elem_id="tokenize-scales"
            )
            message = message_place("tokenize-message")
            facts = gr.HTML(opening.facts_html(), elem_id="tokenize-facts", apply_default_css=False)
            energy = chart(
                opening.charts.get("energy"),
                label=ENERGY,
                height=CHART_HEIGHT,
                elem_id="tokenize-energy",
                show_label=True,
            )
        words("tokenize")

    def show(held: Session, view: View, note: str = "") -> tuple[Any, ...]:
        assert held.source is not None
        window = gr.update(
            visible=held.source.is_long, maximum=max(0.1, round(held.source.last_start, 1)), value=held.start
        )
        steps = gr.update(maximum=max(2, view.controls["count"]), value=view.controls["scales"])
        chosen = held.example or None
        return (
            held, Noted(view.stage_json(), note), view.facts_html(), view.charts["energy"], chosen, held.caption,
            window, steps,
        )  # fmt: skip

    def choose(wanted: str) -> tuple[Any, ...]:
        found = services.example(wanted)
        held = Session(wanted, Source(found.motion(), found.title), 0.0, found.caption)
        return show(*run(services, held))

    def bring(path: str | None) -> tuple[Any, ...]:
        source = read_upload(path)
        return show(*run(services, Session(source=source)), note=f"{source.title}: {source.note}")

    def again(text: str, held: Session | None) -> tuple[Any, ...]:
        held = open_session(services, held, opening)
        return show(*run(services, replace(held, caption=text or "", tokenized=None)))

    def move(second: float, held: Session | None) -> tuple[Any, ...]:
        held = open_session(services, held, opening)
        return show(*run(services, replace(held, start=float(second), tokenized=None)))

    def rebuild(used: float, held: Session | None) -> tuple[Any, ...]:
        held, view = run(services, open_session(services, held, opening), int(used))
        return held, view.stage_json(), view.facts_html(), view.charts["energy"]

    def stop_at(held: Session | None, event: gr.EventData) -> tuple[Any, ...]:
        used = max(1, int(event.id))
        return (*rebuild(used, held), used)

    parts = [session, stage, facts, energy]
    everything = [*parts, example, caption, start, scales]
    attach(example.input, choose, [example], everything, message, stage="tokenize", doing=DOING)
    attach(upload.upload, bring, [upload], everything, message, stage="tokenize", doing=DOING)
    for event in (caption.submit, go.click):
        attach(event, again, [caption, session], everything, message, stage="tokenize", doing=DOING)
    attach(start.input, move, [start, session], everything, message, trigger_mode="always_last")
    scales.change(None, [scales], None, js=MARK_SCALES, api_visibility="private")
    attach(scales.input, rebuild, [scales, session], parts, message, trigger_mode="always_last")
    attach(energy.pick, stop_at, [session], [*parts, scales], message, trigger_mode="always_last")
