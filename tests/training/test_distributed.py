"""Two processes under torchrun on the CPU have the gradients of one process with the doubled batch."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from playground.data.library import LibraryClip, write_library
from tests.conftest import drifting

SCRIPT = """
import sys
from dataclasses import replace
from pathlib import Path
from playground.data.batches import BatchConfig
from playground.training import configs, run
from playground.training.configs import EvaluatorTraining, GeneratorTraining, Schedule, TokenizerTraining
from playground.training.loop import Launch
from tests.evaluation.tiny import TINY_EVALUATOR
from tests.tiny import TINY, TINY_GENERATOR

library, out, tokens = (Path(argument) for argument in sys.argv[1:])
plan = Schedule(steps=1, rate=1e-3, warmup=1, save_every=10, validate_every=10)
batch = BatchConfig(size=4, shortest=16, bucket=2)
# Few codes: the first ones are the leading vectors of the batch, and those belong to the first process.
model = replace(TINY, max_frames=196, codes=(2, 2, 2), text_table=2048, text_width=1)
configs.TOKENIZERS["tiny-tokenizer"] = TokenizerTraining(
    model, batch, plan, text="words", synthetic=0.0, heading=0.1, masked_mean=True
)
configs.GENERATORS["tiny-generator"] = GeneratorTraining(
    TINY_GENERATOR, "tiny-tokenizer", batch, plan, size=4, variants=2, text="words", synthetic=0.0
)
names = {"tiny-tokenizer": out, "tiny-generator": tokens}
for kind in ("tmr", "clip"):
    configs.EVALUATORS[f"tiny-{kind}"] = EvaluatorTraining(replace(TINY_EVALUATOR, kind=kind), batch, plan)
    names[f"tiny-{kind}"] = out
for name, folder in names.items():
    run.train(name, library, folder, launch=Launch(accelerator="cpu", precision="32-true"))
"""


def gradients(path: Path) -> dict:
    """After one step AdamW's first moment is a tenth of the (clipped) gradient."""
    from safetensors import safe_open

    with safe_open(str(path), framework="pt") as file:
        return {n: 10 * file.get_tensor(n) for n in file.keys() if n.endswith(".exp_avg")}  # noqa: SIM118


@pytest.fixture
def library(tmp_path) -> Path:
    words = ("walks left", "runs", "walks on", "hops", "walks right", "turns")
    clips = [LibraryClip(f"c{n}", "A", "train", "walk", (words[n],), drifting(40 + 5 * n, n)) for n in range(6)]
    write_library(tmp_path / "library", clips, "tiny library")
    return tmp_path / "library"


def test_two_processes_have_the_gradients_of_one_with_the_doubled_batch(library, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    root = Path(__file__).resolve().parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root), "OMP_NUM_THREADS": "1"}
    one, two, tokens = (tmp_path / name for name in ("one", "two", "tokens"))
    launcher = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc_per_node", "2"]
    for launch, folders in (([sys.executable], (one, one)), (launcher, (two, tokens))):
        if folders[1] == tokens:  # the generators read the same tokens
            shutil.copytree(one / "tokenizer", tokens / "tokenizer")
        call = [*launch, str(script), str(library), *map(str, folders)]
        done = subprocess.run(call, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[-6000:]
    for part, folder in (("tokenizer", two), ("generator", tokens), ("tmr", two), ("clip", two)):
        alone, shared = gradients(one / part / "state.safetensors"), gradients(folder / part / "state.safetensors")
        largest = max(float(value.abs().max()) for value in alone.values())
        assert alone.keys() == shared.keys() and largest > 1e-3
        for name, value in alone.items():
            off = float((value - shared[name]).abs().max())
            assert off <= 1e-3 * float(value.abs().max()) + 1e-6 * largest, f"{part} {name}: off by {off}"
    facts = json.loads((two / "tokenizer" / "facts.json").read_text())
    assert facts["step"] == 1
