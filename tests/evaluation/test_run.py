"""Evaluation of a tiny system, against a loop over single clips through the engine's parts."""

from pathlib import Path

import numpy as np
import pytest
import torch

from playground.data.library import Library, LibraryClip, write_library
from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.evaluation.run import evaluate
from playground.motion.representation import from_features67
from tests.analysis.tiny import CODES, SYSTEM, same_numbers, tiny_assets, tiny_library
from tests.conftest import drifting


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> tuple[Engine, Library]:
    folder = tmp_path_factory.mktemp("tiny")
    library = tiny_library(folder / "library")
    return Engine(tiny_assets(folder / "assets", library)), library


def slow(engine: Engine, library: Library) -> tuple[dict[str, list[float]], list[list[int]]]:
    """Frame errors by source, and the ids a scale, one clip at a time."""
    runtime = engine.runtime(SYSTEM)
    errors: dict[str, list[float]] = {}
    ids: list[list[int]] = [[] for _ in CODES]
    for i in library.split("test"):
        clip = library.clips[i]
        rows = min((clip.frames - 1) // 4 * 4, 196)
        if rows < 16:
            continue
        features = library.features(i)[:rows]
        text = runtime.encoder.encode([clip.captions[0]]) if clip.captions else None
        z = torch.from_numpy(runtime.normaliser.apply(features))[None]
        quantized = runtime.tokenizer.encode(z, torch.tensor([rows]), text)
        rebuilt = runtime.tokenizer.decode(quantized.embedding, torch.tensor([rows]), text)[0].numpy()
        a, b = from_features67(features), from_features67(runtime.normaliser.invert(rebuilt))
        for f in range(rows):
            gaps = [np.linalg.norm((a[f, j] - a[f, 0]) - (b[f, j] - b[f, 0])) * 1000 for j in range(22)]
            errors.setdefault(clip.source, []).append(float(np.mean(gaps)))
        for level, found in enumerate(quantized.tokens.ids):
            ids[level] += found[0].tolist()
    return errors, ids


def test_against_one_clip_at_a_time(place: tuple[Engine, Library]) -> None:
    engine, library = place
    result = evaluate(SYSTEM, library.path, "test", engine=engine, seed=3)
    errors, ids = slow(engine, library)
    assert result["n"] == 5 and result["seed"] == 3 and result["split"] == "test" and result["data"] == "tiny"
    assert result["system"] == SYSTEM and result["checkpoint"] == engine.runtime(SYSTEM).checkpoint
    assert result["mpjpe_mm"] == pytest.approx(np.mean(errors["A"] + errors["B"]), rel=1e-3)
    assert {name: row["n"] for name, row in result["by_source"].items()} == {"A": 3, "B": 2}
    means = [np.mean(errors[name]) for name in ("A", "B")]
    assert [row["mpjpe_mm"] for row in result["by_source"].values()] == pytest.approx(means, rel=1e-3)
    assert result["mpjpe_mm_source_mean"] == pytest.approx(np.mean(means), rel=1e-3)
    for level, size in enumerate(CODES):
        assert result["usage"][level] == pytest.approx(len(set(ids[level])) / size)
        p = np.bincount(ids[level], minlength=size) / len(ids[level])
        assert result["perplexity"][level] == pytest.approx(np.exp(-(p * np.log(p + 1e-7)).sum()))
    assert result["usage_all"] == pytest.approx(sum(len(set(level)) for level in ids) / sum(CODES))


def test_same_library_same_result_and_progress_reaches_the_end(place: tuple[Engine, Library]) -> None:
    engine, library = place
    seen: list[tuple[int, int]] = []
    first = evaluate(SYSTEM, library.path, "test", lambda done, total: seen.append((done, total)), engine=engine)
    assert seen[-1] == (5, 5) and seen == sorted(seen)
    assert same_numbers(first, evaluate(SYSTEM, library.path, "test", engine=engine))


def test_a_split_with_nothing_to_measure_is_refused(place: tuple[Engine, Library], tmp_path: Path) -> None:
    write_library(tmp_path, [LibraryClip("a", "A", "test", "walk", ("walks",), drifting(10))], name="short")
    with pytest.raises(PlaygroundError, match="no clip long enough"):
        evaluate(SYSTEM, tmp_path, "test", engine=place[0])
    with pytest.raises(PlaygroundError, match="no clip long enough"):
        evaluate(SYSTEM, tmp_path, "val", engine=place[0])


@pytest.mark.parametrize("system, split", [("lgtok-giant", "test"), (SYSTEM, "tomorrow")])
def test_unknown_names_are_refused(place: tuple[Engine, Library], system: str, split: str) -> None:
    engine, library = place
    with pytest.raises(PlaygroundError):
        evaluate(system, library.path, split, engine=engine)


def test_no_library_is_refused(place: tuple[Engine, Library], tmp_path: Path) -> None:
    with pytest.raises(PlaygroundError):
        evaluate(SYSTEM, tmp_path / "nowhere", "test", engine=place[0])
