"""Two processes under torchrun measure what one does, number for number."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from playground.data.library import Library
from playground.evaluation.spread import Spread, Tally
from tests.analysis.tiny import SYSTEM, tiny_assets, tiny_library

SCRIPT = """
import json, sys
from dataclasses import replace
from pathlib import Path
import torch
from playground.engine import Engine
from playground.evaluation.run import Order, evaluate
from playground.evaluation.spread import join_spread
from playground.evaluation.sweep import guidance_sweep
from tests.evaluation.tiny import tiny_evaluator

folder, out = Path(sys.argv[1]), Path(sys.argv[2])
torch.set_num_threads(1)
spread = join_spread()
engine, evaluators = Engine(folder / "assets"), {"tmr": tiny_evaluator("tmr"), "clip": tiny_evaluator("clip")}
order = Order(repeats=1, mm_texts=2, mm_samples=10, evaluators=evaluators, out=out)
for repeats in (1, 2):  # the second call goes on where the first one ended
    result = evaluate("lgtok", folder / "library", "test", engine=engine, order=replace(order, repeats=repeats),
                      spread=spread)
sweep = guidance_sweep("lgtok", folder / "library", scales=(0.0, 1.0), engine=engine, spread=spread,
                       order=Order(repeats=1, evaluators=evaluators))
assert bool(result) == bool(sweep) == spread.first
if spread.first:
    out.write_text(json.dumps([result, sweep]))
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    library = tiny_library(tmp_path / "library")
    assert isinstance(library, Library) and tiny_assets(tmp_path / "assets", library)
    return tmp_path


def test_two_processes_equal_one(folder: Path) -> None:
    script = folder / "script.py"
    script.write_text(SCRIPT)
    root = Path(__file__).resolve().parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root), "OMP_NUM_THREADS": "1", "CUDA_VISIBLE_DEVICES": ""}
    launcher = ["-m", "torch.distributed.run", "--standalone", "--nproc_per_node", "2"]
    found = []
    for name, words in (("one", []), ("two", launcher)):
        out = folder / f"{name}.json"
        call = [sys.executable, *words, str(script), str(folder), str(out)]
        done = subprocess.run(call, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[-6000:]
        found.append(json.loads(out.read_text()))
    assert found[0] == found[1]
    assert found[0][0]["system"] == SYSTEM and found[0][0]["repeats"] == 2


def test_alone_every_portion_is_mine_and_sums_are_what_they_were() -> None:
    spread = Spread()
    assert spread.first and spread.size == 1 and spread.mine([3, 1, 2]) == [3, 1, 2] and spread.tell(7) == 7
    array = np.array([1.0, np.nan])
    assert spread.total(array) is array


def test_a_tally_never_passes_its_end() -> None:
    seen: list[tuple[int, int]] = []
    tally = Tally(lambda done, total: seen.append((done, total)), 10)
    for _ in range(3):
        tally.add(4)
    assert seen == [(4, 10), (8, 10), (10, 10)]
