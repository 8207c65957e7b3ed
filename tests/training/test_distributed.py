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


RESUMED = """
import json, os, sys
from dataclasses import replace
from pathlib import Path
from playground.data.batches import BatchConfig
from playground.training.configs import Schedule, TokenizerTraining
from playground.training.loop import Launch
from playground.training.run import Order, run_training
from tests.tiny import TINY

library, out, log = (Path(argument) for argument in sys.argv[1:4])
end, rank = int(sys.argv[4]), os.environ["RANK"]
model = replace(TINY, max_frames=196, text_table=2048, text_width=1, dropout=0.3)
plan = Schedule(steps=4, rate=1e-3, warmup=1, save_every=2, validate_every=100)
training = TokenizerTraining(model, BatchConfig(size=4, shortest=16, bucket=2), plan, text="words", synthetic=0.0)
losses = []

def on_step(step, loss):
    losses.append(loss)
    log.with_suffix("." + rank).write_text(json.dumps(losses))
    if step + 1 == end:
        os._exit(0)

launch = Launch(accelerator="cpu", precision="32-true")
run_training(training, Order(library, out, resume=True, launch=launch, on_step=on_step))
"""
LAUNCHER = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc_per_node", "2"]


def call(command: list[str]) -> None:
    root = Path(__file__).resolve().parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-6000:]


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
    one, two, tokens = (tmp_path / name for name in ("one", "two", "tokens"))
    for launch, folders in (([sys.executable], (one, one)), (LAUNCHER, (two, tokens))):
        if folders[1] == tokens:  # the generators read the same tokens
            shutil.copytree(one / "tokenizer", tokens / "tokenizer")
        call([*launch, str(script), str(library), *map(str, folders)])
    for part, folder in (("tokenizer", two), ("generator", tokens), ("tmr", two), ("clip", two)):
        alone, shared = gradients(one / part / "state.safetensors"), gradients(folder / part / "state.safetensors")
        largest = max(float(value.abs().max()) for value in alone.values())
        assert alone.keys() == shared.keys() and largest > 1e-3
        for name, value in alone.items():
            off = float((value - shared[name]).abs().max())
            assert off <= 1e-3 * float(value.abs().max()) + 1e-6 * largest, f"{part} {name}: off by {off}"
    facts = json.loads((two / "tokenizer" / "facts.json").read_text())
    assert facts["step"] == 1


def test_every_process_of_a_resumed_run_goes_on_with_its_own_draws(library, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(RESUMED)
    found = {}
    for name, ends in (("whole", (0,)), ("ended", (3, 0))):
        for end in ends:
            call([*LAUNCHER, str(script), str(library), str(tmp_path / name), str(tmp_path / name) + ".log", str(end)])
        found[name] = [json.loads((tmp_path / f"{name}.{rank}").read_text()) for rank in (0, 1)]
    assert [len(losses) for losses in (*found["whole"], *found["ended"])] == [4, 4, 2, 2]
    assert found["ended"] == [losses[2:] for losses in found["whole"]]
    assert found["whole"][0] != found["whole"][1]
