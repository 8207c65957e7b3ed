"""What Compare does, on the engine's stand-in: settings, results, the table with its best, links."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import gradio as gr
import numpy as np
import pytest

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.measures import mpjpe
from playground.systems import SystemInfo
from playground.ui.compared import COLUMNS, ERROR, best_of, compared_view
from playground.ui.comparing import (
    PROMPT,
    VARIATIONS,
    Compared,
    chosen,
    first_variation,
    offered,
    run,
    settings_of,
)
from playground.ui.rooms.compare import Handlers, Held, compare, opening_view, room
from playground.ui.services import Services
from playground.ui.state import DIFFERENCES, parse
from tests.ui.double import FakeEngine, motions


class TwoSystems(FakeEngine):
    """The stand-in with a second shipped system that has no generator."""

    def systems(self) -> list[SystemInfo]:
        (first,) = super().systems()
        lite = replace(first, name="lgtok-lite", title="LG-Tok lite", generator=None)
        return [first, lite, replace(first, name="lgtok-mid", title="LG-Tok mid", checkpoint="absent")]


@pytest.fixture
def services() -> Services:
    engine = FakeEngine()
    return Services(lambda: engine)  # type: ignore[arg-type, return-value]


def names(services: Services, vary: str) -> list[str]:
    return [name for _, name in chosen(services, vary, ())]


def test_the_address_knows_every_variation() -> None:
    assert set(DIFFERENCES) == set(VARIATIONS)


def test_systems_are_offered_as_soon_as_there_are_two(services: Services) -> None:
    assert not {"system", "maker"} & {key for _, key in offered(services)}
    engine = TwoSystems()
    two = Services(lambda: engine)  # type: ignore[arg-type, return-value]
    assert "system" in [key for _, key in offered(two)] and "maker" not in [key for _, key in offered(two)]
    assert names(two, "system") == ["lgtok", "lgtok-lite"]
    settings = settings_of(two, "system", names(two, "system"), "x")
    assert [one.system for one in settings] == ["lgtok", "lgtok-lite"]
    view = compared_view(two, list(run(two, settings, motions()[0]))[-1], motions()[0], "a walk", 0)
    assert [track["system"] for track in view.stage["tracks"]] == ["lgtok", "lgtok-lite"]


def test_a_copy_without_any_system_has_an_empty_room_and_no_error() -> None:
    class NoSystem(FakeEngine):
        def systems(self) -> list[SystemInfo]:
            return [replace(one, checkpoint="absent") for one in super().systems()]

    engine = NoSystem()
    none = Services(lambda: engine)  # type: ignore[arg-type, return-value]
    first = first_variation(none)
    assert first == "scales" and chosen(none, first, ()) == []
    with pytest.raises(PlaygroundError, match="no trained system is shipped"):
        opening_view(none)
    with gr.Blocks():
        room(none)


@pytest.mark.parametrize("vary", [key for key in VARIATIONS if key not in ("system", "maker")])
def test_every_variation_changes_one_thing(services: Services, vary: str) -> None:
    settings = settings_of(services, vary, names(services, vary), "a person sits", 2.0, 3)
    assert 2 <= len(settings) <= VARIATIONS[vary].most and len({one.name for one in settings}) == len(settings)
    field = {"s": "cfg", "g": "guidance", "caption": "text", "redraw": "seed"}.get(vary, vary)
    assert len({getattr(one, field) for one in settings}) == len(settings)
    assert len({replace(one, name="", **{field: getattr(settings[0], field)}) for one in settings}) == 1
    source = None if VARIATIONS[vary].of == PROMPT else motions()[0]
    *_, done = run(services, settings, source)
    figures = compared_view(services, done, source, "x", 1).stage["figures"]
    assert len(figures) == len(settings) + (source is not None) <= LIMITS.max_figures


@pytest.mark.parametrize("picked", [(), ("2",), ("2", "none"), tuple(map(str, range(1, 11)))])
def test_too_few_and_too_many_are_refused(services: Services, picked: tuple[str, ...]) -> None:
    with pytest.raises(PlaygroundError, match="choose 2 to 5 of them"):
        settings_of(services, "scales", picked, "")


@pytest.mark.parametrize(("vary", "text", "seconds", "seed"), [("colour", "x", 4, 0), ("seed", "", 4, 0),
                         ("seed", "x", 99, 0), ("seed", "x", 4, -1), ("seed", "x", None, 0)])  # fmt: skip
def test_what_does_not_fit_is_refused(services: Services, vary: str, text: str, seconds: Any, seed: Any) -> None:
    with pytest.raises(PlaygroundError):
        settings_of(services, vary, ("0", "1"), text, seconds, seed)


def test_numbers_are_those_of_slow_formulas(services: Services) -> None:
    source = motions()[0]
    *_, done = run(services, settings_of(services, "scales", ("2", "10"), source.caption), source)
    for one in done:
        used = one.levels
        assert one.tokens == sum(len(level.ids) for level in used)
        assert one.bits == pytest.approx(sum(len(level.ids) * np.log2(level.codes) for level in used))
    assert done[0].tokens == 3 and done[0].error_mm > done[1].error_mm  # type: ignore[operator]
    *_, drawn = run(services, settings_of(services, "seed", ("0", "1"), "a person sits"), None)
    assert drawn[0].error_mm is None
    assert drawn[1].error_mm == pytest.approx(mpjpe(drawn[0].motion.joints, drawn[1].motion.joints))


def fake(error: float | None, services: Services) -> Compared:
    (setting, *_) = settings_of(services, "scales", ("2", "3"), "")
    return Compared(setting, motions()[0], (), error, 1.0)


def test_the_best_is_the_least_as_it_is_written(services: Services) -> None:
    rows = [fake(error, services) for error in (31.0, 30.96, 45.0, None, float("nan"))]
    assert best_of(rows, ERROR) == {0, 1}  # both read 31
    assert best_of(rows[:2], ERROR) is None  # nothing to choose between
    assert best_of(rows[2:], ERROR) is None
    assert best_of(rows, COLUMNS[-1]) is None


def test_the_table_marks_the_best_and_says_what_was_measured(services: Services) -> None:
    view = opening_view(services)
    table = view.controls["table"]
    assert "<strong>" in table and "MPJPE" in table and "lgtok" in table and "time of tokenizing" in table
    assert len(view.stage["figures"]) == 1 + len(names(services, "scales"))
    held = Held()
    *_, last = compare(services, held, "seed", ["0", "1"], "<b>sits", 2.0, 0, None)
    assert "&lt;b&gt;sits" in last.controls["table"] and "<b>" not in last.controls["table"]
    assert "from the first" in last.controls["table"] and held.source is None


def test_a_link_shows_controls_and_results(services: Services) -> None:
    do, held = Handlers(services), Held()
    query = "?room=compare&vary=s&values=0_6_9&prompt=a+person+sits&seconds=2&seed=4&take=1"
    *_, last = do.arrive(held, SimpleNamespace(query=query))  # type: ignore[arg-type]
    stage, table, vary, values, prompt, seconds, seed, _, for_prompt, for_motion = last
    assert (vary, values["value"], prompt, seconds, seed) == ("s", ["0", "6"], "a person sits", 2.0, 4)
    assert for_prompt["visible"] and not for_motion["visible"] and '"one1"' in stage
    assert 'data-key="1" aria-pressed="true"' in table
    assert [one.setting.cfg for one in held.done] == [0.0, 6.0]
    *_, plain = do.arrive(Held(), SimpleNamespace(query="?room=compare&vary=system"))  # type: ignore[arg-type]
    assert plain[2] == "scales"  # one system alone is nothing to compare
    assert parse(query)["values"] == "0_6_9"


def test_another_ones_tokens_are_shown_with_what_differs(services: Services) -> None:
    do, held = Handlers(services), Held()
    stage, table, take = do.look_at(held, SimpleNamespace(code="1"))  # type: ignore[arg-type]
    assert take == "1" and "Scales 1 to 5" in stage and table.count('aria-pressed="true"') == 1  # of the opening
    list(do.compare(held, "caption", ["own", "none"], "", 4.0, 0, "m0"))
    stage, *_ = do.look_at(held, SimpleNamespace(code="1"))  # type: ignore[arg-type]
    assert "no caption" in stage and "another code than the first" in stage


def test_prompt_and_motion_take_turns(services: Services) -> None:
    do = Handlers(services)
    values, prompt, motion = do.set_vary("seed")
    assert prompt["visible"] and not motion["visible"] and values["value"] == ["0", "1", "2", "3"]
    values, prompt, motion = do.set_vary("caption")
    assert motion["visible"] and not prompt["visible"] and VARIATIONS["seed"].of == PROMPT
