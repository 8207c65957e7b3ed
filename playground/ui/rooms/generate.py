"""Room 4: motions from words, appearing scale by scale; a token's alternatives; what the visit has made so far."""

from collections.abc import Iterator
from dataclasses import astuple
from functools import partial
from typing import Any

import gradio as gr

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.systems import SamplingDefaults
from playground.ui.drawing import (
    WISHES,
    Change,
    Drawing,
    Result,
    Visit,
    Wish,
    change,
    draw,
    last_of,
    read_changes,
    wish_values,
    write_changes,
)
from playground.ui.errors import Noted, attach, message_place
from playground.ui.generated import drawing_view, earlier, onward, result_view, token_card
from playground.ui.inspector import inspector
from playground.ui.layout import panel, room_frame, stage_and_score, words
from playground.ui.links import asked, commits, link_door
from playground.ui.rewriting import rewriter
from playground.ui.services import Services
from playground.ui.stage.component import stage_call
from playground.ui.state import control
from playground.ui.view import View

NAME = "generate"
LEAD = "Describe a motion. Its tokens are chosen scale by scale, and the figure sharpens. Then click a token."
PROMPTS = (
    control(NAME, "prompt").default,
    "someone jogs",
    "a person turns left while walking",
    "a person is waving with both hands",
)
OPENING_SECONDS = float(control(NAME, "seconds").default)
DOING = "Choosing the first tokens"
GUIDANCES = (
    "Two guidances: <b>s</b> acts while tokens are chosen and makes them follow the words; <b>g</b> leaves the tokens "
    "as they are and changes how they are read."
)
PLANT = (
    "The way over the ground is computed anew from how the body moves, so that standing feet slide less; the tokens "
    "stay the same."
)
STEPS = (0.1, 0.1, 0.05, 0.01, 0.01)  # of the sampling sliders
KEEP = "(changes, take) => window.mtpState?.keep('generate', ['changes', 'take'], [changes || null, +take || null])"
SKIP = gr.skip()
SHOWN = 7 + len(WISHES)  # values that show a result


def stream(services: Services, wish: Wish) -> Iterator[View]:
    """One view after every scale; the last one is the result."""
    for drawing in draw(services, wish):
        yield drawing_view(services, drawing)


def opening_view(services: Services) -> View:
    """The room's first result: the first prompt, seed 0."""
    *_, last = stream(services, opening_wish(services))
    return last


def opening_wish(services: Services) -> Wish:
    """What the room opens with."""
    return Wish.checked(PROMPTS[0], False, OPENING_SECONDS, 0, *astuple(services.sampling()))


