"""Room 6: a span of a motion drawn anew after words, everything else kept; before and after in sync."""

import json
from dataclasses import replace
from typing import Any

import gradio as gr

from playground.engine.editing import benchmark_span
from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.ui.drawing import MADE, Wish, made_name, read_changes, wish_values
from playground.ui.editing import (
    KINDS,
    NAME,
    EditSession,
    EditWish,
    editor_of,
    file_name,
    motion_of,
    open_source,
    opening_motion,
    opening_view,
    run,
    source_view,
)
from playground.ui.errors import Noted, attach, message_place
from playground.ui.layout import panel, room_frame, stage_and_score, words
from playground.ui.links import arrival, asked, commits, link_door
from playground.ui.services import Services
from playground.ui.state import OWN_FILE, control, parse
from playground.ui.uploads import read_upload
from playground.ui.view import View

LEAD = "Drag a span on the timeline, say what should happen there, and press Repaint. Hatched frames stay as they were."
OPENING, DOING, LAST = "Opening the motion", "Repainting", "Drawing your last generation"
WISHES = ("prompt", "kind", "from", "to", "seed", "g", "s", "anchor", "measured")  # keys of the table of controls
ANCHORS = [("stay in place", "place"), ("may move on the floor as one piece", "body")]
# The stage and the two numbers show one span: a drag writes the numbers, the numbers move the band.
SPANNING = """
const on = () => {
  const stage = window.MotionStage?.get('edit');
  if (stage) stage.setSpanMode(true);
  else setTimeout(on, 250);
};
on();
"""
READ_SPAN = """(start, stop) => {
  const span = window.MotionStage?.get('edit')?.state.span;
  return span ? [span[0] / 20, span[1] / 20] : [start, stop];
}"""
SHOW_SPAN = """(start, stop) => {
  const span = [Math.round(start * 20), Math.round(stop * 20)];
  if (start !== null && stop !== null && span[1] > span[0]) window.MotionStage?.restore('edit', { span });
}"""
KEEP = (
    "(motion, caption, system) => window.mtpState?.keep('edit', "
    f"{json.dumps(['motion', 'caption', 'system', *WISHES, 'start', 'selection'])}, "
    "[motion, caption || null, system === %s ? null : system])"
)  # another motion: what was asked of the one before goes


