"""Captions of synthetic motions: sentences that differ and that name side and count of the factors."""

import re

import pytest

from playground.motion.captions import participle, third
from playground.motion.synthetic import Synthetic, corpus

COUNT_WORDS = {"once": 1, "twice": 2} | {
    f"{word} times": n for n, word in enumerate(("three", "four", "five", "six", "seven", "eight"), start=3)
}


@pytest.fixture(scope="module")
def items() -> list[Synthetic]:
    return corpus(120, seed=8)


def test_captions_are_sentences_that_differ(items: list[Synthetic]) -> None:
    for item in items:
        assert 3 <= len(item.captions) <= 4, item.captions
        assert len(set(item.captions)) == len(item.captions)
        assert item.motion.caption == item.captions[0]
        for text in item.captions:
            assert re.fullmatch(r"[a-z][a-z, ]+[a-z]\.", text), text
            assert "  " not in text


def test_captions_name_side_and_count(items: list[Synthetic]) -> None:
    sided = 0
    for item in items:
        side, turn = item.factors.get("side"), item.factors.get("turn_degrees")
        if turn is not None:
            side = "left" if turn > 0 else "right"
        for text in item.captions:
            words = set(re.findall(r"[a-z]+", text))
            if side in ("left", "right"):
                clock = "counterclockwise" if side == "left" else "clockwise"
                full = turn is not None and ("full turn" in text or clock in words)
                assert side in words or full, text
                assert {"left": "right", "right": "left"}[side] not in words, text
                sided += 1
            elif side == "both":
                assert "both" in words, text
            for phrase, count in COUNT_WORDS.items():
                if phrase in text:
                    assert item.factors["repetitions"] == count, text
    assert sided > 100


@pytest.mark.parametrize(
    ("verb", "forms"), [("walk", ("walks", "walking")), ("run", ("runs", "running")), ("do", ("does", "doing"))]
)
def test_verbs_are_conjugated(verb: str, forms: tuple[str, str]) -> None:
    assert (third(verb), participle(verb)) == forms
