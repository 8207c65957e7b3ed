"""Room 7: one prompt, motion or edit through two to six settings, in sync, with their differences in a table."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import gradio as gr

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.motion import Motion
from playground.ui.compared import compared_view
from playground.ui.comparing import (
    EDIT,
    MOTION,
    PROMPT,
    VARIATIONS,
    Compared,
    chosen,
    first_variation,
    offered,
    run,
    settings_of,
    span_of,
    variation_of,
)
from playground.ui.drawing import MADE
from playground.ui.errors import Noted, attach, message_place
from playground.ui.inspector import inspector
from playground.ui.layout import panel, room_frame, stage_and_score, words
from playground.ui.links import arrival, asked, commits, link_door
from playground.ui.origins import is_origin, origin_caption, origin_of
from playground.ui.services import Services
from playground.ui.state import State, control
from playground.ui.view import View

NAME = "compare"
LEAD = "One motion or prompt, several settings in sync. Choose what differs; the table says by how much."
DOING = "Running every setting"
WISHES = ("vary", "values", "prompt", "seconds", "seed", "motion")  # keys of the table of controls
KEEP = """(vary, values, prompt, seconds, seed, motion) => window.mtpState?.keep(
  'compare', ['vary', 'values', 'prompt', 'seconds', 'seed', 'motion', 'take', 'selection'],
  [vary, [...values].sort((a, b) => a - b || 0).join('_'), prompt, seconds, seed, motion, null, null]);"""
KEEP_TAKE = "(take) => window.mtpState?.keep('compare', ['take'], [Number(take) || null])"
LAST = 9  # more than there are: the last one
SHOWS = {PROMPT: (PROMPT, EDIT), MOTION: (MOTION, EDIT)}  # row of controls -> the comparisons that need it


@dataclass(eq=False)
class Held:
    """What one visitor compares."""

    done: list[Compared] = field(default_factory=list)
    source: Motion | None = None
    name: str = ""
    link: State = field(default_factory=lambda: State(NAME))  # what a link said of its motion: its words, a span
    stop: bool = False  # asked for by "Stop", heard between two settings

    def said_of(self, motion: str) -> State:
        """What the link says, as long as its motion is the one that is compared."""
        return self.link if self.link["motion"] == motion else State(NAME)


def compare(services: Services, held: Held, *values: Any, take: int = 0) -> Iterator[View]:
    """A view after every setting; `values` are those of WISHES."""
    vary, picked, prompt, seconds, seed, motion = values
    if vary not in VARIATIONS:
        raise PlaygroundError(f"what differs is one of {', '.join(VARIATIONS)}")
    of, text, held.name, held.source = VARIATIONS[vary].of, prompt, str(prompt or ""), None
    name = motion or services.opening_example().id
    said = held.said_of(name)
    if of != PROMPT:
        origin = origin_of(services, name, said["caption"])
        held.name, held.source = origin.title, origin.motion
        text = held.source.caption if of == MOTION else prompt
    edit = (str(said["kind"]), span_of(said))
    settings = settings_of(services, vary, picked or (), text, seconds, seed, *edit, held.link.system)
    for done in run(services, settings, held.source):
        held.done = done
        yield compared_view(services, done, held.source, held.name, take)


def opening_view(services: Services) -> View:
    """The room's first result: a motion through several systems; of a single one, from fewer and from more scales."""
    example, vary = services.opening_example(), first_variation(services)
    picked = [name for _, name in chosen(services, vary, ())]
    *_, last = compare(services, Held(), vary, picked, "", 4.0, 0, example.id, take=LAST)
    return View(last.stage, controls={**last.controls, "motion": example.id}, seconds=last.seconds)


