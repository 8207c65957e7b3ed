"""Room 5: what the guidance scale g does: to one motion, live in the browser; to quality, from a stored sweep."""

import html
import time
from pathlib import Path
from typing import Any

import gradio as gr

from playground.analysis.results import read_result
from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.systems import row_of
from playground.ui.chart import chart
from playground.ui.errors import Noted, attach, message_place
from playground.ui.facts import as_sentence
from playground.ui.layout import panel, room_frame, stage_and_score, words
from playground.ui.links import arrival, asked, commits, link_door
from playground.ui.scenes import guidance_scene, token_facts
from playground.ui.services import Services
from playground.ui.stage.component import stage_call
from playground.ui.state import State, control, query
from playground.ui.uploads import checked_number
from playground.ui.view import View

NAME = "guidance"
LEAD = (
    "The same tokens, read with and without the caption: drag g. The generator's guidance s, in contrast, chooses "
    "other tokens."
)
FIRST = float(control(NAME, "g").default)
FORMULA = '<p class="mtp-formula">m = (1 + g) · m<sub>words</sub> − g · m<sub>wordless</sub></p>'
DOING = "Decoding twice"
MARKING = (Path(__file__).parent.parent / "sweep.js").read_text(encoding="utf-8")
ITEM, SWEEP_HEIGHT = "guidance_sweep", 104
SWEEP_LABEL = "Quality of generated motions against g; a click takes g there"


def reader_of(services: Services, wanted: str | None) -> tuple[str, str]:
    """The system whose decoder reads words where this one is wanted, and a sentence where it is another one."""
    able = services.readers()
    usual = able[0] if able else services.default_system()
    if wanted is None or wanted in [one.name for one in able]:
        return wanted or usual.name, ""
    title = row_of(wanted).title
    if wanted not in [one.name for one in services.shipped()]:
        return usual.name, f"{title} is not shipped with this copy; this is {usual.title}."
    return usual.name, f"{title} has no decoder that reads words, so there is no g to change; this is {usual.title}."


def run(services: Services, example_id: str, caption: str, g: float = FIRST, name: str = "") -> View:
    """Tokenize an example and decode it with and without the caption; the live figure stands at g. name: the system,
    "" for the first one whose decoder reads words."""
    began = time.perf_counter()
    engine, system = services.engine(), services.system(name or reader_of(services, None)[0])
    tokenized = engine.tokenize(services.example(example_id).motion(), caption, system=system.name)
    pair = engine.guidance_pair(tokenized, caption)
    return View(
        stage=guidance_scene(system, tokenized.motion, tokenized.levels, pair, services.palettes(system.name), g),
        facts=token_facts(tokenized.levels),
        controls={"example": example_id, "caption": tokenized.caption},
        seconds=time.perf_counter() - began,
    )


def opening_view(services: Services) -> View:
    """The room's first result: the first example with its own caption."""
    example = services.opening_example()
    return run(services, example.id, example.caption)


def facts_html(view: View, system: str | None = None) -> str:
    """The line of numbers, and where this motion can be taken next: to Compare, with the system that is named."""
    motion = view.controls.get("example")
    if not motion:
        return view.facts_html()
    links = [("g", "Compare values of g"), ("caption", "with other captions")]
    own = {"system": (system,)} if system else {}
    states = [(State("compare", {"vary": vary, "motion": motion, **own}), words) for vary, words in links]
    parts = [f'<a data-state href="{html.escape(query(to), quote=True)}">{words}</a>' for to, words in states]
    return f'{view.facts_html()}<p class="mtp-aside mtp-onward">{" · ".join(parts)}</p>'


def sweep(services: Services, name: str = "") -> tuple[str | None, str]:
    """The stored sweep of a system as Plotly JSON text (None where there is none), and one sentence on it. name: as in
    `run`."""
    try:
        system = services.system(name or reader_of(services, None)[0])
        found = read_result(ITEM, system.name, services.engine().assets / "results")
    except PlaygroundError as error:
        return None, as_sentence(str(error))
    if found is None:
        return None, f"FID and R-Precision against g have not been measured for {system.title} yet."
    from playground.figures.sweep import small_sweep

    return str(small_sweep(found).to_json()), f"Measured on {found.line}; top 3 of 32; bars are 95 % intervals."


