"""The room Endless without a browser: pieces, what was said, plans as text, and the panel that rewrites a prompt."""

import base64
import json
import runpy
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.errors import PlaygroundError
from playground.text.rewriting import rewrite
from playground.ui.code import python_for
from playground.ui.complete import complete
from playground.ui.rewriting import RULES, rewritten_card, who
from playground.ui.rooms.endless import NAME, OPENING, Handlers, opening_view
from playground.ui.services import Services
from playground.ui.state import parse
from playground.ui.walking import WINDOW, Said, Walk, clean, plan_of_steps, read_plan, write_plan
from tests.ui.double import FakeEngine


@pytest.fixture
def services() -> Services:
    engine = FakeEngine()
    return Services(lambda: engine)  # type: ignore[arg-type, return-value]


def stage(value: Any) -> dict[str, Any]:
    return dict(json.loads(getattr(value, "value", value)))


def test_pieces_follow_each_other_and_an_instruction_holds_from_what_is_not_drawn(services: Services) -> None:
    do, walk = Handlers(services), Walk()
    first = stage(do.start(walk, "a person walks", 3, "")[0])
    assert first["growing"] == {"first": 0, "window": WINDOW, "ahead": 40, "play": True}
    assert first["ribbon"] == [[0, "a person walks"]] and first["frames"] == 20
    told = do.say(walk, "a person | jumps")[3]
    assert told.text == "From second 1.8 on: a person , jumps." and told.value == "1.8 a person , jumps"
    second, third = (stage(do.onward(walk)[0]) for _ in range(2))
    assert second["growing"]["first"] == 20 and second["scene"] == first["scene"] and not second["growing"]["play"]
    assert second["ribbon"] == third["ribbon"] == [[0, "a person walks"], [36, "a person , jumps"]]
    assert [level["size"] for level in third["tracks"][0]["levels"]] == [5, 5, 5]
    assert "jerk at switches" in do.onward(walk)[1]


def test_what_left_the_window_is_let_go(services: Services) -> None:
    do, walk = Handlers(services), Walk()
    do.start(walk, "a person walks", 0, "")
    for turn in range(80):
        do.say(walk, f"a person does number {turn}")
        shown = stage(do.onward(walk)[0])
    assert len(walk.said) == 64 and len(shown["ribbon"]) <= WINDOW // 20 + 2
    assert shown["ribbon"][-1][1] == "a person does number 79"


def test_a_plan_gives_the_motion_that_was_told_by_hand(services: Services) -> None:
    do, by_hand, again = Handlers(services), Walk(), Walk()
    pieces = [do.start(by_hand, "a person walks", 5, "")]
    pieces += [do.onward(by_hand) for _ in range(2)]
    plan = do.say(by_hand, "a person jumps")[3].value
    pieces += [do.onward(by_hand) for _ in range(4)]
    copied = [do.arrive(again, "a person walks", 5, plan), *(do.onward(again) for _ in range(6))]
    for piece, copy in zip(pieces, copied, strict=True):
        assert stage(piece[0])["figures"] == stage(copy[0])["figures"]
        assert stage(piece[0])["tracks"] == stage(copy[0])["tracks"]
    assert again.following() == by_hand.following() == plan
    assert not stage(copied[0][0])["growing"]["play"]


def test_stop_lets_the_session_go_and_late_requests_find_nothing(services: Services) -> None:
    do, walk = Handlers(services), Walk()
    with pytest.raises(PlaygroundError, match="press Start"):
        do.onward(walk)
    with pytest.raises(PlaygroundError, match="press Start"):
        do.say(walk, "a person jumps")
    do.enter(walk, "a person walks", 0, "")
    assert do.enter(walk, "a person jumps", 0, "")[3].value == "1.8 a person jumps"
    do.stop(walk)
    assert walk.session is None and [type(one) for one in do.onward(walk)] == [dict, dict]  # as Gradio's skip() is
    assert stage(do.enter(walk, "a person jumps", 0, "")[0])["ribbon"] == [[0, "a person jumps"]]


BAD = [
    ("", 0, "", "empty"),
    ("walks", 1.5, "", "seed"),
    ("walks", -1, "", "seed"),
    ("walks", 0, "soon jumps", "no second"),
    ("walks", 0, "4", "empty"),
    ("walks", 0, "4 a | 3 b", "too early"),
    ("walks", 0, "nan a", "no second"),
    ("walks", 0, "inf a", "no second"),
    ("walks", 0, "0 a", "too early"),
]


@pytest.mark.parametrize(("prompt", "seed", "then", "why"), BAD)
def test_what_cannot_be_meant_is_said_in_a_sentence(
    services: Services, prompt: str, seed: float, then: str, why: str
) -> None:
    (services.engine().assets / "checkpoints" / "mogo").mkdir(parents=True)
    (services.engine().assets / "checkpoints" / "mogo" / "generator.safetensors").touch()
    with pytest.raises(PlaygroundError, match=why):
        Handlers(services).start(Walk(), prompt, seed, then)


def test_without_the_system_the_room_says_which_command_trains_it(services: Services) -> None:
    services.engine().untrained = True  # type: ignore[attr-defined]
    shown = services.first_view(NAME, opening_view)
    assert shown.stage["state"] == "empty" and '"make others" trains it' in shown.stage["message"]
    with pytest.raises(PlaygroundError, match="not trained here yet"):
        Handlers(services).start(Walk(), "a person walks", 0, "")


def test_the_opening_is_one_motion_with_its_switch(services: Services) -> None:
    view = opening_view(services)
    assert view.stage["frames"] == 200 and view.stage["growing"] is None and len(view.stage["ribbon"]) == 2
    assert [words for _, words in view.stage["ribbon"]] == list(OPENING)
    assert "Switches, newest first" in view.controls["switches"] and "checkpoint fake" in view.facts[0].card


SPOKEN = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=30).map(clean)


@given(st.lists(st.tuples(st.integers(1, 400), SPOKEN), max_size=20))
def test_a_plan_comes_back_from_its_text(entries: list[tuple[int, str]]) -> None:
    frames = np.cumsum([4 * step for step, _ in entries])
    said = [Said(int(frame), prompt) for frame, (_, prompt) in zip(frames, entries, strict=True)]
    text = write_plan(said)
    assert len(text) <= 2_000 and read_plan(text) == said[: len(read_plan(text))]
    assert write_plan(said, 10**6).count(" | ") == max(0, len(said) - 1)


def test_steps_become_a_plan() -> None:
    found = rewrite("walk forward for 4 seconds, then jump twice, then sit down")
    plan = read_plan(plan_of_steps(found))
    assert len(plan) == len(found.steps) - 1 and plan[0].frame == round(20 * found.steps[0].seconds)
    assert [one.prompt for one in plan] == [step.text for step in found.steps[1:]]


def test_the_card_shows_every_version_and_no_markup_of_the_visitor() -> None:
    found = rewrite("please show me someone who <b>walks</b> & then jumps")
    card = rewritten_card(found, ("All steps", plan_of_steps(found)))
    assert "<b>" not in card and "Why" in card and "left out: a request" in card
    assert card.count('data-do="use"') == len(found.steps) + 3 and card.count('data-do="plan"') == 1
    assert 'data-do="plan"' not in rewritten_card(rewrite("a person jumps"), ("All steps", ""))


def test_the_panel_says_who_rewrites(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PLAYGROUND_LLM_URL", raising=False)
    assert who() == RULES
    monkeypatch.setenv("PLAYGROUND_LLM_URL", "http://127.0.0.1:9/v1")
    monkeypatch.setenv("PLAYGROUND_LLM_MODEL", "tiny")
    assert who() == "The language model tiny at 127.0.0.1 rewrites it, and rules where it fails."
    monkeypatch.setenv("PLAYGROUND_LLM_URL", "nonsense")
    assert who().startswith("PLAYGROUND_LLM_URL is 'nonsense'")


def test_the_script_of_the_room_gives_what_it_shows(
    services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = parse("?room=endless&prompt=a+person+walks&seed=3&then=2+a+person+%22jumps%22")
    (tmp_path / "copied.py").write_text(python_for(NAME, complete(services, state)), encoding="utf-8")
    monkeypatch.setattr("playground.engine.default_engine", services.engine)
    monkeypatch.chdir(tmp_path)
    left = runpy.run_path(str(tmp_path / "copied.py"))
    do, walk = Handlers(services), Walk()
    pieces = [do.arrive(walk, "a person walks", 3, '2 a person "jumps"'), *(do.onward(walk) for _ in range(19))]
    assert len(left["parts"]) == 20 and (tmp_path / "endless.bvh").stat().st_size > 1_000
    for part, piece in zip(left["parts"], pieces, strict=True):
        shown = np.frombuffer(base64.b64decode(stage(piece[0])["figures"][0]["joints"]), "<f4")
        assert np.array_equal(part.ravel(), shown)


def test_a_link_fills_the_controls(services: Services) -> None:
    event = SimpleNamespace(query="?room=endless&prompt=a+person+runs&seed=4&then=4+a+person+jumps")
    assert Handlers(services).fill(event) == ("a person runs", 4, "4 a person jumps")  # type: ignore[arg-type]