class Handlers:
    """What the controls do. A handler that shows a motion returns the values of `shown` in `room`: the session, stage,
    facts, seams, promise, menu, the motion's name and caption for the address, the window of a long file, start and end
    of the span, the system. Where the system may be another one, its own g and s follow."""

    def __init__(self, services: Services, opening: View) -> None:
        self.services = services
        self.opening = opening

    def choose(self, wanted: str, kind: str, held: EditSession) -> tuple[Any, ...]:
        """Another motion of the menu."""
        if wanted == held.name:
            return self._source(held, kind)
        caption = held.caption if wanted.startswith(MADE) else None
        return self._source(open_source(self.services, held, wanted, caption), kind)

    def bring(self, path: str | None, kind: str, held: EditSession) -> tuple[Any, ...]:
        """A file of the visitor's own."""
        source = read_upload(path)
        session = open_source(self.services, replace(held, upload=source), file_name(source))
        return self._source(session, kind, f"{source.title}: {source.note}")

    def move(self, second: float, kind: str, held: EditSession) -> tuple[Any, ...]:
        """Another window of a long file."""
        session = self._held(held)
        return self._source(open_source(self.services, session, session.name, session.caption, float(second)), kind)

    def last(self, address: str, kind: str, held: EditSession) -> tuple[Any, ...]:
        """What the room Generate shows, by its address, with its system where that can edit."""
        state = parse(address)
        wish = Wish.checked(*wish_values(self.services, state))
        changes = read_changes(state["changes"])
        seed = wish.seed if changes else wish.seeds[min(int(state["take"]), wish.takes - 1)]
        name = made_name(wish, seed, changes)
        if not name:
            raise PlaygroundError("this motion was changed too often to be taken along; generate a new one")
        able = wish.system in [one.name for one in self.services.editors()]
        held, note = replace(held, system=wish.system if able else held.system), ""
        if not able:
            maker, reader = (self.services.system(one).title for one in (wish.system, held.system))
            note = f"{maker} writes no tokens; {reader} has read its motion as tokens."
        shown = self._source(open_source(self.services, held, name, wish.prompt or ""), kind, note)
        return *shown, *self._numbers(held.system)

    def change(self, system: str, kind: str, held: EditSession) -> tuple[Any, ...]:
        """Another system: its tokens of the same motion, and its own numbers."""
        name, _ = editor_of(self.services, system)
        session = replace(self._held(held), system=name)
        opened = open_source(self.services, session, session.name, session.caption, session.start)
        return *self._source(opened, kind), *self._numbers(name)

    def set_kind(self, kind: str, held: EditSession) -> tuple[Any, ...]:
        """Another kind of edit, with the span of the published benchmark for it."""
        session = self._held(held)
        start, stop = benchmark_span(kind, motion_of(session).frames)
        return session, _about(kind), start / LIMITS.fps, stop / LIMITS.fps

    def repaint(self, held: EditSession, *values: Any) -> tuple[Any, ...]:
        """The edit that the controls ask for."""
        return self._edited(self._held(held), EditWish.checked(*values))

    def arrive(self, held: EditSession, event: gr.EventData) -> tuple[Any, ...]:
        """What a link asks for: the controls, then the result, or the motion alone where nothing is said of an edit."""
        state = asked(event)
        system, note = editor_of(self.services, state.system)
        held, own = replace(held, system=system), self.services.sampling(system)
        wanted = str(state["motion"] or opening_motion(self.services))
        known = {one.id for one in self.services.examples()}
        if not wanted.startswith((MADE, OWN_FILE)) and wanted not in known:
            wanted = opening_motion(self.services)
        session = open_source(self.services, held, wanted, state.values.get("caption"), float(state["start"]))
        usual = {"g": own.guidance, "s": own.cfg}
        values = [state.values.get(key, usual.get(key, state[key])) for key in WISHES]
        edits = set(state.values) - {"motion", "start", "caption", "selection", "system"}
        if edits:
            shown = self._edited(session, EditWish.checked(*values), note)
        else:
            shown = self._source(session, str(values[1]), note)
        return *shown, values[0], values[1], *values[4:], _about(str(values[1]))

    def _source(self, session: EditSession, kind: str, note: str = "") -> tuple[Any, ...]:
        view = source_view(self.services, session)
        start, stop = benchmark_span(kind, motion_of(session).frames)
        stage = Noted(view.stage_json(), note)
        names, system = self._names(session), self.services.system(session.system).name
        return session, stage, "", "", "", *names, start / LIMITS.fps, stop / LIMITS.fps, system

    def _edited(self, session: EditSession, wish: EditWish, note: str = "") -> tuple[Any, ...]:
        view = run(self.services, session, wish)
        own, system = view.controls, self.services.system(session.system).name
        told = (Noted(view.stage_json(), note), view.facts_html(), own["seams"], _promise(own["promise"]))
        return session, *told, *self._names(session), own["from"], own["to"], system

    def _numbers(self, system: str) -> tuple[float, float]:
        own = self.services.sampling(system)
        return own.guidance, own.cfg

    def _names(self, session: EditSession) -> tuple[Any, ...]:
        choices = self.services.example_choices()
        if session.upload is not None:
            choices.insert(0, (f"{session.upload.title} · yours", file_name(session.upload)))
        if session.name.startswith(MADE):
            choices.insert(0, (f"{session.title} · generated", session.name))
        caption = session.caption if session.name.startswith(MADE) else ""
        long = session.upload if session.name.startswith(OWN_FILE) else None
        last = max(0.1, round(long.last_start, 1)) if long else 0.1
        window = gr.update(visible=bool(long and long.is_long), maximum=last, value=session.start)
        return gr.update(choices=choices, value=session.name), session.name, caption, window

    def _held(self, held: EditSession) -> EditSession:
        if held.base is not None:
            return held
        name = held.name or str(self.opening.controls.get("motion") or opening_motion(self.services))
        return open_source(self.services, held, name)


