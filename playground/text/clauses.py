"""One action of a prompt: who does what, in any form of the verb -> the third person, present tense, of captions."""

import re
from dataclasses import dataclass, replace

from playground.text.english import Form, lexicon

PERSON = "a person"
_ARTICLES = r"(?:a|an|the|this|that|my|some|one|another|two|three|four|five|several|many)"
_STOP = {"of", "in", "on", "with", "the", "a", "an", "to", "and", "at", "from", "for", "by", "while", "like", "then"}
_BE, _HAVE = {"is", "are", "am", "was", "were", "'s", "'re", "'m"}, {"has", "have", "had"}
_NOT_MANNER = {"fly", "apply", "belly", "family", "only", "rely", "reply", "bully", "jelly", "italy"}
_AFTER_OBJECT = {"away", "to", "in", "on", "and", "off", "down", "up", "over", "with", "from", "then", "while"}


@dataclass(frozen=True)
class Clause:
    """One action. form: as the prompt had it, one of base, third, gerund, past, noun, other (no verb), as it is."""

    verb: str
    rest: str
    form: str
    manner: str = ""  # adverbs before the verb
    subject: str = ""  # "a person", with adjectives; empty where the prompt names nobody
    changes: tuple[str, ...] = ()  # what was done to it, one clause each

    def told(self, kind: str = "third") -> str:
        """The action without its subject, the verb in the third person or as a gerund."""
        if self.form == "as it is":
            return self.rest
        words = [self.manner, lexicon().inflect(self.verb, kind), self.rest]
        return " ".join(word for word in words if word)


def parse(text: str, like: str = "") -> Clause | None:
    """A piece of a prompt (lower case) as an action; None if it does not begin as one.

    like: form of the verb before it; given, the piece is a candidate after "and" or a comma, where a base form or a
    plural may be a noun ("bags and box"): such a word counts only if the verb before it stands in the same form.
    """
    text = text.strip(" ,.:!?;'\"")
    subject, rest, changes = subject_of(text)
    words = rest.split()
    manner, helpers, words = _before_verb(words)
    denied = words[0] in lexicon().phrases["not"] or words[:2] in (["do", "not"], ["does", "not"]) if words else False
    if denied:
        why = '"not" was kept, but the models have hardly seen it: say what the person does instead'
        told = re.sub(r"^(?:do(?:es)?n't|do(?:es)? not|didn't|did not|never)\b", "does not", rest)
        return Clause("be", told, "as it is", "", subject or PERSON, (*changes, why))
    form = lexicon().read(words[0]) if words else None
    named = None if subject and form and form.kind == "third" else _named(" ".join(words))
    if named:
        return replace(named, manner=" ".join(manner), subject=subject, changes=changes)
    form = None if words[:1] == ["left"] and not subject else form  # the side, not the past of "leave"
    fits = form and _fits(form, like, bool(subject or helpers), alone=len(words) == 1)
    if form and fits and not (form.kind == "past" and _BE & set(helpers)):
        return _clause(form, words[1:], manner, subject, changes)
    for verb, forms in (("be", _BE), ("have", _HAVE)):
        if forms & set(helpers) and (subject or not like):
            return Clause(verb, _tidy(" ".join(words)), "third", " ".join(manner), subject, changes)
    return None


def guess(text: str) -> Clause:
    """A piece without a known verb, as the name of an action or as it is."""
    text = text.strip(" ,.:!?;'\"")
    subject, rest, changes = subject_of(text)
    if not re.fullmatch(r"[\x00-\x7f]*", rest):
        return Clause("be", rest, "as it is", "", subject, (*changes, "the rules know English only: kept as it is"))
    words = rest.split()
    why = f'"{rest[:60]}" holds no verb that is known: taken as the name of an action'
    if subject and words and words[0] not in _STOP:
        lemma = words[0][:-1] if words[0].endswith("s") and not words[0].endswith("ss") else words[0]
        return Clause(lemma, " ".join(words[1:]), "other", "", subject, (*changes, f'"{words[0]}" taken as a verb'))
    last = lexicon().read(words[-1]) if words else None
    if last and last.kind == "gerund" and len(words) == 2:
        return Clause(last.lemma, f"in {_a(words[0])} way", "gerund", "", subject, changes)
    if words and words[0] in lexicon().phrases["body"]:
        return Clause("stand", f"with the {rest}", "other", "", subject, (*changes, why))
    if words and words[-1] in lexicon().nouns and not re.match(_ARTICLES + r"\b", rest):
        rest = _a(rest)
    return Clause("do", rest, "other", "", subject, (*changes, why))


