"""Repeated evaluation of a tiny system, against loops over single motions; what is drawn for a repeat."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from playground.data.library import Library
from playground.engine import Engine
from playground.engine.refining import refiner_path
from playground.errors import PlaygroundError
from playground.evaluation import items as drawing
from playground.evaluation import metrics
from playground.evaluation.items import Item, draw_items, draw_samples, portions, prompt_items, stream
from playground.evaluation.judges import judge_motion
from playground.evaluation.prompts_obeyed import PROMPTS
from playground.evaluation.repeats import DRAWN, KEYS, TOKENS, summarise
from playground.evaluation.run import Order, evaluate
from playground.evaluation.state import state_path
from playground.motion.measures import bone_drift, foot_sliding, joint_errors
from playground.motion.representation import from_features67
from playground.systems import checkpoint_path, row_of
from tests.analysis.tiny import CODES, SYSTEM, tiny_assets, tiny_library
from tests.evaluation.tiny import tiny_evaluator
from tests.tiny import tiny_refiner

EVALUATORS = {"tmr": tiny_evaluator("tmr"), "clip": tiny_evaluator("clip")}
SMALL = Order(repeats=2, mm_texts=1, mm_samples=10, evaluators=EVALUATORS)
TABLES = ("metrics", "real", "reconstruction")

Place = tuple[Engine, Library]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Place:
    folder = tmp_path_factory.mktemp("tiny")
    library = tiny_library(folder / "library")
    return Engine(tiny_assets(folder / "assets", library)), library


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("out") / "result.json"


@pytest.fixture(scope="module")
def result(place: Place, out: Path) -> dict:
    return run(place, replace(SMALL, out=out))


@pytest.fixture
def first(result: dict, out: Path) -> dict:
    """The first repeat alone: {table: {metric: {"value", "n"}}}."""
    return json.loads(state_path(out).read_text())["repeats"][0]


def run(place: Place, order: Order, progress=None) -> dict:
    return evaluate(SYSTEM, place[1].path, "test", progress, engine=place[0], order=order)


def items_of(library: Library, repeat: int, seed: int = 0) -> list[Item]:
    clips = [i for i in library.split("test") if library.clips[i].frames > 16]
    return draw_items(library, clips, stream(seed, repeat, drawing.ITEMS))


def engine_rows(engine: Engine, item: Item) -> np.ndarray:
    """One motion, made through the engine; free-form where the caption is empty."""
    made = engine.generate(item.caption or None, item.rows / 20, SYSTEM, seed=item.seed, deadline=None)
    return engine.runtime(SYSTEM).normaliser.invert(made.features)


# ---- what is drawn ---------------------------------------------------------------------------------------------------


def test_windows_lie_in_their_clips_and_their_lengths_follow_the_coin(place: Place) -> None:
    library = place[1]
    shorter = []
    for repeat in range(200):
        for item in items_of(library, repeat):
            clip = library.clips[item.index]
            longest = min(clip.frames - 1, 196) // 4 * 4
            assert item.rows in (longest, longest - 4) and 0 <= item.start <= clip.frames - 1 - item.rows
            assert item.caption in clip.captions or (not item.caption and not clip.captions)
            shorter.append(item.rows < longest)
    assert np.mean(shorter) == pytest.approx(1 / 3, abs=0.05)
    assert items_of(library, 3) == items_of(library, 3) != items_of(library, 4)
    assert items_of(library, 3, seed=1) != items_of(library, 3)


def test_portions_hold_every_item_once_captions_apart() -> None:
    items = [Item(n, "text" * (n % 3 > 0), 0, 16 + 4 * (n % 7), n) for n in range(50)]
    parts = portions(items, 8)
    assert sorted(place for part in parts for place in part) == list(range(50))
    assert all(len({bool(items[place].caption) for place in part}) == 1 and len(part) <= 8 for part in parts)
    assert portions([]) == [] and portions(items[:1]) == [[0]]


def test_samples_are_so_many_motions_of_so_many_captioned_items(place: Place) -> None:
    items = items_of(place[1], 0)
    samples = draw_samples(items, 3, 10, stream(0, 0, drawing.SAMPLES))
    assert len(samples) == 30 and len({item.seed for item in samples}) == 30
    assert all(len({item.index for item in samples[n : n + 10]}) == 1 for n in (0, 10, 20))
    assert len(draw_samples(items, 96, 2, stream(0, 0, drawing.SAMPLES))) == 2 * sum(bool(i.caption) for i in items)


def test_the_first_repeat_asks_the_prompts_with_the_seeds_of_the_model_card() -> None:
    prompts, items = prompt_items(0, 0)
    assert len(prompts) == len(items) == 3 * sum(prompt.plain for prompt in PROMPTS)
    assert {item.seed for item in items} == {0, 1, 2} and {item.seed for item in prompt_items(0, 1)[1]} == {3, 4, 5}
    assert [item.rows for item in items[:3]] == [int(20 * prompts[0].seconds)] * 3


# ---- numbers ---------------------------------------------------------------------------------------------------------


def test_every_key_is_there_and_what_cannot_be_measured_says_why(result: dict) -> None:
    assert result["repeats"] == 2 and result["n"] == 5 and result["mpjpe_mm"] > 0
    assert set(result["evaluators"]) == {"tmr", "clip"} and result["sampling"] == vars(row_of(SYSTEM).sampling)
    for table in TABLES:
        assert tuple(result[table]) == KEYS
        for entry in result[table].values():
            if entry["mean"] is None:
                assert entry["n"] == 0 and len(entry["why"]) > 20
            else:
                assert math.isfinite(entry["mean"]) and entry["ci95"] >= 0 and entry["n"] > 0
    assert "pool of 32" in result["metrics"]["r_precision_top1_pool32"]["why"]
    assert "100 pairs" in result["real"]["diversity"]["why"]
    assert "small sample" in result["metrics"]["fid"]["note"]
    assert all(result["real"][key]["mean"] is None for key in (*DRAWN, *TOKENS))
    json.dumps(result, allow_nan=False)


def test_generated_and_recorded_motions_equal_a_loop_over_single_ones(place: Place, result: dict) -> None:
    engine, library = place
    tmr, clip = EVALUATORS["tmr"], EVALUATORS["clip"]
    slow: dict[str, list[float]] = {key: [] for key in ("fid", "mm", "clip", "slide", "drift", "real", "again")}
    for repeat in range(2):
        items = items_of(library, repeat)
        made = [engine_rows(engine, item) for item in items]
        true = [library.features(i.index)[i.start : i.start + i.rows] for i in items]
        again = draw_items(library, [i.index for i in items], stream(0, repeat, drawing.AGAIN))
        other = [library.features(i.index)[i.start : i.start + i.rows] for i in again]
        one = {name: np.concatenate([tmr.embed_rows([rows]) for rows in part]) for name, part in
               (("made", made), ("true", true), ("other", other))}  # fmt: skip
        there = [n for n, item in enumerate(items) if item.caption]
        texts = [items[n].caption for n in there]
        slow["fid"].append(metrics.fid(one["true"], one["made"]))
        slow["again"].append(metrics.fid(one["other"], one["true"]))
        slow["mm"].append(metrics.mm_dist(tmr.embed_texts(texts), one["made"][there]))
        slow["clip"].append(metrics.clip_score(clip.embed_texts(texts), clip.embed_rows([made[n] for n in there])))
        slides = [foot_sliding(from_features67(rows)) for rows in made]
        slow["slide"].append(np.nanmean(slides))
        slow["drift"].append(np.mean([bone_drift(from_features67(rows)) for rows in made]))
        slow["real"].append(np.mean([bone_drift(from_features67(rows)) for rows in true]))
    pairs = {"fid": "fid", "mm": "mm_dist", "clip": "clip_score", "slide": "foot_sliding", "drift": "bone_drift"}
    for name, key in pairs.items():
        entry = result["metrics"][key]
        assert entry["mean"] == pytest.approx(np.mean(slow[name]), rel=2e-3), key
        assert entry["ci95"] == pytest.approx(1.96 * np.std(slow[name]) / math.sqrt(2), rel=2e-2, abs=1e-6), key
    assert result["real"]["bone_drift"]["mean"] == pytest.approx(np.mean(slow["real"]), rel=1e-6)
    assert result["real"]["fid"]["mean"] == pytest.approx(np.mean(slow["again"]), rel=1e-3, abs=1e-7)
    assert result["metrics"]["mm_dist"]["n"] == 4 and result["metrics"]["fid"]["n"] == 5


def test_refined_motions_are_measured_as_the_refiner_leaves_them(place: Place, result: dict) -> None:
    engine, library = place
    order = replace(SMALL, repeats=1, mm_samples=0, refine=True)
    with pytest.raises(PlaygroundError, match="no root refiner"):
        run(place, order)
    with pytest.raises(PlaygroundError, match="--repeats 1"):
        replace(order, repeats=0).check()
    tiny_refiner(engine.assets, engine.runtime(SYSTEM).normaliser)
    refiner = engine.refiner()
    measured = run(place, order)
    refiner_path(engine.assets).unlink()
    assert measured["refiner"] == refiner.checkpoint and "refiner" not in result
    made = [engine_rows(engine, item) for item in items_of(library, 0)]
    pairs = [[from_features67(rows) for rows in (one, refiner.rows([one])[0])] for one in made]
    drifts = [np.linalg.norm((a - b)[:, 0, ::2], axis=1).mean() for a, b in pairs]
    metrics = measured["metrics"]
    assert metrics["path_drift"]["mean"] == pytest.approx(np.mean(drifts), rel=1e-2) and metrics["path_drift"]["n"] == 5
    assert metrics["foot_sliding"]["mean"] == pytest.approx(np.nanmean([foot_sliding(b) for _, b in pairs]), rel=1e-2)
    assert all("path_drift" not in result[table] for table in TABLES) and "path_drift" not in measured["real"]


def test_tokens_equal_a_loop_over_single_motions(place: Place, result: dict) -> None:
    import torch

    engine, library = place
    runtime = engine.runtime(SYSTEM)
    expected: dict[str, list[float]] = {"mpjpe_mm": [], "usage": [], "nll": [], "argmax": []}
    for repeat in range(2):
        errors, ids, losses, best = [], [[] for _ in CODES], [[] for _ in CODES], [[] for _ in CODES]
        for item in items_of(library, repeat):
            rows = library.features(item.index)[item.start : item.start + item.rows]
            x, lengths = torch.from_numpy(runtime.normaliser.apply(rows))[None], torch.tensor([item.rows])
            text = runtime.text(item.caption)
            quantized = runtime.tokenizer.encode(x, lengths, text)
            back = runtime.tokenizer.decode(quantized.embedding, lengths, text)[0].numpy()
            errors.append(joint_errors(from_features67(rows), from_features67(runtime.normaliser.invert(back))))
            for level, logits in enumerate(runtime.generator.logits(quantized.tokens, text, lengths)):
                true = quantized.tokens.ids[level][0]
                ids[level] += true.tolist()
                best[level] += logits[0].argmax(-1).tolist()
                losses[level] += torch.nn.functional.cross_entropy(logits[0], true, reduction="none").tolist()
        expected["mpjpe_mm"].append(np.concatenate(errors).mean())
        expected["usage"].append(np.mean([len(set(level)) / size for level, size in zip(ids, CODES, strict=True)]))
        expected["nll"].append(np.mean([math.exp(np.mean(level)) for level in losses]))
        shares = [np.bincount(level) / len(level) for level in best]
        expected["argmax"].append(np.mean([math.exp(-(p * np.log(p + 1e-7)).sum()) for p in shares]))
    for table in ("metrics", "reconstruction"):
        for key, name in (("mpjpe_mm", "mpjpe_mm"), ("usage", "usage"), ("model_perplexity_nll", "nll"),
                          ("model_perplexity_argmax", "argmax")):  # fmt: skip
            assert result[table][key]["mean"] == pytest.approx(np.mean(expected[name]), rel=1e-3), key


def test_multimodality_and_prompts_equal_single_generations(place: Place, first: dict) -> None:
    engine, library = place
    samples = draw_samples(items_of(library, 0), 1, 10, stream(0, 0, drawing.SAMPLES))
    made = EVALUATORS["tmr"].embed_rows([engine_rows(engine, item) for item in samples])
    spread = metrics.multimodality(made[None], stream(0, 0, drawing.TEXT_PAIRS))
    assert first["metrics"]["multimodality"] == {"value": pytest.approx(spread, rel=2e-3), "n": 10}
    prompts, asked = prompt_items(0, 0)
    pairs = zip(prompts, asked, strict=True)
    obeyed = [not judge_motion(p.judge, from_features67(engine_rows(engine, item))) for p, item in pairs]
    assert first["metrics"]["prompts_obeyed"] == {"value": pytest.approx(np.mean(obeyed)), "n": 24}


def test_the_size_of_a_batch_does_not_matter(place: Place, first: dict, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("playground.evaluation.passes.portions", lambda items: portions(items, 3))
    other = run(place, replace(SMALL, repeats=1))
    for table in TABLES:
        for key, entry in first[table].items():
            expected = entry["value"] and pytest.approx(entry["value"], rel=2e-3, abs=1e-6)
            assert other[table][key]["mean"] == expected, (table, key)


def test_the_guidance_asked_for_is_used_and_written_down(place: Place, result: dict) -> None:
    order = Order(repeats=1, mm_samples=0, guidance=1.5, cfg=0.0, evaluators=EVALUATORS)
    other = run(place, order)
    assert (other["sampling"]["guidance"], other["sampling"]["cfg"]) == (1.5, 0.0)
    assert "0 motions were asked for" in other["metrics"]["multimodality"]["why"]
    assert other["metrics"]["bone_drift"]["mean"] != pytest.approx(result["metrics"]["bone_drift"]["mean"], rel=1e-3)


def test_a_system_without_a_generator_is_measured_on_its_tokens(place: Place, tmp_path: Path) -> None:
    engine = Engine(tiny_assets(tmp_path, place[1]))
    checkpoint_path(tmp_path, SYSTEM, "generator").unlink()
    found = run((engine, place[1]), Order(repeats=1, evaluators=EVALUATORS))
    for key in KEYS:
        there = key in ("mpjpe_mm", "usage", "code_perplexity")
        assert (found["metrics"][key]["mean"] is not None) == there
        assert there or "no generator" in found["metrics"][key]["why"]
    assert found["real"]["fid"]["mean"] is not None and found["reconstruction"]["fid"]["mean"] is not None


def test_without_evaluators_the_rest_is_measured(place: Place) -> None:
    found = run(place, Order(repeats=1, mm_samples=0, evaluators={}))
    assert "evaluator tmr" in found["metrics"]["fid"]["why"] and "evaluator clip" in found["real"]["clip_score"]["why"]
    assert found["metrics"]["foot_sliding"]["mean"] is not None and found["metrics"]["prompts_obeyed"]["n"] == 24


def test_the_mean_of_repeats_by_hand() -> None:
    def table(**values: float | None) -> dict:
        return {key: {"value": v, "n": 7} if v is not None else {"value": None, "n": 0, "why": "too small"}
                for key, v in values.items()}  # fmt: skip

    rows = summarise([table(fid=1.0, mm_dist=2.0), table(fid=4.0, mm_dist=None), table(fid=7.0, mm_dist=2.0)])
    assert rows["fid"] == {"mean": 4.0, "ci95": pytest.approx(1.96 * math.sqrt(6.0) / math.sqrt(3)), "n": 7}
    assert rows["mm_dist"] == {"mean": None, "ci95": None, "n": 0, "why": "too small"}
