"""Room 7: a motion that never ends. It is told what to do next while it moves; seams and tokens are shown as they come.

The browser asks for a second of motion whenever two are left ahead of the playhead, and each request takes the model
slot anew: a visitor who looks away costs nothing, and nobody waits for another one longer than for a second of motion.
"""

from typing import Any

import gradio as gr

from playground.limits import LIMITS
from playground.ui.errors import Noted, attach, message_place
from playground.ui.layout import panel, room_frame, stage_and_score, words
from playground.ui.links import asked, link_door
from playground.ui.rewriting import rewriter
from playground.ui.services import Services
from playground.ui.stage.component import stage_call
from playground.ui.state import control
from playground.ui.view import View
from playground.ui.walking import Walk, opening, plan_of_steps

NAME = "endless"
LEAD = "Say what the figure does, and while it moves what it does next. What was drawn stays; what comes changes."
PROMPTS = (
    control(NAME, "prompt").default,
    "a person runs in a circle",
    "a person raises both arms",
    "a person walks backwards",
)
OPENING = (PROMPTS[0], PROMPTS[2])
OPENING_SECONDS = 5  # of each
STEPS = "Play the steps one after the other"
KEEP = "(...values) => window.mtpState?.keep('endless', ['prompt', 'seed', 'then'], values.map((one) => one || null))"
SKIP = gr.skip()


def opening_view(services: Services) -> View:
    """The room's first result: two instructions, five seconds each. PlaygroundError where MOGO is not trained."""
    return opening(services, OPENING, OPENING_SECONDS)


class Handlers:
    """What the controls do. Those that show something return stage, facts, first prompt, plan and the three buttons."""

    def __init__(self, services: Services) -> None:
        self.services = services

    def start(self, walk: Walk, prompt: str, seed: float, then: str) -> tuple[Any, ...]:
        """From the beginning: the first second."""
        return self._start(walk, prompt, seed, then, play=True)

    def enter(self, walk: Walk, prompt: str, seed: float, then: str) -> tuple[Any, ...]:
        """Enter in the prompt: the next instruction where something moves, else the first one."""
        if walk.session is None:
            return self._start(walk, prompt, seed, then, play=True)
        return self.say(walk, prompt)

    def say(self, walk: Walk, prompt: str) -> tuple[Any, ...]:
        """The next instruction."""
        said = walk.say(prompt)
        note = f"From second {said.frame / LIMITS.fps:.1f} on: {said.prompt}."
        return SKIP, SKIP, SKIP, Noted(walk.following(), note), SKIP, SKIP, SKIP

    def onward(self, walk: Walk) -> tuple[Any, ...]:
        """The next second, when the stage asks for it; nothing once it was stopped."""
        if walk.session is None and walk.run:
            return SKIP, SKIP
        view = walk.onward(self.services)
        return (view.stage_json(), _told(view)) if walk.session is not None else (SKIP, SKIP)

    def stop(self, walk: Walk) -> tuple[Any, ...]:
        """The end: the session is let go, the last seconds stay on the stage."""
        walk.session = None
        return _buttons(False)

    def fill(self, event: gr.EventData) -> tuple[Any, ...]:
        """The controls as a link asks for them."""
        state = asked(event)
        return state["prompt"], state["seed"], state["then"] or ""

    def arrive(self, walk: Walk, prompt: str, seed: float, then: str) -> tuple[Any, ...]:
        """What a link shows; it plays unless the visitor asks for calm."""
        return self._start(walk, prompt, seed, then, play=False)

    def _start(self, walk: Walk, prompt: str, seed: float, then: str, play: bool) -> tuple[Any, ...]:
        view = walk.begin(self.services, prompt, seed, then, play)
        return view.stage_json(), _told(view), walk.said[0].prompt, walk.following(), *_buttons(True)


def _told(view: View) -> str:
    """The numbers, and the newest switches."""
    return view.facts_html() + str(view.controls.get("switches", ""))


