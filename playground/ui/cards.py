"""Teaching text, kept as data in learn/: a card a room, a card a question, terms with their hover text, the tour.

    learn/<id>.md     lines "key: value" (title, and if wanted room, equation, reading, paper, call, try), a line "---",
                      the idea in a few paragraphs, then questions: "## Question?" and its answer
    learn/terms.json  term -> {"name", "text"}: what [[term]] or [[term|other words]] in a card shows on hover and focus
    learn/tour.json   the steps: {"title", "text", "query": address of the room, "target": CSS selector}

A room shows its card by `layout.words(NAME)`; a number's hover text is `term("mpjpe")`; the same words stand in Learn,
and in a notebook by `display(HTML(card_html(card("tokenize"))))`. Equations are plain text with _ and ^ for what stands
low or high, and ";" where a new line starts. Facts come from the papers named on the card.
"""

import html
import json
import re
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path

from playground.errors import PlaygroundError
from playground.ui.state import ROOMS, parse, query

FOLDER = Path(__file__).parent / "learn"
KEYS = ("title", "room", "equation", "reading", "paper", "call", "try")
QUESTIONS = ("token-and-time", "accumulated-sum", "shared-codebook", "length", "two-guidances")


@dataclass(frozen=True)
class Card:
    """One card. idea and answers are in the small Markdown of this module."""

    id: str
    title: str
    idea: str
    room: str = ""  # the room it belongs to; "" for a question of its own
    equation: str = ""
    reading: str = ""  # the equation in words
    paper: str = ""  # where it stands
    call: str = ""  # the Python that does it
    link: str = ""  # address that sets the stage, from the "?" on
    questions: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Step:
    """One step of the tour."""

    title: str
    text: str
    query: str
    target: str


@lru_cache(maxsize=1)
def terms() -> dict[str, dict[str, str]]:
    """Every term: {"name", "text"}."""
    return dict(json.loads((FOLDER / "terms.json").read_text(encoding="utf-8")))


def term(name: str) -> str:
    """The hover text of a term; KeyError for one that is not explained."""
    return terms()[name]["text"]


@lru_cache(maxsize=1)
def tour() -> tuple[Step, ...]:
    """The steps of the guided tour."""
    return tuple(Step(**step) for step in json.loads((FOLDER / "tour.json").read_text(encoding="utf-8")))


def tour_json() -> str:
    """The steps for the browser half, as JSON text that may stand inside a script element."""
    return json.dumps([asdict(step) for step in tour()]).replace("<", "\\u003c")


@lru_cache(maxsize=64)
def card(name: str) -> Card:
    """The card of a room or a question. PlaygroundError if there is none or its file is not in the form above."""
    try:
        text = (FOLDER / f"{name}.md").read_text(encoding="utf-8")
    except OSError as error:
        raise PlaygroundError(f"there is no card {name!r}") from error
    head, _, body = text.partition("\n---\n")
    values = dict(line.split(": ", 1) for line in head.splitlines())
    if not body or "title" not in values or set(values) - set(KEYS):
        raise PlaygroundError(f"the card {name!r} needs lines of {', '.join(KEYS)}, a line ---, and its text")
    idea, *parts = re.split(r"^## ", body, flags=re.MULTILINE)
    questions = tuple((question.strip(), answer.strip()) for question, _, answer in (p.partition("\n") for p in parts))
    given = {key: values.get(key, "") for key in KEYS if key != "try"}
    return Card(id=name, idea=idea.strip(), link=values.get("try", ""), questions=questions, **given)


def cards() -> list[Card]:
    """All cards in the order of Learn: the rooms that are there, then the questions."""
    return [card(room) for room in ROOMS if (FOLDER / f"{room}.md").is_file()] + [card(name) for name in QUESTIONS]


