"""The closer looks of the room Tokenize on the engine's stand-in: one token, other words, the card of a code."""

import base64
import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.analysis.bundle import Bundle
from playground.errors import PlaygroundError
from playground.ui import tokencard
from playground.ui.closer import Closer
from playground.ui.rooms import tokenize
from playground.ui.scenes import readable_words
from playground.ui.services import Services
from playground.ui.state import Token, parse
from playground.ui.tokenizing import Session, run, scales_of, stage_of
from playground.ui.uploads import Source
from tests.ui.double import CODES, SIZES, FakeEngine, motions, stored_analysis


@pytest.fixture
def engine() -> FakeEngine:
    return FakeEngine()


@pytest.fixture
def services(engine: FakeEngine) -> Services:
    return Services(lambda: engine)  # type: ignore[arg-type, return-value]


@pytest.fixture
def closer(services: Services) -> Closer:
    return Closer(services, tokenize.opening_view(services))


def event(**values: Any) -> Any:
    return SimpleNamespace(**values)


def chosen(scale: int, position: int) -> Any:
    return event(selection={"system": "lgtok", "scale": scale, "position": position})


def selected(closer: Closer, scale: int = 5, position: int = 2) -> tuple[Any, ...]:
    *_, last = closer.select(None, chosen(scale, position))
    return last


def test_a_selected_token_is_explained_at_once_and_measured_after(closer: Closer, services: Services) -> None:
    first, last = closer.select(None, chosen(5, 2))
    assert "Measuring" in first[2] and "Governs" in last[2]
    held = last[0]
    code = int(held.tokenized.levels[4].ids[2])
    assert f"Code {code}<" in last[2] and "token 3 of 6" in last[2]
    levels = stage_of(services, held)["tracks"][0]["levels"]
    spans = np.frombuffer(base64.b64decode(levels[4]["spans"]), "<i2").reshape(-1, 2)
    assert spans.tolist() == services.engine().governed(held.tokenized, 5).tolist()
    assert all(level["spans"] is None for n, level in enumerate(levels) if n != 4)


def test_the_scale_is_measured_once(closer: Closer) -> None:
    held = selected(closer)[0]
    assert len(list(closer.select(held, chosen(5, 3)))) == 1  # no second word to wait for


@pytest.mark.parametrize("selection", [None, {}])
def test_no_selection_goes_back_to_the_motion(closer: Closer, selection: object) -> None:
    *_, last = closer.select(selected(closer)[0], event(selection=selection))
    assert last[2] == "" and last[0].token is None


@pytest.mark.parametrize("place", [(0, 0), (11, 0), (5, 6), (5, -1)])
def test_a_token_that_is_not_there_is_refused(closer: Closer, place: tuple[int, int]) -> None:
    with pytest.raises(PlaygroundError, match="choose a token"):
        list(closer.select(None, chosen(*place)))


def test_a_swap_shows_a_third_figure_and_where_it_moves(closer: Closer, services: Services) -> None:
    held, stage, card, _, code, _ = closer.act(selected(closer)[0], event(do="replace", code="7", number=""))
    scene = stage_of(services, held)
    assert code == "7" and [figure["id"] for figure in scene["figures"]] == ["original", "rebuilt", "swapped"]
    assert scene["strips"][0]["unit"] == "mm" and scene["strips"][0]["max"] == pytest.approx(100, rel=1e-3)
    ids = np.frombuffer(base64.b64decode(scene["tracks"][0]["levels"][4]["ids"]), "<i2")
    marks = np.frombuffer(base64.b64decode(scene["tracks"][0]["levels"][4]["marks"]), "u1")
    assert ids[2] == 7 and marks.tolist() == [0, 0, 1, 0, 0, 0]
    assert "at most 100 mm" in card and "not frames by construction" in card and "live" in stage
    held, _, card, _, code, _ = closer.act(held, event(do="undo", code="", number=""))
    assert code == "" and "Undo" not in card and len(stage_of(services, held)["figures"]) == 2


