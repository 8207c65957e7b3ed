"""Room 4: a motion from words, appearing scale by scale while it is generated."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass
from functools import partial
from typing import Any

import gradio as gr
import numpy as np

from playground.limits import LIMITS
from playground.systems import SamplingDefaults
from playground.text.prompts import normalise
from playground.ui.errors import Noted, attach, message_place
from playground.ui.facts import Fact, significant
from playground.ui.layout import panel, room_frame, stage_and_score, words
from playground.ui.links import asked, commits, link_door
from playground.ui.scenes import generated_scene, token_facts
from playground.ui.services import Services
from playground.ui.state import control
from playground.ui.uploads import checked_number
from playground.ui.view import View

NAME = "generate"
LEAD = "Describe a motion. Its tokens are chosen scale by scale, and the figure sharpens with every one of them."
PROMPTS = (
    control(NAME, "prompt").default,
    "someone jogs",
    "a person turns left while walking",
    "a person is waving with both hands",
)
OPENING_SECONDS = float(control(NAME, "seconds").default)
DOING = "Choosing the first tokens"
ENTROPY_CARD = (
    "How undecided the generator was, on average over its tokens: at 0 bit one code was certain, at 3 bit it was like "
    "drawing one of eight. Faint cells are unsure ones."
)


STEPS = (0.1, 0.1, 0.05, 0.01, 0.01)  # of the sampling sliders
WISHES = ("prompt", "free", "seconds", "seed", "g", "s", "temperature", "topk", "topp")  # keys of state.CONTROLS


@dataclass(frozen=True)
class Wish:
    """What is asked of the generator, checked."""

    prompt: str | None
    seconds: float
    seed: int
    guidance: float
    cfg: float
    temperature: float
    top_k: float
    top_p: float

    @classmethod
    def checked(cls, prompt: object, free: object, *numbers: object) -> "Wish":
        """From the controls as they come; PlaygroundError with one sentence for what does not fit."""
        words = None if free is True else normalise(prompt)  # type: ignore[arg-type]
        bounds = (
            ("the length in seconds", LIMITS.min_seconds, LIMITS.max_seconds),
            ("the seed", 0, LIMITS.max_seed),
            ("the decoder's guidance", 0, LIMITS.max_guidance),
            ("the generator's guidance", 0, LIMITS.max_guidance),
            ("the temperature", 0, LIMITS.max_temperature),
            ("top-k", 0.01, 1),
            ("top-p", 0.05, 1),
        )
        seconds, seed, *rest = (checked_number(n, *bound) for n, bound in zip(numbers, bounds, strict=True))
        return cls(words, seconds, int(seed), *rest)


@dataclass
class Control:
    """The one object that a visitor's running generation and the "Stop" button share."""

    stop: bool = False


def stream(services: Services, wish: Wish) -> Iterator[View]:
    """One view after every scale; the last one is the result."""
    began = time.perf_counter()
    engine, system = services.engine(), services.default_system()
    sizes, palettes = services.scales(system.name), services.palettes(system.name)
    steps = engine.generate_steps(
        wish.prompt, wish.seconds, system=system.name, seed=wish.seed, guidance=wish.guidance, cfg=wish.cfg,
        temperature=wish.temperature, top_k=wish.top_k, top_p=wish.top_p,
    )  # fmt: skip
    for step in steps:
        yield View(
            stage=generated_scene(system, step.motion, step.levels, step.entropy, palettes, sizes),
            facts=(*token_facts(step.levels), entropy_fact(step.entropy)),
            controls={"prompt": wish.prompt or "", "level": len(step.levels), "count": len(sizes)},
            seconds=time.perf_counter() - began,
        )


def entropy_fact(entropy: Sequence[Any]) -> Fact:
    """Mean entropy over all tokens so far."""
    mean = (
        float(np.concatenate([np.asarray(row, np.float64) for row in entropy]).mean()) if len(entropy) else float("nan")
    )
    return Fact(f"{significant(mean)} bit", "mean entropy", ENTROPY_CARD)


def opening_view(services: Services) -> View:
    """The room's first result: the first prompt, seed 0."""
    numbers = astuple(services.sampling())
    *_, last = stream(services, Wish.checked(PROMPTS[0], False, OPENING_SECONDS, 0, *numbers))
    return last


