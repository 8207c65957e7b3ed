"""Just enough English for prompts: which verb a word is a form of, the forms of a verb, numbers in words."""

import json
import re
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

DATA = Path(__file__).parent / "data"
_VOWELS = "aeiou"


@dataclass(frozen=True)
class Form:
    """A word read as a verb: its base form, and which form it is (base, third, gerund or past)."""

    lemma: str
    kind: str


@dataclass(frozen=True, eq=False)
class Lexicon:
    """The verbs and phrases that the rules know, as the files in data/ list them."""

    verbs: dict[str, dict[str, Any]]  # base form -> class, and where it has its own: seconds, detail
    classes: dict[str, dict[str, Any]]  # class -> seconds, seconds of a repetition, words for the expressive style
    irregular: dict[str, dict[str, str]]  # third, gerund, past -> base form -> form
    doubled: frozenset[str]  # base forms that double their last letter
    actions: tuple[str, ...]  # names of actions that are no verbs
    countable: frozenset[str]  # those of them that take an article
    poses: tuple[str, ...]
    nouns: frozenset[str]  # nouns of motion: "a jump", "two kicks"
    phrases: dict[str, Any]

    @cached_property
    def forms(self) -> dict[str, Form]:
        """Every form of every verb. A word that is two forms ("put") counts as the base form."""
        table: dict[str, Form] = {}
        for kind in ("past", "gerund", "third"):
            table |= {self.inflect(lemma, kind): Form(lemma, kind) for lemma in self.verbs}
        return table | {lemma: Form(lemma, "base") for lemma in self.verbs}

    def inflect(self, lemma: str, kind: str) -> str:
        """The third person, gerund or past of a base form; unknown verbs follow the rules of spelling."""
        special = self.irregular.get(kind, {}).get(lemma)
        if special:
            return special
        if kind == "third":
            if lemma.endswith(("s", "x", "z", "ch", "sh", "o")):
                return lemma + "es"
            return lemma[:-1] + "ies" if _consonant_y(lemma) else lemma + "s"
        stem = lemma + lemma[-1] if lemma in self.doubled else lemma
        if kind == "gerund":
            return stem[:-1] + "ing" if stem.endswith("e") and not stem.endswith(("ee", "ye", "oe")) else stem + "ing"
        if stem.endswith("e"):
            return stem + "d"
        return stem[:-1] + "ied" if _consonant_y(stem) else stem + "ed"

    def read(self, word: str) -> Form | None:
        """A word as a verb of the table, or an unknown one that ends in -ing; None if it is neither."""
        word = word.rstrip(",")
        found = self.forms.get(word)
        if found or not word.endswith("ing") or len(word) < 6 or word in self.phrases["nouns"]:
            return found
        stem = word[:-3]
        if not re.search("[aeiouy]", stem):
            return None
        if stem[-1] == stem[-2] and stem[-1] not in "lsfz":
            stem = stem[:-1]
        elif stem[-1] in "cvuz" or stem.endswith(("dg", "ag", "at", "ur")):
            stem += "e"
        return Form(stem, "gerund")

    def kind_of(self, lemma: str) -> str:
        """Class of a verb: travel, turn, posture, gesture, whole, object or still; whole for an unknown one."""
        return str(self.verbs.get(lemma, {}).get("class", "whole"))

    def seconds(self, lemma: str) -> float:
        """How long an action of this verb takes, typically."""
        own = self.verbs.get(lemma, {}).get("seconds")
        return float(own or self.classes[self.kind_of(lemma)]["seconds"])

    @cached_property
    def number(self) -> str:
        """Pattern of a number in digits or words."""
        words = sorted(self.phrases["units"], key=len, reverse=True)
        return r"(?:\d+(?:\.\d+)?|" + "|".join(map(re.escape, words)) + ")"

    def value(self, number: str) -> float:
        """What a match of `number` means."""
        known = self.phrases["units"].get(number)
        return float(number if known is None else known)


def _consonant_y(word: str) -> bool:
    return word.endswith("y") and len(word) > 1 and word[-2] not in _VOWELS


@cache
def lexicon() -> Lexicon:
    """The tables of the package, read once."""
    verbs = json.loads((DATA / "verbs.json").read_text(encoding="utf-8"))
    phrases = json.loads((DATA / "phrases.json").read_text(encoding="utf-8"))
    return Lexicon(
        verbs["verbs"],
        verbs["classes"],
        {kind: verbs[kind] for kind in ("third", "gerund", "past")},
        frozenset(verbs["doubled"]),
        tuple(verbs["actions"]),
        frozenset(verbs["countable"]),
        tuple(verbs["poses"]),
        frozenset(verbs["nouns"]),
        phrases,
    )
