"""Stored results are computed as the evaluation computes them; computed once, and again when a file has changed."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from playground.analysis.motions import unpacked
from playground.analysis.results import Result, read_result
from playground.data.library import Library
from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.evaluation.items import ITEMS as WINDOWS
from playground.evaluation.items import draw_items, measurable, stream
from playground.evaluation.published import __main__ as command
from playground.evaluation.published import base, motions
from playground.evaluation.published.items import ITEMS, LGTOK, applies, compute, results_of, settings_of, up_to_date
from playground.evaluation.run import Order, evaluate
from playground.evaluation.sweep import guidance_sweep
from playground.motion.measures import foot_sliding
from playground.motion.representation import from_features67
from playground.systems import row_of
from tests.analysis.tiny import SYSTEM, same_numbers, tiny_assets, tiny_library
from tests.evaluation.tiny import tiny_evaluator

EVALUATORS = {"tmr": tiny_evaluator("tmr"), "clip": tiny_evaluator("clip")}
METRICS = ("fid", "mm_dist", "clip_score", "foot_sliding", "bone_drift")
Place = tuple[Engine, Library]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Place:
    folder = tmp_path_factory.mktemp("tiny")
    library = tiny_library(folder / "library")
    return Engine(tiny_assets(folder / "assets", library)), library


@pytest.fixture(scope="module")
def settings(place: Place) -> base.Settings:
    return base.Settings(place[1].path, repeats=1, mm_samples=0, motions=2, evaluators=EVALUATORS)


@pytest.fixture(scope="module")
def found(place: Place, settings: base.Settings) -> dict[str, Result]:
    return {name: compute(name, SYSTEM, settings, place[0]) for name in ITEMS}


def test_every_result_says_how_it_was_made(found: dict[str, Result], settings: base.Settings) -> None:
    for name, result in found.items():
        facts = result.provenance
        assert (result.item, facts["system"], facts["seed"]) == (name, SYSTEM, 0)
        assert len(facts["checkpoint"]) == len(facts["generator"]) == 12 and facts["parameters"] > 1000
        assert facts["tokens"] == 10
        assert result.made_by.startswith(f"python -m playground.evaluation.published {name} --system {SYSTEM}")
        assert str(settings.library) not in result.made_by
        json.dumps(result.as_dict(), allow_nan=False)
    assert "--repeats 1 --mm-texts 12 --mm-samples 0" in found["evaluation"].made_by


def test_an_evaluation_is_the_evaluation(place: Place, found: dict[str, Result]) -> None:
    order = Order(1, 12, 0, evaluators=EVALUATORS)
    whole = evaluate(SYSTEM, place[1].path, engine=place[0], order=order)
    rows = {row["of"]: row for row in found["evaluation"].rows}
    for of, table in (("generated", "metrics"), ("real", "real"), ("reconstruction", "reconstruction")):
        assert same_numbers({key: rows[of][key] for key in METRICS}, {key: whole[table][key] for key in METRICS})
    assert rows["every clip once"]["mpjpe_mm"] == pytest.approx(whole["mpjpe_mm"])


def test_prompted_tokens_read_with_the_caption_are_those_of_the_sweep(place: Place, found: dict[str, Result]) -> None:
    order = Order(1, mm_samples=0, evaluators=EVALUATORS)
    swept = guidance_sweep(SYSTEM, place[1].path, engine=place[0], order=order, scales=(0.0, 1.0, 2.0))
    for row in swept["rows"]:
        same = found["free_form"].row(drawn="prompted", read=f"text, g = {row['g']:g}")
        for key in METRICS:
            assert same[key]["mean"] == pytest.approx(row[key]["mean"], rel=1e-3), (row["g"], key)
    assert same_numbers(found["free_form"].more["real"], swept["real"])


@pytest.mark.parametrize("read", ["no text", "text, g = 1"])
def test_free_form_tokens_are_drawn_without_text(place: Place, found: dict[str, Result], read: str) -> None:
    runtime, library = place[0].runtime(SYSTEM), place[1]
    clips = measurable(library, library.split("test"))
    sampling = {key: value for key, value in vars(row_of(SYSTEM).sampling).items() if key != "guidance"}
    assert found["free_form"].provenance["sampling"] == sampling
    sliding = []
    for item in draw_items(library, clips, stream(0, 0, WINDOWS)):
        drawn = runtime.generate_batch([""], [item.rows], [item.seed], sampling)
        caption, g = ("", 0.0) if read == "no text" else (item.caption, 1.0)
        (rows,) = runtime.decode_batch(drawn.embedding, [item.rows], [caption], g)
        sliding.append(foot_sliding(from_features67(rows)))
    kept = [value for value in sliding if np.isfinite(value)]
    row = found["free_form"].row(drawn="free", read=read)
    assert row["foot_sliding"]["mean"] == pytest.approx(np.mean(kept), rel=1e-3)


def test_edits_keep_what_is_kept(found: dict[str, Result]) -> None:
    result = found["edits"]
    assert [row["kind"] for row in result.rows] == list(motions.BENCHMARK)
    for row in result.rows:
        assert row["kept_mm"]["mean"] < 0.01 and row["plain_error_mm"]["mean"] > 1.0
        assert row["seam_mm"]["n"] == result.provenance["n"]
    inside, outside = result.more["examples"]
    assert inside["drawn"] == [[100, 160]] and outside["drawn"][0] == [0, 60] and outside["drawn"][1][0] == 160
    before, after = unpacked(inside["source"]), unpacked(inside["motion"])
    moved = np.abs(before - after).max(axis=(1, 2)) > 0.002
    assert not moved[:100].any() and not moved[160:].any() and moved[110:150].any()


def test_a_strip_is_the_motion_of_its_prompt(place: Place, found: dict[str, Result]) -> None:
    row = found["strips"].rows[2]
    made = place[0].generate(row["prompt"], row["seconds"], SYSTEM, seed=row["seed"])
    assert np.abs(unpacked(row["motion"]) - made.motion.joints).max() < 0.001
    assert len({one["prompt"] for one in found["strips"].rows}) == len(motions.PROMPTS)


def test_the_whole_and_its_part_are_timed(found: dict[str, Result]) -> None:
    rows = {row["what"]: row for row in found["inference_time"].rows}
    assert all(row["seconds"]["n"] == 2 and row["best"] > 0 for row in rows.values())
    assert list(rows) == ["text to motion", "tokens to motion"]
    assert rows["text to motion"]["best"] <= rows["text to motion"]["median"]
    assert found["inference_time"].provenance["machine"]["threads"] >= 1


def test_intervals_by_hand() -> None:
    values = [1.0, 2.0, 4.0, float("nan")]
    mean = 7 / 3
    spread = (sum((value - mean) ** 2 for value in values[:3]) / 3) ** 0.5
    expected = {"mean": mean, "ci95": 1.96 * spread / 3**0.5, "n": 3}
    assert same_numbers(base.measured(values), expected)
    assert base.measured([float("nan")])["mean"] is None and base.measured([])["why"]


def test_only_what_changed_is_out_of_date(place: Place, found: dict[str, Result], settings: base.Settings) -> None:
    engine = place[0]
    for result in found.values():
        assert up_to_date(result, engine, settings)
    assert not up_to_date(None, engine, settings)
    assert not up_to_date(found["evaluation"], engine, replace(settings, repeats=2))
    assert up_to_date(found["strips"], engine, replace(settings, repeats=2))
    other = replace(found["strips"], provenance=found["strips"].provenance | {"generator": "0" * 12})
    assert not up_to_date(other, engine, settings)


def test_results_are_read_or_computed(place: Place, tmp_path: Path) -> None:
    assert results_of("strips", folder=tmp_path) == dict.fromkeys(LGTOK)
    given = {"engine": place[0], "library": place[1].path, "recompute": True}
    made = results_of("inference_time", ["lgtok-mini", SYSTEM], motions=1, **given)
    assert made["lgtok-mini"] is None and made[SYSTEM] is not None and made[SYSTEM].provenance["n"] == 1


@pytest.mark.parametrize(("item", "changes", "words"), [
    ("nothing", {}, "unknown item"),
    ("evaluation", {"repeats": 0}, "at least 1"),
    ("edits", {"motions": 0}, "no clip"),
    ("edits", {"split": "val"}, "no clip"),
    ("inference_time", {"motions": 0}, "no caption"),
    ("strips", {"systems": ["nobody"]}, "unknown system"),
])  # fmt: skip
def test_bad_input_is_told(place: Place, item: str, changes: dict, words: str) -> None:
    with pytest.raises(PlaygroundError, match=words):
        results_of(item, **{"systems": [SYSTEM], "recompute": True, "engine": place[0], "library": place[1].path,
                            "evaluators": EVALUATORS} | changes)  # fmt: skip


@pytest.mark.parametrize(("item", "system", "there"), [
    ("evaluation", "mdm", True), ("evaluation", "lgtok-rvq", True), ("strips", "lgtok-rvq", False),
    ("edits", "mdm", False), ("inference_time", "mdm", True), ("guidance_sweep", "lgtok-notext", True),
    ("guidance_sweep", "mosa", False), ("free_form", "momask", False), ("levels", "mdm", False),
])  # fmt: skip
def test_an_item_applies_to_systems_of_its_kind(item: str, system: str, there: bool) -> None:
    assert applies(ITEMS[item], system) is there


def test_the_flagship_is_measured_in_full() -> None:
    full, less = settings_of(SYSTEM, Path("library")), settings_of("lgtok-mini", Path("library"))
    assert (full.repeats, full.mm_texts, full.mm_samples, full.motions) == (20, 24, 10, 100)
    assert (less.repeats, less.mm_texts, less.mm_samples) == (5, 12, 10)


def test_the_command(place: Place, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.setattr(command, "default_engine", lambda: place[0])
    call = [
        "strips",
        "--system",
        SYSTEM,
        "--system",
        "lgtok-mini",
        "--out",
        str(tmp_path),
        "--work",
        str(tmp_path / "work"),
    ]
    assert command.main([*call, "--list"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"strips, {SYSTEM}: to be computed",
        "strips, lgtok-mini: not trained yet",
    ]
    assert command.main(["edits", "--system", "mdm", "--list"]) == 0
    assert capsys.readouterr().out == "edits, mdm: is not measured of a system of this kind\n"
    assert command.main(call) == 0
    assert read_result("strips", SYSTEM, tmp_path) is not None
    capsys.readouterr()
    assert command.main(call) == 0
    assert capsys.readouterr().out.startswith(f"strips, {SYSTEM}: up to date")
    assert command.main(["nothing"]) == 2 and "unknown item" in capsys.readouterr().err
    assert command.main(["edits", "--system", SYSTEM, "--library", str(tmp_path), "--out", str(tmp_path)]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
