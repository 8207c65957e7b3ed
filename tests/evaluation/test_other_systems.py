"""Evaluation and stored analysis of systems whose motions have fewer tokens when short, or none at all."""

import numpy as np
import pytest
import torch

from playground.analysis.store import build_bundle
from playground.data.library import Library
from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.evaluation.published.items import results_of
from playground.evaluation.run import Order, evaluate
from tests.analysis.tiny import tiny_library
from tests.evaluation.test_repeats import items_of
from tests.evaluation.tiny import tiny_evaluator
from tests.tiny_systems import tiny_system

NAMES = ("momaskpp", "t2mgpt-casim", "mdm")


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> tuple[Engine, object]:
    library = tiny_library(tmp_path_factory.mktemp("library"))
    folder = tmp_path_factory.mktemp("assets")
    for name in NAMES:
        tiny_system(folder, name, library.normaliser)
    return Engine(folder), library.path


@pytest.mark.parametrize("name", NAMES)
def test_every_metric_that_exists_is_measured(place, name):
    engine, library = place
    order = Order(repeats=1, mm_texts=2, mm_samples=20, evaluators={"tmr": tiny_evaluator()})
    result = evaluate(name, library, engine=engine, order=order)
    drawn, rebuilt = result["metrics"], result["reconstruction"]
    assert drawn["fid"]["mean"] is not None and drawn["foot_sliding"]["n"] == result["n"]
    if name == "mdm":
        assert result["mpjpe_mm"] is None and result["usage"] == []
        assert "has no tokenizer" in drawn["usage"]["why"] and "has no tokenizer" in rebuilt["fid"]["why"]
        return
    assert rebuilt["fid"]["mean"] is not None and len(result["usage"]) == len(engine.scales(name))
    likely = drawn["model_perplexity_nll"]
    assert (likely["mean"] is not None) == (name == "t2mgpt-casim") or "without a likelihood" in likely["why"]


def test_the_stored_analysis_holds_the_tokens_that_are_there(place):
    engine, library = place
    bundle = build_bundle("momaskpp", library, engine=engine)
    assert bundle.sizes == (6, 12, 24, 49) and (bundle.tokens < 0).any()
    for row, clip in enumerate(bundle.clips):
        levels = bundle.levels(row)
        assert tuple(level.size for level in levels) == engine.sizes("momaskpp", clip.frames)
        assert [bundle.count(row, scale) for scale in range(4)] == [level.size for level in levels]
        assert engine.decode(bundle.token_file(row)).motion.frames == clip.frames
    counted = np.split(bundle.counts, np.cumsum(bundle.codes)[:-1])
    for scale, counts in enumerate(counted):
        assert counts.sum() == sum(bundle.count(row, scale) for row in range(len(bundle)))
    for row, scale, position in bundle.token_index:
        assert position < bundle.count(row, scale - 1)
    with pytest.raises(PlaygroundError, match="has no tokenizer"):
        build_bundle("mdm", library, engine=engine)


@pytest.mark.parametrize("name", ["momaskpp", "mdm"])
def test_the_decoder_is_timed_where_there_are_tokens(place, name):
    engine, library = place
    result = results_of("inference_time", [name], recompute=True, library=library, engine=engine, motions=2)[name]
    parts = [(row["what"], row["seconds"]["n"]) for row in result.rows]
    assert parts == [("text to motion", 2), ("tokens to motion", 2)][: 1 if name == "mdm" else 2]


def test_every_token_weighs_the_same_in_the_perplexity(place):
    engine, path = place
    library, runtime = Library.open(path), engine.runtime("t2mgpt-casim")
    result = evaluate("t2mgpt-casim", path, engine=engine, order=Order(repeats=1, mm_texts=1, evaluators={}))
    losses = []
    for item in items_of(library, 0):
        rows = library.features(item.index, runtime.heading)[item.start : item.start + item.rows]
        lengths = torch.tensor([item.rows])
        tokens = runtime.tokenizer.encode(torch.from_numpy(runtime.normaliser.apply(rows))[None], lengths, None).tokens
        (logits,) = runtime.generator.logits(tokens, runtime.texts([item.caption], prompts=True), lengths)
        losses.append(torch.nn.functional.cross_entropy(logits[0], tokens.ids[0][0], reduction="none").tolist())
    assert len({len(one) for one in losses}) > 1  # motions of several lengths
    expected = np.exp(np.mean(np.concatenate(losses)))
    assert result["metrics"]["model_perplexity_nll"]["mean"] == pytest.approx(expected, rel=1e-4)
