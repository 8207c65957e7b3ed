"""Numbers that the notebooks quote from papers: one table, cited.json, so that every quoted number stands once."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from playground.errors import PlaygroundError

_FILE = Path(__file__).with_name("cited.json")
Cell = str | float | int | None


@dataclass(frozen=True)
class Cited:
    """Part of a published table. rows: one list a row, as long as the columns; None where the paper prints nothing."""

    item: str
    title: str
    where: str  # paper and place in it
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""

    def value(self, label: str, column: str) -> Cell:
        """One cell, by the first cell of its row. PlaygroundError if there is none such."""
        for row in self.rows:
            if row[0] == label and column in self.columns:
                return row[self.columns.index(column)]
        raise PlaygroundError(f"no number is quoted for {label!r}, {column!r} in {self.item}")

    @property
    def printed(self) -> tuple[tuple[str, ...], ...]:
        """The rows as text: a column has as many places behind the point as its longest number; a dash for None."""
        columns = [self._printed(column) for column in zip(*self.rows, strict=True)]
        return tuple(zip(*columns, strict=True))

    @staticmethod
    def _printed(column: tuple[Cell, ...]) -> list[str]:
        places = max((len(repr(cell).partition(".")[2]) for cell in column if isinstance(cell, float)), default=0)
        return [
            "–" if cell is None else f"{cell:.{places}f}" if isinstance(cell, float) else str(cell) for cell in column
        ]


@cache
def _all() -> dict[str, Any]:
    return dict(json.loads(_FILE.read_text(encoding="utf-8")))


def cited(item: str) -> Cited:
    """What is quoted for an item, such as "table2_humanml3d". PlaygroundError for an unknown one."""
    if item not in _all():
        raise PlaygroundError(f"nothing is quoted for {item!r}; one of {', '.join(_all())} is accepted")
    entry = _all()[item]
    rows = tuple(tuple(row) for row in entry["rows"])
    return Cited(item, entry["title"], entry["where"], tuple(entry["columns"]), rows, entry.get("note", ""))
