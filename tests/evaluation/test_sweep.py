"""The guidance sweep equals an evaluation at each guidance scale; stored as JSON; resumed; refused in one sentence."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from playground.data.library import Library
from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.evaluation import sweep
from playground.evaluation.run import Order, evaluate
from playground.evaluation.state import state_path
from playground.evaluation.sweep import SCALES, guidance_sweep
from playground.systems import checkpoint_path
from tests.analysis.tiny import SYSTEM, same_numbers, tiny_assets, tiny_library
from tests.evaluation.tiny import tiny_evaluator

Place = tuple[Engine, Library]
ORDER = Order(repeats=2, mm_samples=0, evaluators={"tmr": tiny_evaluator("tmr"), "clip": tiny_evaluator("clip")})


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Place:
    folder = tmp_path_factory.mktemp("tiny")
    library = tiny_library(folder / "library")
    return Engine(tiny_assets(folder / "assets", library)), library


@pytest.fixture(scope="module")
def swept(place: Place) -> dict:
    return guidance_sweep(SYSTEM, place[1].path, engine=place[0], order=ORDER, scales=(0.0, 1.5))


def test_a_row_equals_the_evaluation_at_that_guidance(place: Place, swept: dict) -> None:
    for row in swept["rows"]:
        order = replace(ORDER, guidance=row["g"])
        whole = evaluate(SYSTEM, place[1].path, engine=place[0], order=order)
        for key in ("fid", "mm_dist", "clip_score", "foot_sliding", "bone_drift"):
            assert row[key]["mean"] == pytest.approx(whole["metrics"][key]["mean"], rel=1e-3), (row["g"], key)
            assert row[key]["ci95"] == pytest.approx(whole["metrics"][key]["ci95"], rel=1e-2, abs=1e-6)
        assert "pool of 32" in row["r_precision_top3_pool32"]["why"]
        for key, entry in swept["real"].items():
            assert same_numbers(entry, whole["real"][key]), key
    assert swept["rows"][0]["bone_drift"]["mean"] != pytest.approx(swept["rows"][1]["bone_drift"]["mean"], rel=1e-4)


def test_it_says_what_it_was_measured_on(swept: dict) -> None:
    facts = swept["provenance"]
    assert (facts["system"], facts["data"], facts["split"], facts["n"], facts["repeats"]) == (
        SYSTEM,
        "tiny",
        "test",
        5,
        2,
    )
    assert set(facts["evaluators"]) == {"tmr", "clip"} and "guidance" not in facts["sampling"]
    assert facts["checkpoint"] and facts["generator"] and facts["own_guidance"] == 1.0
    json.dumps(swept, allow_nan=False)
    assert SCALES == (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0)


def test_it_goes_on_where_it_stopped(place: Place, swept: dict, tmp_path: Path) -> None:
    order = replace(ORDER, out=tmp_path / "sweep.json")

    def stop(done: int, total: int) -> None:
        if done > total * 0.6:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        guidance_sweep(SYSTEM, place[1].path, progress=stop, engine=place[0], order=order, scales=(0.0, 1.5))
    assert len(json.loads(state_path(order.out).read_text())["repeats"]) == 1
    again = guidance_sweep(SYSTEM, place[1].path, engine=place[0], order=order, scales=(0.0, 1.5))
    assert same_numbers(again, swept)
    with pytest.raises(PlaygroundError, match="another scales;"):
        guidance_sweep(SYSTEM, place[1].path, engine=place[0], order=order, scales=(0.0,))


def test_what_cannot_be_swept_is_refused(place: Place, tmp_path: Path) -> None:
    for wrong in ({"scales": ()}, {"scales": (-1.0,)}, {"scales": (99.0,)}, {"order": replace(ORDER, repeats=0)}):
        with pytest.raises(PlaygroundError):
            guidance_sweep(SYSTEM, place[1].path, engine=place[0], **{"order": ORDER, **wrong})
    engine = Engine(tiny_assets(tmp_path, place[1]))
    checkpoint_path(tmp_path, SYSTEM, "generator").unlink()
    with pytest.raises(PlaygroundError, match="no generator"):
        guidance_sweep(SYSTEM, place[1].path, engine=engine, order=ORDER)


def test_the_command_writes_a_file_or_one_line(
    place: Place, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("playground.evaluation.sweep.default_engine", lambda: place[0])
    monkeypatch.setattr("playground.evaluation.run.shipped_evaluators", lambda: ORDER.evaluators)
    out = tmp_path / "deep" / "sweep.json"
    call = ["--system", SYSTEM, "--repeats", "1", "--json", str(out)]
    assert sweep.main([*call, "--library", str(place[1].path)]) == 0
    stored = json.loads(out.read_text())
    assert len(stored["rows"]) == 9 and str(tmp_path) not in out.read_text()
    assert stored["made_by"].startswith(f"python -m playground.evaluation.sweep --system {SYSTEM} --library library")
    capsys.readouterr()  # progress, where that took long
    assert sweep.main([*call, "--library", str(tmp_path)]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