def room(services: Services) -> None:
    """Build the room inside the current tab."""
    opening = services.first_view(NAME, opening_view)
    own = opening.controls
    session = gr.State(EditSession(), time_to_live=LIMITS.session_seconds)
    with room_frame(NAME):
        stage = stage_and_score(NAME, opening)
        with panel("Change a part of a motion", LEAD, compare=True):
            example, upload, last, window = _sources(services, opening)
            wishes = _controls(services, opening)
            message = message_place("edit-message")
            facts = gr.HTML(opening.facts_html(), elem_id="edit-facts", apply_default_css=False)
            with gr.Accordion("How the rest is kept", open=False, elem_classes=["mtp-knobs"]):
                promise = gr.HTML(_promise(own.get("promise", "")), elem_id="edit-promise", apply_default_css=False)
                seams = gr.HTML(own.get("seams", ""), elem_id="edit-seams", apply_default_css=False)
        words(NAME)
        door = link_door(NAME)
        gr.HTML("", js_on_load=SPANNING, apply_default_css=False, elem_classes=["mtp-unseen"])
        unseen = [gr.Textbox(elem_classes=["mtp-unseen"], show_label=False, container=False) for _ in range(3)]
    span = [wishes["from"], wishes["to"]]
    shown = [session, stage, facts, seams, promise, example, *unseen[:2], window, *span, wishes["system"]]
    _wire(Handlers(services, opening), shown, wishes, (upload, last, unseen[2], door), message)


def _wire(do: Handlers, shown: list[Any], wishes: dict[str, Any], ways_in: tuple[Any, ...], message: Any) -> None:
    """What happens at which event."""
    session, stage, _, _, _, example, name, caption, window, start, stop, system = shown
    upload, last, address, door = ways_in
    kind, about, go = wishes["kind"], wishes["about"], wishes["go"]
    own: dict[str, Any] = {"stage": NAME, "doing": OPENING}
    silent: dict[str, Any] = {"api_visibility": "private"}
    asks, numbers = [wishes[key] for key in WISHES], [wishes["g"], wishes["s"]]
    opened = [attach(example.input, do.choose, [example, kind, session], shown, message, **own)]
    opened.append(attach(upload.upload, do.bring, [upload, kind, session], shown, message, **own))
    told = last.click(None, None, [address], js="() => window.mtpState?.query('generate') ?? ''", **silent)
    came = attach(told.then, do.last, [address, kind, session], [*shown, *numbers], message, stage=NAME, doing=LAST)
    opened.append(came)
    opened.append(attach(system.input, do.change, [system, kind, session], [*shown, *numbers], message, **own))
    opened.append(attach(window.input, do.move, [window, kind, session], shown, message,
                         trigger_mode="always_last", **own))  # fmt: skip
    opened.append(attach(kind.input, do.set_kind, [kind, session], [session, about, start, stop], message))
    for event in opened:
        event.then(None, [start, stop], None, js=SHOW_SPAN, **silent)
    keep = KEEP % json.dumps(system.value)
    for event in opened[:3]:
        event.then(None, [name, caption, system], None, js=keep, **silent)
    commits(NAME, {"system": system}, system.input, forget=(*WISHES, "selection"))
    commits(NAME, {"start": window}, window.input, forget=(*WISHES, "selection"))
    for number in (start, stop):
        number.input(None, [start, stop], None, js=SHOW_SPAN, **silent)
    stage.span(None, [start, stop], [start, stop], js=READ_SPAN, **silent)
    for event in (go.click, wishes["prompt"].submit):
        attach(event, do.repaint, [session, *asks], shown, message, stage=NAME, doing=DOING)
        commits(NAME, {key: wishes[key] for key in WISHES} | {"system": system}, event, forget=("selection",))
    others = [wishes[key] for key in (*WISHES[:2], *WISHES[4:])]
    arrival(door, do.arrive, [session], [*shown, *others, about], message, room=NAME, stage=NAME, doing=DOING)


