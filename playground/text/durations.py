"""How long an action of a prompt takes: what the prompt says of seconds, times, steps, degrees, metres and speed."""

import re
from dataclasses import dataclass

from playground.text.english import lexicon

_SPEED = {"run": 3.0, "sprint": 5.0, "jog": 2.2, "dash": 4.0, "crawl": 0.5, "sneak": 0.6, "swim": 0.8}  # m/s
_WALKING = 1.2  # m/s, every other way to travel
_STEP = 0.6  # seconds
_SLOW, _FAST = 1.4, 0.75


@dataclass(frozen=True)
class Duration:
    """The seconds of an action, and how they were found."""

    seconds: float
    said: bool  # True where the prompt names a time
    why: str  # one clause; empty where it is the typical time of the verb


def take_time(text: str) -> tuple[str, float | None]:
    """(the text without its words for a time, the seconds that they name or None)."""
    number = lexicon().number
    about = r"(?:(?:about|around|roughly|approximately|at least|nearly|exactly|another)\s+)?"
    span = rf"({number})(?:\s*(?:-|–|to|or)\s*({number}))?"
    unit = r"(seconds?|secs?\b|s\b|minutes?|mins?\b)(?!\s+(?:time|kick|jump|step|turn))"
    pattern = rf"\s*,?\s*(?:\b(?:for|during|over|in|lasting)\s+)?\b{about}{span}\s*-?\s*{unit}(?:\s+(?:long|of))?"
    found = re.search(pattern, text)
    if found and (found[3] != "s" or found[1][-1].isdigit()):
        low = lexicon().value(found[1])
        seconds = (low + lexicon().value(found[2])) / 2 if found[2] else low
        seconds *= 60 if found[3].startswith("min") else 1
        return _without(text, found), seconds
    for words, seconds in (("a long time", 6.0), ("a while", 4.0), ("a moment", 2.0), ("a bit", 2.0)):
        found = re.search(rf"\s*\bfor {words}\b", text)
        if found:
            return _without(text, found), seconds
    return text, None


def duration(text: str, verb: str) -> Duration:
    """How long the action `text` of the base form `verb` takes, from all but a named time."""
    lex = lexicon()
    if verb in ("do", "take"):  # "do two kicks" lasts as kicking does
        verb = next((w for w in re.findall(r"[a-z]+", re.sub("e?s\\b", "", text)) if w in lex.nouns), verb)
    usual = lex.seconds(verb)
    count = _count(text)
    again = float(lex.classes[lex.kind_of(verb)]["again"])
    steps = re.search(rf"\b({lex.number})\s+(?:[a-z]+\s+){{0,2}}?(?:steps?|paces?|strides?)\b", text)
    metres = re.search(rf"\b({lex.number})\s*(?:m\b|met(?:er|re)s?\b|yards?\b)", text)
    degrees = re.search(r"\b(\d+)\s*(?:degrees?\b|°)", text)
    why = ""
    if count is not None:
        usual, why = max(again * count, 0.75 * usual if count == 1 else 0.0), f"{count:g} times {again:g} s"
    elif steps:
        usual, why = _STEP * lex.value(steps[1]) + 0.4, f"{_STEP:g} s a step"
    elif metres:
        speed = _SPEED.get(verb, _WALKING)
        usual, why = lex.value(metres[1]) / speed + 0.5, f"{speed:g} m a second"
    elif degrees:
        usual, why = 1.0 + int(degrees[1]) / 180, f"{degrees[1]} degrees"
    words = set(re.findall(r"[a-z]+", text))
    factor = _SLOW if words & set(lex.phrases["slow"]) else _FAST if words & set(lex.phrases["fast"]) else 1.0
    if factor != 1.0:
        why = f"{why}, {factor:g} times as long for the speed".lstrip(", ")
    return Duration(usual * factor, False, why)


def _count(text: str) -> float | None:
    lex = lexicon()
    for words, count in (("once", 1.0), ("twice", 2.0), ("thrice", 3.0)):
        if re.search(rf"\b{words}\b", text):
            return count
    found = re.search(rf"\b({lex.number})\s*(?:times\b|x\b|repetitions\b|reps\b)", text)
    if found:
        return lex.value(found[1])
    if re.search(r"\b(?:repeatedly|over and over|again and again|multiple times)\b", text):
        return 4.0
    names = [*lex.actions, *(noun + ending for noun in lex.nouns - {"step"} for ending in ("s", "es"))]
    listed = "|".join(map(re.escape, sorted(names, key=len, reverse=True)))
    found = re.search(rf"\b({lex.number})\s+(?:[a-z]+\s+)?(?:{listed})\b", text)
    return lex.value(found[1]) if found else None


def _without(text: str, found: "re.Match[str]") -> str:
    return " ".join(f"{text[: found.start()]} {text[found.end() :]}".split()).strip(" ,")
