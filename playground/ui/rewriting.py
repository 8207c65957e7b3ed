"""The folded panel "Rewrite the prompt": a prompt before, after and why, with a button for every version of it."""

import html
from collections.abc import Callable
from typing import Any

import gradio as gr

from playground.errors import PlaygroundError
from playground.text.endpoint import URL, Endpoint, from_environment
from playground.text.rewriting import Rewritten, rewrite
from playground.ui.errors import attach, message_place
from playground.ui.facts import as_sentence, significant
from playground.ui.inspector import inspector

RULES = f"Rules rewrite it, offline. A language model of your own does it where {URL} names one."
Plan = Callable[[Rewritten], str]  # the steps of a rewritten prompt as a room takes them, one text


def rewriter(name: str, prompt: Any, plan: tuple[str, Plan, Any] | None = None) -> None:
    """The panel inside the current column. prompt: the textbox that it reads, and that a version is put into.

    plan: where steps can follow each other: what the button says, the steps as one text, and where that text goes; the
    first step goes into the prompt.
    """
    with gr.Accordion("Rewrite the prompt", open=False, elem_classes=["mtp-knobs"], elem_id=f"{name}-rewrite"):
        with gr.Row(elem_classes=["mtp-line"]):
            go = gr.Button("Rewrite", size="sm", scale=0, min_width=88, elem_id=f"{name}-rewrite-go")
            gr.HTML(f'<p class="mtp-aside">{html.escape(who())}</p>', apply_default_css=False)
        message = message_place(f"{name}-rewrite-message")
        card = inspector(elem_id=f"{name}-rewritten")

    def run(text: str) -> tuple[str]:
        found = rewrite(text, from_environment())
        return (rewritten_card(found, (plan[0], plan[1](found)) if plan else None),)

    def use(event: gr.EventData) -> tuple[str, ...]:
        first, _, following = str(event.code).partition("\n")
        return (first, following) if plan else (first,)

    attach(go.click, run, [prompt], [card], message, model=False)
    attach(card.act, use, [], [prompt, plan[2]] if plan else [prompt], message, model=False)


def who() -> str:
    """Who rewrites here, in a sentence."""
    try:
        found: Endpoint | None = from_environment()
    except PlaygroundError as error:
        return as_sentence(str(error))
    return f"The language model {found.name} rewrites it, and rules where it fails." if found else RULES


def rewritten_card(found: Rewritten, plan: tuple[str, str] | None = None) -> str:
    """A prompt before, after and why. plan: what the button says that takes all steps, and these steps as one text."""
    steps = "".join(
        f"<li><span>{html.escape(step.text)}</span> <small>{significant(step.seconds)} s</small>{_use(step.text)}</li>"
        for step in found.steps
    )
    every = _button(plan[0], f"{found.steps[0].text}\n{plan[1]}", "plan") if plan and len(found.steps) > 1 else ""
    why = "".join(f"<li>{html.escape(as_sentence(note))}</li>" for note in found.notes)
    return (
        '<section class="mtp-rewritten" aria-label="The prompt rewritten">'
        + _version("Before", found.original.replace("\n", " "))
        + _version("As captions say it", found.normalised)
        + f"<h3>Step by step</h3><ol>{steps}</ol>{every}"
        + _version("Told expressively", found.expressive)
        + f"<h3>Why</h3><ul>{why}</ul></section>"
    )


def _version(title: str, text: str) -> str:
    return f"<h3>{title}</h3><p><span>{html.escape(text)}</span>{_use(text)}</p>"


def _use(text: str) -> str:
    return _button("Use", text, "use", f"Use: {text}")


def _button(words: str, text: str, do: str, label: str = "") -> str:
    code = html.escape(text, quote=True).replace("\n", "&#10;")
    told = f' aria-label="{html.escape(label, quote=True)}"' if label else ""
    return (
        f'<button type="button" class="mtp-quiet" data-do="{do}" data-code="{code}"{told}>{html.escape(words)}</button>'
    )
