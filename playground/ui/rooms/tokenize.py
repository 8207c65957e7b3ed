"""Room 1: a motion becomes tokens, scale by scale, and comes back."""

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import gradio as gr

from playground.analysis.residual import ScaleEnergy
from playground.errors import PlaygroundError
from playground.figures.residual import residual_bars
from playground.limits import LIMITS
from playground.ui.chart import chart
from playground.ui.errors import Noted, attach, message_place
from playground.ui.layout import panel, room_frame, stage_and_score, words
from playground.ui.links import arrival, asked, commits, link_door
from playground.ui.scenes import error_fact, token_facts, tokenized_scene
from playground.ui.services import Services
from playground.ui.state import OWN_FILE, UPLOADED, control
from playground.ui.uploads import Source, read_upload
from playground.ui.view import View

if TYPE_CHECKING:
    from playground.engine import Tokenized

NAME = "tokenize"
LEAD = (
    "Left, a motion. Below, the same motion as tokens, one row a scale. Right, what comes back from the tokens alone. "
    "Drag the slider to drop fine scales."
)
CHART_HEIGHT = 104
ENERGY = "% of energy missing after each scale; click a bar to stop there"
DOING, AGAIN = "Tokenizing", "Rebuilding"
MARK_SCALES = """(n) => {
  const stage = window.MotionStage?.get('tokenize');
  stage?.setScale(n < (stage.data?.tracks[0]?.levels.length ?? 0) ? n : null, 'upto');
  return n;
}"""


@dataclass
class Session:
    """What one visitor is looking at. Without a `source` it is the stored opening, known by its example id."""

    example: str = ""  # id of an example, or UPLOADED
    source: Source | None = None
    start: float = 0.0  # second at which the window begins
    caption: str = ""
    tokenized: "Tokenized | None" = None
    upload: Source | None = None  # stays in the menu when an example is chosen


def open_session(services: Services, session: Session | None, opening: View) -> Session:
    """The session with its source loaded; a forgotten or fresh one starts at the opening example."""
    found = session or Session()
    if found.source is None:
        wanted = found.example or str(opening.controls.get("example", ""))
        if not wanted:
            raise PlaygroundError("choose a motion or upload one first")
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


class Handlers:
    """What the controls do. Each returns the values of `everything` in `room`, or of its first four."""

    def __init__(self, services: Services, opening: View) -> None:
        self.services = services
        self.opening = opening

    def choose(self, wanted: str, held: Session | None) -> tuple[Any, ...]:
        """Another motion of the menu, with its own caption."""
        upload = held.upload if held else None
        if wanted == UPLOADED and upload is not None:
            return self._show(Session(UPLOADED, upload, caption=upload.caption, upload=upload))
        found = self.services.example(wanted)
        return self._show(Session(wanted, Source(found.motion(), found.title), 0.0, found.caption, upload=upload))

    def bring(self, path: str | None) -> tuple[Any, ...]:
        """A file of the visitor's own, with the caption that it carries, if any."""
        source = read_upload(path)
        session = Session(UPLOADED, source, caption=source.caption, upload=source)
        return self._show(session, note=f"{source.title}: {source.note}")

    def again(self, text: str, held: Session | None) -> tuple[Any, ...]:
        """The same motion with another caption."""
        held = open_session(self.services, held, self.opening)
        return self._show(replace(held, caption=text or "", tokenized=None))

    def move(self, second: float, held: Session | None) -> tuple[Any, ...]:
        """Another window of a long motion."""
        held = open_session(self.services, held, self.opening)
        return self._show(replace(held, start=float(second), tokenized=None))

    def rebuild(self, used: float, held: Session | None) -> tuple[Any, ...]:
        """The same tokens, fewer or more scales."""
        held, view = run(self.services, open_session(self.services, held, self.opening), int(used))
        return held, view.stage_json(), view.facts_html(), view.charts["energy"]

    def stop_at(self, held: Session | None, event: gr.EventData) -> tuple[Any, ...]:
        """A click on bar n: scales 1 to n."""
        used = max(1, int(event.id))
        return (*self.rebuild(used, held), used)

    def arrive(self, held: Session | None, event: gr.EventData) -> tuple[Any, ...]:
        """What a link asks for. A file that its maker brought along is not here: the opening example stands in."""
        state = asked(event)
        wanted, upload, note = str(state["motion"] or ""), held.upload if held else None, ""
        if wanted.startswith(OWN_FILE) and upload is not None:
            session = Session(UPLOADED, upload, float(state["start"]), upload.caption, upload=upload)
        else:
            if wanted.startswith(OWN_FILE):
                note = f"This link was made with a file of its maker's own, {wanted.removeprefix(OWN_FILE)}; upload it."
            known = {example.id: example for example in self.services.examples()}
            found = known.get(wanted) or self.services.opening_example()
            session = Session(found.id, Source(found.motion(), found.title), 0.0, found.caption, upload=upload)
        session = replace(session, caption=state.values.get("caption", session.caption))
        scales = state["scales"]
        return self._show(session, note, scales.n if scales and scales.kind == "upto" else None)

    def _show(self, session: Session, note: str = "", scales: int | None = None) -> tuple[Any, ...]:
        held, view = run(self.services, session, scales)
        source = held.source
        assert source is not None
        own = [(f"{held.upload.title} · yours", UPLOADED)] if held.upload else []
        menu = gr.update(choices=[*own, *self.services.example_choices()], value=held.example)
        last = max(0.1, round(source.last_start, 1))
        window = gr.update(visible=source.is_long, maximum=last, value=held.start)
        steps = gr.update(maximum=max(2, view.controls["count"]), value=view.controls["scales"])
        stage = Noted(view.stage_json(), note)
        return held, stage, view.facts_html(), view.charts["energy"], menu, held.caption, window, steps


