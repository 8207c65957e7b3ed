"""Levels kept: the numbers of a tiny system, motion by motion, by way of the engine's own studies."""

from pathlib import Path

import numpy as np
import pytest

from playground.analysis.order import attention_lag, clauses
from playground.analysis.passes import first_caption
from playground.data.library import Library
from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.evaluation.items import measurable
from playground.evaluation.levels import measure_levels
from playground.evaluation.metrics import fid
from playground.evaluation.published import contents
from playground.evaluation.published.alignment import ORDERS, alignment, coarse
from playground.evaluation.published.base import Settings
from playground.evaluation.published.levels import levels
from playground.evaluation.run import reconstruct
from playground.evaluation.trained import measure_generated, measure_rebuilt
from playground.motion.motion import Motion
from playground.motion.representation import from_features67
from playground.systems import SamplingDefaults, checkpoint_path
from tests.analysis.tiny import SCALES, SYSTEM, tiny_assets, tiny_library
from tests.evaluation.tiny import tiny_evaluator

Place = tuple[Engine, Library]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Place:
    folder = tmp_path_factory.mktemp("tiny")
    library = tiny_library(folder / "library")
    return Engine(tiny_assets(folder / "assets", library)), library


def test_every_prefix_is_what_the_engine_decodes_from_it(place: Place) -> None:
    engine, library = place
    judge = tiny_evaluator("tmr")
    clips = measurable(library, library.split("test"))
    captions = [first_caption(library.clips[index].captions) for index in clips]
    found = measure_levels(engine.runtime(SYSTEM), library, clips, captions, judge)
    assert [row["kept"] for row in found["rows"]] == list(range(len(SCALES) + 1))
    assert [row["tokens"] for row in found["rows"]] == [sum(SCALES[:n]) for n in range(len(SCALES) + 1)]
    errors: list[list[float]] = []
    energies, recorded, rebuilt = [], [], []
    for index, caption in zip(clips, captions, strict=True):
        tokenized = engine.tokenize(Motion(library.joints(index)), caption, SYSTEM)
        kept = [engine.reconstruct(tokenized, scales=n) for n in range(1, len(SCALES) + 1)]
        errors.append([float(one.mpjpe_mm or 0.0) for one in kept])
        energies.append(tokenized.residual_energy)
        recorded.append(from_features67(tokenized.features))
        rebuilt.append(kept[-1].motion.joints)
    for kept_levels in range(1, len(SCALES) + 1):
        got = found["rows"][kept_levels]
        want = [row[kept_levels - 1] for row in errors]
        assert sorted(got["mpjpe_mm"]) == pytest.approx(sorted(want), rel=1e-3)
        assert np.mean(got["energy"]) == pytest.approx(np.mean(np.array(energies)[:, kept_levels]), rel=1e-3)
    value = fid(judge.embed_motions(recorded), judge.embed_motions(rebuilt))
    assert found["rows"][-1]["fid"] == pytest.approx(value, rel=1e-2)
    assert found["rows"][0]["coupling"] is None and 0 <= found["rows"][1]["coupling"] <= 1
    assert found["vectors"] == len(clips) * SCALES[-1] and np.shape(found["between"]) == (len(SCALES),) * 2


def test_the_stored_item_agrees_with_the_evaluation(place: Place) -> None:
    engine, library = place
    result = levels(SYSTEM, Settings(library.path, evaluators={}), engine, None)
    last, whole = result.rows[-1], reconstruct(engine.runtime(SYSTEM), library, "test", 0)
    assert last["fid"] is None and last["mpjpe_mm"]["n"] == result.provenance["n"] == whole["n"]
    by_source = [row["mpjpe_mm"] for row in whole["by_source"].values()]
    assert min(by_source) * 0.5 < last["mpjpe_mm"]["mean"] < max(by_source) * 2
    with pytest.raises(PlaygroundError, match="no clip"):
        measure_levels(engine.runtime(SYSTEM), library, [5], ["too short"])


def test_files_alone_are_measured_as_their_system(place: Place) -> None:
    engine, library = place
    judge, clips = tiny_evaluator("tmr"), library.split("test")
    paths = {part: checkpoint_path(engine.assets, SYSTEM, part) for part in ("tokenizer", "generator")}
    rebuilt = measure_rebuilt(paths["tokenizer"], "x", library, clips, judge, repeats=2, seed=0)
    assert rebuilt["mpjpe_mm"] == rebuilt["levels"][-1]["mpjpe_mm"] and rebuilt["rfid"]["mean"] > 0
    assert rebuilt["rtop1"]["mean"] is None and "pool of 32" in rebuilt["rtop1"]["why"]
    drawn = measure_generated(
        paths["tokenizer"], paths["generator"], "x", library, clips, judge, SamplingDefaults(), repeats=1, seed=0
    )
    assert drawn["gfid"]["mean"] > 0 and drawn["gmm_dist"]["n"] == 1 and drawn["parameters"] > 1000
    unjudged = measure_rebuilt(paths["tokenizer"], "x", library, clips, None, repeats=2, seed=0)
    assert unjudged["rfid"]["mean"] is None and "evaluator" in unjudged["rfid"]["why"]


def test_orders_and_attention(place: Place) -> None:
    engine = place[0]
    result = alignment(SYSTEM, Settings(motions=6, seed=2), engine, None)
    assert [(row["first"], row["second"]) for row in result.rows] == list(ORDERS)
    row = result.rows[0]
    made = engine.generate(row["prompt"], row["seconds"], SYSTEM, seed=2)
    seen = engine.alignment(made)
    assert row["words"] == seen.words and row["what"] == seen.what and "detokenizer" in seen.what
    assert row["lag"] == pytest.approx(attention_lag(seen.weights, *clauses(seen.words)), abs=1e-6)
    assert np.array(row["weights"]).sum(axis=1) == pytest.approx(1.0, abs=1e-3)
    assert coarse(np.arange(5.0)[:, None], 2)[:, 0].tolist() == [1.0, 3.5]


def test_contents_are_counted(place: Place, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = {row["source"]: row for row in contents.contents(place[1]).rows}
    assert rows["all"]["clips"] == 8 and rows["A"]["clips"] + rows["B"]["clips"] == 8
    assert rows["all"]["captions"] == 8 and rows["A"]["words"]["n"] == rows["A"]["captions"]
    assert rows["all"]["hours"] == pytest.approx(sum(clip.frames for clip in place[1].clips) / 72_000)
    call = ["--library", str(place[1].path), "--out", str(tmp_path)]
    assert contents.main(call) == 0 and (tmp_path / "contents.json").is_file()
    assert "raises the left hand" not in (tmp_path / "contents.json").read_text()
    assert contents.main(["--library", str(tmp_path)]) == 2 and "library" in capsys.readouterr().err
