"""What Generate keeps: changes in an address, several seeds, a token forced, the visit's history, names of motions."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import gradio as gr
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.ui.drawing import (
    MAX_CHANGES,
    Change,
    Visit,
    Wish,
    change,
    draw,
    last_of,
    made_again,
    made_name,
    read_changes,
    read_name,
    wish_values,
    write_changes,
)
from playground.ui.drawviews import controls
from playground.ui.errors import Noted
from playground.ui.generated import drawing_view, earlier, onward, result_view, token_card
from playground.ui.rooms.generate import SHOWN, Handlers
from playground.ui.services import Services
from playground.ui.state import State, parse, query
from playground.ui.view import View
from tests.ui.double import SIZES, FakeEngine

NUMBERS: tuple[Any, ...] = (4.0, 3, 2.0, 4.0, 1.0, 0.2, 0.95)
CHANGES = st.builds(Change, st.integers(1, 99), st.integers(0, 999), st.integers(0, 9999)) | st.builds(
    Change, st.integers(1, 99), st.none(), st.none(), st.integers(0, LIMITS.max_seed)
)


@pytest.fixture
def services() -> Services:
    engine = FakeEngine()
    return Services(lambda: engine)  # type: ignore[arg-type, return-value]


def wish(takes: int = 1) -> Wish:
    return Wish.checked("a person sits", False, *NUMBERS, takes)


def event(**values: Any) -> Any:
    return SimpleNamespace(**values)


@given(st.lists(CHANGES, max_size=MAX_CHANGES))
def test_changes_come_back_from_the_address(changes: list[Change]) -> None:
    text = write_changes(changes)
    assert read_changes(text) == tuple(changes)
    if text and len(text) <= 80:
        assert parse(query(State("generate", {"changes": text})))["changes"] == text


@given(st.text(max_size=40))
def test_any_text_is_changes_or_none(text: str) -> None:
    found = read_changes(text)
    assert found == () or write_changes(found) == "_".join(str(one) for one in found)


def test_seeds_stand_side_by_side_in_one_batch(services: Services) -> None:
    result = last_of(draw(services, wish(3)))
    assert [one.seed for one in result.takes] == [3, 4, 5]
    alone = last_of(draw(services, Wish.checked("a person sits", False, 4.0, 4, *NUMBERS[2:])))
    for together, single in zip(result.takes[1].levels, alone.takes[0].levels, strict=True):
        assert np.array_equal(together.ids, single.ids)
    view = result_view(services, result, 1)
    assert [figure["name"] for figure in view.stage["figures"]] == ["Seed 3", "Seed 4", "Seed 5"]
    assert "seed 4" in view.stage["tracks"][0]["name"] and len(view.stage["tracks"]) == 1
    assert [bool(figure["caption"]) for figure in view.stage["figures"]] == [False, True, False]


def test_planted_feet_change_the_motion_and_leave_the_tokens(services: Services) -> None:
    plain, asked = last_of(draw(services, wish())), Wish.checked("a person sits", False, *NUMBERS, 1, True)
    *_, last = draw(services, asked)
    assert last.result is not None and asked.plant and not wish().plant
    (made,) = last.result.takes
    assert made.refiner == "fake" and services.engine().calls.count("refine") == 1  # type: ignore[attr-defined]
    for level, same in zip(made.levels, plain.takes[0].levels, strict=True):
        assert np.array_equal(level.ids, same.ids)
    shown, unplanted = (drawing_view(services, one).stage for one in (last, replace(last, result=plain)))
    assert shown["figures"] != unplanted["figures"]
    again = last_of(change(services, last.result, 0, Change(2, seed=9)))
    assert again.takes[0].refiner == "fake" and again.address["plant"] is True


def test_a_link_plants_feet_where_there_is_a_refiner(services: Services, monkeypatch: pytest.MonkeyPatch) -> None:
    state = parse("?room=generate&prompt=a+person+sits&plant=1")
    assert state["plant"] is True and "plant=1" in query(state)
    assert Wish.checked(*wish_values(services, state)).plant
    monkeypatch.setattr(FakeEngine, "refines", False)
    assert not Wish.checked(*wish_values(services, state)).plant


def test_the_switch_stands_in_the_room_where_there_is_a_refiner(
    services: Services, monkeypatch: pytest.MonkeyPatch
) -> None:
    for there in (True, False):
        monkeypatch.setattr(FakeEngine, "refines", there)
        with gr.Blocks():
            *_, plant, _ = controls(View(stage={}), services)
        assert plant.visible is there and plant.value is False
        assert plant.label == "Plant the feet" and "tokens stay the same" in plant.info


def test_the_last_seeds_there_are_stay_within_the_limit() -> None:
    assert Wish.seeds_of(LIMITS.max_seed, 3) == (LIMITS.max_seed - 2, LIMITS.max_seed - 1, LIMITS.max_seed)


@pytest.mark.parametrize("takes", [0, 7, 2.5, None, "2"])
def test_a_number_of_motions_out_of_bounds_is_refused(takes: object) -> None:
    if takes == 2.5:
        assert Wish.checked("a person sits", False, *NUMBERS, takes).takes == 2
        return
    with pytest.raises(PlaygroundError, match="side by side must be a number from 1 to 6"):
        Wish.checked("a person sits", False, *NUMBERS, takes)


def test_a_forced_token_keeps_the_coarser_scales_and_shows_before_and_after(services: Services) -> None:
    result = last_of(draw(services, wish()))
    changed = last_of(change(services, result, 0, Change(5, 2, 77)))
    old, new = result.takes[0].levels, changed.takes[0].levels
    assert all(np.array_equal(a.ids, b.ids) for a, b in zip(old[:4], new[:4], strict=True))
    assert new[4].ids[2] == 77 and changed.before is result.takes[0]
    view = result_view(services, changed)
    assert [figure["name"] for figure in view.stage["figures"]] == ["Before", "After"]
    marks = [level["marks"] is not None for level in view.stage["tracks"][0]["levels"]]
    assert all(marks)
    levels = [one.steps[0].level for one in change(services, result, 0, Change(5, 2, 77))]
    assert levels == list(range(5, len(SIZES) + 1))  # what stays is not shown growing


def test_changes_end_somewhere(services: Services) -> None:
    result = last_of(draw(services, wish()))
    for n in range(MAX_CHANGES):
        result = last_of(change(services, result, 0, Change(9, seed=n)))
    with pytest.raises(PlaygroundError, match="generate a new one"):
        last_of(change(services, result, 0, Change(9, seed=99)))


def test_a_made_motion_can_be_named_and_drawn_again(services: Services) -> None:
    result = last_of(draw(services, wish(3)))
    for made, take in ((result, 2), (last_of(change(services, result, 1, Change(4, 1, 5))), 0)):
        name = made_name(made.wish, made.wish.seed if made.changes else made.takes[take].seed, made.changes)
        assert parse(f"?room=tokenize&motion={name}")["motion"] == name
        again = made_again(services, name, "a person sits")
        assert all(np.array_equal(a.ids, b.ids) for a, b in zip(again.levels, made.takes[take].levels, strict=True))


def test_the_name_of_a_made_motion_holds_its_system() -> None:
    engine = FakeEngine(others=("momask",))
    services = Services(lambda: engine)  # type: ignore[arg-type, return-value]
    named = replace(wish(), system="momask")
    name = made_name(named, 3, (Change(4, 1, 5),))
    assert read_name(name, "a person sits") == (named, (Change(4, 1, 5),)) and "_momask_4.1.5" in name
    assert made_again(services, name, "a person sits").system == "momask"
    plain = made_name(wish(), 3)
    assert [made_again(services, plain, "x", usual).system for usual in ("", "momask")] == ["lgtok", "momask"]


@pytest.mark.parametrize("name", ["made_", "made_1_2", "made_x_5_0_3_1_0.2_0.95", "walk", "made_1_5_0_3_1_0.2_0.95_z",
                                  "made_1_99_0_3_1_0.2_0.95", "made_nan_5_0_3_1_0.2_0.95"])  # fmt: skip
def test_other_names_are_refused_in_a_sentence(services: Services, name: str) -> None:
    with pytest.raises(PlaygroundError):
        made_again(services, name, "a person sits")


def test_a_token_is_asked_about_forced_and_the_visit_remembers(services: Services) -> None:
    do, visit = Handlers(services), Visit()
    list(do.generate(visit, "a person sits", False, *NUMBERS, 1))
    (card,) = do.token(visit, event(selection={"system": "lgtok", "scale": 5, "position": 2}))
    assert "scale 5, token 3 of 6" in card and "scales 1 to 4 stay" in card and card.count('data-do="code"') == 8
    do.choose(visit, event(code="201"))
    *_, last = do.redraw(visit)
    assert len(last) == SHOWN and isinstance(last[0], Noted) and "token 3 set to code 201" in last[0].text
    assert last[5] == "5.2.201" and last[3].count("data-do") == 2
    do.choose(visit, event(code=""))
    *_, last = do.redraw(visit)
    assert last[5] == "5.2.201_5.s4"
    back = do.bring_back(visit, event(code="0"))
    assert back[5] == "" and back[7] == "a person sits" and visit.shown is visit.results[0]
    with pytest.raises(PlaygroundError, match="not kept any more"):
        do.bring_back(visit, event(code="9"))
    assert do.token(visit, event(selection=None)) == ("",)


def test_a_link_with_changes_gives_the_motion_it_was_made_from(services: Services) -> None:
    do, first, other = Handlers(services), Visit(), Visit()
    list(do.generate(first, "a person sits", False, *NUMBERS, 1))
    do.token(first, event(selection={"scale": 3, "position": 0}))
    do.choose(first, event(code="9"))
    list(do.redraw(first))
    do.fill(other, event(query=f"?room=generate&prompt=a+person+sits&seconds=4&seed=3&changes={'3.0.9'}"))
    list(do.generate(other, "a person sits", False, *NUMBERS, 1))
    assert first.shown and other.shown
    for a, b in zip(first.shown.takes[0].levels, other.shown.takes[0].levels, strict=True):
        assert np.array_equal(a.ids, b.ids)


def test_a_stopped_motion_has_no_card(services: Services) -> None:
    do, visit = Handlers(services), Visit()
    for _ in do.generate(visit, "a person sits", False, *NUMBERS, 1):
        do.stop(visit)
    with pytest.raises(PlaygroundError, match="stopped on its way"):
        do.token(visit, event(selection={"scale": 1, "position": 0}))


def test_the_history_has_an_end_and_words_of_visitors_are_escaped(services: Services) -> None:
    visit = Visit()
    for seed in range(LIMITS.history + 3):
        visit.keep(last_of(draw(services, Wish.checked("<b>x</b>", False, 2.0, seed, *NUMBERS[2:]))))
    assert len(visit.results) == LIMITS.history and visit.results[0].wish.seed == 3
    shown = earlier(visit)
    assert "<b>x" not in shown and "&lt;b&gt;x" in shown
    assert visit.shown is not None and "<b>" not in onward(visit.shown, 0)


def test_a_code_that_cannot_be_drawn_is_said_so(services: Services) -> None:
    result = last_of(draw(services, wish()))
    found = services.engine().alternatives(result.takes[0], 1, 0)
    card = token_card(found, 1, ["#000000"] * 8)
    assert card.count("cut off") == 2  # in the row's words and in what is read out
    assert "all other tokens anew." in card


def test_the_list_of_the_visit_tells_results_of_the_same_words_apart(services: Services) -> None:
    visit = Visit()
    for takes in (1, 3):
        visit.keep(last_of(draw(services, wish(takes))))
    visit.keep(last_of(change(services, visit.results[0], 0, Change(4, 1, 2))))
    text = earlier(visit)
    assert text.count("<span>a person sits</span>") == 3 and text.count('aria-pressed="true"') == 1
    assert [one.tail for one in visit.results] == ["seed 3", "seed 3 to 5", "seed 3, changed at scale 4"]
    assert all(f"<small>{one.tail}</small>" in text for one in visit.results)
