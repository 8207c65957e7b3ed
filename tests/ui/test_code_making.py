"""Copy as Python in the rooms that make motions: the script runs and gives the tokens that the room shows."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from playground.engine import default_engine
from playground.systems import checkpoint_path
from playground.ui.bar import script
from playground.ui.comparing import run as compare_all
from playground.ui.drawing import Change, Wish, change, draw, last_of, made_name
from playground.ui.editing import EditSession, EditWish, open_source
from playground.ui.services import Services
from playground.ui.state import State, query
from tests.ui.test_code import ids, run


@pytest.fixture(scope="module")
def services() -> Services:
    engine = default_engine()
    if not all(checkpoint_path(engine.assets, "lgtok", part).is_file() for part in ("tokenizer", "generator")):
        pytest.skip("no trained system is shipped with this copy")
    return Services(default_engine)


@pytest.fixture
def made(services: Services) -> Any:
    own = services.sampling()
    wish = Wish.checked("a person waves", False, 2.0, 7, own.guidance, own.cfg, own.temperature, own.top_k, own.top_p)
    return last_of(draw(services, wish))


def test_a_changed_motion(services: Services, made: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    changed = made
    for one in (Change(3, 1, 17), Change(6, seed=5)):
        changed = last_of(change(services, changed, 0, one))
    _, left = run(services, "?room=generate&prompt=a+person+waves&seconds=2&seed=7&changes=3.1.17_6.s5", tmp_path,
                  monkeypatch)  # fmt: skip
    assert ids(left["made"].levels) == ids(changed.takes[0].levels)


def test_one_of_several_seeds(services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    query = "?room=generate&prompt=a+person+waves&seconds=2&seed=7&takes=3&take=1"
    _, left = run(services, query, tmp_path, monkeypatch)
    assert [one.seed for one in left["takes"]] == [7, 8, 9] and left["made"].seed == 8
    own = services.sampling()
    wish = Wish("a person waves", 2.0, 7, own.guidance, own.cfg, own.temperature, own.top_k, own.top_p, 3)
    assert ids(left["made"].levels) == ids(last_of(draw(services, wish)).takes[1].levels)


def test_an_edit_of_a_motion_of_the_library(
    services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    address = "?room=edit&motion=synthetic-walk&kind=inbetween&from=1&to=2.5&prompt=a+person+%22bows%22&seed=4&s=2.5"
    _, left = run(services, address, tmp_path, monkeypatch)
    base = open_source(services, EditSession(), "synthetic-walk").base
    assert base is not None
    edited = default_engine().edit(base, (20, 50), 'a person "bows"', 4, "inbetween", cfg=2.5)
    assert ids(left["edited"].levels) == ids(edited.levels)
    assert np.allclose(left["edited"].motion.joints, edited.motion.joints, atol=1e-5)


def test_an_edit_as_the_room_opens_with_it(services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    state, left = run(services, "?room=edit", tmp_path, monkeypatch)
    own = services.sampling()
    wish = EditWish.checked(state["prompt"], "inpaint", None, None, 0, own.guidance, own.cfg, "place", False)
    base = open_source(services, EditSession(), str(state["motion"])).base
    assert base is not None
    edited = default_engine().edit(base, None, wish.prompt, 0)
    assert ids(left["edited"].levels) == ids(edited.levels)


def test_an_edit_of_a_generated_motion(
    services: Services, made: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = made_name(made.wish, 7, (Change(3, 1, 17),))
    address = query(State("edit", {"motion": name, "caption": "a person waves", "prompt": "a person bows"}))
    _, left = run(services, address, tmp_path, monkeypatch)
    changed = last_of(change(services, made, 0, Change(3, 1, 17))).takes[0]
    assert ids(left["made"].levels) == ids(changed.levels)
    assert ids(left["edited"].levels) == ids(default_engine().edit(changed, None, "a person bows").levels)


def test_a_name_that_names_nothing_is_said_so(services: Services) -> None:
    assert "no motion that can be drawn again" in script(services, "?room=edit&motion=made_7&caption=x")["error"]


DRAWN = "?room=compare&vary=s&values=0_4&prompt=a+person+%22jumps%22&seconds=2&seed=3"


@pytest.mark.parametrize("query", ["?room=compare", "?room=compare&vary=caption&motion=synthetic-walk", DRAWN])
def test_a_comparison(services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, query: str) -> None:
    state, left = run(services, query, tmp_path, monkeypatch)
    source = None
    if query != DRAWN:
        source = services.example(str(state["motion"])).motion()
    *_, done = compare_all(services, state.values["settings"], source)
    assert list(left["results"]) == [one.setting.name for one in done]
    for one in done:
        result = left["results"][one.setting.name]
        found = result if source is None else left["tokens"][one.setting.name]
        assert ids(found.levels)[: len(one.levels)] == ids(one.levels)
        assert np.allclose(result.motion.joints, one.motion.joints, atol=1e-5)