def _buttons(moving: bool) -> tuple[Any, ...]:
    start = gr.update(value="Start anew" if moving else "Start", variant="secondary" if moving else "primary")
    return start, gr.update(interactive=moving), gr.update(interactive=moving)


def room(services: Services) -> None:
    """Build the room inside the current tab."""
    shown = services.first_view(NAME, opening_view)
    walk = gr.State(Walk(), time_to_live=LIMITS.session_seconds)
    with room_frame(NAME):
        stage = stage_and_score(NAME, shown)
        with panel("A motion without end", LEAD, compare=True):
            prompt, buttons = _prompt()
            heard = message_place("endless-heard")
            message = message_place("endless-message")
            facts = gr.HTML(_told(shown), elem_id="endless-facts", apply_default_css=False)
            seed, then = _more()
            rewriter(NAME, prompt, (STEPS, plan_of_steps, then))
        words(NAME)
        door = link_door(NAME)
        first = gr.Textbox("", elem_classes=["mtp-unseen"], show_label=False, container=False)
    _wire(Handlers(services), walk, [stage, facts, first, then, *buttons], (prompt, seed, then), (heard, message), door)


def _wire(do: Handlers, walk: Any, shown: list[Any], wishes: tuple[Any, ...], told: tuple[Any, ...], door: Any) -> None:
    """What happens at which event."""
    stage, facts, first, then, start, say, stop = shown
    (prompt, seed, _), (heard, message) = wishes, told
    quick: dict[str, Any] = {"queue": False, "api_visibility": "private", "show_progress": "hidden"}
    silent: dict[str, Any] = {"api_visibility": "private"}
    filled = attach(door.arrive, do.fill, [], list(wishes), heard, model=False)
    arrived = attach(filled.then, do.arrive, [walk, *wishes], shown, heard)
    arrived.then(None, None, None, js=f"() => window.mtpState?.settled('{NAME}')", **silent)
    runs = [
        attach(start.click, do.start, [walk, *wishes], shown, heard),
        attach(prompt.submit, do.enter, [walk, *wishes], shown, heard),
        attach(say.click, do.say, [walk, prompt], shown, heard),
    ]
    for run in runs:
        run.then(None, [first, seed, then], None, js=KEEP, **silent)
    attach(stage.hungry, do.onward, [walk], [stage, facts], message)
    stop.click(do.stop, [walk], [start, say, stop], **quick)
    stop.click(None, None, None, js=stage_call(NAME, "finish"), **silent)


def _prompt() -> tuple[Any, list[Any]]:
    """The instruction with its buttons."""
    prompt = gr.Textbox(
        PROMPTS[0], label=control(NAME, "prompt").label, lines=1, max_lines=2, placeholder=PROMPTS[0],
        elem_id=control(NAME, "prompt").element,
    )  # fmt: skip
    gr.Examples([[text] for text in PROMPTS], [prompt], label="Try one of these", elem_id="endless-examples")
    with gr.Row(elem_classes=["mtp-line"]):
        start = gr.Button("Start", variant="primary", size="sm", min_width=88, elem_id="endless-go")
        say = gr.Button("Say", variant="primary", size="sm", interactive=False, min_width=64, elem_id="endless-say")
        stop = gr.Button(
            "Stop", variant="secondary", size="sm", interactive=False, min_width=64, elem_id="endless-stop"
        )
    return prompt, [start, say, stop]


def _more() -> tuple[Any, Any]:
    """The seed, and the instructions that follow by themselves."""
    with gr.Row(elem_classes=["mtp-line"]):
        row = control(NAME, "seed")
        seed = gr.Number(row.default, label=row.label, precision=0, minimum=0, maximum=LIMITS.max_seed,
                         elem_id=row.element, min_width=72, scale=0)  # fmt: skip
        row = control(NAME, "then")
        then = gr.Textbox("", label=row.label, max_lines=1, elem_id=row.element, min_width=160,
                          placeholder="4 a person jumps | 8 a person sits down")  # fmt: skip
    return seed, then
