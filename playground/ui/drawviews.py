"""The controls of the room Generate, from top to bottom: the form, and the folded sampling."""

from dataclasses import astuple
from functools import partial
from typing import Any

import gradio as gr

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.systems import SamplingDefaults
from playground.ui.drawing import WISHES
from playground.ui.services import Services
from playground.ui.state import control
from playground.ui.view import View

NAME = "generate"
PROMPTS = (
    control(NAME, "prompt").default,
    "someone jogs",
    "a person turns left while walking",
    "a person is waving with both hands",
)
OPENING_SECONDS = float(control(NAME, "seconds").default)
GUIDANCES = (
    "Two guidances: <b>s</b> acts while tokens are chosen and makes them follow the words; <b>g</b> leaves the tokens "
    "as they are and changes how they are read."
)
PLANT = "Standing feet slide less; the tokens stay the same."
STEPS = (0.1, 0.1, 0.05, 0.01, 0.01)  # of the sampling sliders


def controls(opening: View, services: Services) -> tuple[Any, ...]:
    """From top to bottom: prompt, system if there are several, seconds, seed, seeds side by side, "Plant the feet" if
    there is a root refiner, "Generate" and "Stop"."""
    able = {one.name: one.title for one in services.shipped("generator")}
    usual = services.system().name if able else None
    prompt = gr.Textbox(
        opening.controls.get("prompt", PROMPTS[0]), label="Prompt", lines=2, max_lines=3,
        placeholder=PROMPTS[0], elem_id="generate-prompt",
    )  # fmt: skip
    gr.Examples([[text] for text in PROMPTS], [prompt], label="Try one of these", elem_id="generate-examples")
    with gr.Row(elem_classes=["mtp-line"]):
        system = gr.Dropdown(
            [(title, name) for name, title in able.items()], value=usual if usual in able else None,
            label=control(NAME, "system").label, elem_id="generate-system", visible=len(able) > 1, min_width=160,
            scale=3,
        )  # fmt: skip
        seconds = gr.Slider(
            LIMITS.min_seconds, LIMITS.max_seconds, value=OPENING_SECONDS, step=0.2, label="Seconds",
            elem_id="generate-seconds", min_width=140, scale=2,
        )  # fmt: skip
    with gr.Row(elem_classes=["mtp-line", "mtp-draws"]):
        seed = gr.Number(
            0, label="Seed", precision=0, minimum=0, maximum=LIMITS.max_seed, elem_id="generate-seed",
            min_width=72, scale=0,
        )  # fmt: skip
        takes = gr.Number(
            1, label=control(NAME, "takes").label, precision=0, minimum=1, maximum=LIMITS.max_seeds,
            elem_id="generate-takes", min_width=96, scale=0,
        )  # fmt: skip
        plant = gr.Checkbox(
            False, label=control(NAME, "plant").label, info=PLANT, visible=services.refines(), min_width=160,
            elem_id="generate-plant",
        )  # fmt: skip
    with gr.Row(elem_classes=["mtp-line"]):
        go = gr.Button("Generate", variant="primary", size="sm", elem_id="generate-go")
        cancel = gr.Button("Stop", variant="secondary", size="sm", interactive=False, elem_id="generate-stop")
    return prompt, system, seconds, seed, takes, plant, [go, cancel]


def words_switch(services: Services) -> tuple[Any, Any]:
    """The switch of the map of words by frames, for a system that can tell, and the sentence under it."""
    try:
        able = services.engine().looks_at_words(services.system().name)
    except PlaygroundError:
        able = False
    switch = gr.Checkbox(False, label=control(NAME, "words").label, visible=able, elem_id="generate-words")
    return switch, gr.HTML("", elem_id="generate-looked", apply_default_css=False)


def knobs(default: SamplingDefaults) -> list[Any]:
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
