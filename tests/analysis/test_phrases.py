"""Sentences of our own: every group has one, sides come from the caption, its words do not."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.analysis.phrases import _SENTENCES, group_of, sentence, side_of
from playground.data.actions import GROUPS


def test_every_group_has_a_sentence() -> None:
    for name, _ in GROUPS:
        assert (name, "") in _SENTENCES
    assert {group for group, _ in _SENTENCES} == {name for name, _ in GROUPS} | {"other"}


@pytest.mark.parametrize(
    "action, caption, expected",
    [
        ("raise hands", "The LEFT arm goes up.", "a person raises the left hand"),
        ("raise hands", "both hands, left and right", "a person raises both hands"),
        ("raise hands", "first the left, then the right", "a person raises a hand"),
        ("walk", "steps backwards", "a person is walking backwards"),
        ("walk-turn-right|happy", "a right turn", "a person steadily walks forward and turns right"),
        ("dance", "turns left", "a person dances"),
        ("", "someone kicks", "a person kicks"),
        ("", "", "a person moves"),
    ],
)
def test_sentences(action: str, caption: str, expected: str) -> None:
    assert sentence(action, (caption,)) == expected


@given(st.text(max_size=30), st.lists(st.text(max_size=60), max_size=2))
def test_whatever_a_clip_says_the_sentence_is_ours(action: str, captions: list[str]) -> None:
    assert sentence(action, captions) in _SENTENCES.values()
    assert side_of(captions) in ("both", "left", "right", "back", "")


def test_a_group_stays_itself() -> None:
    for name, _ in GROUPS:
        assert group_of(name, ("somebody runs",)) == name
