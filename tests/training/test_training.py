"""Training on tiny models: resume, distributed slices, losses, schedules, exported checkpoints."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.nn import functional as F

from playground.checkpoints import load_generator, load_tokenizer, read_card
from playground.data.batches import BatchConfig
from playground.data.library import Library, LibraryClip, write_library
from playground.errors import PlaygroundError
from playground.tokenizers.transformer import TrainingOutput
from playground.training import configs, run
from playground.training.configs import GeneratorTraining, Schedule, TokenizerTraining, rate_at, with_steps
from playground.training.loop import Launch
from playground.training.tokenizer import tokenizer_loss
from tests.conftest import drifting
from tests.tiny import TINY, TINY_GENERATOR

PLAN = Schedule(steps=6, rate=1e-3, warmup=2, save_every=3, validate_every=3)
BATCH = BatchConfig(size=4, shortest=16, bucket=2, speed=0.5)
CPU = Launch(accelerator="cpu", precision="32-true")


@pytest.fixture
def library(tmp_path) -> Path:
    clips = []
    for n in range(8):
        split, joints = ("val" if n == 5 else "train"), drifting(40 + n, n)
        clips.append(LibraryClip(f"clip{n}", "AB"[n % 3 == 0], split, "walk", ("walks left",), joints))
    write_library(tmp_path / "library", clips, "tiny library")
    return tmp_path / "library"


@pytest.fixture
def runs(monkeypatch):
    """Two runs of tiny models under the names `tiny-tokenizer` and `tiny-generator`."""
    tokenizer = TokenizerTraining(replace(TINY, dropout=0.1, max_frames=196), BATCH, PLAN, synthetic=0.0)
    generator = GeneratorTraining(
        replace(TINY_GENERATOR, dropout=0.1, lengths=49),
        "tiny-tokenizer",
        BATCH,
        PLAN,
        size=4,
        variants=2,
        synthetic=0.0,
    )
    monkeypatch.setitem(configs.TOKENIZERS, "tiny-tokenizer", tokenizer)
    monkeypatch.setitem(configs.GENERATORS, "tiny-generator", generator)


def losses(name: str, library: Path, out: Path, **options) -> list[float]:
    seen: list[float] = []
    run.train(name, library, out, launch=CPU, on_step=lambda step, loss: seen.append(loss), **options)
    return seen


def stop_after(count: int):
    def on_step(step: int, loss: float) -> None:
        if step + 1 == count:
            raise KeyboardInterrupt

    return on_step


@pytest.mark.parametrize("name", ["tiny-tokenizer", "tiny-generator"])
def test_a_run_killed_and_resumed_has_the_losses_of_one_that_never_stopped(library, tmp_path, runs, name):
    if name == "tiny-generator":
        for out in ("whole", "broken"):
            losses("tiny-tokenizer", library, tmp_path / out)
    whole = losses(name, library, tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        run.train(name, library, tmp_path / "broken", launch=CPU, on_step=stop_after(5))
    with pytest.raises(PlaygroundError, match="--resume"):
        run.train(name, library, tmp_path / "broken", launch=CPU)
    rest = losses(name, library, tmp_path / "broken", resume=True)
    assert len(whole) == 6 and rest == whole[3:]


def test_checkpoints_describe_themselves_and_load(library, tmp_path, runs):
    losses("tiny-tokenizer", library, tmp_path / "out")
    losses("tiny-generator", library, tmp_path / "out")
    path = tmp_path / "out" / "tokenizer" / "checkpoint.safetensors"
    model, card = load_tokenizer(path)
    assert card.data == "tiny library" and card.facts["step"] == 6 and card.encoder.name == "minilm"
    assert card.config == replace(TINY, dropout=0.1, max_frames=196, text_width=384)
    assert "mpjpe_mm_source_mean" in card.facts["validation"][-1]
    normaliser = Library.open(library).normaliser
    np.testing.assert_allclose(card.normaliser.mean, normaliser.mean)
    assert not model.training and not any(p.requires_grad for p in model.parameters())
    network, generator_card = load_generator(tmp_path / "out" / "generator" / "checkpoint.safetensors")
    assert generator_card.facts["tokenizer"] == card.hash[:12] and network.config.scales == TINY.scales
    with pytest.raises(PlaygroundError, match="is no generator checkpoint but one of kind tokenizer"):
        load_generator(path)


def test_broken_checkpoints_are_one_sentence(tmp_path, library, runs):
    losses("tiny-tokenizer", library, tmp_path / "out")
    good = (tmp_path / "out" / "tokenizer" / "checkpoint.safetensors").read_bytes()
    for name, data in {"empty": b"", "cut": good[: len(good) // 2], "noise": bytes(range(256)) * 8}.items():
        path = tmp_path / f"{name}.safetensors"
        path.write_bytes(data)
        with pytest.raises(PlaygroundError, match="not a checkpoint"):
            read_card(path)
    with pytest.raises(PlaygroundError, match="not a checkpoint"):
        read_card(tmp_path / "absent.safetensors")


def test_unknown_names_and_missing_tokenizers_are_refused(library, tmp_path, runs):
    with pytest.raises(PlaygroundError, match="known are"):
        run.train("nothing", library, tmp_path / "out")
    with pytest.raises(PlaygroundError, match="train tiny-tokenizer into the same folder first"):
        run.train("tiny-generator", library, tmp_path / "out")
    with pytest.raises(PlaygroundError, match="at least 1 step"):
        run.train("tiny-tokenizer", library, tmp_path / "out", steps=0)


# ---- numbers ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("masked", [True, False])
@pytest.mark.parametrize("heading", [0.0, 0.3])
def test_loss_equals_a_loop(masked, heading):
    torch.manual_seed(0)
    config = TokenizerTraining(TINY, masked_mean=masked, heading=heading)
    lengths = torch.tensor([6, 3])
    truth, guess = torch.randn(2, 6, 67), torch.randn(2, 6, 67)
    truth[1, 3:] = guess[1, 3:] = 0
    total, drift = 0.0, 0.0
    for b, length in enumerate([6, 3]):
        turned = 0.0
        for f in range(length):
            total += float(F.smooth_l1_loss(guess[b, f], truth[b, f]))
            turned += float(guess[b, f, 0] - truth[b, f, 0])
            yaw = 2 * turned * 0.0128 / 0.4
            drift += 0.5 * yaw**2 if abs(yaw) < 1 else abs(yaw) - 0.5
    expected = total / (9 if masked else 12) + heading * drift / 9 + 0.02 * 0.7
    loss = tokenizer_loss(TrainingOutput(guess, torch.tensor(0.7), ()), truth, lengths, config, 0.0128, 9.0)
    assert float(loss) == pytest.approx(expected, rel=1e-5)


def test_learning_rate_warms_up_stays_and_falls():
    plan = Schedule(steps=100, rate=1.0, warmup=10, fall=0.3, floor=0.05)
    rates = [rate_at(step, plan) for step in range(100)]
    assert rates[0] == pytest.approx(0.1) and rates[9] == rates[60] == 1.0
    assert rates[99] == pytest.approx(1 - 0.95 * 29 / 30) and rates[70:] == sorted(rates[70:], reverse=True)
    assert with_steps(plan, None) is plan and with_steps(plan, 7).steps == 7


def test_facts_of_a_run_are_written(library, tmp_path, runs):
    losses("tiny-tokenizer", library, tmp_path / "out")
    facts = json.loads((tmp_path / "out" / "tokenizer" / "facts.json").read_text())
    assert facts["step"] == 6 and [entry["step"] for entry in facts["validation"]] == [3, 6]
