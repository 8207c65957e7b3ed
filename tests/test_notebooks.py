"""Every notebook runs: as it stands, from stored results, and on small settings that compute everything again."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from tests.analysis.tiny import tiny_library

ROOT = Path(__file__).resolve().parent.parent
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
SYSTEM = "lgtok-lite"
needs_checkpoint = pytest.mark.skipif(
    not (ROOT / "assets" / "checkpoints" / SYSTEM / "tokenizer.safetensors").is_file(),
    reason="no checkpoint is shipped",
)
needs_analysis = pytest.mark.skipif(
    not (ROOT / "assets" / "analysis" / f"{SYSTEM}.json").is_file(), reason="no stored analysis is shipped"
)


def parameter_cells(notebook: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    return [cell for cell in notebook.cells if "parameters" in cell.metadata.get("tags", [])]


def run(path: Path, **changes: object) -> nbformat.NotebookNode:
    """Execute a notebook with other values in its parameter cell; an error in a cell fails the test."""
    notebook = nbformat.read(path, as_version=4)
    (cell,) = parameter_cells(notebook)
    cell.source += "".join(f"\n{name} = {value!r}" for name, value in changes.items())
    NotebookClient(
        notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": path.parent}}
    ).execute()
    return notebook


def figures(notebook: nbformat.NotebookNode) -> int:
    """Plotly figures among the outputs."""
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    return sum("application/vnd.plotly.v1+json" in output.get("data", {}) for output in outputs)


def test_there_are_notebooks() -> None:
    assert {"lgtok_fig6_tsne", "lgtok_fig7_code_usage"} <= {path.stem for path in NOTEBOOKS}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_thin_and_has_one_parameter_cell(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert len(parameter_cells(notebook)) == 1
    for cell in notebook.cells:
        if cell.cell_type == "code":
            assert len(cell.source.splitlines()) <= 20 and "def " not in cell.source, "work belongs into the package"
    text = notebook.cells[0].source + notebook.cells[-1].source
    assert "What the paper shows" in text and "What is alike, what is not, and why" in text


@needs_analysis
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_from_stored_results(path: Path) -> None:
    assert figures(run(path)) >= 2


@needs_checkpoint
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_computes_again_on_small_settings(path: Path, tmp_path: Path) -> None:
    tiny_library(tmp_path / "library")
    done = run(path, LIBRARY=str(tmp_path / "library"), LIMIT=4)
    assert figures(done) >= 2
    said = "".join(
        output.get("data", {}).get("text/markdown", "") for c in done.cells for output in c.get("outputs", [])
    )
    assert "test clips of tiny" in said
