"""Every notebook is thin and runs as it stands, from stored results."""

import json
import re
from pathlib import Path

import nbformat
import pytest

from tests.notebooks import NOTEBOOKS, ROOT, SYSTEM, parameter_cells, run, shown

ITEMS = {  # what the paper's notebooks begin with -> items
    "lgtok": (
        "fig11", "fig4_9_10", "fig5", "fig6_tsne", "fig7_code_usage", "perplexity", "table1_fig2", "table2", "table3",
        "table4", "table5", "table6", "table7", "table8", "table9",
    ),
    "mogo": ("fig2", "levels", "table1", "table2", "table3", "table4"),
    "casim": ("alignment", "tables"),
    "snapmogen": ("fig5", "layers", "table1", "table4", "tables2_3"),
}  # fmt: skip
PAPERS = {"lgtok": "2602.08337", "mogo": "2506.05952", "casim": "2502.02063", "snapmogen": "2507.09122"}
LONGEST = 60_000  # bytes of a notebook without outputs


def test_every_published_item_has_its_notebook() -> None:
    assert {path.stem for path in NOTEBOOKS} == {f"{paper}_{item}" for paper, items in ITEMS.items() for item in items}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_thin_and_has_one_parameter_cell(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    (parameters,) = parameter_cells(notebook)
    assert "RECOMPUTE = False" in parameters.source and "LIBRARY = ROOT / " in parameters.source
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    for cell in code:
        assert len(cell.source.splitlines()) <= 20 and "def " not in cell.source, "work belongs into the package"
        assert not cell.outputs and cell.execution_count is None, "outputs are not kept"
    assert any("RECOMPUTE" in cell.source for cell in code if cell is not parameters), "the parameter does something"
    paper = PAPERS[path.stem.partition("_")[0]]
    assert "**What the paper shows**" in notebook.cells[0].source and f"arXiv {paper}" in notebook.cells[0].source
    assert "What is alike, what is not, and why" in notebook.cells[-1].source
    assert path.stat().st_size < LONGEST


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_from_stored_results(path: Path) -> None:
    few = {"SYSTEMS": [SYSTEM]} if "fig4" in path.stem else {}  # pictures take their time
    outputs = shown(run(path, **few))
    assert len(outputs) >= 2
    assert all("Traceback" not in text for _, text in outputs)


def test_no_caption_of_the_data_stands_in_a_notebook_or_a_stored_result(library_data: Path) -> None:
    clips = [json.loads(line) for line in (library_data / "clips.jsonl").read_text(encoding="utf-8").splitlines()]
    captions = {caption["text"].strip().strip(".").lower() for clip in clips for caption in clip["captions"]}
    long = {caption for caption in captions if len(caption.split()) >= 6}
    assert len(long) > 1000
    words = re.compile(r'[^"\\]+')
    for path in [*NOTEBOOKS, *sorted((ROOT / "assets" / "results").glob("*.json"))]:
        found = {part.strip().strip(".").lower() for part in words.findall(path.read_text(encoding="utf-8"))}
        assert not found & long, f"{path.name} holds a caption of the data set"