def _clause(form: Form, words: list[str], manner: list[str], subject: str, changes: tuple[str, ...]) -> Clause:
    rest, role = " ".join(words), re.search(r" like an? [a-z ]+$", subject)
    if role:
        subject, rest = subject[: role.start()], f"{rest}{role[0]}".strip()
    return Clause(form.lemma, _tidy(rest), form.kind, " ".join(manner), subject, changes)


def _fits(form: Form, like: str, led: bool, alone: bool) -> bool:
    """Whether a word may be a verb after "and" or a comma; "bags and boxes" holds none."""
    if not like or led or form.kind == "gerund":
        return True
    if alone and form.lemma in lexicon().phrases["things"]:
        return False
    if form.kind == "third":
        return like in ("third", "gerund", "past", "other")
    return like == form.kind or (form.kind == "base" and like in ("noun", "other"))


def subject_of(text: str) -> tuple[str, str, tuple[str, ...]]:
    """(subject as captions say it, what follows, what was changed)."""
    p = lexicon().phrases
    people, roles = "|".join(p["people"]), "|".join(p["roles"])
    pronoun = re.match(rf"(?:{'|'.join(p['pronouns'])})(?='|\b)(?!-)", text)
    found = re.match(rf"(?:{_ARTICLES}\s+)?((?:[a-z][a-z-]*\s+){{0,3}}?)({people}|{roles})(?:'s)?\b(?!\s+of\b)", text)
    if pronoun:
        told, rest = pronoun[0], text[pronoun.end() :]
        who = PERSON
    elif found and not _STOP & set(found[1].split()) and _issubject_of(found, text):
        told, rest = found[0], text[found.end() :]
        who = _who(found[1].split(), found[2])
    else:
        return "", text, ()
    changes = () if told.startswith(who.split(" like ")[0]) else (f'"{told}" told as "{who}"',)
    if told.split()[-1] in p["many"]:
        changes = (f'"{told}": one person is made, not several',)
    rest, left_out = _described(rest.strip())
    second = subject_of(rest[4:]) if rest.startswith("and ") else ("", "", ())
    if second[0]:
        return who, second[1], (*changes, f'"{told}" and another: one person is made, not several')
    return who, rest, (*changes, *left_out)


def _described(rest: str) -> tuple[str, tuple[str, ...]]:
    """What follows a subject, without a description of it: "in red walks", "who holds a box walks"."""
    lex, words = lexicon(), rest.split()
    who = bool(words) and words[0] in ("who", "that", "which")
    if not words or not (who or words[0] in ("in", "with", "wearing", "holding", "carrying", "on")):
        return rest, ()
    start = 3 if who else 2
    verbs = [n for n, word in enumerate(words) if n >= start and (f := lex.read(word)) and f.kind == "third"]
    verbs += [n for n, word in enumerate(words) if n >= start and word in _BE and not who]
    if not verbs:
        return " ".join(words[1:]) if who else rest, ()
    told, action = words[who : min(verbs)], " ".join(words[min(verbs) :])
    told = told[1:] if told[0] in _BE else told
    form = lex.read(told[0])
    if form and told[0] != "wearing":
        return f"{action} while {lex.inflect(form.lemma, 'gerund')} {' '.join(told[1:])}".strip(), ()
    return action, (f'"{" ".join(told)}" left out: it is not a part of the motion',)


