"""An evaluation that is stopped goes on where it was; the state of another one is refused; bad orders are refused."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from playground.data.library import Library
from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.evaluation.run import Order, evaluate
from playground.evaluation.state import state_path
from tests.analysis.tiny import SYSTEM, same_numbers, tiny_assets, tiny_library
from tests.evaluation.tiny import tiny_evaluator

Place = tuple[Engine, Library]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Place:
    folder = tmp_path_factory.mktemp("tiny")
    library = tiny_library(folder / "library")
    return Engine(tiny_assets(folder / "assets", library)), library


@pytest.fixture
def order(tmp_path: Path) -> Order:
    """Two repeats without the two slow metrics' many generations."""
    return Order(repeats=2, mm_samples=0, evaluators={"tmr": tiny_evaluator()}, out=tmp_path / "result.json")


def run(place: Place, order: Order, progress=None) -> dict:
    return evaluate(SYSTEM, place[1].path, "test", progress, engine=place[0], order=order)


def test_stopped_and_resumed_equals_uninterrupted(place: Place, order: Order) -> None:
    whole = run(place, replace(order, out=None))
    seen: list[tuple[int, int]] = []

    def stop(done: int, total: int) -> None:
        if done > total * 0.6:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(place, order, stop)
    stored = json.loads(state_path(order.out).read_text())
    assert len(stored["repeats"]) == 1, "the first repeat was finished, the second one was not"
    resumed = run(place, order, lambda done, total: seen.append((done, total)))
    assert same_numbers(resumed, whole)
    assert seen == sorted(seen) and seen[-1][0] == seen[-1][1] == 4 * 5 + 24, "one repeat was left to do"
    seen.clear()
    assert same_numbers(run(place, order, lambda done, total: seen.append((done, total))), whole)
    assert not seen, "finished repeats are not computed again"
    assert run(place, replace(order, repeats=1))["repeats"] == 1


def test_the_state_of_another_evaluation_is_refused(place: Place, order: Order) -> None:
    order = replace(order, repeats=1, evaluators={})
    run(place, order)
    before = state_path(order.out).read_text()
    changes = {"seed": 1, "mm_samples": 11, "guidance": 2.0, "evaluators": {"tmr": tiny_evaluator()}}
    for what, value in changes.items():
        named = "sampling" if what == "guidance" else what
        with pytest.raises(PlaygroundError, match=f"another {named};") as caught:
            run(place, replace(order, **{what: value}))
        assert len(str(caught.value).splitlines()) == 1 and "result.state.json" in str(caught.value)
    assert state_path(order.out).read_text() == before


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"format": 9, "settings": {}, "repeats": []}', '{"format": 1}', "\0"]
)
def test_a_broken_state_is_refused(place: Place, order: Order, text: str) -> None:
    state_path(order.out).write_text(text)
    with pytest.raises(PlaygroundError, match="not the state of an evaluation"):
        run(place, order)


@pytest.mark.parametrize(
    "wrong", [{"repeats": -1}, {"mm_texts": -1}, {"mm_samples": 5000}, {"seed": -1}, {"guidance": 9.0}, {"cfg": -1.0}]
)
def test_orders_out_of_range_are_refused(place: Place, wrong: dict) -> None:
    with pytest.raises(PlaygroundError):
        run(place, Order(**{"repeats": 1, **wrong}))
