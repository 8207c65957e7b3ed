"""The state of the page in its address: one table of controls, an address read into a State and written from one.

    /?room=generate&prompt=a+person+waves&seed=7&system=lgtok&hide=seed

A control is a row of CONTROLS; the same key may stand in several rooms with another default. A room makes its controls
from their rows (`control("generate", "seed").label`, `.default`, `.low`, `.high`, `.element`) and joins the address as
links.py says. Whatever an address holds, `parse` gives a State: what is unknown, too long or out of range is as good as
absent. The browser half is state.js; it reads the table as `table_json()`. No torch, no gradio.
"""

import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import parse_qsl, urlencode

from playground.limits import LIMITS
from playground.systems import SYSTEMS
from playground.ui.places import Scales as Scales
from playground.ui.places import Span as Span
from playground.ui.places import Token as Token

ROOMS = ("tokenize", "embedding-map", "codebooks", "generate", "guidance", "edit", "endless", "compare", "learn")
PARTS = {name: f'[data-part="{name}"]' for name in ("link", "python", "export", "tour", "compare")} | {
    "learn": "#room-learn-button"
}  # parts of the page, beside controls, that `hide` may name -> how the page finds them
UPLOADED = "uploaded"  # what a menu of motions calls the visitor's own file
OWN_FILE = "file:"  # how the value of `motion` begins that stands for a file of the visitor's own
Value = Any  # str | float | int | bool | tuple[str, ...] | Scales | Token | Span | None


@dataclass(frozen=True)
class Control:
    """One row of the table. A default of None means: what the room opens with, or what the system itself prefers."""

    key: str  # its name in the address
    room: str  # the room it stands in; "" for the page as a whole
    kind: str  # a key of KINDS
    default: Value
    label: str
    low: float = 0.0  # least number
    high: float = 0.0  # greatest number, or the length of a text
    choices: tuple[str, ...] = ()
    element: str = ""  # id of its element on the page; "" where it has none of its own


def _of_stage(room: str, prefix: str) -> tuple[Control, ...]:
    """What every room with a stage has."""
    return (
        Control("system", room, "systems", None, "System", element=f"{prefix}-system"),
        Control("selection", room, "selection", None, "Selected token or frames"),
    )