class Handlers:
    """What the controls do. A generation looks at its control after every scale, so that stopping waits for nobody."""

    def __init__(self, services: Services) -> None:
        self.services = services

    def fill(self, event: gr.EventData) -> tuple[Any, ...]:
        """The controls as a link asks for them, in the order of `Wish.checked`."""
        state, own = asked(event), self.services.sampling()
        usual = {"g": own.guidance, "s": own.cfg, "temperature": own.temperature, "topk": own.top_k, "topp": own.top_p}
        return tuple(state.values.get(key, usual.get(key, state[key])) for key in WISHES)

    def begin(self, control: Control) -> tuple[Any, ...]:
        """At the click, before any waiting: "Stop" becomes possible and "Generate" does not."""
        control.stop = False
        return gr.update(interactive=False), gr.update(interactive=True)

    def stop(self, control: Control) -> Any:
        """Ask the running generation to end after the scale it is at."""
        control.stop = True
        return gr.update(interactive=False)

    def end(self) -> tuple[Any, ...]:
        """After the last word: "Generate" becomes possible again."""
        return gr.update(interactive=True), gr.update(interactive=False)

    def generate(self, control: Control, *values: Any) -> Iterator[tuple[Any, ...]]:
        """Stage and facts after every scale."""
        wish = Wish.checked(*values)
        if control.stop:
            yield Noted(gr.skip(), "Stopped before the first scale was done."), gr.skip()
            return
        for view in stream(self.services, wish):
            level, count = view.controls["level"], view.controls["count"]
            halted = control.stop and level < count
            note = f"Stopped; this is the motion after scale {level} of {count}." if halted else ""
            yield Noted(view.stage_json(), note), view.facts_html()
            if halted:
                return


def room(services: Services) -> None:
    """Build the room inside the current tab."""
    opening = services.first_view(NAME, opening_view)
    running = gr.State(Control(), time_to_live=LIMITS.session_seconds)
    with room_frame(NAME):
        stage = stage_and_score(NAME, opening)
        with panel("Words become a motion", LEAD):
            prompt, seconds, seed, go, cancel = _controls(opening)
            message = message_place("generate-message")
            facts = gr.HTML(opening.facts_html(), elem_id="generate-facts", apply_default_css=False)
            free, *numbers = _knobs(services.sampling())
        words(NAME)
        door = link_door(NAME)
    do = Handlers(services)
    wishes = [prompt, free, seconds, seed, *numbers]
    buttons = [go, cancel]
    quick: dict[str, Any] = {"queue": False, "api_visibility": "private", "show_progress": "hidden"}
    filled = attach(door.arrive, do.fill, [], wishes, message, model=False)
    for event in (go.click, prompt.submit, filled.then):
        started = event(do.begin, [running], buttons, **quick)
        run = attach(started.then, do.generate, [running, *wishes], [stage, facts], message, stage=NAME, doing=DOING)
        ended = run.then(do.end, None, buttons, **quick)
    ended.then(None, None, None, js=f"() => window.mtpState?.settled('{NAME}')", api_visibility="private")
    commits(NAME, dict(zip(WISHES, wishes, strict=True)), go.click, prompt.submit, forget=("selection",))
    cancel.click(do.stop, [running], [cancel], **quick)


def _controls(opening: View) -> tuple[Any, ...]:
    """The controls from top to bottom: prompt, seconds, seed, "Generate", "Stop"."""
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
            min_width=80, scale=0,
        )  # fmt: skip
    with gr.Row(elem_classes=["mtp-line"]):
        go = gr.Button("Generate", variant="primary", size="sm", elem_id="generate-go")
        cancel = gr.Button("Stop", variant="secondary", size="sm", interactive=False, elem_id="generate-stop")
    return prompt, seconds, seed, go, cancel


def _knobs(default: SamplingDefaults) -> list[Any]:
    """The folded sampling controls in the order of `Wish.checked`; the first one is free-form."""
    with gr.Accordion("Sampling", open=False, elem_classes=["mtp-knobs"]), gr.Row(elem_classes=["mtp-pairs"]):
        guidance, cfg, temperature, top_k, top_p = (
            gr.Slider(row.low, row.high, value, step=step, label=row.label, elem_id=row.element)
            for row, value, step in zip(map(partial(control, NAME), WISHES[4:]), astuple(default), STEPS, strict=True)
        )
        free = gr.Checkbox(False, label=control(NAME, "free").label, elem_id="generate-free")
    return [free, guidance, cfg, temperature, top_k, top_p]
