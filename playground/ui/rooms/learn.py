"""Learn: what every room is about and what people really ask, as cards that each set the stage by a link."""

import html

import gradio as gr

from playground.ui.cards import Card, card_html, cards, terms
from playground.ui.services import Services

NAME = "learn"
LEAD = "Short answers, each with a link that sets the stage. New here? Take the tour of six steps."


def room(services: Services) -> None:
    """Build the room inside the current tab."""
    gr.HTML(page(), elem_id="learn-page", apply_default_css=False)


def page() -> str:
    """The whole room as HTML: contents at the left, cards, and the words that the page explains."""
    shown = cards()
    groups = (("Rooms", [one for one in shown if one.room]), ("Questions", [one for one in shown if not one.room]))
    contents = "".join(f"<h3>{title}</h3><ul>{''.join(map(_entry, group))}</ul>" for title, group in groups)
    articles = "".join(f'<article id="learn-{one.id}">{card_html(one)}</article>' for one in shown)
    words = "".join(
        f"<div><dt>{html.escape(entry['name'])}</dt><dd>{html.escape(entry['text'])}</dd></div>"
        for entry in sorted(terms().values(), key=lambda entry: entry["name"].lower())
    )
    return (
        '<div class="mtp-learn"><nav aria-label="Cards"><h2>Learn</h2>'
        f'<p>{LEAD}</p><button type="button" class="mtp-start" data-do="tour">Take the tour</button>{contents}'
        '<ul><li><a href="#learn-words">Words</a></li></ul></nav>'
        f'<div class="mtp-cards">{articles}<article id="learn-words"><div class="mtp-card"><div><h3>Words</h3>'
        f'<dl class="mtp-glossary">{words}</dl></div></div></article></div></div>'
    )


def _entry(one: Card) -> str:
    return f'<li><a href="#learn-{one.id}">{html.escape(one.title)}</a></li>'
