"""A line of small buttons: the results of a visit. It stands in an `inspector`, which hears of the clicks."""

import html
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Entry:
    """One button of a list."""

    id: str
    text: str
    chosen: bool = False


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
    data = f'data-do="open" data-code="{id}" data-key="{id}"'
    return f'<button type="button" {data} aria-pressed="{pressed}" title="{text}">{text}</button>'
