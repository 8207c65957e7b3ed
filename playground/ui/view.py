"""What a room shows for one result. Stored and live results are the same thing and take the same path to the screen."""

import json
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from playground.figures import stage as scene
from playground.ui.facts import Fact, facts_line


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
    made_from: str = ""  # fingerprint of the checkpoints behind a stored view

    def stored(self, made_from: str = "") -> "View":
        """The same result, marked as stored."""
        return replace(self, kind="stored", made_from=made_from)

    def stage_json(self) -> str:
        """The stage's value: the payload with the badge of this view."""
        if "state" in self.stage:
            return json.dumps(self.stage)
        return json.dumps({**self.stage, "badge": scene.badge(self.kind, self.seconds)}, separators=(",", ":"))

    def facts_html(self) -> str:
        """The line of numbers; the stage shows the badge."""
        return facts_line(self.facts)

    def write(self, path: Path) -> None:
        """Store this view."""
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(asdict(self), separators=(",", ":")) + "\n", encoding="utf-8")


def read_view(path: Path, made_from: str = "") -> View | None:
    """A stored view, or None where there is none, another version wrote it or it was made from other checkpoints."""
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
        view = View(facts=tuple(Fact(**fact) for fact in values.pop("facts")), **values)
        current = view.stage.get("version", scene.VERSION) == scene.VERSION and view.made_from == made_from
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None
    return view if current else None
