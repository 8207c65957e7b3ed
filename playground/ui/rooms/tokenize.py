"""Room 1: a motion becomes tokens, scale by scale, and comes back; its tokens and its words under the microscope."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import gradio as gr

from playground.limits import LIMITS
from playground.ui.beside import MOST, beside_it
from playground.ui.chart import chart
from playground.ui.closer import Closer
from playground.ui.closerviews import bind_closer, closer_views
from playground.ui.cutting import HEIGHT as CURVE
from playground.ui.cutting import LABEL, cut, cuts_figure, part_choices, part_of
from playground.ui.energy import HEIGHT, LABELS
from playground.ui.errors import Noted, attach, message_place
from playground.ui.layout import panel, room_frame, stage_and_score, words
from playground.ui.links import arrival, asked, commits, link_door
from playground.ui.services import Services
from playground.ui.state import OWN_FILE, UPLOADED, State, Token, control
from playground.ui.tokenizing import NAME, Session, open_session, ready, run, scales_of, window_of
from playground.ui.uploads import Source, read_upload
from playground.ui.view import View

LEAD = (
    "Left, a motion; below, its tokens; right, what comes back from the tokens alone. Click a token to take it apart."
)
DOING, AGAIN, LOOKING = "Tokenizing", "Rebuilding", "Looking closely"
KINDS = [("1 to n", "upto"), ("only n", "only"), ("without n", "without")]
MARK_SCALES = """(n, kind) => {
  const stage = window.MotionStage?.get('tokenize');
  const all = kind === 'upto' && n >= (stage?.data?.tracks[0]?.levels.length ?? 0);
  stage?.setScale(all ? null : n, kind);
  window.mtpState?.keep('tokenize', ['scales'], [all ? null : kind === 'upto' ? n : `${kind}-${n}`]);
}"""


def opening_view(services: Services) -> View:
    """The room's first result: the first example, all scales."""
    return preset_view(services, services.opening_example().id)


def preset_view(services: Services, wanted: str) -> View:
    """The result for an example with its own caption, all scales."""
    example = services.example(wanted)
    return run(services, Session(wanted, Source(example.motion(), example.title), caption=example.caption))[1]


