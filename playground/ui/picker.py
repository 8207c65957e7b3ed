"""A list of buttons on the page whose clicks Python hears of: alternatives of a token, results of the visit.

    earlier = picker("generate-earlier", stage="generate")
    earlier.pick(handler, ...)                     # def handler(event: gr.EventData): event.id is the data-pick clicked

Its value is HTML made here or in a room; inside it `<button data-pick="ID">` reports a click, and `data-close` takes
the selection off the stage, of which the room hears as of any other selection.
"""

import html
from collections.abc import Sequence
from dataclasses import dataclass

import gradio as gr

_ON_LOAD = """
element.addEventListener('click', (event) => {
  const button = event.target.closest('button');
  if (button?.dataset.pick !== undefined) trigger('pick', { id: button.dataset.pick });
  if (button?.hasAttribute('data-close')) {
    window.MotionStage?.get(props.stage)?.store.commit('select', { selection: null });
  }
});
"""


@dataclass(frozen=True)
class Entry:
    """One button of a list."""

    id: str
    text: str
    chosen: bool = False


def picker(elem_id: str, *, stage: str, value: str = "") -> gr.HTML:
    """The place of a list, empty at first; `stage` is the name of the room's stage."""
    return gr.HTML(
        value=value, js_on_load=_ON_LOAD, apply_default_css=False, elem_id=elem_id, elem_classes=["mtp-picker"],
        stage=stage,
    )  # fmt: skip


def shelf(title: str, entries: Sequence[Entry]) -> str:
    """A line of small buttons under a word, "" without entries."""
    if not entries:
        return ""
    buttons = "".join(map(_button, entries))
    name = html.escape(title)
    return f'<div class="mtp-shelf" role="group" aria-label="{name}"><span>{name}</span><div>{buttons}</div></div>'


def _button(entry: Entry) -> str:
    id, text, pressed = (
        html.escape(entry.id, quote=True),
        html.escape(entry.text, quote=True),
        str(entry.chosen).lower(),
    )
    return f'<button type="button" data-pick="{id}" aria-pressed="{pressed}" title="{text}">{text}</button>'
