"""What a room shows for one result. Stored and live results are the same thing and take the same path to the screen."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from playground.errors import PlaygroundError
from playground.figures import stage as scene
from playground.ui.facts import Fact, facts_line

OPENING = Path(__file__).parents[2] / "assets" / "opening"


@dataclass(frozen=True)
class View:
    """One result, ready to be drawn; every part is plain JSON.

    stage: payload of figures/stage.py; facts: the line of numbers; charts: name to Plotly figure as JSON text;
    controls: what the room's controls say for this result; kind: "live" or "stored", with the seconds it took.
    """

    stage: dict[str, Any]
    facts: tuple[Fact, ...] = ()
    charts: dict[str, str] = field(default_factory=dict)
    controls: dict[str, Any] = field(default_factory=dict)
    kind: str = "live"
    seconds: float = 0.0

    def stored(self) -> "View":
        """The same result, marked as stored."""
        return replace(self, kind="stored")

    def stage_json(self) -> str:
        """The stage's value: the payload with the badge of this view."""
        if "state" in self.stage:
            return json.dumps(self.stage)
        return json.dumps({**self.stage, "badge": scene.badge(self.kind, self.seconds)}, separators=(",", ":"))

    def facts_html(self) -> str:
        """The line of numbers; the stage shows the badge."""
        return facts_line(self.facts)

    def write(self, name: str, folder: Path = OPENING) -> Path:
        """Store this view as `folder/name.json`; returns the path."""
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{name}.json"
        path.write_text(json.dumps(asdict(self.stored()), separators=(",", ":")) + "\n", encoding="utf-8")
        return path


def read_view(name: str, folder: Path = OPENING) -> View | None:
    """The stored view of that name, or None where there is none or it was written by another version."""
    path = folder / f"{name}.json"
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
        facts = tuple(Fact(**fact) for fact in values.pop("facts"))
        view = View(facts=facts, **values)
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None
    return view if view.stage.get("version") == scene.VERSION else None


def first_view(name: str, compute: Callable[[], View]) -> View:
    """The stored opening result of a room, or one computed now; an empty stage with one sentence without either."""
    found = read_view(name)
    if found is not None:
        return found
    try:
        return compute()
    except PlaygroundError as error:
        return View(stage=scene.message("empty", str(error)))