class Handlers:
    """What the controls do. A result is stage and table."""

    def __init__(self, services: Services) -> None:
        self.services = services

    def set_vary(self, vary: str) -> tuple[Any, ...]:
        """Another thing that differs: its choices, and prompt or motion as it needs them."""
        of = VARIATIONS[vary].of if vary in VARIATIONS else PROMPT
        picked = [name for _, name in chosen(self.services, vary, ())][: VARIATIONS[vary].most]
        return (self._values(vary, picked), *(gr.update(visible=of in shows) for shows in SHOWS.values()))

    def begin(self, held: Held) -> tuple[Any, ...]:
        """At the click, before any waiting: "Stop" becomes possible and "Compare" does not."""
        held.stop = False
        return gr.update(interactive=False), gr.update(interactive=True)

    def stop(self, held: Held) -> Any:
        """Ask the running comparison to end after the setting it is at."""
        held.stop = True
        return gr.update(interactive=False)

    def end(self) -> tuple[Any, ...]:
        """After the last word: "Compare" becomes possible again."""
        return gr.update(interactive=True), gr.update(interactive=False)

    def compare(self, held: Held, *values: Any, take: int = 0) -> Iterator[tuple[Any, ...]]:
        """All settings, one after the other."""
        count = len(values[1] or ())
        for view in compare(self.services, held, *values, take=take):
            done = len(held.done)
            stage = view.stage_json()
            halted = held.stop and done < count
            yield Noted(stage, f"Stopped after {done} of {count}.") if halted else stage, view.controls["table"]
            if halted:
                return

    def look_at(self, held: Held, event: gr.EventData) -> tuple[Any, ...]:
        """A name in the table: its tokens. The stored opening is computed once more for that."""
        take = int(event.code)
        if not held.done:
            vary = first_variation(self.services)
            picked = [name for _, name in chosen(self.services, vary, ())]
            for _ in compare(self.services, held, vary, picked, "", 4.0, 0, None):
                pass
        view = compared_view(self.services, held.done, held.source, held.name, take)
        return view.stage_json(), view.controls["table"], str(take)

    def arrive(self, held: Held, event: gr.EventData) -> Iterator[tuple[Any, ...]]:
        """What a link asks for: the controls, then the results."""
        state = asked(event)
        vary = variation_of(self.services, state["vary"])
        wanted = [name for _, name in chosen(self.services, vary, str(state["values"] or "").split("_"))]
        wanted = wanted[: VARIATIONS[vary].most]
        asked_for = str(state["motion"] or "")
        motion = asked_for if is_origin(self.services, asked_for) else self.services.opening_example().id
        held.link, held.stop = state.with_values(motion=motion), False
        rest = (state["prompt"], state["seconds"], state["seed"])
        _, *rows = self.set_vary(vary)
        asks = (vary, wanted, *rest, motion)
        controls = (vary, self._values(vary, wanted), *rest, self._menu(motion, state["caption"]), *rows)
        for shown in self.compare(held, *asks, take=int(state["take"])):
            yield *shown, *controls

    def _menu(self, motion: str, caption: str | None) -> Any:
        """The menu of motions, with one from elsewhere on top."""
        choices = self.services.example_choices()
        if motion not in [id for _, id in choices]:
            origin = "generated" if motion.startswith(MADE) else "from the map"
            title = caption if motion.startswith(MADE) else origin_caption(self.services, motion)
            choices.insert(0, (f"{title or motion} · {origin}", motion))
        return gr.update(choices=choices, value=motion)

    def _values(self, vary: str, picked: list[str]) -> Any:
        variation = VARIATIONS[vary]
        label = _choose(vary)
        return gr.update(choices=list(variation.choices(self.services)), value=picked, label=label)


def room(services: Services) -> None:
    """Build the room inside the current tab."""
    opening = services.first_view(NAME, opening_view)
    held = gr.State(Held(), time_to_live=LIMITS.session_seconds)
    with room_frame(NAME):
        stage = stage_and_score(NAME, opening)
        with panel("Side by side", LEAD, back=True):
            wishes, rows, buttons = _controls(services, opening)
            message = message_place("compare-message")
            table = inspector(opening.controls.get("table", ""), elem_id="compare-take")
        words(NAME)
        door = link_door(NAME)
        take = gr.Textbox(elem_classes=["mtp-unseen"], show_label=False, container=False)
    _wire(Handlers(services), held, wishes, rows, buttons, (stage, table, take), (door, message))