EDITS = ("inpaint", "outpaint", "prefix", "suffix", "inbetween")
DIFFERENCES = (  # what Compare may vary
    "system", "scales", "caption", "g", "maker", "seed", "s", "temperature", "redraw", "kind",
)  # fmt: skip
_WAVES = "a person is waving with both hands"
_PROMPT, _SEED, _G = LIMITS.max_prompt_chars, LIMITS.max_seed, LIMITS.max_guidance
CONTROLS: tuple[Control, ...] = (
    Control("room", "", "choice", "tokenize", "Room", choices=ROOMS),
    *_of_stage("tokenize", "tokenize"),
    Control("motion", "tokenize", "name", None, "Motion", element="tokenize-example"),
    Control("beside", "tokenize", "systems", None, "Other systems beside it", element="tokenize-beside"),
    Control("start", "tokenize", "number", 0.0, "or 9.8 s from second", 0, 600,
            element="tokenize-start"),
    Control("part", "tokenize", "whole", 0, "Tokenize the part", 0, 999, element="tokenize-part"),
    Control("caption", "tokenize", "text", None, "Caption (may be empty)", 0, _PROMPT,
            element="tokenize-caption"),
    Control("scales", "tokenize", "scales", None, "n", 1, 64, element="tokenize-scales"),
    Control("code", "tokenize", "whole", None, "Code that the selected token is replaced by", 0, 32_767,
            element="tokenize-code"),
    Control("wrong", "tokenize", "text", None, "A wrong caption", 1, _PROMPT, element="tokenize-wrong"),
    *_of_stage("embedding-map", "embedding"),
    Control("motion", "embedding-map", "name", None, "Motion", element="embedding-near"),
    Control("each", "embedding-map", "choice", "clip", "Points", choices=("clip", "token"), element="embedding-each"),
    Control("colour", "embedding-map", "choice", "action", "Colour", element="embedding-colour",
            choices=("action", "scale", "time", "length", "source")),
    Control("map", "embedding-map", "choice", "tsne", "Map", choices=("tsne", "pca"), element="embedding-kind"),
    Control("place", "embedding-map", "name", None, "An example as a new point", element="embedding-place"),
    Control("prompt", "embedding-map", "text", None, "A prompt as a new point", 1, _PROMPT, element="embedding-prompt"),
    Control("system", "codebooks", "systems", None, "System", element="codebooks-system"),
    Control("order", "codebooks", "choice", "sorted", "Order of the codes", choices=("sorted", "index"),
            element="codebooks-order"),
    Control("k", "codebooks", "whole", 10, "Top k", 1, 256, element="codebooks-k"),
    Control("code", "codebooks", "name", None, "Code"),
    *_of_stage("generate", "generate"),
    Control("prompt", "generate", "text", "a person steadily walks forward", "Prompt", 1, _PROMPT,
            element="generate-prompt"),
    Control("free", "generate", "flag", False, "No prompt (free-form)", element="generate-free"),
    Control("seconds", "generate", "number", 5.0, "Seconds", LIMITS.min_seconds, LIMITS.max_seconds,
            element="generate-seconds"),
    Control("seed", "generate", "whole", 0, "Seed", 0, _SEED, element="generate-seed"),
    Control("g", "generate", "number", None, "Guidance g, decoder", 0, _G, element="generate-g"),
    Control("s", "generate", "number", None, "Guidance s, generator", 0, _G, element="generate-s"),
    Control("temperature", "generate", "number", None, "Temperature", 0, LIMITS.max_temperature,
            element="generate-temperature"),
    Control("topk", "generate", "number", None, "Top-k, share of codes", 0.01, 1, element="generate-topk"),
    Control("topp", "generate", "number", None, "Top-p, share of odds", 0.05, 1, element="generate-topp"),
    Control("takes", "generate", "whole", 1, "Side by side", 1, LIMITS.max_seeds, element="generate-takes"),
    Control("plant", "generate", "flag", False, "Plant the feet", element="generate-plant"),
    Control("take", "generate", "whole", 0, "Tokens of", 0, LIMITS.max_seeds - 1, element="generate-take"),
    Control("words", "generate", "flag", False, "Which words did each moment look at?", element="generate-words"),
    Control("changes", "generate", "name", None, "Changes to the motion"),
    *_of_stage("guidance", "guidance"),
    Control("motion", "guidance", "name", None, "Motion", element="guidance-example"),
    Control("caption", "guidance", "text", None, "Caption", 0, _PROMPT, element="guidance-caption"),
    Control("g", "guidance", "number", 2.0, "Guidance g", 0, _G, element="guidance-g"),
    *_of_stage("edit", "edit"),
    Control("motion", "edit", "name", None, "Motion", element="edit-example"),
    Control("start", "edit", "number", 0.0, "The 9.8 s that are edited start at second", 0, 600, element="edit-start"),
    Control("caption", "edit", "text", None, "Caption of the motion", 0, _PROMPT),
    Control("kind", "edit", "choice", "inpaint", "What is drawn anew", element="edit-kind", choices=EDITS),
    Control("from", "edit", "number", None, "From, s", 0, LIMITS.max_seconds, element="edit-from"),
    Control("to", "edit", "number", None, "To, s", 0, LIMITS.max_seconds, element="edit-to"),
    Control("prompt", "edit", "text", "a person raises both arms", "What should happen there", 1, _PROMPT,
            element="edit-prompt"),
    Control("seed", "edit", "whole", 0, "Seed", 0, _SEED, element="edit-seed"),
    Control("g", "edit", "number", None, "Guidance g, decoder", 0, _G, element="edit-g"),
    Control("s", "edit", "number", None, "Guidance s, generator", 0, _G, element="edit-s"),
    Control("anchor", "edit", "choice", "place", "Kept frames that follow", 0, 0, ("place", "body"), "edit-anchor"),
    Control("measured", "edit", "flag", False, "Tokens by measured frames", element="edit-measured"),
    Control("prompt", "endless", "text", "a person walks forward", "Instruction", 1, _PROMPT, element="endless-prompt"),
    Control("seed", "endless", "whole", 0, "Seed", 0, _SEED, element="endless-seed"),
    Control("then", "endless", "text", None, "What follows, by second", 1, 2_000, element="endless-then"),
    *_of_stage("compare", "compare"),
    Control("vary", "compare", "choice", "system", "What differs", element="compare-vary", choices=DIFFERENCES),
    Control("values", "compare", "name", None, "Side by side", element="compare-values"),
    Control("motion", "compare", "name", None, "Motion", element="compare-example"),
    Control("prompt", "compare", "text", _WAVES, "Prompt", 1, _PROMPT, element="compare-prompt"),
    Control("seconds", "compare", "number", 4.0, "Seconds", 1, LIMITS.max_seconds, element="compare-seconds"),
    Control("seed", "compare", "whole", 0, "Seed", 0, _SEED, element="compare-seed"),
    Control("caption", "compare", "text", None, "Caption of the motion", 0, _PROMPT),
    Control("kind", "compare", "choice", "inpaint", "Kind of edit", choices=EDITS),
    Control("from", "compare", "number", None, "Edited from, s", 0, LIMITS.max_seconds),
    Control("to", "compare", "number", None, "Edited to, s", 0, LIMITS.max_seconds),
    Control("take", "compare", "whole", 0, "Tokens of", 0, LIMITS.max_figures - 1, element="compare-take"),
    Control("hide", "", "names", (), "Hidden controls"),
)  # fmt: skip


