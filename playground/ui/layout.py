"""The frame that every room has: figures left, panel right, the score under both, words below (ui.md, "The stage")."""

import html
from collections.abc import Iterator
from contextlib import contextmanager

import gradio as gr

from playground.ui.cards import card, card_html
from playground.ui.stage.component import score_slot, stage_component
from playground.ui.view import View

FIGURES_HEIGHT = 392  # CSS pixels; with player and score a room's first look fits 1280x720


@contextmanager
def room_frame(name: str) -> Iterator[gr.Column]:
    """The grid of one room; what is made inside goes to its place by itself."""
    with gr.Column(elem_classes=["mtp-room", f"mtp-room-{name}"]) as frame:
        yield frame


def stage_and_score(name: str, opening: View, height: int = FIGURES_HEIGHT) -> gr.HTML:
    """The room's stage at the left and its score across the page, with the opening result on them."""
    stage = stage_component(
        name, opening.stage_json(), height, elem_id=f"{name}-stage", elem_classes=["mtp-stage"], container=False
    )
    score_slot(name, elem_id=f"{name}-score", elem_classes=["mtp-score"])
    return stage


@contextmanager
def panel(title: str, lead: str, compare: bool = False, back: bool = False) -> Iterator[gr.Column]:
    """The panel of a room, opened by what the room shows in one line and how to read it in one more.

    compare: with the switch that takes what the room shows to Compare; back: with the way back from there (bar.js).
    """
    switch = '<button type="button" class="mtp-switch" data-part="compare">Compare</button>' if compare else ""
    switch += '<button type="button" class="mtp-switch" data-part="back" hidden>Back</button>' if back else ""
    with gr.Column(elem_classes=["mtp-panel"], min_width=0) as box:
        gr.HTML(
            f'<div class="mtp-lead"><div><h2>{html.escape(title)}</h2>{switch}</div><p>{html.escape(lead)}</p></div>',
            apply_default_css=False,
        )
        yield box


def words(name: str) -> None:
    """The folded explanation of a room: its card of Learn (cards.py)."""
    with gr.Accordion("What am I looking at?", open=False, elem_classes=["mtp-words"]):
        gr.HTML(card_html(card(name), inside=True), apply_default_css=False)
