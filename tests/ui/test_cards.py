"""Teaching text: every card reads, says where it comes from, sets a stage that exists, and escapes what it holds."""

import html
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.errors import PlaygroundError
from playground.ui import cards as module
from playground.ui.cards import QUESTIONS, Card, card, card_html, cards, equation_html, term, terms, tour, tour_json
from playground.ui.rooms import ROOMS as BUILT
from playground.ui.rooms.learn import page
from playground.ui.state import ROOMS, State, parse

FILES = sorted(path.stem for path in module.FOLDER.glob("*.md"))


class Balance(HTMLParser):
    """Fails on a tag that is not closed in its turn; keeps the visible words."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.words = ""
        self.feed(text)
        assert not self.open, self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += data


@pytest.mark.parametrize("name", FILES)
def test_a_card_reads(name: str) -> None:
    one = card(name)
    assert len(one.title) < 60 and 80 < len(one.idea) < 1_200
    assert one.paper and (one.call or not one.room), "a card names its source, a room's card the call too"
    assert not one.equation or one.reading
    assert all(question.endswith("?") and answer for question, answer in one.questions)
    words = Balance(card_html(one)).words
    assert "[[" not in words and "**" not in words and "_" not in re.sub(r"[a-z]_[a-z]|usage\.\w+_", "", words)


@pytest.mark.parametrize("name", FILES)
def test_try_it_sets_a_stage_that_is_there(name: str) -> None:
    one = card(name)
    if one.room and one.room not in ROOMS:
        assert one not in cards()  # a room that is not built yet has no card on the page
        return
    state = parse(one.link)
    assert one.link and state.room == (one.room or state.room) and state.room != "learn"
    assert set(re.findall(r"[?&]([a-z]+)=", one.link)) == {"room", *state.values}, "a part of the link means nothing"


def test_every_room_and_every_question_has_a_card() -> None:
    assert {one.room for one in cards()} - {""} == set(ROOMS) - {"learn"}
    asked = {"one token", "accumulated sum", "share a codebook", "length come from", "two guidances"}
    titles = " ".join(card(name).title.lower() for name in QUESTIONS)
    assert all(words in titles for words in asked)
    assert [label.lower().replace(" ", "-") for label in BUILT] == list(ROOMS)


def test_the_same_words_everywhere() -> None:
    whole = page()
    Balance(whole)
    for name, entry in terms().items():
        assert term(name) == entry["text"] and entry["text"].endswith(".") and len(entry["text"]) < 240
        assert html.escape(entry["text"]) in whole
    used = {
        name.lower()
        for one in FILES
        for name in re.findall(r"\[\[([^\]|]+)", (module.FOLDER / f"{one}.md").read_text())
    }
    assert used <= set(terms())


def test_the_tour_has_six_steps_through_rooms_that_are_there() -> None:
    steps = tour()
    assert len(steps) == 6 and "<" not in tour_json()
    for step in steps:
        assert parse(step.query) == State(parse(step.query).room) and step.target.startswith("#")
        assert 20 < len(step.text) < 220


def test_equations() -> None:
    assert (
        equation_html("r_{n−1} = x^2; a")
        == "<div><i>r</i><sub><i>n</i>−1</sub> = <i>x</i><sup>2</sup></div><div><i>a</i></div>"
    )
    assert "<i>" not in equation_html("exp(pool)") and "&lt;" in equation_html("1 < 2")


@given(st.text(max_size=200))
def test_nothing_in_a_card_becomes_markup(text: str) -> None:
    text = text.replace("[[", "").replace("**", "").replace("*", "").replace("`", "")
    Balance(
        card_html(
            Card("x", text, text or "x", paper=text, call=text, reading=text, equation="a", questions=((text, text),))
        )
    )


@pytest.mark.parametrize("text", ["", "title: x", "title: x\n---\n", "color: red\n---\nidea"])
def test_a_broken_card_is_said_so(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "broken.md").write_text(text)
    monkeypatch.setattr(module, "FOLDER", tmp_path)
    card.cache_clear()
    with pytest.raises(PlaygroundError, match="needs lines of title"):
        card("broken")
    with pytest.raises(PlaygroundError, match="no card"):
        card("absent")
    card.cache_clear()
