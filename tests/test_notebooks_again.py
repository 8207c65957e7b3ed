"""Notebooks that compute again, on small settings: the one parameter does what it says."""

from pathlib import Path

import pytest

from tests.analysis.tiny import tiny_library
from tests.notebooks import ROOT, SYSTEM, needs_checkpoint, run, said


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data") / "library"
    tiny_library(folder)
    return folder


@needs_checkpoint
@pytest.mark.parametrize("item", ["fig6_tsne", "fig7_code_usage"])
def test_maps_and_counts(item: str, library: Path) -> None:
    done = run(ROOT / "notebooks" / f"lgtok_{item}.ipynb", RECOMPUTE=True, LIBRARY=str(library), LIMIT=4,
               SYSTEMS=[SYSTEM])  # fmt: skip
    assert "test clips of tiny" in said(done)


@needs_checkpoint
def test_a_measurement(library: Path) -> None:
    path = ROOT / "notebooks" / "lgtok_table8.ipynb"
    text = said(run(path, RECOMPUTE=True, LIBRARY=str(library), SYSTEMS=[SYSTEM], REPEATS=1, SEED=3))
    assert "5 test clips of tiny, 1 repeat, seed 3" in text and "free-form" in text and "not trained yet" not in text


@needs_checkpoint
def test_a_stopwatch(library: Path) -> None:
    path = ROOT / "notebooks" / "lgtok_table9.ipynb"
    text = said(run(path, RECOMPUTE=True, LIBRARY=str(library), SYSTEMS=[SYSTEM], MOTIONS=1))
    assert "1 test clips of tiny" in text and "tokens to motion" in text


def test_a_census(library: Path) -> None:
    text = said(run(ROOT / "notebooks" / "snapmogen_table1.ipynb", RECOMPUTE=True, LIBRARY=str(library)))
    assert "Ours: tiny" in text and "not counted yet" not in text and "20450" in text
