"""A run ended by SIGKILL and resumed in another process has the losses of one that never stopped."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from playground.data.batches import BatchConfig
from playground.data.library import LibraryClip, write_library
from playground.training.configs import Schedule, TokenizerTraining
from playground.training.loop import Launch
from playground.training.run import Order, run_training
from tests.conftest import drifting
from tests.tiny import TINY

STEPS, SAVED, KILLED = 7, 3, 5
SCRIPT = (
    "import sys; from pathlib import Path; from tests.training.test_kill import train; train(*map(Path, sys.argv[1:]))"
)


def train(library: Path, out: Path, log: Path | None = None) -> list[float]:
    """Train a tiny tokenizer with dropout; with a log, write every loss there and die by SIGKILL in step KILLED."""
    model = replace(TINY, max_frames=196, text_table=2048, text_width=1, dropout=0.1)
    plan = Schedule(steps=STEPS, rate=1e-3, warmup=2, save_every=SAVED, validate_every=100)
    training = TokenizerTraining(model, BatchConfig(size=4, shortest=16, bucket=2), plan, text="words", synthetic=0.0)
    losses: list[float] = []

    def on_step(step: int, loss: float) -> None:
        losses.append(loss)
        if log is not None:
            log.write_text(json.dumps(losses))
            if step + 1 == KILLED:
                os.kill(os.getpid(), signal.SIGKILL)

    launch = Launch(accelerator="cpu", precision="32-true")
    run_training(training, Order(library, out, resume=True, launch=launch, on_step=on_step))
    return losses


def test_a_killed_run_goes_on_as_if_nothing_had_happened(tmp_path):
    clips = [LibraryClip(f"c{n}", "A", "train", "walk", ("walks left",), drifting(40 + 9 * n, n)) for n in range(6)]
    write_library(tmp_path / "library", clips, "tiny library")
    whole = train(tmp_path / "library", tmp_path / "whole")
    root, log = Path(__file__).resolve().parents[2], tmp_path / "log.json"
    call = [sys.executable, "-c", SCRIPT, str(tmp_path / "library"), str(tmp_path / "killed"), str(log)]
    environment = {**os.environ, "PYTHONPATH": str(root), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(call, env=environment, capture_output=True, text=True, check=False, cwd=root)
    assert done.returncode == -signal.SIGKILL, done.stderr[-3000:]
    assert json.loads(log.read_text()) == whole[:KILLED]
    assert not (tmp_path / "killed" / "tokenizer" / "checkpoint.safetensors").exists()
    assert train(tmp_path / "library", tmp_path / "killed") == whole[SAVED:]
    assert (tmp_path / "killed" / "tokenizer" / "checkpoint.safetensors").is_file()