@dataclass(frozen=True)
class State:
    """What an address says: the room, and the value of each of its controls that is given there."""

    room: str = "tokenize"
    values: Mapping[str, Value] = field(default_factory=dict)
    hide: tuple[str, ...] = ()

    def __getitem__(self, key: str) -> Value:
        """The value of a control of this room, its default where none is given; KeyError for a key it does not have."""
        row = control(self.room, key)
        return self.values.get(key, row.default)

    def with_values(self, **values: Value) -> "State":
        """The same state with these values, None taking one away."""
        merged = {**self.values, **values}
        return State(self.room, {key: value for key, value in merged.items() if value is not None}, self.hide)

    @property
    def system(self) -> str | None:
        """The first system named, or None for the one the page prefers."""
        return (self.values.get("system") or (None,))[0]


def control(room: str, key: str) -> Control:
    """A row of the table: of the room, or of the page as a whole. KeyError where there is none."""
    return _ROWS.get((room, key)) or _ROWS["", key]


def controls_of(room: str) -> tuple[Control, ...]:
    """The rows of one room, without those of the page as a whole."""
    return tuple(row for row in CONTROLS if row.room == room)


def parse(query: str) -> State:
    """The State that an address asks for. query: its part behind the "?" (a "?" in front is fine). Never raises."""
    text = query[: LIMITS.max_link_chars] if isinstance(query, str) else ""
    try:
        pairs = parse_qsl(text.lstrip("?"), keep_blank_values=True, max_num_fields=LIMITS.max_link_keys)
    except ValueError:
        return State()
    given: dict[str, str] = {}
    for key, value in pairs:
        given.setdefault(key, value)
    room = _read(_ROWS["", "room"], given.get("room"))
    values = {row.key: _read(row, given.get(row.key), None) for row in controls_of(room)}
    hide = _read(_ROWS["", "hide"], given.get("hide"))
    return State(room, {key: value for key, value in values.items() if value is not None}, hide)


