"""The bench of endless motion, shortened: every figure is there. Times are never asserted."""

import json

import pytest
import torch

from benchmarks import endless
from playground.bench import endless_rows
from playground.engine.endless import EndlessSession
from playground.systems import SYSTEMS
from playground.training.others import OTHERS
from tests.engine.test_endless import session

HELD = {"settled", "most", "end"}


def test_a_short_walk_has_every_figure() -> None:
    sizes = iter([100, 300, 250, 400, 350, 200])
    answer = endless.measure(session(), 6, settled=3, said_for=2, resident=lambda: next(sizes))
    assert set(answer) == {
        "system", "checkpoint", "seconds", "threads", "computing", "first", "speed", "bytes", "held", "switches", "jerk"
    }  # fmt: skip
    assert (answer["system"], answer["checkpoint"], answer["seconds"], answer["switches"]) == ("mogo", "c" * 12, 6, 2)
    assert answer["bytes"] == {"settled": 250, "most": 400, "end": 200}
    assert set(answer["held"]) == HELD and min(answer["held"].values()) > 0
    speed = answer["speed"]
    assert speed["worst"] > 0 and 1 <= speed["worst_at"] <= 5
    assert speed["mean"] == pytest.approx(6 / answer["computing"]) and 0 < answer["first"] < answer["computing"]
    assert answer["jerk"]["at_switches"] > 0 and answer["jerk"]["elsewhere"] > 0
    rows = [row.what.strip() for row in endless_rows(answer)]
    assert len(rows) == len(set(rows)) == 9 and rows[-2:] == ["jerk at switches", "jerk elsewhere"]


def test_an_untrained_model_has_the_size_of_the_trained_one_and_no_jerk(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    runtime = endless.untrained()
    assert runtime.tokenizer.config.width == OTHERS["mogo-tokenizer"].model.width
    assert runtime.drawing.network.config.depths == OTHERS["mogo-generator"].model.depths  # type: ignore[attr-defined]
    one = EndlessSession(runtime, endless.PROMPTS[0], 0, SYSTEMS["mogo"].sampling)
    monkeypatch.setattr(endless, "opened", lambda: (one, endless.UNTRAINED))
    assert endless.main([str(torch.get_num_threads()), "2"]) == 0
    lines = capsys.readouterr().out.splitlines()
    answer = json.loads(lines[-1])
    assert lines[0] == answer["note"] == endless.UNTRAINED and answer["threads"] == torch.get_num_threads()
    assert answer["jerk"] == {"at_switches": None, "elsewhere": None} and answer["bytes"]["end"] > 1e6
    assert len(lines) == 2 + 7 and "m/s" not in "".join(lines[1:-1])


def test_prompts_are_sentences_of_their_own() -> None:
    assert len(set(endless.PROMPTS)) == len(endless.PROMPTS) >= 4
    assert endless.SECONDS == 300 and endless.SETTLED == 30 and endless.SAID_FOR == 20
