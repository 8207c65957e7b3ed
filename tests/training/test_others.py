"""Trainings of the other papers' systems: the table, runs that are stopped and go on, losses, lent tokenizers."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from playground.checkpoints import Card, load_generator, read_card, save_checkpoint
from playground.data.batches import BatchConfig, BatchSource, library_samples
from playground.data.library import Library, LibraryClip, write_library
from playground.errors import PlaygroundError
from playground.motion.representation import Normaliser
from playground.systems import SYSTEMS, checkpoint_path
from playground.text.encoders import identify, load_encoder
from playground.text.store import FeatureStore
from playground.tokenizers.base import TrainingOutput
from playground.training import ship
from playground.training.configs import FeatureTraining, GeneratorTraining, Schedule, TokenizerTraining
from playground.training.generator import build_bank
from playground.training.loop import Launch
from playground.training.others import OTHERS
from playground.training.queue import Job
from playground.training.run import Order, run_training, tokenizer_of
from playground.training.tokenizer import tokenizer_loss
from playground.training.train_others import main, other_jobs
from tests.conftest import drifting
from tests.tiny_systems import random_model, shrunk, tiny_system

PLAN = Schedule(steps=4, rate=1e-3, warmup=1, save_every=2, validate_every=4)
BATCH = BatchConfig(size=4, shortest=16, bucket=2)
CPU = Launch(accelerator="cpu", precision="32-true")
RUNS = (
    "t2mgpt-tokenizer", "mogo-tokenizer", "momask-generator", "momaskpp-cross-generator", "t2mgpt-casim-generator",
    "mogo-generator", "mosa-generator", "mdm-casim-decoder-generator",
)  # fmt: skip


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("data") / "library"
    clips = []
    for n in range(8):
        split, joints = ("val" if n == 5 else "train"), drifting(30 + 7 * n, n)
        clips.append(LibraryClip(f"clip{n}", "AB"[n % 2], split, "walk", ("walks left",), joints))
    write_library(folder, clips, "tiny library")
    return folder


def small(name: str) -> TokenizerTraining | GeneratorTraining | FeatureTraining:
    """A training of the table with next to no weights, motions and steps."""
    training = replace(OTHERS[name], model=shrunk(OTHERS[name].model), batch=BATCH, schedule=PLAN, synthetic=0.0)
    return replace(training, size=4, variants=2) if isinstance(training, GeneratorTraining) else training


def ordered(name: str, library: Path, out: Path, stop: int = 0, resume: bool = False) -> list[float]:
    """Losses of a run, stopped after so many steps."""
    seen: list[float] = []

    def on_step(step: int, loss: float) -> None:
        seen.append(loss)
        if step + 1 == stop:
            raise KeyboardInterrupt

    run_training(small(name), Order(library, out, resume, None, CPU, on_step))
    return seen


def write_tokenizer(path: Path, training: GeneratorTraining, library: Path) -> None:
    """A random tokenizer of the kind that a generator run needs."""
    model = random_model(shrunk(OTHERS[training.tokenizer].model), 1)
    card = Card("tokenizer", model.config, identify(load_encoder()), "tiny", {}, Library.open(library).normaliser)
    save_checkpoint(path, model, card)


def test_every_system_of_the_table_has_its_trainings():
    for name, row in SYSTEMS.items():
        if row.family == "lgtok":
            continue
        assert (f"{name}-generator" in OTHERS) and (f"{name}-tokenizer" in OTHERS) == (
            "tokenizer" in row.parts and not row.lends
        )
        training = OTHERS[f"{name}-generator"]
        if isinstance(training, GeneratorTraining):
            assert training.tokenizer == f"{row.lends or name}-tokenizer" and training.lent == bool(row.lends)
    assert {name.rsplit("-", 1)[0] for name in OTHERS} <= set(SYSTEMS)


@pytest.mark.parametrize("name", RUNS)
def test_a_stopped_run_goes_on_with_the_same_losses(library, tmp_path, name):
    training = OTHERS[name]
    for out in ("whole", "broken"):
        if isinstance(training, GeneratorTraining):
            system = training.tokenizer.removesuffix("-tokenizer") if training.lent else out
            write_tokenizer(tmp_path / system / "tokenizer" / "checkpoint.safetensors", training, library)
    whole = ordered(name, library, tmp_path / "whole")
    assert len(whole) == 4 and np.isfinite(whole).all()
    with pytest.raises(KeyboardInterrupt):
        ordered(name, library, tmp_path / "broken", stop=3)
    assert ordered(name, library, tmp_path / "broken", resume=True) == whole[2:]
    part = "tokenizer" if isinstance(training, TokenizerTraining) else "generator"
    card = read_card(tmp_path / "whole" / part / "checkpoint.safetensors")
    assert type(card.config) is type(training.model) and card.facts["step"] == 4
    assert (card.normaliser is None) == isinstance(training, GeneratorTraining)


def test_the_bank_knows_how_many_tokens_are_real(library, tmp_path):
    data, encoder = Library.open(library), load_encoder()
    source = BatchSource(library_samples(data, "train"), data.normaliser, BATCH, 0)
    store = FeatureStore.cached(library, [*source.captions(), ""], encoder)
    model = random_model(shrunk(OTHERS["momaskpp-tokenizer"].model), 1)
    bank = build_bank(model, source, store, 2, torch.device("cpu"))
    assert len(set(map(tuple, bank.counts.tolist()))) > 1
    starts = np.cumsum((0, *model.config.scales))
    for ids, counts, frames in zip(bank.ids, bank.counts, bank.lengths, strict=True):
        assert tuple(counts) == model.sizes(int(frames))
        for start, size, count in zip(starts, model.config.scales, counts, strict=False):
            assert not ids[start + count : start + size].any()


def test_joint_and_velocity_terms_are_those_of_a_loop():
    rng = np.random.default_rng(0)
    truth, guess = rng.normal(size=(2, 2, 6, 67)).astype(np.float32)
    lengths = [6, 4]
    for row, length in enumerate(lengths):
        truth[row, length:] = guess[row, length:] = 0
    base = TokenizerTraining(OTHERS["momask-tokenizer"].model, masked_mean=True)

    def loss(config: TokenizerTraining) -> float:
        out = TrainingOutput(torch.from_numpy(guess), torch.tensor(0.0), ())
        return float(tokenizer_loss(out, torch.from_numpy(truth), torch.tensor(lengths), config, 1.0, 10.0))

    def smooth(error: float) -> float:
        return 0.5 * error**2 if abs(error) < 1 else abs(error) - 0.5

    places = moves = 0.0
    for row, length in enumerate(lengths):
        for frame in range(length):
            places += np.mean([smooth(guess[row, frame, c] - truth[row, frame, c]) for c in range(4, 67)]) / 10
            if frame:
                step = (guess[row, frame] - guess[row, frame - 1]) - (truth[row, frame] - truth[row, frame - 1])
                moves += np.mean([smooth(error) for error in step]) / 10
    assert loss(replace(base, joints=0.5)) - loss(base) == pytest.approx(0.5 * places, rel=1e-4)
    assert loss(replace(base, velocity=0.5)) - loss(base) == pytest.approx(0.5 * moves, rel=1e-4)


def test_a_lent_tokenizer_is_looked_for_beside_and_among_the_shipped(library, tmp_path):
    training = OTHERS["momaskpp-cross-generator"]
    assert isinstance(training, GeneratorTraining)
    out, assets = tmp_path / "momaskpp-cross", tmp_path / "assets"
    job = Job("momaskpp-cross-generator", training, out)
    with pytest.raises(PlaygroundError, match="momaskpp-tokenizer into"):
        tokenizer_of(training, out, assets)
    write_tokenizer(checkpoint_path(assets, "momaskpp", "tokenizer"), training, library)
    assert tokenizer_of(training, out, assets) == checkpoint_path(assets, "momaskpp", "tokenizer")
    beside = tmp_path / "momaskpp" / "tokenizer" / "checkpoint.safetensors"
    write_tokenizer(beside, training, library)
    assert tokenizer_of(training, out, assets) == beside and job.ready
    assert [one.name for one in other_jobs(tmp_path)] == list(OTHERS)


def test_shipping_a_generator_on_a_lent_tokenizer_and_one_without(tmp_path):
    normaliser = Normaliser(np.zeros(67, np.float32), np.ones(67, np.float32))
    made, assets = tmp_path / "made", tmp_path / "assets"
    for name in ("momaskpp-cross", "mdm"):
        tiny_system(made, name, normaliser)
        run = tmp_path / name / "generator" / "checkpoint.safetensors"
        run.parent.mkdir(parents=True)
        run.write_bytes(checkpoint_path(made, name, "generator").read_bytes())
    with pytest.raises(PlaygroundError, match="ship the system that lends it first"):
        ship.ship(tmp_path / "momaskpp-cross", "momaskpp-cross", assets)
    lent = checkpoint_path(assets, "momaskpp", "tokenizer")
    lent.parent.mkdir(parents=True)
    lent.write_bytes(checkpoint_path(made, "momaskpp", "tokenizer").read_bytes())
    for name in ("momaskpp-cross", "mdm"):
        ship.ship(tmp_path / name, name, assets)
        assert load_generator(checkpoint_path(assets, name, "generator"))[1].data == "tiny"
    assert sorted(path.name for path in (assets / "checkpoints").rglob("*")) == [
        "generator.safetensors", "generator.safetensors", "mdm", "momaskpp", "momaskpp-cross", "tokenizer.safetensors",
    ]  # fmt: skip


def test_the_command_lists_what_is_left(tmp_path, capsys):
    assert main(["--list", "--out", str(tmp_path), "--only", "mdm-generator"]) == 0
    assert "mdm-generator                not begun" in capsys.readouterr().out
    assert main(["--library", str(tmp_path)]) == 2