def test_a_random_code_is_another_one(closer: Closer) -> None:
    held = selected(closer, 1, 0)[0]
    before = int(held.tokenized.levels[0].ids[0])
    codes = {int(closer.act(held, event(do="random", code="", number=""))[4]) for _ in range(40)}
    assert before not in codes and len(codes) > 5 and codes <= set(range(CODES[0]))


@pytest.mark.parametrize("number", ["", "-1", "1e3", "٣", "99999999", "twelve"])
def test_what_is_no_code_is_refused_in_one_sentence(closer: Closer, number: str) -> None:
    with pytest.raises(PlaygroundError, match=r"0 to 255$"):
        closer.act(selected(closer)[0], event(do="number", code="", number=number))


def test_a_code_out_of_range_leaves_everything_as_it_was(closer: Closer) -> None:
    held = selected(closer)[0]
    with pytest.raises(PlaygroundError, match="0 to 255 are accepted"):
        closer.act(held, event(do="number", code="", number="256"))
    assert held.found.swap is None


def test_words_are_compared_and_flips_marked(closer: Closer, services: Services) -> None:
    held, _, card, words, _, kept, wrong = closer.words("", None)
    assert card == "" and kept == wrong != held.caption and wrong in [one.caption for one in services.examples()]
    total = sum(SIZES)
    assert f">{total} of {total}<" in words and "Measured on this clip" in words
    scene = stage_of(services, held)
    assert len(scene["figures"]) == 4 and scene["strips"][0]["rows"][-1] == "(end)"
    marked = [base64.b64decode(level["marks"]) for level in scene["tracks"][0]["levels"]]
    assert sum(sum(row) for row in marked) == sum(flips.sum() for flips in held.found.language.bare_flips)
    held = closer.mark("misled", held)[0]
    marked = [base64.b64decode(level["marks"]) for level in stage_of(services, held)["tracks"][0]["levels"]]
    assert sum(sum(row) for row in marked) == total
    assert closer.close(held)[3] == ""


def test_the_wrong_caption_must_be_another(closer: Closer) -> None:
    held = selected(closer)[0]
    with pytest.raises(PlaygroundError, match="the wrong caption is the right one"):
        closer.words(held.caption, held)


def test_pieces_become_words_and_keep_their_weight() -> None:
    weights = np.array([[0.1, 0.2, 0.3, 0.4]], np.float32)
    words, added = readable_words(["[CLS]", "side", "##ways", "[SEP]"], weights)
    assert words == ["(begin)", "sideways", "(end)"]
    assert added[0].tolist() == pytest.approx([0.1, 0.5, 0.4])


@given(st.integers(0, 4), st.integers(0, 200))
def test_counts_of_a_card_are_those_of_a_slow_count(scale: int, code: int) -> None:
    bundle: Bundle = stored_analysis()
    text = tokencard.occurrences(bundle, scale + 1, code)
    tokens = [bundle.levels(row)[scale].ids.tolist() for row in range(len(bundle))]
    clips, places = sum(code in ids for ids in tokens), sum(ids.count(code) for ids in tokens)
    assert f"In {clips} of 90 test clips of made up; {places} of {90 * SIZES[scale]:,} tokens" in text
    links = re.findall(r'href="([^"]+)"', text)
    assert len(links) == min(clips, tokencard.LISTED)
    for link in links:
        state = parse(link.replace("&amp;", "&"))
        token = state["selection"]
        assert state.room == "embedding-map" and isinstance(token, Token)
        assert tokens[bundle.position(state["motion"])][token.position] == code


def test_another_motion_forgets_what_was_found(services: Services) -> None:
    held, _ = run(services, Session("m1", Source(motions()[1], "one"), caption="a person walks"))
    held.found.spans[1] = np.zeros((1, 2), np.int64)
    other = held.forgetful(caption="a person runs")
    assert other.tokenized is None and not other.found.spans and not other.found.studies


@pytest.mark.parametrize(("text", "expected"), [("scales=only-3", "only:3"), ("scales=11", None), ("", None)])
def test_scales_of_a_link(text: str, expected: str | None) -> None:
    found = scales_of(parse(f"?room=tokenize&{text}")["scales"], 10)
    assert (str(found) if found else None) == expected
