"""Stopping a generation: it ends after the scale it is at, keeps that motion, and the next one starts afresh."""

from typing import Any

import pytest

from playground.ui.drawing import Visit
from playground.ui.errors import Noted
from playground.ui.rooms.generate import Handlers
from playground.ui.services import Services
from tests.ui.double import SIZES, FakeEngine

CONTROLS: tuple[Any, ...] = ("a person sits", False, 4.0, 3, 2.0, 4.0, 1.0, 0.2, 0.95)


@pytest.fixture
def do() -> Handlers:
    engine = FakeEngine()
    return Handlers(Services(lambda: engine))  # type: ignore[arg-type, return-value]


def test_it_runs_through_when_nobody_stops_it(do: Handlers) -> None:
    assert len(list(do.generate(Visit(), *CONTROLS))) == len(SIZES)


@pytest.mark.parametrize("after", [1, 4, 8])
def test_a_stop_keeps_the_motion_of_the_scale_it_is_at(do: Handlers, after: int) -> None:
    control, seen = Visit(), []
    for values in do.generate(control, *CONTROLS):
        seen.append(values)
        if len(seen) == after:
            do.stop(control)
    last = seen[-1][0]
    assert len(seen) == after + 1 < len(SIZES) and isinstance(last, Noted)
    assert last.text == f"Stopped; this is the motion after scale {len(seen)} of {len(SIZES)}."
    assert isinstance(last.value, str) and last.value.startswith("{")


def test_a_stop_before_the_start_shows_nothing_new(do: Handlers) -> None:
    control = Visit(stop=True)
    ((stage, facts, *_),) = do.generate(control, *CONTROLS)
    assert isinstance(stage, Noted) and "before the first scale" in stage.text
    assert stage.value == facts  # both leave what is there


def test_the_next_click_forgets_the_stop(do: Handlers) -> None:
    control = Visit(stop=True)
    do.begin(control)
    assert len(list(do.generate(control, *CONTROLS))) == len(SIZES)