class Handlers:
    """What the controls do. A generation looks at its visit after every scale, so that stopping waits for nobody.

    A handler that shows a result returns the values of SHOWN in `room`: stage, facts, where to go next, the visit's
    list, the choice among several motions, the changes for the address, the token's card.
    """

    def __init__(self, services: Services) -> None:
        self.services = services

    def fill(self, visit: Visit, event: gr.EventData) -> tuple[Any, ...]:
        """The controls as a link asks for them, in the order of `Wish.checked`."""
        state = asked(event)
        visit.wanted, visit.take = read_changes(state["changes"]), int(state["take"])
        return wish_values(self.services, state)

    def begin(self, visit: Visit) -> tuple[Any, ...]:
        """At the click, before any waiting: "Stop" becomes possible and "Generate" does not."""
        visit.stop = False
        return gr.update(interactive=False), gr.update(interactive=True)

    def stop(self, visit: Visit) -> Any:
        """Ask the running generation to end after the scale it is at."""
        visit.stop = True
        return gr.update(interactive=False)

    def end(self) -> tuple[Any, ...]:
        """After the last word: "Generate" becomes possible again."""
        return gr.update(interactive=True), gr.update(interactive=False)

    def generate(self, visit: Visit, *values: Any) -> Iterator[tuple[Any, ...]]:
        """The stage after every scale, and at the end all that belongs to the result."""
        wish = Wish.checked(*values)
        wanted, visit.wanted, visit.token = visit.wanted, (), None
        if visit.stop:
            yield Noted(SKIP, "Stopped before the first scale was done."), *[SKIP] * (SHOWN - 1)
            return
        yield from self._run(visit, draw(self.services, wish))
        for one in wanted:
            if visit.shown is not None and not visit.halted:
                yield from self._run(visit, change(self.services, visit.shown, visit.take, one))

    def choose(self, visit: Visit, event: gr.EventData) -> tuple[Any, ...]:
        """A click in the card of a token, before any waiting."""
        visit.picked = str(event.code)
        return self.begin(visit)

    def redraw(self, visit: Visit) -> Iterator[tuple[Any, ...]]:
        """From the token's scale on, with the code that was clicked forced, or with another seed."""
        result = self._held(visit)
        if visit.token is None:
            raise PlaygroundError("choose a token in the score first")
        scale, position = visit.token
        other = (result.takes[visit.take].seed + 1) % LIMITS.max_seed
        wanted = Change(scale, position, int(visit.picked)) if visit.picked else Change(scale, seed=other)
        yield from self._run(visit, change(self.services, result, visit.take, wanted))

    def token(self, visit: Visit, event: gr.EventData) -> tuple[Any, ...]:
        """A click on a token: its card; none where none is chosen."""
        if not event.selection:
            visit.token = None
            return ("",)
        result = self._held(visit)
        visit.token = int(event.selection["scale"]), int(event.selection["position"])
        return (self._card(visit, result),)

    def bring_back(self, visit: Visit, event: gr.EventData) -> tuple[Any, ...]:
        """A result of the visit, at once, with the controls that made it."""
        result = visit.open(int(event.code))
        return self._result(visit, result, result_view(self.services, result))

    def look_at(self, visit: Visit, place: str) -> tuple[Any, ...]:
        """Another one of several motions: its tokens."""
        result = self._held(visit)
        visit.take = min(max(0, int(place)), len(result.takes) - 1)
        return self._result(visit, result, result_view(self.services, result, visit.take))

    def _run(self, visit: Visit, run: Iterator[Drawing]) -> Iterator[tuple[Any, ...]]:
        for drawing in run:
            result = drawing.result
            if result is not None:
                visit.keep(result)
                yield self._result(visit, result, drawing_view(self.services, drawing, visit.take))
                return
            view = drawing_view(self.services, drawing, visit.take)
            visit.halted = visit.stop
            level, count = view.controls["level"], view.controls["count"]
            note = f"Stopped; this is the motion after scale {level} of {count}." if visit.halted else ""
            yield Noted(view.stage_json(), note), view.facts_html(), *[SKIP] * (SHOWN - 2)
            if visit.halted:
                return

    def _result(self, visit: Visit, result: Result, view: View) -> tuple[Any, ...]:
        choices = [(f"Seed {one.seed}", str(n)) for n, one in enumerate(result.takes)]
        which = gr.update(choices=choices, value=str(visit.take), visible=len(choices) > 1)
        card = self._card(visit, result) if visit.token else ""
        told = ", then ".join(one.words for one in result.changes)
        stage = Noted(view.stage_json(), f"{told[:1].upper()}{told[1:]}." if told else "")
        told_of = (onward(result, visit.take), earlier(visit), which, write_changes(result.changes), card)
        return stage, view.facts_html(), *told_of, *(result.address[key] for key in WISHES)

    def _card(self, visit: Visit, result: Result) -> str:
        assert visit.token is not None
        made, (scale, position) = result.takes[visit.take], visit.token
        found = self.services.engine().alternatives(made, scale, position)
        palette = self.services.palettes(made.system)[scale - 1]
        colors = ["#{:02x}{:02x}{:02x}".format(*palette[code]) for code in found.codes]
        return token_card(found, made.levels[scale - 1].size, colors)

    def _held(self, visit: Visit) -> Result:
        """What is on the screen; the stored opening is drawn once more when something is asked of it."""
        if visit.halted:
            raise PlaygroundError("this motion was stopped on its way; generate it to the end to look into its tokens")
        if visit.shown is None:
            visit.keep(last_of(draw(self.services, opening_wish(self.services))))
        assert visit.shown is not None
        return visit.shown


def room(services: Services) -> None:
    """Build the room inside the current tab."""
    opening = services.first_view(NAME, opening_view)
    visit = gr.State(Visit(), time_to_live=LIMITS.session_seconds)
    with room_frame(NAME):
        stage = stage_and_score(NAME, opening)
        with panel("Words become a motion", LEAD, compare=True):
            card = inspector(elem_id="generate-token")
            with gr.Column(elem_classes=["mtp-form"], min_width=0):
                prompt, seconds, seed, takes, plant, buttons = _controls(opening, services.refines())
            which = gr.Radio([], label=control(NAME, "take").label, visible=False, elem_id="generate-take",
                             elem_classes=["mtp-segments"])  # fmt: skip
            message = message_place("generate-message")
            facts = gr.HTML(opening.facts_html(), elem_id="generate-facts", apply_default_css=False)
            further = gr.HTML("", elem_id="generate-onward", apply_default_css=False)
            shelf = inspector(elem_id="generate-earlier")
            free, *numbers = _knobs(services.sampling())
            rewriter(NAME, prompt)
        words(NAME)
        door = link_door(NAME)
        changes = gr.Textbox("", elem_classes=["mtp-unseen"], show_label=False, container=False)
    wishes = [prompt, free, seconds, seed, *numbers, takes, plant]
    shown = [stage, facts, further, shelf, which, changes, card, *wishes]
    _wire(Handlers(services), visit, message, shown, buttons, door)


