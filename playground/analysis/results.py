"""Stored results: what notebooks and rooms show without computing. One reader, one writer, no torch.

`assets/results/<item>-<system>.json`, or `<item>.json` for what belongs to no single system:

    {"item", "made_by": the command line that makes it again, "provenance": {"system", "checkpoint", "data", "split",
     "n", "seed", ...}, "rows": [{...}, ...], ...}

A measured number in a row is {"mean", "ci95", "n"}, with a null mean and a "why" where it does not exist; any other
number stands as it is. What further keys there are is told where the item is made. No caption of the data set.
"""

import hashlib
import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from playground.engine import ASSETS
from playground.errors import PlaygroundError
from playground.systems import SYSTEMS, checkpoint_path, row_of

RESULTS = ASSETS / "results"
NOT_TRAINED = "not trained yet"
NOT_MEASURED = "trained, not measured yet"
NO_GENERATOR = "has no generator"
_KEYS = ("item", "made_by", "provenance", "rows")


@dataclass(frozen=True)
class Estimate:
    """One measured number. mean: None where it does not exist, `why` then says so. ci95: half the 95 % interval."""

    mean: float | None
    ci95: float | None = None
    why: str = ""

    @classmethod
    def of(cls, entry: object) -> "Estimate":
        """From an entry of a row: {"mean", "ci95"}, a plain number, or None for nothing."""
        if isinstance(entry, Mapping):
            mean, ci95 = entry.get("mean"), entry.get("ci95")
            return cls(mean, ci95 if mean is not None else None, str(entry.get("why", "")))
        if isinstance(entry, int | float) and not isinstance(entry, bool) and math.isfinite(entry):
            return cls(float(entry))
        return cls(None, why="" if entry is None else "not a number")

    @property
    def low(self) -> float:
        """Lower end of the interval; the mean itself where there is none, nan without a mean."""
        return math.nan if self.mean is None else self.mean - (self.ci95 or 0.0)

    @property
    def high(self) -> float:
        """Upper end of the interval; the mean itself where there is none, nan without a mean."""
        return math.nan if self.mean is None else self.mean + (self.ci95 or 0.0)


@dataclass(frozen=True)
class Result:
    """One stored result. more: keys of the file beyond the four that every one has."""

    item: str
    made_by: str
    provenance: dict[str, Any]
    rows: list[dict[str, Any]]
    more: dict[str, Any] = field(default_factory=dict)

    @property
    def system(self) -> str:
        """The system of the table that was measured, "" for what belongs to no single one."""
        name = str(self.provenance.get("system", ""))
        return name if name in SYSTEMS else ""

    @classmethod
    def of(cls, held: Mapping[str, Any]) -> "Result":
        """From what a file holds. KeyError if one of the four keys is absent."""
        more = {key: value for key, value in held.items() if key not in _KEYS}
        return cls(**{key: held[key] for key in _KEYS}, more=more)

    def row(self, **facts: Any) -> dict[str, Any]:
        """The first row with these values; {} where there is none."""
        return next((row for row in self.rows if all(row.get(key) == value for key, value in facts.items())), {})

    def estimate(self, key: str, **facts: Any) -> Estimate:
        """A number of the first row with these values."""
        return self.value(self.row(**facts).get(key))

    def value(self, entry: object) -> Estimate:
        """A number of this result. A single repeat has no interval: its ci95 of 0 would say nothing (F2)."""
        found = Estimate.of(entry)
        return Estimate(found.mean, None, found.why) if self.provenance.get("repeats") == 1 else found

    @property
    def line(self) -> str:
        """One line for a caption: what it was measured on."""
        facts = self.provenance
        parts = [str(facts.get("system", self.item))]
        parts += [f"checkpoint {facts['checkpoint'][:8]}"] if facts.get("checkpoint") else []
        if facts.get("data"):
            clips = f"{facts['n']} " if "n" in facts else ""
            parts.append(f"{clips}{facts.get('split', '')} clips of {facts['data']}")
        repeats = facts.get("repeats")
        parts += [f"{repeats} repeat{'s' if repeats != 1 else ''}"] if repeats else []
        if facts.get("mm_samples") and self.estimate("multimodality", of="generated").mean is not None:
            parts.append(f"MultiModality of {facts['mm_texts']} texts by {facts['mm_samples']} motions")
        parts += [f"seed {facts['seed']}"] if "seed" in facts else []
        return ", ".join(parts)

    def as_dict(self) -> dict[str, Any]:
        """What the file holds."""
        head = {"item": self.item, "made_by": self.made_by, "provenance": self.provenance}
        return head | self.more | {"rows": self.rows}


def result_path(item: str, system: str = "", folder: Path = RESULTS) -> Path:
    """The file of a result."""
    return folder / (f"{item}-{system}.json" if system else f"{item}.json")


