"""A prompt of several actions -> the actions in the order in which they happen (MOGO's atomic instructions; C4)."""

import re
from dataclasses import dataclass, replace

from playground.text.clauses import Clause, guess, parse, subject_of
from playground.text.durations import take_time
from playground.text.english import lexicon

_ARROWS = r"\s*(?:->|=>|→|⇒|➜|>>|\||;|\u2022)\s*"
_THEN = (
    r"\s*[,.]?\s*(?:\b(?:and|but)\s+)?(?:\b(?:just\s+)?(?:after (?:that|this|which|doing so|it)|afterwards?|thereafter"
    r"|followed by|following that|subsequently|eventually|finally|lastly|at last|(?:at|in) the end|to finish"
    r"|later on|then|next)\b(?!\s+to\b))\s*,?\s*(?:and\s+)?"
)
_ORDINAL = (
    r"^(?:(?:first(?:ly)?|second(?:ly)?|third(?:ly)?|fourth(?:ly)?|last(?:ly)?|initially|at first|to begin with"
    r"|to start(?: with)?|first of all|step \d+|and|but|then)\b\s*[:,]?\s*)+"
)
_SOFT = re.compile(r"(\s*,\s*(?:(?:and|&)\s+)?|\s+(?:and|&|\+|plus)\s+|\s*/\s*)")
_TOGETHER = re.compile(r"\s*,?\s*\b(?:all )?(?:at the same time|simultaneously|at once|meanwhile)\b\s*,?")
_DIRECTIONS = (
    "forward", "forwards", "backward", "backwards", "back", "left", "right", "sideways", "up", "down", "around",
    "diagonally", "clockwise", "counterclockwise", "to", "again", "faster", "slower", "quickly", "slowly",
)  # fmt: skip
_WHILE = r"(?:while|whilst|as)"


@dataclass(frozen=True)
class Action:
    """One step: the clause, what happens meanwhile, and the time that the prompt names for it, if it does."""

    clause: Clause
    meanwhile: tuple[Clause, ...] = ()
    seconds: float | None = None
    why: tuple[str, ...] = ()  # why it stands where it stands, one clause each

    def told(self) -> str:
        """The action without its subject, in the third person."""
        others = [clause.told("gerund") for clause in self.meanwhile if clause.verb != self.clause.verb]
        return " while ".join([self.clause.told(), *others])


def split(line: str) -> list[Action]:
    """A prompt in one line of lower-case text -> its actions in order; empty where there is no word."""
    line = re.sub(r"(?:^|(?<=[\s|]))(?:\d+[.)]|[-*])\s+(?=[a-z])", "|", line)
    line = re.sub(_THEN, "|", re.sub(_ARROWS, "|", re.sub(r"[.!?]+(?=\s|$)|\.{2,}|:\s", "|", line)))
    actions: list[Action] = []
    for sentence in line.split("|"):
        for piece, why in _ordered(re.sub(_ORDINAL, "", sentence.strip(" ,"))):
            actions += _parts(re.sub(_ORDINAL, "", piece.strip(" ,.")), why, actions[-1] if actions else None)
    return actions


def _acts(text: str, like: str = "third") -> Clause | None:
    """The clause that a piece begins with, its time left out, as a candidate beside another one."""
    return parse(take_time(re.sub(_ORDINAL, "", text))[0], like)


def _ordered(sentence: str) -> list[tuple[str, tuple[str, ...]]]:
    """Pieces of a sentence in the order of time: "before", "after" and "until" are taken apart."""
    who = rf"(?:{'|'.join(lexicon().phrases['pronouns'])}|(?:a|the) [a-z]+)"
    for words, later in ((r"before", True), (r"after|once|when|as soon as|upon", False)):
        led = re.match(rf"(?:{words})\s+(.+?)(?:\s*,\s*|\s+(?={who}\s))(.+)$", sentence)
        if led and _acts(led[1]) and parse(take_time(led[2])[0]):
            why = (f'"{sentence.split()[0]}" put into the order of time',)
            first, second = (led[2], led[1]) if later else (led[1], led[2])
            return [*_ordered(first), (second, why)]
    for word, swapped in (("before", False), ("until", False), ("after", True), ("once", True)):
        for found in re.finditer(rf"\s*,?\s*\b(?:right |just )?{word}\s+", sentence):
            left, right = sentence[: found.start()], sentence[found.end() :]
            if left and _acts(right) and _acts(left, ""):
                why = (f'"{word}" put into the order of time',)
                return [(right, ()), (left, why)] if swapped else [*_ordered(left), (right, why)]
    return [(sentence, ())] if sentence else []


