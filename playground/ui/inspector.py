"""A piece of HTML on the page whose own buttons speak to Python: cards with chips, lists and an undo.

In a card, <button data-do="replace" data-code="17"> triggers "act" with {"do", "code", "number"}, number being what
stands in the card's own number field, if it has one; Enter in that field is a click on the button after it. A button
with data-deselect="NAME" takes the selection off that stage. What is focused stays focused when the card is told anew.
Texts of visitors are escaped by who writes the card.
"""

from typing import Any

import gradio as gr

_ON_LOAD = """
const tell = ({ dataset }) => trigger("act", {
  do: dataset.do, code: dataset.code ?? "", number: element.querySelector("input[type=number]")?.value ?? "",
});
let focused = null;
element.addEventListener("click", (event) => {
  const stage = event.target.closest("button[data-deselect]")?.dataset.deselect;
  if (stage) return void window.MotionStage?.get(stage)?.store.commit("select", { selection: null });
  const button = event.target.closest("button[data-do]");
  if (!button) return;
  focused = button.dataset.key ?? button.dataset.do;
  tell(button);
});
element.addEventListener("keydown", (event) => {
  if (event.key !== "Enter" || !event.target.matches("input[type=number]")) return;
  event.preventDefault();
  focused = "number";
  element.querySelector("button[data-do=number]")?.click();
});
watch("value", () => requestAnimationFrame(() => {
  if (!focused || document.activeElement !== document.body) return;
  const again = ["key", "do"].map((name) => `[data-${name}="${CSS.escape(focused)}"]`).join();
  element.querySelector(again)?.focus({ preventScroll: true });
}));
"""


def inspector(value: str = "", *, elem_id: str, **settings: Any) -> gr.HTML:
    """A card inside a Blocks context; bind `card.act(handler)`, whose event data has `do`, `code` and `number`."""
    return gr.HTML(value, js_on_load=_ON_LOAD, apply_default_css=False, elem_id=elem_id, **settings)
