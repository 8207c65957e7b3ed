"""Prompts and captions as strings: cleaning what a visitor types, and mirroring left and right."""

import re
import unicodedata

from playground.errors import PlaygroundError
from playground.limits import LIMITS

_LETTER = r"[^\W\d_]"
_SUFFIX = r"(?:wards?|wardly|hand|hands|handed|hander|foot|footed|feet|side|sided|most|s|y|ie|ies)?"
_SIDE = re.compile(rf"(?<!{_LETTER})(left|right)(?={_SUFFIX}(?!{_LETTER}))", re.IGNORECASE)
_SPIN = re.compile(
    rf"(?<!{_LETTER})(?:((?:counter|contra|anti)[-\u2010\u2011 ]?)?clock-?wise|(c?cw))(?!{_LETTER})",
    re.IGNORECASE,
)
_INVISIBLE = {"Cc", "Cf", "Cs", "Co", "Cn"}  # control, format, surrogate, private, unassigned


def normalise(text: str, *, what: str = "prompt", allow_empty: bool = False) -> str:
    """A visitor's text in one clean line: control and invisible characters removed, white space collapsed, NFC.

    PlaygroundError if it is no string, empty (unless allow_empty), or longer than LIMITS.max_prompt_chars.
    """
    if not isinstance(text, str):
        raise PlaygroundError(f"the {what} must be text, got {type(text).__name__}")
    spaced = " ".join(text.split())
    kept = "".join(char for char in spaced if unicodedata.category(char) not in _INVISIBLE)
    line = " ".join(kept.split())
    if len(line) <= LIMITS.max_prompt_chars:  # composing is slow on huge nonsense, and may lengthen a text
        line = unicodedata.normalize("NFC", line)
    if len(line) > LIMITS.max_prompt_chars:
        raise PlaygroundError(
            f"the {what} has {len(line)} characters, at most {LIMITS.max_prompt_chars} are accepted; shorten it"
        )
    if not line and not allow_empty:
        raise PlaygroundError(
            f'the {what} is empty; write what the person does, for example "a person steadily walks forward"'
        )
    return line


def mirror_caption(text: str) -> str:
    """The caption of the mirrored motion: left and right swapped, clockwise and counterclockwise swapped, case kept.

    Whole words only ("upright", "bright" stay), with their endings ("leftward", "right-handed", "lefts").
    Every spelling of counterclockwise becomes clockwise; clockwise becomes "counterclockwise". Twice gives the text
    back, up to that spelling. The meaning is not read: "right away" is swapped too.
    """
    return _SPIN.sub(_swap_spin, _SIDE.sub(_swap_side, text))


def _swap_side(match: re.Match[str]) -> str:
    word = match.group(1)
    return _like(word, "right" if word.lower() == "left" else "left")


def _swap_spin(match: re.Match[str]) -> str:
    short = match.group(2)
    if short:
        return _like(short, "cw" if short.lower() == "ccw" else "ccw")
    return _like(match.group(0), "clockwise" if match.group(1) else "counterclockwise")


def _like(model: str, word: str) -> str:
    """The word in the case of the model: UPPER, Capitalised or lower."""
    if model.isupper():
        return word.upper()
    return word.capitalize() if model[0].isupper() else word