class Handlers:
    """What the controls do. Each returns the values of `everything` in `room`, or of its `parts`."""

    def __init__(self, services: Services, opening: View) -> None:
        self.services = services
        self.opening = opening
        self.closer = Closer(services, opening)

    def choose(self, wanted: str, held: Session | None) -> tuple[Any, ...]:
        """Another motion of the menu, with its own caption; as it is stored, where it is."""
        upload, system, beside = (held.upload, held.system, held.beside) if held else (None, "", ())
        how: dict[str, Any] = {"upload": upload, "system": system, "beside": beside}
        if wanted == UPLOADED and upload is not None:
            return self._show(Session(UPLOADED, upload, caption=upload.caption, **how))
        found = self.services.example(wanted)
        usual = system in ("", self.services.default_system().name) and not beside
        stored = self.services.preset(NAME, wanted) if usual else None
        if stored is not None:
            held = Session(wanted, caption=found.caption, **how)
            return self._told(held, stored)
        source = Source(found.motion(), found.title)
        return self._show(Session(wanted, source, caption=found.caption, **how))

    def bring(self, path: str | None, held: Session | None) -> tuple[Any, ...]:
        """A file of the visitor's own, with the caption that it carries, if any."""
        source = read_upload(path)
        system, beside = (held.system, held.beside) if held else ("", ())
        session = Session(
            UPLOADED, source, caption=source.caption, upload=source, system=system, beside=beside
        )  # fmt: skip
        return self._show(session, note=f"{source.title}: {source.note}")

    def again(self, text: str, held: Session | None) -> tuple[Any, ...]:
        """The same motion with another caption."""
        return self._show(self._open(held).forgetful(caption=text or ""))

    def move(self, second: float, held: Session | None) -> tuple[Any, ...]:
        """Another window of a long motion."""
        return self._show(self._open(held).forgetful(start=float(second), part=0))

    def cut(self, part: str | None, held: Session | None) -> tuple[Any, ...]:
        """A part of a long recording, between two still moments; ANYWHERE: the window where the slider stands."""
        session = self._open(held)
        number = int(part) if part and part.isascii() and part.isdigit() and len(part) < 4 else 0
        source, start = session.source, session.start
        if source:
            start = part_of(source.motion, number)[0] / LIMITS.fps if number else min(start, source.last_start)
        return self._show(session.forgetful(part=number, start=start))

    def point(self, held: Session | None, event: gr.EventData) -> tuple[Any, ...]:
        """A click on the speed curve: the part that it is in."""
        return self.cut(str(event.id), held)

    def change(self, system: str, held: Session | None) -> tuple[Any, ...]:
        """Another system."""
        return self._show(self._open(held).forgetful(system=str(system)))

    def join(self, systems: Sequence[str], held: Session | None) -> tuple[Any, ...]:
        """Other systems beside it."""
        return self._show(replace(self._open(held), beside=beside_it(self.services, systems)))

    def rebuild(self, used: float, kind: str, held: Session | None) -> tuple[Any, ...]:
        """The same tokens, another set of scales."""
        from playground.findings import ScaleSet

        session = ready(self.services, self._open(held))
        assert session.tokenized is not None
        count = len(session.tokenized.levels)  # the slider of a single scale has a second stop that means nothing
        held, view = run(self.services, session, ScaleSet.of(f"{kind}:{min(int(used), count)}", count))
        return self._parts(held, view)

    def stop_at(self, kind: str, held: Session | None, event: gr.EventData) -> tuple[Any, ...]:
        """A click on bar n: scales 1 to n, or n alone, or all but n."""
        used = max(1, int(event.id))
        return (*self.rebuild(used, kind, held), used)

    def arrive(self, held: Session | None, event: gr.EventData) -> tuple[Any, ...]:
        """What a link asks for. A file that its maker brought along is not here: the opening example stands in."""
        state = asked(event)
        wanted, upload, note = str(state["motion"] or ""), held.upload if held else None, ""
        if wanted.startswith(OWN_FILE) and upload is not None:
            part, start = int(state["part"]), float(state["start"])
            start = part_of(upload.motion, part)[0] / LIMITS.fps if part and upload.is_long else start
            session = Session(UPLOADED, upload, start, part, upload.caption, upload=upload)
        else:
            if wanted.startswith(OWN_FILE):
                note = f"This link was made with a file of its maker's own, {wanted.removeprefix(OWN_FILE)}; upload it."
            known = {example.id: example for example in self.services.examples()}
            found = known.get(wanted) or self.services.opening_example()
            source = Source(found.motion(), found.title)
            session = Session(found.id, source, caption=found.caption, upload=upload)
        session.caption = state.values.get("caption", session.caption)
        shipped = {system.name for system in self.services.shipped("tokenizer")}
        session.system = state.system if state.system in shipped else ""
        session.beside = beside_it(self.services, state["beside"] or ())
        session.wish = state["code"] if isinstance(state["selection"], Token) else None
        shown = [*self._show(session, note, state), gr.skip()]
        if state["wrong"]:
            shown[0], shown[1], shown[4], shown[5], _, shown[7], shown[-1] = self.closer.words(state["wrong"], shown[0])
        return tuple(shown)

    def _open(self, held: Session | None) -> Session:
        return open_session(self.services, held, self.opening)

    def _show(self, session: Session, note: str = "", state: State | None = None) -> tuple[Any, ...]:
        count = len(self.services.scales(session.system or self.services.default_system().name))
        scales = scales_of(state["scales"], count) if state else None
        held, view = run(self.services, session, scales)
        return self._told(held, view, note)

    def _told(self, held: Session, view: View, note: str = "") -> tuple[Any, ...]:
        held.caption = str(view.controls["caption"])
        own = [(f"{held.upload.title} · yours", UPLOADED)] if held.upload else []
        menu = gr.update(choices=[*own, *self.services.example_choices()], value=held.example)
        source = held.source
        last = max(0.1, round(source.last_start, 1), held.start) if source else 0.1
        window = gr.update(maximum=last, value=held.start)
        count = view.controls["count"]
        steps = gr.update(maximum=max(2, count), value=view.controls["scales"], interactive=count > 1)
        session, stage, *rest = self._parts(held, view)
        systems = held.system or self.services.default_system().name, list(held.beside)
        told = (menu, held.caption, window, steps, view.controls["kind"], *systems, *self._cuts(held))
        return session, Noted(stage, note), *rest, *told

    def _cuts(self, held: Session) -> tuple[Any, ...]:
        """For a recording longer than a window: where it would be cut. The whole box, the menu of parts, the curve."""
        if held.source is None or not held.source.is_long:
            return gr.update(visible=False), gr.skip(), gr.skip()
        found = cut(held.source.motion)
        menu = gr.update(choices=part_choices(found), value=str(held.part))
        return gr.update(visible=True), menu, cuts_figure(found, window_of(held))

    def _parts(self, held: Session, view: View) -> tuple[Any, ...]:
        bars = gr.update(value=view.charts["energy"], label=LABELS[view.controls["kind"]])
        return held, view.stage_json(), view.facts_html(), bars, "", "", "", ""


