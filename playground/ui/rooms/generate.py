"""Room 4: motions from words, appearing scale by scale; a token's alternatives; what the visit has made so far."""

from collections.abc import Iterator
from dataclasses import astuple
from typing import TYPE_CHECKING, Any

import gradio as gr

from playground.errors import PlaygroundError
from playground.limits import LIMITS
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
from playground.ui.drawviews import NAME, OPENING_SECONDS, PROMPTS, controls, knobs, words_switch
from playground.ui.errors import Noted, attach, message_place
from playground.ui.generated import (
    drawing_view,
    earlier,
    onward,
    result_view,
    token_card,
    with_words,
    words_card,
)
from playground.ui.inspector import inspector
from playground.ui.layout import panel, room_frame, stage_and_score, words
from playground.ui.links import asked, commits, link_door
from playground.ui.rewriting import rewriter
from playground.ui.services import Services
from playground.ui.stage.component import stage_call
from playground.ui.state import control
from playground.ui.view import View

if TYPE_CHECKING:
    from playground.findings import Alignment
    from playground.results import Generation

LEAD = "Describe a motion. Its tokens are chosen scale by scale, and the figure sharpens. Then click a token."
DOING, LOOKING = "Beginning", "Looking at the words"
KEEP = "(changes, take) => window.mtpState?.keep('generate', ['changes', 'take'], [changes || null, +take || null])"
REVEAL = """(on) => on && requestAnimationFrame(() => requestAnimationFrame(
  () => document.querySelector('#generate-score')?.scrollIntoView({ block: 'nearest' })))"""  # the map may lie below
SKIP = gr.skip()
SHOWN = 9 + len(WISHES)  # values that show a result


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
    list, the choice among several motions, the changes for the address, the token's card, the controls, the switch of
    the words and what stands under it.
    """

    def __init__(self, services: Services) -> None:
        self.services = services

    def fill(self, visit: Visit, event: gr.EventData) -> tuple[Any, ...]:
        """The controls as a link asks for them, in the order of `Wish.checked`."""
        state = asked(event)
        visit.wanted, visit.take = read_changes(state["changes"]), int(state["take"])
        visit.words = bool(state["words"])
        values = wish_values(self.services, state)
        return *values, self._switch(str(values[-1]), value=visit.words)

    def settle(self, system: str) -> tuple[Any, ...]:
        """Another system in the menu: its own sampling, and the switch of the words where it has one."""
        return *astuple(self.services.sampling(system)), self._switch(system)

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

    def look(self, on: bool, visit: Visit) -> tuple[Any, ...]:
        """The switch of the words: the map of words by frames under the score, or not."""
        visit.words = on is True
        result = self._held(visit)
        looked, why = self._looked(visit, result.takes[visit.take])
        view = with_words(result_view(self.services, result, visit.take), looked, result, visit.take)
        return view.stage_json(), words_card(looked, why)

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
            level, count, unit = (view.controls[key] for key in ("level", "count", "unit"))
            note = f"Stopped; this is the motion after {unit} {level} of {count}." if visit.halted else ""
            yield Noted(view.stage_json(), note), view.facts_html(), *[SKIP] * (SHOWN - 2)
            if visit.halted:
                return

    def _result(self, visit: Visit, result: Result, view: View) -> tuple[Any, ...]:
        choices = [(f"Seed {one.seed}", str(n)) for n, one in enumerate(result.takes)]
        which = gr.update(choices=choices, value=str(visit.take), visible=len(choices) > 1)
        card = self._card(visit, result) if visit.token else ""
        told, made = ", then ".join(one.words for one in result.changes), result.takes[visit.take]
        looked, why = self._looked(visit, made)
        view = with_words(view, looked, result, visit.take)
        stage = Noted(view.stage_json(), f"{told[:1].upper()}{told[1:]}." if told else "")
        links = onward(result, visit.take, [one.name for one in self.services.editors()])
        told_of = (links, earlier(visit), which, write_changes(result.changes), card)
        seen = (self._switch(made.system), words_card(looked, why))
        return stage, view.facts_html(), *told_of, *(result.address[key] for key in WISHES), *seen

    def _looked(self, visit: Visit, made: "Generation") -> tuple["Alignment | None", str]:
        """Which words a motion looked at, if the visitor wants to see it; or why there is nothing to see."""
        engine = self.services.engine()
        if not visit.words or not engine.looks_at_words(made.system):
            return None, ""
        if visit.looked is None or visit.looked[0] is not made:
            try:
                visit.looked = made, engine.alignment(made)
            except PlaygroundError as error:  # no prompt
                return None, str(error)
        return visit.looked[1], ""

    def _switch(self, system: str, value: bool | None = None) -> Any:
        """The switch of the words, for a system that has something to tell; its visitor alone turns it, or a link."""
        able = self.services.engine().looks_at_words(system)
        return gr.update(visible=able) if value is None else gr.update(visible=able, value=value)

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
                prompt, system, seconds, seed, takes, plant, buttons = controls(opening, services)
            which = gr.Radio([], label=control(NAME, "take").label, visible=False, elem_id="generate-take",
                             elem_classes=["mtp-segments"])  # fmt: skip
            message = message_place("generate-message")
            facts = gr.HTML(opening.facts_html(), elem_id="generate-facts", apply_default_css=False)
            switch, looked = words_switch(services)
            further = gr.HTML("", elem_id="generate-onward", apply_default_css=False)
            shelf = inspector(elem_id="generate-earlier")
            free, *numbers = knobs(services.sampling())
            rewriter(NAME, prompt)
        words(NAME)
        door = link_door(NAME)
        changes = gr.Textbox("", elem_classes=["mtp-unseen"], show_label=False, container=False)
    wishes = [prompt, free, seconds, seed, *numbers, takes, plant, system]
    shown = [stage, facts, further, shelf, which, changes, card, *wishes, switch, looked]
    do = Handlers(services)
    _wire(do, visit, message, shown, buttons, door)
    quick: dict[str, Any] = {"model": False, "trigger_mode": "always_last"}
    attach(system.input, do.settle, [system], [*numbers, switch], message, **quick)
    seen: dict[str, Any] = {"stage": NAME, "doing": LOOKING, "trigger_mode": "always_last"}
    shown_words = attach(switch.input, do.look, [switch, visit], [stage, looked], message, **seen)
    shown_words.then(None, [switch], None, js=REVEAL, api_visibility="private")
    commits(NAME, {"words": switch}, switch.input)


def _wire(do: Handlers, visit: Any, message: Any, shown: list[Any], buttons: list[Any], door: Any) -> None:
    """What happens at which event."""
    stage, _, _, shelf, which, changes, card, *wishes, switch, _ = shown
    prompt, (go, cancel) = wishes[0], buttons
    quick: dict[str, Any] = {"queue": False, "api_visibility": "private", "show_progress": "hidden"}
    silent: dict[str, Any] = {"api_visibility": "private"}
    keys = dict(zip(WISHES, wishes, strict=True))
    filled = attach(door.arrive, do.fill, [visit], [*wishes, switch], message, model=False)
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
    back = attach(shelf.act, do.bring_back, [visit], shown, message)
    look = attach(which.input, do.look_at, [visit, which], shown, message)
    for run in (again, back, look):
        run.then(None, [changes, which], None, js=KEEP, **silent)
    commits(NAME, keys, again.then, back.then)
