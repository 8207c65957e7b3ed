"""The stopwatches: turns are interleaved, the best counts, a fresh process reports for itself."""

import os

import pytest

from benchmarks import timing
from benchmarks.timing import fresh, interleave, peak_bytes, resident_bytes


class Clock:
    """A clock that calls move by hand."""

    def __init__(self) -> None:
        self.now = 0.0

    def perf_counter(self) -> float:
        """Seconds."""
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """Replaces the real clock."""
    mine = Clock()
    monkeypatch.setattr(timing, "time", mine)
    return mine


def test_calls_take_turns_and_the_best_turn_counts(clock: Clock) -> None:
    order: list[str] = []
    costs = {"a": iter([9.0, 5.0, 3.0, 4.0]), "b": iter([9.0, 1.0, 2.0, 7.0])}

    def call(name: str) -> None:
        order.append(name)
        clock.now += next(costs[name])

    result = interleave({"a": lambda: call("a"), "b": lambda: call("b")}, turns=3)
    assert order == ["a", "b"] * 4  # one warm-up turn, not counted
    assert (result["a"].best, result["a"].median, result["a"].turns) == (3.0, 4.0, 3)
    assert (result["b"].best, result["b"].median, result["b"].turns) == (1.0, 2.0, 3)


def test_a_spent_budget_stops_after_three_turns(clock: Clock) -> None:
    def slow() -> None:
        clock.now += 100.0

    assert interleave({"slow": slow}, turns=50, budget=1.0)["slow"].turns == 3


def test_peak_memory_sees_what_was_touched_and_given_back() -> None:
    before = peak_bytes()
    block = bytearray(os.urandom(1)) * (before + 100_000_000)
    assert peak_bytes() >= before + 90_000_000
    del block
    assert resident_bytes() < peak_bytes()


def test_a_fresh_process_answers_in_json_and_its_failure_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    assert fresh("json.tool", "--compact", "benchmarks/reference.json")["seconds"]["tokenize"]["batch 1"] == 0.07
    with pytest.raises(RuntimeError, match=r"json.tool no-such-file failed: .*no-such-file"):
        fresh("json.tool", "no-such-file")
