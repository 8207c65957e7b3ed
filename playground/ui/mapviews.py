"""The panel of the room Embedding map: its controls, and the few lines that work in the browser alone."""

from dataclasses import dataclass

import gradio as gr

from playground.ui.chart import chart
from playground.ui.errors import message_place
from playground.ui.mapping import COLOURS, EACH, HEIGHT, MAPS
from playground.ui.services import Services
from playground.ui.state import control
from playground.ui.view import View

NAME = "embedding-map"
MOST = 4  # maps side by side: more would be stamps
DRAGS = [("zooms", "off"), ("draws group A", "A"), ("draws group B", "B")]
RING = """(id) => {
  document.dispatchEvent(new CustomEvent('mtp-pick', { detail: { chart: 'embedding-map', id } }));
  return id;
}"""
SELECT = """(id) => {
  const stage = window.MotionStage?.get('embedding'), [, scale, position] = String(id).split('/');
  const system = stage?.data?.tracks[0]?.system;
  if (system && position !== undefined) {
    stage.store.commit('select', { selection: { system, scale: Number(scale), position: Number(position) } });
  }
}"""
_TELL = "document.dispatchEvent(new CustomEvent('mtp-lasso', { detail: { chart: 'embedding-map', WISH } }))"
KEEP_GROUP = "(drag) => " + _TELL.replace("WISH", "group: drag === 'off' ? '' : drag")
FORGET = "() => " + _TELL.replace("WISH", "forget: true")
FREE = "() => " + _TELL.replace("WISH", "forget: true, group: ''")
SAVE = """(text) => {
  if (!text) return;
  const link = document.createElement('a');
  link.href = URL.createObjectURL(new Blob([text], { type: 'text/csv' }));
  link.download = 'embedding-map.csv';
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}"""


@dataclass(frozen=True, eq=False)
class Views:
    """The components of the panel."""

    system: gr.Dropdown
    each: gr.Radio
    colour: gr.Dropdown
    map: gr.Radio
    plot: gr.HTML
    message: gr.HTML
    facts: gr.HTML
    near: gr.Radio
    drag: gr.Radio
    clear: gr.Button
    groups: gr.HTML
    example: gr.Dropdown
    upload: gr.UploadButton
    prompt: gr.Textbox
    go: gr.Button
    csv: gr.Button
    text: gr.Textbox  # the CSV text on its way to the visitor's disk; not seen
    about: gr.HTML
    current: gr.Textbox  # id of the point that is ringed; not seen


def panel_views(services: Services, systems: list[str], opening: View, near: str) -> Views:
    """Everything of the panel, from top to bottom."""
    made = _choices(services, systems, opening)
    plot = chart(opening.charts.get("maps"), label="Maps of motions", height=HEIGHT, elem_id="embedding-map",
                 narrowest=560)  # fmt: skip
    message = message_place("embedding-message")
    facts = gr.HTML(opening.facts_html(), elem_id="embedding-facts", apply_default_css=False)
    nearest = gr.Radio(opening.controls.get("near", []), value=None, label=near, elem_id="embedding-near")
    with gr.Accordion("Compare two groups", open=False, elem_classes=["mtp-fold"]):
        with gr.Row(elem_classes=["mtp-line"]):
            drag = gr.Radio(DRAGS, value="off", label="A drag on the map", elem_id="embedding-drag",
                            elem_classes=["mtp-segments"])  # fmt: skip
            clear = gr.Button("Forget groups", size="sm", elem_id="embedding-clear", scale=0, min_width=104)
        groups = gr.HTML("", elem_id="embedding-groups", apply_default_css=False)
    example, upload, prompt, go = _placing(services)
    with gr.Row(elem_classes=["mtp-line"]):
        about = gr.HTML(opening.controls.get("about", ""), elem_id="embedding-about", apply_default_css=False)
        csv = gr.Button("Coordinates (CSV)", size="sm", elem_id="embedding-csv", scale=0, min_width=132)
    text = gr.Textbox("", visible="hidden", elem_id="embedding-text")
    current = gr.Textbox(opening.controls.get("id"), visible="hidden", elem_id="embedding-current")
    return Views(
        *made, plot, message, facts, nearest, drag, clear, groups, example, upload, prompt, go, csv, text, about,
        current,
    )  # fmt: skip


def _choices(
    services: Services, systems: list[str], opening: View
) -> tuple[gr.Dropdown, gr.Radio, gr.Dropdown, gr.Radio]:
    titles = {one.name: one.title for one in services.engine().systems()}
    several = len(systems) > 1
    system = gr.Dropdown(
        [(titles[name], name) for name in systems], value=opening.controls.get("system", []), multiselect=True,
        max_choices=MOST, label="Systems side by side", elem_id="embedding-system", elem_classes=["mtp-several"],
        visible=several,
    )  # fmt: skip
    with gr.Row(elem_classes=["mtp-line", "mtp-scales"]):
        each = gr.Radio(EACH, value="clip", label=control(NAME, "each").label, elem_id="embedding-each",
                        elem_classes=["mtp-segments"], min_width=0)  # fmt: skip
        kind = gr.Radio(MAPS, value="tsne", label=control(NAME, "map").label, elem_id="embedding-kind",
                        elem_classes=["mtp-segments"], min_width=0, visible=several)  # fmt: skip
        colour = gr.Dropdown(COLOURS["clip"], value="action", label=control(NAME, "colour").label,
                             elem_id="embedding-colour", min_width=100)  # fmt: skip
    return system, each, colour, kind


def _placing(services: Services) -> tuple[gr.Dropdown, gr.UploadButton, gr.Textbox, gr.Button]:
    """What a new point is made of."""
    with gr.Accordion("Place a motion of your own", open=False, elem_classes=["mtp-fold"]):
        with gr.Row(elem_classes=["mtp-line"]):
            example = gr.Dropdown(services.example_choices(), value=None, label=control(NAME, "place").label,
                                  elem_id="embedding-place", scale=1, min_width=160)  # fmt: skip
            upload = gr.UploadButton("Upload", file_count="single", size="sm", scale=0, min_width=84,
                                     elem_id="embedding-upload")  # fmt: skip
        with gr.Row(elem_classes=["mtp-line"]):
            prompt = gr.Textbox("", label="Or a prompt: 5 s, seed 0", max_lines=1, elem_id="embedding-prompt", scale=1,
                                min_width=160, placeholder="a person waves")  # fmt: skip
            go = gr.Button("Generate and place", size="sm", scale=0, min_width=140, elem_id="embedding-go")
    return example, upload, prompt, go