def card_html(shown: Card, level: int = 3, inside: bool = False) -> str:
    """A card as HTML. level: of its headings; inside: in the room itself, where title and "try it" are left out."""
    parts = [] if inside else [f"<h{level}>{html.escape(shown.title)}</h{level}>"]
    parts.append(_paragraphs(shown.idea, "In one sentence. " if inside else ""))
    if shown.equation:
        parts.append(f'<div class="mtp-equation">{equation_html(shown.equation)}</div>')
        parts.append(f'<p class="mtp-reading">{_SYMBOL.sub(_symbol, _inline(shown.reading))}</p>')
    for question, answer in shown.questions:
        parts.append(f"<details><summary>{_inline(question)}</summary>{_paragraphs(answer)}</details>")
    return f'<div class="mtp-card"><div>{"".join(parts)}</div><div>{_sources(shown, inside)}</div></div>'


def _sources(shown: Card, inside: bool) -> str:
    """What stands beside a card: the call, the paper, the link."""
    calls = "".join(f"<code>{html.escape(call)}</code>" for call in shown.call.split("; ")) if shown.call else ""
    rows = [("In Python", calls), ("In the paper", html.escape(shown.paper))]
    facts = "".join(f"<div><dt>{name}</dt><dd>{value}</dd></div>" for name, value in rows if value)
    link = ""
    if shown.link and not inside:
        address = query(parse(shown.link)) or "?room=tokenize"
        link = f'<p class="mtp-try"><a data-state href="{html.escape(address, quote=True)}">Try it</a></p>'
    return f'<dl class="mtp-sources">{facts}</dl>{link}'


def equation_html(text: str) -> str:
    """An equation as HTML: letters slanted, what follows _ low, what follows ^ high, ";" starts a line of its own."""
    lines = [part.strip() for part in text.split(";")]
    return "".join(f"<div>{_formula(line)}</div>" for line in lines)


def term_html(name: str, words: str = "") -> str:
    """A term with its dotted underline and hover text. KeyError for one that is not explained."""
    shown = html.escape(words or terms()[name]["name"])
    return f'<span class="mtp-term" tabindex="0" data-card="{html.escape(term(name), quote=True)}">{shown}</span>'


_SYMBOL = re.compile(r"([A-Za-zẑφ])_(\{[^}]*\}|[A-Za-z0-9])")  # a letter with something low, in running text
_LOW_HIGH = re.compile(r"([_^])(\{[^}]*\}|[A-Za-z0-9−]+)")


def _symbol(match: re.Match[str]) -> str:
    return f"<i>{match[1]}</i><sub>{_formula(match[2].strip('{}'))}</sub>"


def _formula(text: str) -> str:
    def shifted(match: re.Match[str]) -> str:
        tag = "sub" if match[1] == "_" else "sup"
        return f"<{tag}>{match[2].strip('{}')}</{tag}>"

    placed = _LOW_HIGH.sub(shifted, html.escape(text))
    return re.sub(r"(?<![A-Za-z&])([A-Za-zẑφ])(?![A-Za-z;])", r"<i>\1</i>", placed)


def _paragraphs(text: str, lead: str = "") -> str:
    blocks = [block for block in re.split(r"\n\s*\n", text.strip()) if block]
    strong = f"<strong>{lead}</strong>" if lead else ""
    return "".join(f"<p>{strong if n == 0 else ''}{_inline(block)}</p>" for n, block in enumerate(blocks))


def _inline(text: str) -> str:
    """**bold**, *slanted*, `code` and [[term]] or [[term|words]] of a text; everything else is escaped."""
    escaped = html.escape(" ".join(text.split()), quote=False)
    escaped = re.sub(r"`([^`]+)`", r"<code>\1</code>", escaped)
    escaped = re.sub(r"\*\*([^*]+)\*\*", r"<strong>\1</strong>", escaped)
    escaped = re.sub(r"\*([^*]+)\*", r"<em>\1</em>", escaped)

    def linked(match: re.Match[str]) -> str:
        name, _, words = match[1].partition("|")
        return term_html(name.lower(), words or name)

    return re.sub(r"\[\[([^\]]+)\]\]", linked, escaped)