def room(services: Services) -> None:
    """Build the room inside the current tab."""
    opening = services.first_view(NAME, opening_view)
    session = gr.State(Session(), time_to_live=LIMITS.session_seconds)
    with room_frame(NAME):
        stage = stage_and_score(NAME, opening)
        with panel("A motion to tokens and back", LEAD, compare=True):
            with gr.Column(elem_classes=["mtp-view", "mtp-view-motion"], min_width=0):
                example, system, beside, upload, caption, go, ask, window, kind, scales = _controls(services, opening)
            message = message_place("tokenize-message")
            with gr.Column(elem_classes=["mtp-view", "mtp-view-motion"], min_width=0):
                facts = gr.HTML(opening.facts_html(), elem_id="tokenize-facts", apply_default_css=False)
                energy = chart(
                    opening.charts.get("energy"), label=LABELS["upto"], height=HEIGHT, elem_id="tokenize-energy",
                    show_label=True,
                )  # fmt: skip
            views = closer_views()
        words(NAME)
        door = link_door(NAME)
    do = Handlers(services, opening)
    parts = [session, stage, facts, energy, views.card, views.told, views.swapped, views.misled]
    box, part, start, curve = window
    everything = [*parts, example, caption, start, scales, kind, system, beside, box, part, curve]
    busy: dict[str, Any] = {"message": message, "stage": NAME, "doing": DOING}
    attach(example.input, do.choose, [example, session], everything, **busy)
    attach(system.input, do.change, [system, session], everything, **busy)
    attach(beside.input, do.join, [beside, session], everything, **busy)
    attach(upload.upload, do.bring, [upload, session], everything, **busy)
    for event in (caption.submit, go.click):
        attach(event, do.again, [caption, session], everything, **busy)
    attach(start.input, do.move, [start, session], everything, trigger_mode="always_last", **busy)
    attach(part.input, do.cut, [part, session], everything, trigger_mode="always_last", **busy)
    pointed = attach(curve.pick, do.point, [session], everything, trigger_mode="always_last", **busy)
    again: dict[str, Any] = {**busy, "doing": AGAIN, "trigger_mode": "always_last"}
    for change in (scales.change, kind.change):
        change(None, [scales, kind], None, js=MARK_SCALES, api_visibility="private")
    for event in (scales.input, kind.input):
        attach(event, do.rebuild, [scales, kind, session], parts, **again)
    attach(energy.pick, do.stop_at, [kind, session], [*parts, scales], **again)
    bind_closer(do.closer, views, ask, session, stage, {**again, "doing": LOOKING})

    arrival(door, do.arrive, [session], [*everything, views.wrong], room=NAME, **busy)
    own = ("start", "part", "scales", "selection", "code", "wrong")
    commits(NAME, {"motion": example}, example.input, forget=("caption", *own))
    commits(NAME, {"motion": upload}, upload.upload, forget=("caption", *own))
    commits(NAME, {"caption": caption}, caption.submit, go.click, forget=own[2:])
    commits(NAME, {"start": start}, start.input, forget=own[1:])
    commits(NAME, {"part": part}, part.input, pointed.then, forget=("start", *own[2:]))
    commits(NAME, {"system": system}, system.input, forget=own[2:])
    commits(NAME, {"beside": beside}, beside.input)