def read_result(item: str, system: str = "", folder: Path = RESULTS) -> Result | None:
    """A stored result, None where there is none. PlaygroundError if the file is broken or another item's."""
    path = result_path(item, system, folder)
    if not path.is_file():
        return None
    try:
        held = json.loads(path.read_text(encoding="utf-8"))
        result = Result.of(held)
        shaped = isinstance(result.rows, list) and all(isinstance(row, dict) for row in result.rows)
        if not shaped or not isinstance(result.provenance, dict) or (result.item, result.system) != (item, system):
            raise ValueError("shape")
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise PlaygroundError(f"{path} is no stored result of {item}; `make figures` makes it again") from error
    return result


def write_result(result: Result, folder: Path = RESULTS) -> Path:
    """Write a result, whole or not at all; returns its file. PlaygroundError for numbers that JSON does not know."""
    path = result_path(result.item, result.system, folder)
    try:
        text = json.dumps(result.as_dict(), indent=1, ensure_ascii=False, allow_nan=False)
    except ValueError as error:
        raise PlaygroundError(f"the result {result.item} holds a number that is not finite") from error
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    partial.write_text(text + "\n", encoding="utf-8")
    os.replace(partial, path)
    return path


def files_of(system: str, assets: Path = ASSETS) -> dict[str, str]:
    """{"checkpoint", "generator"}: digests of a system's files, "" where there is none; what a provenance states.

    "checkpoint" is that of the file which identifies the system: without a tokenizer it is the generator's.
    """
    first = row_of(system).parts[0]
    paths = {"checkpoint": checkpoint_path(assets, system, first)}
    paths["generator"] = checkpoint_path(assets, system, "generator")
    return {key: digest(path) for key, path in paths.items()}


def is_stale(result: Result, assets: Path = ASSETS, judges: Mapping[str, str] | None = None) -> bool:
    """Whether a system has other files, other evaluators or another usual sampling now than when it was measured.

    judges: digests of the evaluators by name, those of the shipped ones by default.
    """
    told: dict[str, Any] = result.provenance
    drawn, judged = told.get("sampling") or {}, told.get("evaluators") or {}
    if judges is None:
        judges = {name: digest(checkpoint_path(ASSETS, "evaluators", name)) for name in judged}
    usual = vars(row_of(result.system).sampling)
    pairs = ((told, files_of(result.system, assets)), (drawn, usual), (judged, judges))
    return any(then.get(key, value) != value for then, now in pairs for key, value in now.items())


def digest(path: Path) -> str:
    """First 12 hexadecimal digits of the sha256 of a file; "" if there is none."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:12] if path.is_file() else ""


def why_absent(system: str, draws: bool = True, assets: Path = ASSETS) -> str:
    """Why there is no result of a system, in a few words. draws: of an item that needs a generator."""
    row = row_of(system)
    if draws and row.generator is None:
        return NO_GENERATOR
    paths = {part: checkpoint_path(assets, system, part) for part in row.parts}
    needed = row.parts if draws else row.needed
    return NOT_MEASURED if all(paths[part].is_file() for part in needed) else NOT_TRAINED


# ---- a claim of a paper against our numbers --------------------------------------------------------------------------


def verdict(better: Estimate, worse: Estimate, *, lower: bool = True) -> str:
    """Whether `better` is the better one of two numbers, in a sentence that says how sure that is.

    lower: is a lower number better? The intervals cover what repeats of the measurement change, not another training.
    """
    if better.mean is None or worse.mean is None:
        return "cannot be said: " + (better.why or worse.why or "a number is missing")
    first, second = (better, worse) if lower else (worse, better)  # first should be the lower one
    apart = "the intervals are apart" if better.ci95 is not None and worse.ci95 is not None else "no intervals"
    if better.mean == worse.mean:
        return "not seen: both are equal"
    if first.high < second.low:
        return f"seen, {apart}"
    if second.high < first.low:
        return f"not seen: it is the other way round, {apart}"
    leaning = "as the paper has it" if (first.mean or 0.0) < (second.mean or 0.0) else "the other way round"
    return f"undecided: the intervals overlap; the means stand {leaning}"


def verdict_of_pairs(gain: Estimate) -> str:
    """The same of a difference that was measured pair by pair; gain: by how much the first is better, above 0 if it is.

    PlaygroundError without a mean.
    """
    if gain.mean is None:
        raise PlaygroundError("there is no difference to judge")
    said = f"clip by clip it gains {gain.mean:.2f} ± {gain.ci95 or 0:.2f}"
    if gain.low > 0:
        return f"seen: {said}"
    return f"not seen: it is the other way round, {said}" if gain.high < 0 else f"undecided: {said}"
