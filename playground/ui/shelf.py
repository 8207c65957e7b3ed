"""A line of small buttons: the results of a visit. It stands in an `inspector`, which hears of the clicks."""

import html
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Entry:
    """One button of a list."""

    id: str
    text: str  # what may be cut where there is little room
    chosen: bool = False
    tail: str = ""  # what tells it from the others, never cut


def shelf(title: str, entries: Sequence[Entry]) -> str:
    """A line of small buttons under a word, "" without entries."""
    if not entries:
        return ""
    buttons = "".join(map(_button, entries))
    name = html.escape(title)
    return f'<div class="mtp-shelf" role="group" aria-label="{name}"><span>{name}</span><div>{buttons}</div></div>'


def _button(entry: Entry) -> str:
    id, text, tail = (html.escape(words, quote=True) for words in (entry.id, entry.text, entry.tail))
    data = f'data-do="open" data-code="{id}" data-key="{id}" aria-pressed="{str(entry.chosen).lower()}"'
    rest = f"<small>{tail}</small>" if tail else ""
    return f'<button type="button" {data} title="{text} {tail}"><span>{text}</span>{rest}</button>'
