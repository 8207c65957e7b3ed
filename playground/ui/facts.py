"""Numbers as a visitor reads them: two or three significant digits, a unit, what they were measured on. Pure text."""

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Fact:
    """One number of a result line: "38 mm" "MPJPE" with the words of its hover card."""

    value: str
    label: str
    card: str = ""  # what the label means, shown on hover and focus


def significant(value: float, digits: int = 2) -> str:
    """`value` with `digits` significant digits and no exponent: 38.42 -> "38", 0.2149 -> "0.21", 1234 -> "1,230"."""
    if not math.isfinite(value):
        return "not measured"
    if value == 0:
        return "0"
    digits = max(digits, 3) if abs(value) >= 100 else digits
    places = digits - 1 - math.floor(math.log10(abs(value)))
    rounded = round(value, places)
    return f"{rounded:,.{max(places, 0)}f}" if places > 0 else f"{rounded:,.0f}"


def millimetres(value: float | None) -> str:
    """ "38 mm", or a dash where there is nothing to compare with."""
    return "–" if value is None else f"{significant(value)} mm"


def bits(sizes: list[int], codes: list[int]) -> float:
    """Bits needed to write the tokens down, sum of size * log2(codes) over the scales."""
    return sum(size * math.log2(code) for size, code in zip(sizes, codes, strict=True) if code > 1)


def bits_text(count: float) -> str:
    """ "840 bit", "1.7 kbit"."""
    return f"{significant(count)} bit" if count < 1000 else f"{significant(count / 1000)} kbit"


def seconds_text(seconds: float) -> str:
    """ "0.21 s"; "1.5 s"; "<0.01 s"."""
    return "<0.01 s" if seconds < 0.01 else f"{significant(seconds)} s"


def badge(kind: str, seconds: float) -> str:
    """The live / stored badge with the time taken, as HTML."""
    if kind == "stored":
        told = f"Computed when the playground was built, in {seconds_text(seconds)}; loaded now"
        return f'<span class="mtp-badge mtp-stored" title="{told}">stored</span>'
    return f'<span class="mtp-badge mtp-live" title="Computed just now">live, {seconds_text(seconds)}</span>'


def facts_line(facts: Sequence[Fact], badge: str = "") -> str:
    """A result in one line of HTML: the facts, then a badge where no stage shows it. Empty without facts."""
    if not facts:
        return ""
    cells = " ".join(_cell(fact) for fact in facts)
    last = f'<div class="mtp-fact">{badge}</div>' if badge else ""
    return f'<dl class="mtp-facts">{cells}{last}</dl>'


def _cell(fact: Fact) -> str:
    label = html.escape(fact.label)
    if fact.card:
        label = f'<span class="mtp-term" tabindex="0" data-card="{html.escape(fact.card, quote=True)}">{label}</span>'
    return f'<div class="mtp-fact"><dd>{html.escape(fact.value)}</dd> <dt>{label}</dt></div>'


def as_sentence(text: str) -> str:
    """Words of an error as a sentence on the page: one line, a capital first letter, a full stop; "" stays ""."""
    line = " ".join(text.split())
    return line[:1].upper() + line[1:] + ("" if not line or line[-1] in ".!?" else ".")


def table(header: list[str], rows: list[list[str]], caption: str) -> str:
    """A small HTML table; the first column is text, the others are numbers."""
    head = "".join(f'<th scope="col">{html.escape(name)}</th>' for name in header)
    body = "".join(
        "<tr>" + f'<th scope="row">{html.escape(row[0])}</th>' + "".join(f"<td>{html.escape(c)}</td>" for c in row[1:])
        + "</tr>"
        for row in rows
    )  # fmt: skip
    told = html.escape(caption, quote=True)
    return (
        f'<div class="mtp-table-box" role="group" tabindex="0" aria-label="{told}">'  # scrolls sideways by keyboard too
        f'<table class="mtp-table"><caption>{told}</caption>'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )
