"""Which words each moment looked at, in Generate: the map under the score, its switch, and systems without tokens."""

import base64
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gradio as gr
import numpy as np
import pytest

from playground.engine import default_engine
from playground.systems import SYSTEMS
from playground.ui.code import python_for
from playground.ui.drawing import Visit, Wish, wish_values
from playground.ui.drawviews import controls, words_switch
from playground.ui.errors import Noted
from playground.ui.generated import words_card
from playground.ui.rooms import edit
from playground.ui.rooms.generate import SHOWN, Handlers
from playground.ui.scenes import words_strip
from playground.ui.services import Services
from playground.ui.state import State, parse
from playground.ui.view import View
from tests.ui.double import DENOISED, DENOISER, FakeEngine
from tests.ui.test_code import run
from tests.ui.test_code import services as real_services

assert real_services  # a fixture
PROMPT = "a person sits ."
NUMBERS: tuple[Any, ...] = (4.0, 3, 2.0, 4.0, 1.0, 0.2, 0.95, 1, False)


@pytest.fixture
def engine() -> FakeEngine:
    return FakeEngine(denoises=True)


@pytest.fixture
def do(engine: FakeEngine) -> Handlers:
    return Handlers(Services(lambda: engine))  # type: ignore[arg-type, return-value]


def stage(value: Any) -> Any:
    import json

    return json.loads(value.value if isinstance(value, Noted) else value)


def made(do: Handlers, visit: Visit, system: str = "", prompt: str = PROMPT, free: bool = False) -> tuple[Any, ...]:
    *_, last = do.generate(visit, prompt, free, *NUMBERS, system)
    assert len(last) == SHOWN
    return last


def test_the_switch_puts_the_map_of_this_very_motion_under_the_score(do: Handlers, engine: FakeEngine) -> None:
    visit = Visit()
    assert stage(made(do, visit)[0])["strips"] == []
    shown, card = do.look(True, visit)
    (strip,) = stage(shown)["strips"]
    assert visit.shown is not None
    found = engine.alignment(visit.shown.takes[0])
    values = np.frombuffer(base64.b64decode(strip["values"]), "<f4").reshape(len(strip["rows"]), -1)
    np.testing.assert_allclose(values, found.weights.T, rtol=1e-6)
    assert strip["rows"] == ["(begin)", "a", "person", "sits", ".", ".", "(end)"]
    assert strip["max"] == pytest.approx(found.weights[:, 1:4].max()), "marks and full stops do not set the ramp"
    assert strip["name"] == "Which words the detokenizer looks at" and "detokenizer looks while" in card
    assert "on average over 2 steps" in card
    again, _ = do.look(True, visit)
    assert again == shown and engine.calls.count("alignment 3") == 2  # once by this test
    assert stage(do.look(False, visit)[0])["strips"] == []


def test_the_next_motions_show_theirs_until_it_is_switched_off(do: Handlers, engine: FakeEngine) -> None:
    visit = Visit(words=True)
    for seed in (3, 4):
        *_, last = do.generate(visit, PROMPT, False, 4.0, seed, *NUMBERS[2:])
        assert len(stage(last[0])["strips"]) == 1 and "map under the score" in last[-1]
        assert last[-2]["visible"] is True and "value" not in last[-2]  # who turns it meanwhile is not overruled
    back = do.bring_back(visit, SimpleNamespace(code="0"))  # type: ignore[arg-type]
    assert len(stage(back[0])["strips"]) == 1 and visit.looked is not None and visit.looked[0].seed == 3


def test_of_several_motions_the_map_says_whose_it_is(do: Handlers, engine: FakeEngine) -> None:
    visit = Visit(words=True)
    *_, last = do.generate(visit, PROMPT, False, *NUMBERS[:7], 2, False, DENOISER)
    assert stage(last[0])["strips"][0]["name"] == "Which words the denoiser looks at, seed 3"
    assert [figure["caption"] for figure in stage(last[0])["figures"]] == ["", ""]
    other = do.look_at(visit, "1")
    assert stage(other[0])["strips"][0]["name"].endswith("seed 4") and engine.calls[-1] == "alignment 4"


def test_a_motion_without_words_says_so(do: Handlers) -> None:
    visit = Visit(words=True)
    last = made(do, visit, free=True)
    assert stage(last[0])["strips"] == [] and "without words" in last[-1]
    assert words_card(None) == "" and words_card(None, "<b>").count("<b>") == 0


def test_a_system_that_cannot_tell_has_no_switch(
    do: Handlers, engine: FakeEngine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FakeEngine, "looks_at_words", lambda self, system: system == DENOISER)
    last = made(do, Visit(words=True))
    assert stage(last[0])["strips"] == [] and last[-2]["visible"] is False and last[-1] == ""
    assert do.settle(DENOISER)[-1]["visible"] is True
    with gr.Blocks():
        assert words_switch(do.services)[0].visible is False


def test_a_system_without_tokens_draws_step_by_step(do: Handlers) -> None:
    visit, notes = Visit(words=True), []
    for values in do.generate(visit, PROMPT, False, *NUMBERS, DENOISER):
        notes.append(stage(values[0])["figures"][0]["caption"])
    assert notes == [*(f"step {n} of {DENOISED}" for n in range(1, DENOISED)), ""]
    shown = stage(values[0])
    assert shown["tracks"] == [] and shown["strips"][0]["name"] == "Which words the denoiser looks at"
    assert "nan" not in values[1] and "no tokens" in values[1] and "Edit this motion" in values[2]
    visit.stop = False
    said = []
    for values in do.generate(visit, PROMPT, False, *NUMBERS, DENOISER):
        said.append(values[0].text)
        do.stop(visit)
    assert said == ["", f"Stopped; this is the motion after step 2 of {DENOISED}."]


def test_another_system_brings_its_own_sampling(do: Handlers, engine: FakeEngine) -> None:
    own = SYSTEMS[DENOISER].sampling
    assert do.settle(DENOISER)[:5] == (own.guidance, own.cfg, own.temperature, own.top_k, own.top_p)
    state = parse(f"?room=generate&prompt=a+person+sits&system={DENOISER}&words=1&temperature=0.5")
    wish = Wish.checked(*wish_values(do.services, state))
    assert (wish.system, wish.cfg, wish.temperature) == (DENOISER, own.cfg, 0.5)
    visit = Visit()
    *values, switch = do.fill(visit, SimpleNamespace(query=f"?room=generate&system={DENOISER}&words=1"))  # type: ignore[arg-type]
    assert values[-1] == DENOISER and switch["value"] is True and visit.words
    gone = parse("?room=generate&system=mogo")
    assert Wish.checked(*wish_values(do.services, gone)).system == "lgtok"
    with gr.Blocks():
        system = controls(View(stage={}), do.services)[1]
    assert system.visible and [name for _, name in system.choices] == ["lgtok", DENOISER]
    engine.denoises = False
    with gr.Blocks():
        assert not controls(View(stage={}), do.services)[1].visible


def test_edit_reads_a_motion_without_tokens_as_tokens(do: Handlers) -> None:
    room = edit.Handlers(do.services, View(stage={}))
    shown = room.last(f"?room=generate&prompt=a+person+sits&system={DENOISER}", "inpaint", edit.EditSession())
    assert shown[1].text == "MDM with CASIM, decoder writes no tokens; LG-Tok has read its motion as tokens."
    assert shown[0].base.system == shown[11] == "lgtok" and shown[6].endswith(f"_{DENOISER}")


def test_a_map_of_marks_alone_has_a_ramp_too() -> None:
    strip = words_strip("x", ["[CLS]", "[SEP]"], np.array([[0.75, 0.25]] * 4, np.float32))
    assert strip["max"] == 0.75 and strip["rows"] == ["(begin)", "(end)"]


def test_the_script_gives_the_map(real_services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    query = "?room=generate&prompt=a+person+walks+and+then+waves&seconds=2&seed=7&words=1"
    _, left = run(real_services, query, tmp_path, monkeypatch)
    engine = default_engine()
    found = engine.alignment(engine.generate("a person walks and then waves", 2.0, "lgtok", seed=7))
    np.testing.assert_array_equal(left["looked"].weights, found.weights)
    assert left["looked"].words == found.words and "waves" in found.words
    bare = {**parse(query).values, "g": 1.0, "s": 1.0, "temperature": 1.0, "topk": 0.5, "topp": 0.5}
    bare |= {"system": ("lgtok",)}
    assert "alignment" not in python_for("generate", State("generate", {**bare, "words": False}))
    assert "alignment" not in python_for("generate", State("generate", {**bare, "free": True}))