def room(services: Services) -> None:
    """Build the room inside the current tab."""
    opening = services.first_view(NAME, opening_view)
    session = gr.State(Session(), time_to_live=LIMITS.session_seconds)
    with room_frame(NAME):
        stage = stage_and_score(NAME, opening)
        with panel("A motion becomes tokens, and comes back", LEAD):
            example, upload, caption, go, start, scales = _controls(services, opening)
            message = message_place("tokenize-message")
            facts = gr.HTML(opening.facts_html(), elem_id="tokenize-facts", apply_default_css=False)
            energy = chart(
                opening.charts.get("energy"),
                label=ENERGY,
                height=CHART_HEIGHT,
                elem_id="tokenize-energy",
                show_label=True,
            )
        words(NAME)
        door = link_door(NAME)
    do = Handlers(services, opening)
    parts = [session, stage, facts, energy]
    everything = [*parts, example, caption, start, scales]
    attach(example.input, do.choose, [example, session], everything, message, stage=NAME, doing=DOING)
    attach(upload.upload, do.bring, [upload], everything, message, stage=NAME, doing=DOING)
    for event in (caption.submit, go.click):
        attach(event, do.again, [caption, session], everything, message, stage=NAME, doing=DOING)
    attach(
        start.input, do.move, [start, session], everything, message, stage=NAME, doing=DOING, trigger_mode="always_last"
    )
    scales.change(None, [scales], None, js=MARK_SCALES, api_visibility="private")
    attach(
        scales.input, do.rebuild, [scales, session], parts, message, stage=NAME, doing=AGAIN, trigger_mode="always_last"
    )
    attach(
        energy.pick,
        do.stop_at,
        [session],
        [*parts, scales],
        message,
        stage=NAME,
        doing=AGAIN,
        trigger_mode="always_last",
    )

    arrival(door, do.arrive, [session], everything, message, room=NAME, stage=NAME, doing=DOING)
    own = ("caption", "start", "scales", "selection")
    commits(NAME, {"motion": example}, example.input, forget=own)
    commits(NAME, {"motion": upload}, upload.upload, forget=own)
    commits(NAME, {"caption": caption}, caption.submit, go.click, forget=("scales", "selection"))
    commits(NAME, {"start": start}, start.release, forget=("scales", "selection"))
    commits(NAME, {"scales": scales}, scales.change)


def _controls(services: Services, opening: View) -> tuple[Any, ...]:
    """The controls from top to bottom: motion, upload, caption, button, window, scales."""
    with gr.Row(elem_classes=["mtp-line"]):
        example = gr.Dropdown(
            services.example_choices(), value=opening.controls.get("example"), label="Motion",
            elem_id="tokenize-example", scale=1, min_width=160,
        )  # fmt: skip
        upload = gr.UploadButton(
            "Upload", file_count="single", size="sm", scale=0, min_width=84, elem_id="tokenize-upload"
        )
    with gr.Row(elem_classes=["mtp-line"]):
        caption = gr.Textbox(
            opening.controls.get("caption", ""), label=control(NAME, "caption").label,
            max_lines=1, elem_id="tokenize-caption", scale=1, min_width=160,
        )  # fmt: skip
        go = gr.Button("Tokenize", variant="primary", size="sm", scale=0, min_width=84, elem_id="tokenize-go")
    start = gr.Slider(
        0, 1, value=0, step=0.1, visible=False, elem_id="tokenize-start",
        label=control(NAME, "start").label,
    )  # fmt: skip
    count = int(opening.controls.get("count", 1))
    scales = gr.Slider(
        1, max(count, 2), value=count, step=1, label=control(NAME, "scales").label, elem_id="tokenize-scales"
    )
    return example, upload, caption, go, start, scales