def _sources(services: Services, opening: View) -> tuple[Any, ...]:
    """Where the motion comes from: the library, a file, the room Generate."""
    with gr.Row(elem_classes=["mtp-line"]):
        example = gr.Dropdown(
            services.example_choices(), value=opening.controls.get("motion"), label="Motion", elem_id="edit-example",
            scale=1, min_width=140,
        )  # fmt: skip
        upload = gr.UploadButton("Upload", file_count="single", size="sm", scale=0, min_width=72, elem_id="edit-upload")
        last = gr.Button("Last generated", size="sm", scale=0, min_width=116, elem_id="edit-last")
    row = control(NAME, "start")
    window = gr.Slider(0, 1, value=0, step=0.1, visible=False, elem_id=row.element, label=row.label)
    return example, upload, last, window


def _controls(services: Services, opening: View) -> dict[str, Any]:
    """The controls by their keys, with the button and the line that says what the kind does, and the system where
    there are several that can do it."""
    own, made, able = services.sampling(), opening.controls, services.editors()
    most = LIMITS.max_seconds
    found: dict[str, Any] = {}
    found["kind"] = gr.Radio(
        [(title, key) for key, (title, _) in KINDS.items()], value="inpaint", label=control(NAME, "kind").label,
        elem_id="edit-kind",
    )  # fmt: skip
    found["about"] = gr.HTML(_about("inpaint"), elem_id="edit-about", apply_default_css=False)
    with gr.Row(elem_classes=["mtp-line", "mtp-span"]):
        for key in ("from", "to"):
            found[key] = gr.Number(
                made.get(key), label=control(NAME, key).label, minimum=0, maximum=most, step=0.05,
                elem_id=control(NAME, key).element, min_width=64, scale=0,
            )  # fmt: skip
        row = control(NAME, "system")
        found["system"] = gr.Dropdown(
            [(one.title, one.name) for one in able], value=able[0].name if able else None, label=row.label,
            elem_id=row.element, visible=len(able) > 1, scale=1, min_width=140,
        )  # fmt: skip
    with gr.Row(elem_classes=["mtp-line"]):
        found["prompt"] = gr.Textbox(
            made.get("prompt", control(NAME, "prompt").default), label=control(NAME, "prompt").label, max_lines=1,
            elem_id="edit-prompt", scale=1, min_width=120,
        )  # fmt: skip
        found["go"] = gr.Button("Repaint", variant="primary", size="sm", scale=0, min_width=76, elem_id="edit-go")
    with gr.Accordion("More", open=False, elem_classes=["mtp-knobs"]), gr.Row(elem_classes=["mtp-pairs"]):
        found["seed"] = gr.Number(0, label="Seed", precision=0, minimum=0, maximum=LIMITS.max_seed, elem_id="edit-seed")
        row = control(NAME, "measured")
        found["measured"] = gr.Checkbox(False, label=row.label, elem_id=row.element)
        for key, value in (("g", own.guidance), ("s", own.cfg)):
            row = control(NAME, key)
            found[key] = gr.Slider(row.low, row.high, value, step=0.1, label=row.label, elem_id=row.element)
        row = control(NAME, "anchor")
        found["anchor"] = gr.Radio(ANCHORS, value="place", label=row.label, elem_id=row.element)
    return found


def _about(kind: str) -> str:
    return f'<p class="mtp-aside">{KINDS[kind][1]}</p>' if kind in KINDS else ""


def _promise(text: str) -> str:
    return f'<p class="mtp-aside">{text}</p>' if text else ""
