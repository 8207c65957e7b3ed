"""What visitors type, and left and right in the mirror."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.text.prompts import mirror_caption, normalise

PAIRS = [
    ("a person turns left", "a person turns right"),
    ("Left foot, then RIGHT foot.", "Right foot, then LEFT foot."),
    ("two lefts and a right", "two rights and a left"),
    ("steps leftward and rightwards", "steps rightward and leftwards"),
    ("the left-hand side; right-handed throw", "the right-hand side; left-handed throw"),
    ("lefthanded rightmost leftfoot", "righthanded leftmost rightfoot"),
    ("left/right, left_arm (right) left's", "right/left, right_arm (left) right's"),
    ("turns clockwise", "turns counterclockwise"),
    ("Clockwise spin, then COUNTERCLOCKWISE", "Counterclockwise spin, then CLOCKWISE"),
    ("a bright person stands upright", "a bright person stands upright"),
    ("outright righteous cleft leftover aright", "outright righteous cleft leftover aright"),
    ("ccw then CW", "cw then CCW"),
    ("", ""),
]


@pytest.mark.parametrize(("text", "mirrored"), PAIRS)
def test_mirror_swaps_both_ways(text: str, mirrored: str) -> None:
    assert mirror_caption(text) == mirrored
    assert mirror_caption(mirrored) == text


@pytest.mark.parametrize(
    "spelling", ["counter-clockwise", "anticlockwise", "anti-clockwise", "counter clockwise", "contraclockwise"]
)
def test_every_spelling_of_counterclockwise_is_read(spelling: str) -> None:
    assert mirror_caption(f"spins {spelling}, fast") == "spins clockwise, fast"
    assert mirror_caption(spelling.upper()) == "CLOCKWISE"
    assert mirror_caption(spelling.capitalize()) == "Clockwise"


DIRECTIONS = ["left", "right", "Left", "RIGHT", "lefts", "right-hand", "Leftwards", "Right's", "cw"]
WORDS = [*DIRECTIONS, "clockwise", "COUNTERCLOCKWISE", "upright", "bright", "the", "é", "3", "_", "-", ",", "\n", "🕺"]


@given(st.lists(st.sampled_from(WORDS), max_size=12), st.sampled_from([" ", "  ", "-", "/", ". ", ""]))
def test_mirror_is_its_own_inverse(words: list[str], joint: str) -> None:
    text = joint.join(words)
    assert mirror_caption(mirror_caption(text)) == text


@given(st.text())
def test_mirror_changes_nothing_but_the_words_of_direction(text: str) -> None:
    mirrored = mirror_caption(text)
    assert mirror_caption(mirror_caption(mirrored)) == mirrored
    if not re.search("left|right|wise|cw", text, re.IGNORECASE):
        assert mirrored == text


@given(st.lists(st.sampled_from(["left", "right", "a", "walks", "lefts", "rights", "upright"]), max_size=20))
def test_mirror_against_a_slow_word_by_word_swap(words: list[str]) -> None:
    table = {"left": "right", "right": "left", "lefts": "rights", "rights": "lefts"}
    assert mirror_caption(" ".join(words)).split() == [table.get(word, word) for word in words]


@pytest.mark.parametrize(
    ("typed", "clean"),
    [
        ("  a person\t steadily \r\n walks  forward ", "a person steadily walks forward"),
        ("wa\x00lk\x1b", "walk"),
        ("\u202ewalk\u202c \u200b left", "walk left"),
        ("cafe\u0301", "caf\u00e9"),
        ("\ud800walk", "walk"),
        ("🕺 tanzt", "🕺 tanzt"),
        ("يمشي شخص", "يمشي شخص"),
        (" " * 9000 + "run" + "\u200b" * 9000, "run"),
    ],
)
def test_normalise_cleans(typed: str, clean: str) -> None:
    assert normalise(typed) == clean


@pytest.mark.parametrize("typed", ["", "   ", "\x00\x01\n\t", "\u200b\u202e", "\ud800"])
def test_empty_prompts_are_refused_unless_allowed(typed: str) -> None:
    with pytest.raises(PlaygroundError, match="prompt is empty"):
        normalise(typed)
    assert normalise(typed, allow_empty=True) == ""


def test_long_prompts_are_refused_with_both_numbers() -> None:
    assert len(normalise("x" * LIMITS.max_prompt_chars)) == LIMITS.max_prompt_chars
    with pytest.raises(PlaygroundError, match=f"10000 characters, at most {LIMITS.max_prompt_chars}"):
        normalise("x" * 10_000, what="caption")
    with pytest.raises(PlaygroundError, match="characters, at most"):
        normalise("\ufb2c" * LIMITS.max_prompt_chars)  # one character that composes to three
    with pytest.raises(PlaygroundError, match="must be text, got NoneType"):
        normalise(None)  # type: ignore[arg-type]


@given(st.text(max_size=400))
def test_normalised_text_is_one_clean_line_and_stays(typed: str) -> None:
    once = normalise(typed, allow_empty=True)
    assert normalise(once, allow_empty=True) == once
    assert once == once.strip() and "  " not in once and once.isprintable()
