"""Prompts before they reach a model: normalised, split into timed steps, told expressively (systems.md C4, E6).

MOGO lets a language model bring a prompt into the style of the captions and split it into atomic instructions;
SnapMoGen lets one expand it to about 48 words. Neither publishes its template. Here rules do both, offline and the same
every time; a language model of the reader's own may do it instead (text/endpoint.py).
"""

import re
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.text.clauses import PERSON, parse
from playground.text.durations import duration, take_time
from playground.text.english import lexicon
from playground.text.prompts import normalise
from playground.text.splitting import Action, split

_AMBIGUOUS = {"make", "have", "show", "let", "see", "display", "picture", "so", "now", "create", "produce", "to show"}
_OPENINGS = ("First", "Then", "After that", "Next")


@dataclass(frozen=True)
class PromptStep:
    """One atomic instruction and how long it lasts."""

    text: str
    seconds: float


@dataclass(frozen=True)
class Rewritten:
    """A prompt before and after, and why."""

    original: str
    normalised: str  # one sentence in the style of captions
    steps: tuple[PromptStep, ...]
    expressive: str  # the same with pace, limbs and posture
    notes: tuple[str, ...]  # what was done, one clause each

    def record(self) -> dict[str, Any]:
        """As JSON takes it."""
        return asdict(self)


Writer = Callable[[str, Rewritten], Rewritten]


def rewrite(prompt: str, writer: Writer | None = None) -> Rewritten:
    """Rewrite a prompt by the rules, or by `writer`, which gets the cleaned prompt and what the rules make of it.

    PlaygroundError for a prompt that is no text, empty, too long or without a word.
    """
    if isinstance(prompt, str):
        prompt = re.sub(r"\s*[\r\n]+\s*", " | ", prompt.strip())
    line = normalise(prompt)
    ruled = by_rules(line)
    return writer(line, ruled) if writer else ruled


def by_rules(line: str) -> Rewritten:
    """A clean line of text, rewritten by the rules. PlaygroundError without a word."""
    bare, notes = _without_requests(line.lower().replace("\u2019", "'"))
    actions = split(bare)
    if not actions:
        raise PlaygroundError(f"the prompt {line[:60]!r} holds no word; write what the person does")
    subject = next((action.clause.subject for action in actions if action.clause.subject), PERSON)
    steps = []
    for number, action in enumerate(actions, 1):
        step, why = _timed(action, subject, number if len(actions) > 1 else 0)
        steps.append(step)
        notes += [*action.clause.changes, *(c for m in action.meanwhile for c in m.changes), *action.why, *why]
    if any(a.clause.form in ("base", "gerund", "past") for a in actions):
        notes.append("told in the third person, present tense, as captions are")
    if len(steps) > 1:
        notes.append(f"{len(steps)} actions in order")
    normalised = ", then ".join([_by(subject, actions[0]), *(action.told() for action in actions[1:])])
    if len(normalised) > LIMITS.max_prompt_chars:
        normalised = line
        notes.append("too long as one sentence: kept as it was typed")
    notes.append("the expressive text adds pace, limbs and posture that are typical of each verb")
    shown = line.replace(" | ", "\n")
    return Rewritten(shown, normalised, tuple(steps), expressive(actions, subject), tuple(dict.fromkeys(notes)))


def _without_requests(line: str) -> tuple[str, list[str]]:
    """Words of a request, quotes and a trailing "please" left out."""
    phrases = sorted(lexicon().phrases["requests"], key=len, reverse=True)
    listed = "|".join(map(re.escape, phrases))
    bare = re.sub(r"[\"\u201c\u201d\u201e`]|(?<!\w)'|'(?!\w)", "", line).strip(" ,.!")
    left = bare = re.sub(r"\s*,?\s*\b(?:please|thanks|thank you)\b[\s.!]*$", "", bare)
    while asked := re.match(rf"({listed})(?![\w'-])[\s,:]*(?=\w)", left):
        rest = left[asked.end() :]
        if asked[1] in _AMBIGUOUS and parse(take_time(rest)[0]) is None:
            break  # "make a sandwich" is an action
        left = rest
    if left == bare:
        return bare, []
    said = bare[: len(bare) - len(left)].strip(" ,:")
    return left, [f'"{said}" left out: a request, no motion']


def _timed(action: Action, subject: str, number: int) -> tuple[PromptStep, list[str]]:
    """A step with its seconds within the limits, and what there is to say of them."""
    text = action.told()
    where = f"step {number}" if number else "the motion"
    found = duration(text, action.clause.verb)
    seconds = found.seconds
    notes = [f"{where}: {found.why}"] if found.why else []
    if action.seconds is not None:
        seconds, notes = action.seconds, [f"{where}: {action.seconds:g} s, as the prompt says"]
    kept = min(max(seconds, LIMITS.min_seconds), LIMITS.max_seconds)
    if kept != seconds:
        notes.append(
            f"{where}: {seconds:g} s brought to {kept:g} s; {LIMITS.min_seconds:g} to {LIMITS.max_seconds:g} fit"
        )
    return PromptStep(_by(subject, action), round(kept, 1)), notes


def _by(subject: str, action: Action) -> str:
    """An action with who does it; without, where the rules could not read it."""
    clause = action.clause
    if clause.form == "as it is" and not clause.subject:
        return action.told()
    return f"{subject if clause.subject in ('', PERSON) else clause.subject} {action.told()}"


def expressive(actions: list[Action], subject: str) -> str:
    """The actions in sentences with pace, limbs and a last posture: about 48 words for one action (E6).

    Details are dropped from the end where the text would be longer than a prompt may be.
    """
    for detailed in range(len(actions), -1, -1):
        text = " ".join(
            _sentence(action, subject, number, len(actions), number < detailed) for number, action in enumerate(actions)
        )
        ending = lexicon().classes[_kind(actions[-1])]["end"]
        if len(f"{text} {ending}") <= LIMITS.max_prompt_chars:
            return f"{text} {ending}"
        if len(text) <= LIMITS.max_prompt_chars:
            return text
    return text[: LIMITS.max_prompt_chars].rsplit(" ", 1)[0]


def _sentence(action: Action, subject: str, number: int, total: int, detailed: bool) -> str:
    lex, clause = lexicon(), action.clause
    row = lex.classes[_kind(action)] | lex.verbs.get(clause.verb, {})
    if total == 1:
        opening = subject[0].upper() + subject[1:]
    else:
        word = "Finally" if number == total - 1 and total > 2 else _OPENINGS[number if number < 2 else 2 + number % 2]
        opening = f"{word} {subject if number == 0 else subject.replace('an ', 'the ', 1).replace('a ', 'the ', 1)}"
    words = set(f"{clause.manner} {clause.rest}".split())
    paced = words & {*lex.phrases["slow"], *lex.phrases["fast"]} or clause.manner
    if not detailed or clause.form == "as it is":
        return f"{opening} {action.told()}."
    pace = "" if paced else f" {row['pace']}"
    return f"{opening} {action.told()}{pace}, {row['detail']}."


def _kind(action: Action) -> str:
    """Class of a step: somebody who goes while waving goes; somebody who turns a wheel handles an object."""
    kinds = [lexicon().kind_of(clause.verb) for clause in (action.clause, *action.meanwhile)]
    if "travel" in kinds:
        return "travel"
    handled = kinds[0] == "turn" and re.match(r"(?:the|an?|it)\b", action.clause.rest)
    return "object" if handled else kinds[0]
