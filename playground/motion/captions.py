"""A small grammar of English captions for synthetic motions.

A clause is a verb with what follows it, e.g. ("walk", "slowly to the left"). `captions` joins the clauses of one motion
into sentences that differ in subject, tense, wording and manner.
"""

from dataclasses import dataclass

import numpy as np

SUBJECTS = ("a person", "someone", "a man", "a woman", "the person", "the figure", "a human", "this person")
NUMBERS = ("never", "once", "twice", *(f"{n} times" for n in ("three", "four", "five", "six", "seven", "eight")))
JOINS = (", then ", " and then ", ", and after that ", " before ")
MANNER = {
    "neutral": ("",),
    "energetic": (" energetically", " with a lot of energy", " in a lively way"),
    "tired": (" tiredly", " as if exhausted", " in a weary way"),
    "proud": (" proudly", " with the chest out", " in a confident way"),
    "sad": (" sadly", " with the head hanging", " in a gloomy way"),
    "old": (" like an old person", " with the back bent", " with the frailty of old age"),
}
IRREGULAR = {  # third person and participle of the verbs that do not just add s and ing
    "run": ("runs", "running"), "jog": ("jogs", "jogging"), "sit": ("sits", "sitting"), "step": ("steps", "stepping"),
    "wave": ("waves", "waving"), "raise": ("raises", "raising"), "put": ("puts", "putting"),
    "squat": ("squats", "squatting"), "punch": ("punches", "punching"), "move": ("moves", "moving"),
    "make": ("makes", "making"), "take": ("takes", "taking"), "reach": ("reaches", "reaching"),
    "pivot": ("pivots", "pivoting"), "box": ("boxes", "boxing"), "do": ("does", "doing"),
    "rotate": ("rotates", "rotating"), "curve": ("curves", "curving"), "strike": ("strikes", "striking"),
    "crouch": ("crouches", "crouching"),
}  # fmt: skip


@dataclass(frozen=True)
class Clause:
    """One thing that happens: alternatives of (verb, rest of the clause)."""

    options: tuple[tuple[str, str], ...]


def third(verb: str) -> str:
    """walk -> walks."""
    return IRREGULAR.get(verb, (verb + "s", ""))[0]


def participle(verb: str) -> str:
    """walk -> walking."""
    return IRREGULAR.get(verb, ("", verb + "ing"))[1]


def captions(clauses: list[Clause], style: str, rng: np.random.Generator, count: int) -> list[str]:
    """`count` different captions of one motion; each names every clause in order, most of them the style too."""
    found: list[str] = []
    for attempt in range(40 * count):
        if len(found) == count:
            break
        text = _sentence(clauses, style, rng, plain=not found and attempt < 3)
        if text not in found:
            found.append(text)
    return found


def _sentence(clauses: list[Clause], style: str, rng: np.random.Generator, plain: bool) -> str:
    subject = SUBJECTS[rng.integers(len(SUBJECTS))]
    manner = MANNER[style][rng.integers(len(MANNER[style]))] if rng.random() < 0.75 else ""
    parts = []
    for clause in clauses:
        verb, rest = clause.options[0 if plain else rng.integers(len(clause.options))]
        parts.append((verb, f" {rest}" if rest else ""))
    second_verb = len(parts) > 1 or " and " in parts[0][1] or " then " in parts[0][1]
    ongoing = not plain and not second_verb and rng.random() < 0.35
    join = JOINS[rng.integers(len(JOINS))]
    text = ("is " + participle(parts[0][0]) if ongoing else third(parts[0][0])) + parts[0][1]
    for number, (verb, rest) in enumerate(parts[1:]):
        before = join == " before " and number == len(parts) - 2
        joining = join if before or join != " before " else ", then "
        text += joining + (participle(verb) if before else third(verb)) + rest
    return f"{subject} {text}{manner}."


def times(count: int) -> str:
    """2 -> twice."""
    return NUMBERS[count]
