"""Running notebooks in tests."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parent.parent
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
SYSTEM = "lgtok"
needs_checkpoint = pytest.mark.skipif(
    not (ROOT / "assets" / "checkpoints" / SYSTEM / "generator.safetensors").is_file(),
    reason="no checkpoint is shipped",
)
SHOWN = ("application/vnd.plotly.v1+json", "text/html", "text/markdown", "image/png")


def parameter_cells(notebook: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    """Cells tagged as parameters."""
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


def shown(notebook: nbformat.NotebookNode) -> list[tuple[str, str]]:
    """(kind, text) of every figure, table and picture among the outputs; pictures as their base64."""
    outputs = [output.get("data", {}) for cell in notebook.cells for output in cell.get("outputs", [])]
    return [(kind, str(data[kind])) for data in outputs for kind in SHOWN if kind in data]


def said(notebook: nbformat.NotebookNode) -> str:
    """All tables and plots as text."""
    return "\n".join(text for kind, text in shown(notebook) if kind != "image/png")
