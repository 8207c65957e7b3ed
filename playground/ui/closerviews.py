"""The views of the panel of Tokenize that its closer looks fill: the card of a token, and what the words do."""

from dataclasses import dataclass
from typing import Any

import gradio as gr

from playground.ui.closer import Closer
from playground.ui.errors import attach
from playground.ui.inspector import inspector
from playground.ui.state import control
from playground.ui.tokenizing import NAME
from playground.ui.wordcard import MARKS

_LEAD = (
    '<div class="mtp-lead"><h2>What do the words do?</h2><p>The same motion tokenized with its caption, without, and '
    "with a wrong one. Under the score: where the detokenizer looks.</p></div>"
)
_KEEP = "(value) => window.mtpState?.keep('tokenize', ['{key}'], [value || null])"


@dataclass(frozen=True, eq=False)
class Views:
    """The components of both views."""

    card: gr.HTML
    swapped: gr.Textbox  # the code that was put in, for the address; not seen
    misled: gr.Textbox  # the wrong caption that was compared with, likewise
    wrong: gr.Textbox
    compare: gr.Button
    told: gr.HTML
    marks: gr.Radio
    back: gr.Button


def closer_views() -> Views:
    """Both views inside the panel; rooms.css shows the one that is filled."""
    with gr.Column(elem_classes=["mtp-view", "mtp-view-token"], min_width=0):
        card = inspector(elem_id="tokenize-card")
        swapped = gr.Textbox("", visible="hidden", elem_id="tokenize-swapped")
        misled = gr.Textbox("", visible="hidden", elem_id="tokenize-misled")
    with gr.Column(elem_classes=["mtp-view", "mtp-view-words"], min_width=0):
        gr.HTML(_LEAD, apply_default_css=False)
        with gr.Row(elem_classes=["mtp-line"]):
            wrong = gr.Textbox(
                "", label=control(NAME, "wrong").label, max_lines=1, elem_id="tokenize-wrong", scale=1, min_width=160
            )
            compare = gr.Button(
                "Compare", variant="primary", size="sm", scale=0, min_width=84, elem_id="tokenize-compare"
            )
        told = gr.HTML("", elem_id="tokenize-words", apply_default_css=False)
        marks = gr.Radio(MARKS, value="bare", label="Marked in the score: tokens that change", elem_id="tokenize-marks")
        back = gr.Button("Back to the motion", size="sm", elem_id="tokenize-back", elem_classes=["mtp-quiet"])
    return Views(card, swapped, misled, wrong, compare, told, marks, back)


def bind_closer(
    closer: Closer, views: Views, ask: gr.Button, session: gr.State, stage: gr.HTML, how: dict[str, Any]
) -> None:
    """Bind what the views, the stage and the button `ask` do. how: settings of `attach`."""
    looked = [session, stage, views.card, views.told, views.swapped, views.misled]
    attach(stage.select, closer.select, [session], looked, **how)
    attach(views.card.act, closer.act, [session], looked, **how)
    for event in (ask.click, views.compare.click, views.wrong.submit):
        attach(event, closer.words, [views.wrong, session], [*looked, views.wrong], **how)
    attach(views.marks.input, closer.mark, [views.marks, session], looked, **how)
    attach(views.back.click, closer.close, [session], looked, **how)
    for kept, key in ((views.swapped, "code"), (views.misled, "wrong")):
        kept.change(None, [kept], None, js=_KEEP.format(key=key), api_visibility="private")
