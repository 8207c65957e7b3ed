"""Tables as notebooks show them: plain HTML, every cell escaped, a line under them that says what was measured.

`Results` is what evaluation/published gives: system -> its stored result, or None where there is none.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from playground.analysis.cited import cited
from playground.analysis.results import Estimate, Result, is_stale, verdict, verdict_of_pairs, why_absent
from playground.errors import PlaygroundError
from playground.systems import SYSTEMS

DASH = "–"
Results = Mapping[str, Result | None]


@dataclass(frozen=True)
class Table:
    """columns: heads; rows: as many cells each; title above, caption below."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    title: str = ""
    caption: str = ""

    def __post_init__(self) -> None:
        if not self.columns or any(len(row) != len(self.columns) for row in self.rows):
            raise PlaygroundError(f"every row of a table of {len(self.columns)} columns needs as many cells")

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        left, right = ' style="text-align:left"', ' style="text-align:right"'
        sides = [left, *[right] * (len(self.columns) - 1)]
        head = "".join(f"<th{side}>{escape(name)}</th>" for name, side in zip(self.columns, sides, strict=True))
        body = "".join(
            "<tr>" + "".join(f"<td{side}>{escape(cell)}</td>" for cell, side in zip(row, sides, strict=True)) + "</tr>"
            for row in self.rows
        )
        title = f"<p><b>{escape(self.title)}</b></p>" if self.title else ""
        caption = "".join(f"<p><small>{escape(line)}</small></p>" for line in self.caption.splitlines())
        return f"{title}<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{caption}"

    @property
    def markdown(self) -> str:
        """The same as a Markdown table, without title and caption."""
        lines = [self.columns, ("---",) * len(self.columns), *self.rows]
        return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)

    def __str__(self) -> str:
        lines = [self.title, " | ".join(self.columns), *(" | ".join(row) for row in self.rows), self.caption]
        return "\n".join(line for line in lines if line)


def cited_table(item: str) -> Table:
    """What a paper prints, from analysis/cited.json."""
    found = cited(item)
    return Table(found.columns, found.printed, found.title, f"{found.where}. {found.note}".strip())


def number(value: Estimate, scale: float = 1.0) -> str:
    """A measured number with its interval, "0.0571 ± 0.0032"; a dash where there is none.

    Three significant digits, and up to two more places where the interval would be 0 otherwise.
    """
    if value.mean is None:
        return DASH
    mean, half = significant(value.mean * scale), value.ci95
    if half is None or not math.isfinite(value.mean) or not math.isfinite(half):
        return mean
    places = len(mean.partition(".")[2])
    wanted = -math.floor(math.log10(half * scale)) if half * scale > 0 else 0
    places = min(max(places, wanted), places + 2)
    return f"{value.mean * scale:,.{places}f} ± {half * scale:,.{places}f}"


def error_bars(values: Sequence[Estimate]) -> dict[str, Any]:
    """95 % intervals as plotly draws them; none where no number has one."""
    shown = any(value.ci95 for value in values)
    return {
        "type": "data", "array": [value.ci95 or 0.0 for value in values], "visible": shown, "thickness": 1, "width": 3,
    }  # fmt: skip


def significant(value: float, digits: int = 3) -> str:
    """A number with so many significant digits, never in powers of ten: 433, 27.7, 0.0571, 0."""
    if value == 0 or not math.isfinite(value):
        return "0" if value == 0 else DASH
    places = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
    return f"{value:,.{min(places, 6)}f}"


@dataclass(frozen=True)
class Claim:
    """Something a paper says of two numbers: that the first is the better one."""

    text: str
    better: Estimate
    worse: Estimate
    lower: bool = True  # is a lower number better?
    gain: Estimate | None = None  # by how much the first is better, where both were measured on the same clips


def claims_table(claims: Sequence[Claim], title: str = "Is it seen here?", caption: str = "") -> Table:
    """Every claim with both numbers and what they say about it."""

    def said(claim: Claim) -> str:
        if claim.gain is not None and claim.gain.mean is not None:
            return verdict_of_pairs(claim.gain)
        return verdict(claim.better, claim.worse, lower=claim.lower)

    rows = tuple((claim.text, number(claim.better), number(claim.worse), said(claim)) for claim in claims)
    return Table(("what the paper says", "the better one, ours", "the other, ours", "seen here?"), rows, title, caption)


# ---- systems side by side ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Column:
    """A measured column: the number `key` of the row that has the facts `of`, times `scale`."""

    head: str
    key: str
    of: tuple[tuple[str, Any], ...] = (("of", "generated"),)
    scale: float = 1.0


def systems_table(
    results: Results,
    columns: Sequence[Column],
    title: str,
    caption: str = "",
    *,
    draws: bool = True,
    guided: bool = False,
    note: str = "",
) -> Table:
    """One row a system: its tokens and the columns; where there is no result, why. note: added to the caption.

    guided: with a column of the g that motions were drawn with.
    """
    rows = []
    for system, result in results.items():
        head = [SYSTEMS[system].title, str(result.provenance.get("tokens") or DASH) if result else DASH]
        head += [guidance_of(result)] if guided else []
        if result is None:
            rows.append((*head, why_absent(system, draws), *[DASH] * (len(columns) - 1)))
            continue
        values = [result.estimate(column.key, **dict(column.of)) for column in columns]
        rows.append((*head, *(number(v, c.scale) for v, c in zip(values, columns, strict=True))))
    lines = "\n".join(line for line in (caption, measured_on(results), *_whys(results, columns), note) if line)
    heads = ("system", "tokens", *(("g",) if guided else ()), *(column.head for column in columns))
    return Table(heads, tuple(rows), title, lines)


def guidance_of(result: Result | None) -> str:
    """The decoder's g that generated motions of a result were read with; a dash for systems that know none."""
    if result is None or SYSTEMS[result.system].family != "lgtok" or SYSTEMS[result.system].generator is None:
        return DASH
    return f"{result.provenance['sampling']['guidance']:g}"


def _whys(results: Results, columns: Sequence[Column]) -> list[str]:
    """Why numbers are missing from results that are there, each reason once."""
    found = [
        f"{column.head}: {estimate.why}"
        for result in results.values()
        if result is not None
        for column in columns
        if (estimate := result.estimate(column.key, **dict(column.of))).mean is None and estimate.why
    ]
    return list(dict.fromkeys(found))


def measured_on(results: Results) -> str:
    """What every number was measured on, a line a system; what would be measured otherwise now is marked."""
    aged = "; its checkpoint, the evaluator or the sampling is another now: make figures"
    lines = [f"{result.line}{aged if is_stale(result) else ''}" for result in results.values() if result is not None]
    return "\n".join(lines)


def of_system(results: Results, system: str, key: str, **facts: Any) -> Estimate:
    """One number of one system; where there is no result, why."""
    result = results.get(system)
    return Estimate(None, why=f"{system} is {why_absent(system)}") if result is None else result.estimate(key, **facts)