def _wire(
    do: Handlers, held: Any, wishes: dict[str, Any], rows: list[Any], buttons: list[Any], shown: tuple[Any, ...],
    ways: tuple[Any, Any],
) -> None:  # fmt: skip
    """What happens at which event."""
    (stage, table, take), (door, message), (go, cancel) = shown, ways, buttons
    asks, results = [wishes[key] for key in WISHES], [stage, table]
    silent: dict[str, Any] = {"api_visibility": "private"}
    quick: dict[str, Any] = {"queue": False, "show_progress": "hidden", **silent}
    attach(wishes["vary"].input, do.set_vary, [wishes["vary"]], [wishes["values"], *rows], message, model=False)
    for event in (go.click, wishes["prompt"].submit):
        started = event(do.begin, [held], buttons, **quick)
        run = attach(started.then, do.compare, [held, *asks], results, message, stage=NAME, doing=DOING)
        run.then(do.end, None, buttons, **quick)
        event(None, asks, None, js=KEEP, **silent)
    cancel.click(do.stop, [held], [cancel], **quick)
    looked = attach(table.act, do.look_at, [held], [*results, take], message)
    looked.then(None, [take], None, js=KEEP_TAKE, **silent)
    arrival(door, do.arrive, [held], [*results, *asks, *rows], message, room=NAME, stage=NAME, doing=DOING)
    own = ("caption", "kind", "from", "to", "selection")  # what a link said of the motion before
    commits(NAME, {"motion": wishes["motion"]}, wishes["motion"].input, forget=own)


def _controls(services: Services, opening: View) -> tuple[dict[str, Any], list[Any], list[Any]]:
    """The controls by their keys, the rows for a prompt and for a motion, "Compare" and "Stop"."""
    found: dict[str, Any] = {}
    first = first_variation(services)
    variation, picked = VARIATIONS[first], [name for _, name in chosen(services, first, ())]
    with gr.Row(elem_classes=["mtp-line"]):
        found["vary"] = gr.Dropdown(
            offered(services), value=first, label=control(NAME, "vary").label, elem_id="compare-vary", scale=1,
            min_width=160,
        )  # fmt: skip
        go = gr.Button("Compare", variant="primary", size="sm", scale=0, min_width=84, elem_id="compare-go")
        cancel = gr.Button("Stop", size="sm", scale=0, min_width=60, interactive=False, elem_id="compare-stop")
    found["values"] = gr.CheckboxGroup(
        list(variation.choices(services)), value=picked, elem_id="compare-values",
        label=_choose(first),
    )  # fmt: skip
    with gr.Row(elem_classes=["mtp-line"], visible=variation.of == PROMPT) as of_prompt:
        found["prompt"] = gr.Textbox(
            control(NAME, "prompt").default, label=control(NAME, "prompt").label, max_lines=1, scale=1, min_width=120,
            elem_id="compare-prompt",
        )  # fmt: skip
        for key, places in (("seconds", 1), ("seed", 0)):
            row = control(NAME, key)
            found[key] = gr.Number(
                row.default, label=row.label, precision=places, minimum=row.low, maximum=row.high, scale=0,
                min_width=72, elem_id=row.element,
            )  # fmt: skip
    with gr.Row(elem_classes=["mtp-line"], visible=variation.of == MOTION) as of_motion:
        found["motion"] = gr.Dropdown(
            services.example_choices(), value=opening.controls.get("motion"), label=control(NAME, "motion").label,
            elem_id="compare-example", scale=1, min_width=160,
        )  # fmt: skip
    return found, [of_prompt, of_motion], [go, cancel]


def _choose(vary: str) -> str:
    return f"{VARIATIONS[vary].title}: choose 2 to {VARIATIONS[vary].most}"