def _controls(services: Services, opening: View) -> tuple[Any, ...]:
    """The controls from top to bottom: motion, system, upload, caption, its buttons, window, scales."""
    shipped = services.shipped("tokenizer")
    usual = services.default_system().name if shipped else None
    with gr.Row(elem_classes=["mtp-line"]):
        example = gr.Dropdown(
            services.example_choices(), value=opening.controls.get("example"), label="Motion",
            elem_id="tokenize-example", scale=2, min_width=160,
        )  # fmt: skip
        system = gr.Dropdown(
            [(one.title, one.name) for one in shipped], value=usual, scale=1, visible=len(shipped) > 1,
            label=control(NAME, "system").label, elem_id="tokenize-system", min_width=120,
        )  # fmt: skip
        upload = gr.UploadButton(
            "Upload", file_count="single", size="sm", scale=0, min_width=72, elem_id="tokenize-upload"
        )
    beside = gr.Dropdown(
        [(one.title, one.name) for one in shipped], value=[], multiselect=True, max_choices=MOST,
        label=control(NAME, "beside").label, elem_id="tokenize-beside", elem_classes=["mtp-several"],
        visible=len(shipped) > 1,
    )  # fmt: skip
    with gr.Row(elem_classes=["mtp-line", "mtp-caption"]):
        caption = gr.Textbox(
            opening.controls.get("caption", ""), label=control(NAME, "caption").label,
            max_lines=1, elem_id="tokenize-caption", scale=1, min_width=160,
        )  # fmt: skip
        ask = gr.Button("What do the words do?", size="sm", elem_id="tokenize-ask", elem_classes=["mtp-quiet"])
        go = gr.Button("Tokenize", variant="primary", size="sm", scale=0, min_width=84, elem_id="tokenize-go")
    window = _window()
    count = int(opening.controls.get("count", 1))
    with gr.Row(elem_classes=["mtp-line", "mtp-scales"]):
        kind = gr.Radio(
            KINDS, value="upto", label="Rebuild from scale", elem_id="tokenize-kind", elem_classes=["mtp-segments"],
            scale=1, min_width=0,
        )  # fmt: skip
        scales = gr.Slider(
            1, max(count, 2), value=count, step=1, label=control(NAME, "scales").label, elem_id="tokenize-scales",
            scale=1, min_width=120,
        )  # fmt: skip
    return example, system, beside, upload, caption, go, ask, window, kind, scales


def _window() -> tuple[Any, ...]:
    """What is seen with a recording longer than a window: the box, the menu of parts, the slider, the speed curve."""
    with gr.Column(visible=False, elem_classes=["mtp-cuts"], elem_id="tokenize-cuts", min_width=0) as box:
        with gr.Row(elem_classes=["mtp-line"]):
            part = gr.Dropdown(
                [], value=None, label=control(NAME, "part").label, elem_id="tokenize-part", min_width=120, scale=1,
            )  # fmt: skip
            start = gr.Slider(
                0, 1, value=0, step=0.1, label=control(NAME, "start").label, elem_id="tokenize-start", min_width=160,
                scale=1,
            )  # fmt: skip
        curve = chart(None, label=LABEL, height=CURVE, elem_id="tokenize-curve", show_label=True)
    return box, part, start, curve