def query(state: State) -> str:
    """The address of a state, from the "?" on, "" for the page as it opens; `parse` gives the state back."""
    pairs = [("room", state.room)]
    for row in controls_of(state.room):
        value = state.values.get(row.key)
        if value is not None and value != row.default:
            pairs.append((row.key, text_of(row, value)))
    if state.hide:
        pairs.append(("hide", ",".join(state.hide)))
    return "" if pairs == [("room", State().room)] else "?" + urlencode(pairs)


def text_of(row: Control, value: Value) -> str:
    """A value as it stands in an address."""
    if row.kind in ("systems", "names"):
        return ",".join(value)
    if row.kind == "flag":
        return "1" if value else "0"
    if row.kind == "number":
        return repr(float(value)).removesuffix(".0")
    return str(value)


def table_json() -> str:
    """What the browser half needs to know of the table, as JSON text that may stand inside a script element."""
    rows = [
        {"key": row.key, "room": row.room, "element": row.element,
         "default": None if row.default is None else text_of(row, row.default)}
        for row in CONTROLS
    ]  # fmt: skip
    table = {"rooms": ROOMS, "parts": PARTS, "controls": rows, "longest": LIMITS.max_link_chars, "uploaded": UPLOADED}
    return json.dumps(table).replace("<", "\\u003c")


_ROWS = {(row.room, row.key): row for row in CONTROLS}
_HIDEABLE = {row.key for row in CONTROLS if row.element} | set(PARTS)
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]{0,79}")
_FILE = re.compile(re.escape(OWN_FILE) + r"[A-Za-z0-9_][A-Za-z0-9_ .+-]{0,59}")
_WHOLE = re.compile(r"[0-9]{1,10}")


def _read(row: Control, text: str | None, otherwise: Value = ...) -> Value:
    """The value that a text of the address stands for; the row's default, or `otherwise`, where it stands for none."""
    fallback = row.default if otherwise is ... else otherwise
    found = None if text is None else KINDS[row.kind](row, text)
    return fallback if found is None else found


def _text(row: Control, text: str) -> str | None:
    clean = "".join(character for character in text if character.isprintable()).strip()
    return clean if row.low <= len(clean) <= row.high else None


def _number(row: Control, text: str) -> float | None:
    try:
        value = float(text) if len(text) <= 24 and text.isascii() and "_" not in text else math.nan
    except ValueError:
        return None
    return value if math.isfinite(value) and row.low <= value <= row.high else None


def _whole(row: Control, text: str) -> int | None:
    return int(text) if _WHOLE.fullmatch(text) and row.low <= int(text) <= row.high else None


def _scales(row: Control, text: str) -> Scales | None:
    kind, _, number = text.rpartition("-")
    n = _whole(row, number)
    return None if n is None or kind not in ("", "only", "without") else Scales(kind or "upto", n)


def _systems(row: Control, text: str) -> tuple[str, ...] | None:
    names = tuple(dict.fromkeys(text.split(",")))[: LIMITS.max_figures]
    return tuple(name for name in names if name in SYSTEMS) or None


def _selection(row: Control, text: str) -> Token | Span | None:
    system, *places = text.rsplit(".", 2)
    numbers = places if len(places) == 2 else text.split("-")
    if len(numbers) != 2 or not all(map(_WHOLE.fullmatch, numbers)):
        return None
    first, second = map(int, numbers)
    if places:
        return Token(system, first, second) if system in SYSTEMS and first >= 1 and max(first, second) <= 999 else None
    return Span(first, second) if first < second <= LIMITS.max_frames else None


def _names(row: Control, text: str) -> tuple[str, ...]:
    return tuple(name for name in dict.fromkeys(text.split(",")) if name in _HIDEABLE)


KINDS: dict[str, Callable[[Control, str], Value]] = {
    "choice": lambda row, text: text if text in row.choices else None,
    "name": lambda row, text: text if _NAME.fullmatch(text) or _FILE.fullmatch(text) else None,
    "flag": lambda row, text: {"1": True, "0": False}.get(text),
    "text": _text,
    "number": _number,
    "whole": _whole,
    "scales": _scales,
    "systems": _systems,
    "selection": _selection,
    "names": _names,
}