def _parts(piece: str, why: tuple[str, ...], before: Action | None) -> list[Action]:
    """The actions of one piece, joined by commas and "and", or done at once."""
    piece = re.sub(r"\bat the same time as\b", "while", piece)
    together = bool(_TOGETHER.search(piece))
    piece = _TOGETHER.sub(" ", piece).strip(" ,")
    piece, left_out = _while_first(piece)
    why = (*why, *left_out)
    texts, joins = _cut(piece)
    actions: list[Action] = []
    for text, join in zip(texts, joins, strict=True):
        action = _action(text, why if not actions else ())
        last = actions[-1] if actions else None
        if action is None:
            continue
        action = _directed(action, last or before)
        if last and (together or _at_once(last.clause, action.clause, join)):
            reason = "" if together else f'"{last.clause.verb}" and "{action.clause.verb}" go together: done at once'
            seconds = last.seconds or action.seconds
            meanwhile = (*last.meanwhile, action.clause, *action.meanwhile)
            actions[-1] = Action(last.clause, meanwhile, seconds, (*last.why, reason) if reason else last.why)
        else:
            actions.append(action)
    return actions


def _while_first(piece: str) -> tuple[str, tuple[str, ...]]:
    """ "while X, Y" told as "Y while X"; an X that is no action ("as the music starts") is left out."""
    found = re.search(rf"(?:^|,\s*(?:and\s+)?)({_WHILE}\s+([^,]+)),\s*([^,]+)", piece)
    if not found or parse(take_time(found[3])[0]) is None:
        return piece, ()
    acts, start = _acts(found[2]), found.start(1)
    told = f"{found[3]} while {found[2]}" if acts else found[3]
    why = () if acts else (f'"{found[1]}" left out: it is not what the person does',)
    return piece[:start] + told + piece[found.end() :], why


def _directed(action: Action, before: Action | None) -> Action:
    """ "then forwards" after "walks backwards" is a walk too."""
    clause = action.clause
    if before is None or clause.form != "other" or clause.rest.split()[:1] not in [[word] for word in _DIRECTIONS]:
        return action
    verb = before.clause.verb
    named = replace(clause, verb=verb, changes=(f'"{clause.rest}": the verb before it, {verb}, was taken again',))
    return replace(action, clause=named)


def _cut(piece: str) -> tuple[list[str], list[str]]:
    """Cut at commas and "and" where an action follows; (the texts, the join before each)."""
    fields = _SOFT.split(piece)
    texts, joins = [fields[0]], [""]
    for join, text in zip(fields[1::2], fields[2::2], strict=True):
        first = parse(take_time(re.sub(_ORDINAL, "", texts[-1]))[0])
        clause = _acts(text, first.form if first else "other")
        inside = re.search(rf"\b{_WHILE}\b", texts[-1]) and clause is not None and clause.form == "gerund"
        if clause is None or inside or (first is None and not texts[-1].strip()):
            texts[-1] += join + text
        elif first is None:  # nothing acted so far: adverbs, or words that lead in
            texts[-1] += (join if subject_of(text)[0] else " ") + text
        else:
            texts.append(text)
            joins.append(join.strip(" ,"))
    return texts, joins


def _action(text: str, why: tuple[str, ...]) -> Action | None:
    """One text without further actions, or with one after "while"."""
    parts = [part for part in re.split(rf"\s*,?\s*\b{_WHILE}\s+", text) if part.strip()]
    kept, meanwhile = parts[:1], []
    for part in parts[1:]:
        clause = parse(take_time(part)[0], "third")
        if clause is None:
            kept.append(part)  # "as fast as possible", "while on the floor"
        else:
            meanwhile.append(clause)
    if not kept:
        return None
    words = kept[0] if len(kept) == 1 else text
    meanwhile = meanwhile if len(kept) == 1 else []
    bare, seconds = take_time(re.sub(_ORDINAL, "", words))
    if not re.search(r"\w", bare):
        return None
    return Action(parse(bare) or guess(bare), tuple(meanwhile), seconds, why)


def _at_once(first: Clause, second: Clause, join: str) -> bool:
    """Whether "and" joins a way to go or to stand, with no place to arrive at, and a gesture: "walks and waves"."""
    kind = lexicon().kind_of
    arrives = re.search(r"\b(?:to|towards?|into|onto) (?:the|a)\b(?! (?:left|right|side|front|back))", first.rest)
    gesture = kind(first.verb) in ("travel", "still") and kind(second.verb) == "gesture"
    return join in ("and", "&", "+", "plus") and gesture and not arrives
