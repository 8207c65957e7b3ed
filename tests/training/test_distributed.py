"""Two processes under torchrun on the CPU train as one process with the doubled batch does."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from playground.data.library import LibraryClip, write_library
from tests.conftest import drifting

SCRIPT = """
import json, sys
from dataclasses import replace
from pathlib import Path
from playground.data.batches import BatchConfig
from playground.training import configs, run
from playground.training.configs import EvaluatorTraining, GeneratorTraining, Schedule, TokenizerTraining
from playground.training.loop import Launch
from tests.evaluation.tiny import TINY_EVALUATOR
from tests.tiny import TINY, TINY_GENERATOR

library, out = Path(sys.argv[1]), Path(sys.argv[2])
plan = Schedule(steps=2, rate=1e-3, warmup=1, save_every=10, validate_every=10)
batch = BatchConfig(size=4, shortest=16, bucket=2)
# Euclidean codes that stay alive: restarted codes come from one process's share of the batch.
model = replace(TINY, max_frames=196, codes=(2, 2, 2))
configs.TOKENIZERS["tiny-tokenizer"] = TokenizerTraining(
    model, batch, plan, synthetic=0.0, heading=0.1, masked_mean=True
)
configs.GENERATORS["tiny-generator"] = GeneratorTraining(
    TINY_GENERATOR, "tiny-tokenizer", batch, plan, size=4, variants=2, synthetic=0.0
)
names = ["tiny-tokenizer", "tiny-generator"]
for kind in ("tmr", "clip"):
    configs.EVALUATORS[f"tiny-{kind}"] = EvaluatorTraining(replace(TINY_EVALUATOR, kind=kind), batch, plan)
    names.append(f"tiny-{kind}")
for name in names:
    run.train(name, library, out, launch=Launch(accelerator="cpu", precision="32-true"))
"""


def weights(path: Path) -> dict:
    from safetensors import safe_open

    with safe_open(str(path), framework="pt") as file:
        return {name: file.get_tensor(name) for name in file.keys() if name.startswith("model.")}  # noqa: SIM118


@pytest.fixture
def library(tmp_path) -> Path:
    words = ("walks left", "runs", "walks on", "hops", "walks right", "turns")
    clips = [LibraryClip(f"c{n}", "A", "train", "walk", (words[n],), drifting(40 + 5 * n, n)) for n in range(6)]
    write_library(tmp_path / "library", clips, "tiny library")
    return tmp_path / "library"


def test_two_processes_equal_one_with_the_doubled_batch(library, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    root = Path(__file__).resolve().parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root), "OMP_NUM_THREADS": "1"}
    plain = [sys.executable, str(script), str(library), str(tmp_path / "one")]
    launcher = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc_per_node", "2"]
    for command in (plain, [*launcher, str(script), str(library), str(tmp_path / "two")]):
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[-6000:]
    for part in ("tokenizer", "generator", "tmr", "clip"):
        first, second = (weights(tmp_path / run / part / "state.safetensors") for run in ("one", "two"))
        assert first.keys() == second.keys()
        for name, value in first.items():
            if "quantizer.codebooks" not in name:
                assert (value.float() - second[name].float()).abs().max() < 2e-3, name
    facts = json.loads((tmp_path / "two" / "tokenizer" / "facts.json").read_text())
    assert facts["step"] == 2