class Handlers:
    """What the controls do; the slider is not among them, it works in the browser."""

    def __init__(self, services: Services) -> None:
        self.services = services

    def choose(self, wanted: str, at: float, system: str | None) -> tuple[Any, ...]:
        """Another motion, with its own caption."""
        return self.again(wanted, self.services.example(wanted).caption, at, system)

    def again(self, wanted: str, text: str, at: float, system: str | None, note: str = "") -> tuple[Any, ...]:
        """The same motion with another caption."""
        name = reader_of(self.services, system)[0]
        view = run(self.services, wanted, text, checked_number(at, "g", 0, LIMITS.max_guidance), name)
        other = name if name != reader_of(self.services, None)[0] else None
        return Noted(view.stage_json(), note), facts_html(view, other), view.controls["caption"]

    def change(self, wanted: str, text: str, at: float, system: str) -> tuple[Any, ...]:
        """Another system, and what was measured of it."""
        return *self.again(wanted, text, at, system), *self._measured(system)

    def arrive(self, event: gr.EventData) -> tuple[Any, ...]:
        """What a link asks for, the motion and g included."""
        state = asked(event)
        known = {example.id: example for example in self.services.examples()}
        found = known.get(state["motion"]) or self.services.opening_example()
        system, note = reader_of(self.services, state.system)
        shown = self.again(found.id, state.values.get("caption", found.caption), state["g"], system, note)
        return found.id, state["g"], system, *shown, *self._measured(system)

    def _measured(self, system: str) -> tuple[Any, ...]:
        curve, told = sweep(self.services, system)
        return gr.update(value=curve, visible=curve is not None), _told(told)


def room(services: Services) -> None:
    """Build the room inside the current tab."""
    opening = services.first_view(NAME, opening_view)
    with room_frame(NAME):
        stage = stage_and_score(NAME, opening)
        with panel("What g does", LEAD, compare=True):
            g = gr.Slider(0, LIMITS.max_guidance, FIRST, step=0.05, label="Guidance g", elem_id="guidance-g")
            gr.HTML(FORMULA, apply_default_css=False)
            measured = _sweep(services)
            example, system, caption, go = _controls(services, opening)
            message = message_place("guidance-message")
            facts = gr.HTML(facts_html(opening), elem_id="guidance-facts", apply_default_css=False)
        words(NAME)
        door = link_door(NAME)
        gr.HTML("", js_on_load=MARKING, apply_default_css=False, elem_classes=["mtp-unseen"])
    do = Handlers(services)
    shown = [stage, facts, caption]
    busy: dict[str, Any] = {"message": message, "stage": NAME, "doing": DOING}
    attach(example.input, do.choose, [example, g, system], shown, **busy)
    for event in (caption.submit, go.click):
        attach(event, do.again, [example, caption, g, system], shown, **busy)
    attach(system.input, do.change, [example, caption, g, system], [*shown, *measured], **busy)
    arrival(door, do.arrive, [], [example, g, system, *shown, *measured], room=NAME, **busy)
    commits(NAME, {"system": system}, system.input, forget=("selection",))
    commits(NAME, {"motion": example}, example.input, forget=("caption", "selection"))
    commits(NAME, {"caption": caption}, caption.submit, go.click, forget=("selection",))
    commits(NAME, {"g": g}, g.change)
    g.change(None, [g], None, js=stage_call(NAME, "setGuidance"), api_visibility="private")
    g.change(None, [g], None, js="(g) => window.mtpMarkGuidance?.(g)", api_visibility="private")


def _sweep(services: Services) -> list[Any]:
    """The curves of the stored sweep, and the line under them."""
    curve, told = sweep(services)
    shown = chart(curve, label=SWEEP_LABEL, height=SWEEP_HEIGHT, elem_id="guidance-sweep")
    shown.visible = curve is not None
    return [shown, gr.HTML(_told(told), apply_default_css=False, elem_id="guidance-measured")]


def _told(text: str) -> str:
    return f'<p class="mtp-aside mtp-small">{html.escape(text)}</p>'


def _controls(services: Services, opening: View) -> tuple[Any, ...]:
    """Motion, system, caption and its button: one line, two where there are several systems whose decoder reads words
    and the menu of them is seen."""
    several = len(services.readers()) > 1
    with gr.Row(elem_classes=["mtp-line"]):
        example = gr.Dropdown(
            services.example_choices(), value=opening.controls.get("example"), label="Motion",
            elem_id="guidance-example", scale=1, min_width=120,
        )  # fmt: skip
        beside = _menu(services) if several else _caption(opening)
    with gr.Row(elem_classes=["mtp-line"], visible=several):
        below = _caption(opening) if several else _menu(services)
    return example, *((*beside, *below) if several else (*below, *beside))


def _menu(services: Services) -> tuple[Any, ...]:
    """The systems whose decoder reads words."""
    able, row = services.readers(), control(NAME, "system")
    choices = [(one.title, one.name) for one in able]
    return (
        gr.Dropdown(choices, value=able[0].name if able else None, label=row.label, elem_id=row.element, scale=1,
                    min_width=120),
    )  # fmt: skip


def _caption(opening: View) -> tuple[Any, ...]:
    """The caption and its button."""
    return (
        gr.Textbox(opening.controls.get("caption", ""), label="Caption", max_lines=1, elem_id="guidance-caption",
                   scale=1, min_width=120),
        gr.Button("Decode", variant="primary", size="sm", scale=0, min_width=72, elem_id="guidance-go"),
    )  # fmt: skip
