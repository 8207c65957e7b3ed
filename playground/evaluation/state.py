"""What an interrupted evaluation has done so far: a JSON file beside the result, written whole after every repeat."""

import json
import os
from pathlib import Path
from typing import Any

from playground.errors import PlaygroundError

FORMAT = 1


def state_path(out: Path) -> Path:
    """result.json -> result.state.json, in the same folder."""
    return out.with_name(f"{out.stem}.state.json")


class State:
    """Finished repeats of one evaluation, each {"metrics", "real", "reconstruction"}; kept in a file if one is named.

    settings: everything that a number depends on. PlaygroundError if the file holds another evaluation.
    """

    def __init__(self, path: Path | None, settings: dict[str, Any]) -> None:
        self.path = path
        self.settings = json.loads(json.dumps(settings))
        self.repeats: list[dict[str, Any]] = []
        if path is not None and path.is_file():
            self.repeats = self._read(path)

    def add(self, repeat: dict[str, Any]) -> None:
        """One more repeat is finished."""
        self.repeats.append(repeat)
        if self.path is None:
            return
        self.path.parent.mkdir(parents=True, exist_ok=True)
        partial = self.path.with_suffix(".partial")
        text = json.dumps({"format": FORMAT, "settings": self.settings, "repeats": self.repeats}, indent=1)
        partial.write_text(text + "\n", encoding="utf-8")
        os.replace(partial, self.path)

    def _read(self, path: Path) -> list[dict[str, Any]]:
        advice = "delete it or name another file for the result"
        try:
            stored = json.loads(path.read_text(encoding="utf-8"))
            if stored["format"] != FORMAT:
                raise ValueError("format")
            settings, repeats = dict(stored["settings"]), [dict(repeat) for repeat in stored["repeats"]]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise PlaygroundError(f"{path} is not the state of an evaluation; {advice}") from error
        known = [*self.settings, *(key for key in settings if key not in self.settings)]
        other = [key for key in known if settings.get(key) != self.settings.get(key)]
        if other:
            raise PlaygroundError(f"{path} belongs to an evaluation with another {', '.join(other)}; {advice}")
        return repeats