def _wire(do: Handlers, visit: Any, message: Any, shown: list[Any], buttons: list[Any], door: Any) -> None:
    """What happens at which event."""
    stage, _, _, shelf, which, changes, card, *wishes = shown
    prompt, (go, cancel) = wishes[0], buttons
    quick: dict[str, Any] = {"queue": False, "api_visibility": "private", "show_progress": "hidden"}
    silent: dict[str, Any] = {"api_visibility": "private"}
    keys = dict(zip(WISHES, wishes, strict=True))
    filled = attach(door.arrive, do.fill, [visit], wishes, message, model=False)
    for event in (go.click, prompt.submit, filled.then):
        started = event(do.begin, [visit], buttons, **quick)
        run = attach(started.then, do.generate, [visit, *wishes], shown, message, stage=NAME, doing=DOING)
        run.then(None, [changes, which], None, js=KEEP, **silent)
        ended = run.then(do.end, None, buttons, **quick)
    ended.then(None, None, None, js=f"() => window.mtpState?.settled('{NAME}')", **silent)
    for event in (go.click, prompt.submit, shelf.act):
        event(None, None, None, js=stage_call(NAME, "select", None), **silent)
    commits(NAME, keys, go.click, prompt.submit, forget=("selection", "changes", "take"))
    cancel.click(do.stop, [visit], [cancel], **quick)

    attach(stage.select, do.token, [visit], [card], message, trigger_mode="always_last")
    started = card.act(do.choose, [visit], buttons, **quick)
    again = attach(started.then, do.redraw, [visit], shown, message, stage=NAME, doing="Drawing anew")
    again.then(do.end, None, buttons, **quick)
    back = attach(shelf.act, do.bring_back, [visit], shown, message, model=False)
    look = attach(which.input, do.look_at, [visit, which], shown, message, model=False)
    for run in (again, back, look):
        run.then(None, [changes, which], None, js=KEEP, **silent)
    commits(NAME, keys, again.then, back.then)


def _controls(opening: View, refines: bool) -> tuple[Any, ...]:
    """From top to bottom: prompt, seconds, seed, seeds side by side, "Plant the feet" if there is a root refiner,
    "Generate" and "Stop"."""
    prompt = gr.Textbox(
        opening.controls.get("prompt", PROMPTS[0]), label="Prompt", lines=2, max_lines=3,
        placeholder=PROMPTS[0], elem_id="generate-prompt",
    )  # fmt: skip
    gr.Examples([[text] for text in PROMPTS], [prompt], label="Try one of these", elem_id="generate-examples")
    with gr.Row(elem_classes=["mtp-line"]):
        seconds = gr.Slider(
            LIMITS.min_seconds, LIMITS.max_seconds, value=OPENING_SECONDS, step=0.2, label="Seconds",
            elem_id="generate-seconds", min_width=160,
        )  # fmt: skip
        seed = gr.Number(
            0, label="Seed", precision=0, minimum=0, maximum=LIMITS.max_seed, elem_id="generate-seed",
            min_width=72, scale=0,
        )  # fmt: skip
        takes = gr.Number(
            1, label=control(NAME, "takes").label, precision=0, minimum=1, maximum=LIMITS.max_seeds,
            elem_id="generate-takes", min_width=96, scale=0,
        )  # fmt: skip
    plant = gr.Checkbox(
        False, label=control(NAME, "plant").label, info=PLANT, visible=refines, elem_id="generate-plant"
    )
    with gr.Row(elem_classes=["mtp-line"]):
        go = gr.Button("Generate", variant="primary", size="sm", elem_id="generate-go")
        cancel = gr.Button("Stop", variant="secondary", size="sm", interactive=False, elem_id="generate-stop")
    return prompt, seconds, seed, takes, plant, [go, cancel]


def _knobs(default: SamplingDefaults) -> list[Any]:
    """The folded sampling controls in the order of `Wish.checked`; the first one is free-form."""
    with gr.Accordion("Sampling and guidance", open=False, elem_classes=["mtp-knobs"]):
        gr.HTML(f'<p class="mtp-aside">{GUIDANCES}</p>', apply_default_css=False)
        with gr.Row(elem_classes=["mtp-pairs"]):
            rows = map(partial(control, NAME), WISHES[4:9])
            guidance, cfg, temperature, top_k, top_p = (
                gr.Slider(row.low, row.high, value, step=step, label=row.label, elem_id=row.element)
                for row, value, step in zip(rows, astuple(default), STEPS, strict=True)
            )
            free = gr.Checkbox(False, label=control(NAME, "free").label, elem_id="generate-free")
    return [free, guidance, cfg, temperature, top_k, top_p]