def _issubject_of(found: re.Match[str], text: str) -> bool:
    """A role needs an article, and something that acts must follow; "robot dance" is a dance."""
    if found[2] in lexicon().phrases["roles"] and not re.match(_ARTICLES, text):
        return False
    adjectives = [lexicon().read(word) for word in found[1].split()]
    return not any(form and form.kind in ("base", "third") for form in adjectives)


def _who(adjectives: list[str], head: str) -> str:
    kept = " ".join(word for word in adjectives if word not in ("single", "other", "same"))
    who = _a(f"{kept} person".strip())
    return f"{who} like a {head}" if head in lexicon().phrases["roles"] else who


def _a(noun: str) -> str:
    return ("an " if noun[0] in "aeiou" else "a ") + noun


def _before_verb(words: list[str]) -> tuple[list[str], list[str], list[str]]:
    """Adverbs and helping verbs at the beginning, and the words from the verb on."""
    p, manner, helpers = lexicon().phrases, [], []
    while words:
        word = words[0].rstrip(",")
        if word in p["helpers"]:
            helpers.append(word)
        elif (word.endswith("ly") and word not in _NOT_MANNER) or word in p["slow"] + p["fast"]:
            manner.append(word)
        elif _aspect(words):
            helpers.append(word)
        else:
            break
        words = words[max(1, _aspect(words)) :]
    return manner, helpers, words


def _aspect(words: list[str]) -> int:
    """How many words say that something begins, goes on or ends: "starts to" walk, "ends with" a bow; 0 for none."""
    form = lexicon().read(words[0])
    lemma = form.lemma if form else words[0].removesuffix("s")
    if lemma not in [*lexicon().phrases["aspect"], "end", "finish"] or len(words) < 2:
        return 0
    count = 2 if words[1] in ("to", "by", "with") and len(words) > 2 else 1
    verb = lexicon().read(words[count])
    acts = verb is not None and (verb.kind == "gerund" or words[1] == "to")
    return count if acts or (count == 2 and _named(" ".join(words[2:]))) else 0


def _named(text: str) -> Clause | None:
    """Actions that are nouns: "a backflip", "10 push-ups", "two quick kicks", "t-pose"."""
    lex = lexicon()
    names = "|".join(map(re.escape, sorted(lex.actions, key=len, reverse=True)))
    pose = re.match(rf"(?:(?:a|an|the)\s+)?({'|'.join(map(re.escape, lex.poses))})\b", text)
    if pose:
        article = "" if pose[1] == "attention" else "a "
        return Clause("stand", f"{'at' if not article else 'in'} {article}{text[pose.start(1) :]}", "noun")
    if re.match(rf"(?:{lex.number}\s+)?(?:(?:[a-z]+)\s+)?(?:{names})\b", text) and not _leads(text, names):
        return Clause("do", _tidy(_a(text) if text.split(" with")[0] in lex.countable else text), "noun")
    nouns = "|".join(sorted(lex.nouns))
    counted = re.match(rf"{lex.number}\s+(?:[a-z-]+\s+){{0,2}}?(?:{nouns})(?:s|es)?\b(?!-)", text)
    if counted and not re.search(r"\b(?:person|man|woman|of|with)\b", counted[0]):
        return Clause("take" if re.search(r"\bsteps?$", counted[0]) else "do", _tidy(text), "noun")
    return None


def _leads(text: str, names: str) -> bool:
    """True where a verb stands before the name of the action: "practises karate"."""
    first = lexicon().read((text.split() or [""])[0])
    return first is not None and not re.match(rf"(?:{names})\b", text)


def _tidy(rest: str) -> str:
    """Possessives told as captions do: "the left hand"."""
    words = rest.split()
    for number, word in enumerate(words[:-1]):
        if word in ("his", "their", "my", "your", "its", "our") or (
            word == "her" and words[number + 1] not in _AFTER_OBJECT
        ):
            words[number] = "the"
    return " ".join(words).strip(" ,")
