"""The refit of a detokenizer: tokens stay the same, the detokenizer alone moves, drawn tokens keep what is true."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from playground.checkpoints import load_generator, load_tokenizer
from playground.data.batches import BatchConfig, BatchSource, library_samples
from playground.data.library import Library, LibraryClip, write_library
from playground.errors import PlaygroundError
from playground.generators.scalewise import ScalewiseGenerator
from playground.text.encoders import load_encoder
from playground.text.store import FeatureStore
from playground.training import configs, run
from playground.training.configs import GeneratorTraining, RefitTraining, Schedule, TokenizerTraining
from playground.training.loop import Launch
from playground.training.refit import REFIT, build_refit_bank, velocity_loss
from playground.training.tokenizer import JUMP, jump_loss
from tests.conftest import drifting
from tests.tiny import TINY, TINY_GENERATOR

PLAN = Schedule(steps=3, rate=1e-2, warmup=1, save_every=3, validate_every=3)
BATCH = BatchConfig(size=4, shortest=16, bucket=2)
CPU = Launch(accelerator="cpu", precision="32-true")


@pytest.fixture
def trained(tmp_path, monkeypatch) -> tuple[Path, Path]:
    """A library, and a folder with a tokenizer, a generator and the refit of both, all tiny."""
    clips = [
        LibraryClip(f"clip{n}", "A", "val" if n == 5 else "train", "walk", ("walks left",), drifting(40 + n, n))
        for n in range(8)
    ]
    write_library(tmp_path / "library", clips, "tiny library")
    tokenizer = TokenizerTraining(replace(TINY, max_frames=196), BATCH, PLAN, synthetic=0.0)
    generator = GeneratorTraining(
        replace(TINY_GENERATOR, lengths=49), "tiny-tokenizer", BATCH, PLAN, size=4, variants=1, synthetic=0.0
    )
    refit = RefitTraining(tokenizer, BATCH, PLAN, synthetic=0.0, true_scales=1)
    monkeypatch.setitem(configs.TOKENIZERS, "tiny-tokenizer", tokenizer)
    monkeypatch.setitem(configs.GENERATORS, "tiny-generator", generator)
    monkeypatch.setitem(configs.REFITS, "tiny-refit", refit)
    with pytest.raises(PlaygroundError, match="train both there first"):
        run.train("tiny-refit", tmp_path / "library", tmp_path / "out", launch=CPU)
    for name in ("tiny-tokenizer", "tiny-generator", "tiny-refit"):
        run.train(name, tmp_path / "library", tmp_path / "out", launch=CPU)
    return tmp_path / "library", tmp_path / "out"


def test_only_the_detokenizer_moves_and_the_pair_belongs_together(trained):
    _, out = trained
    before, after = (load_file(out / part / "checkpoint.safetensors") for part in ("tokenizer", "refit/tokenizer"))
    assert before.keys() == after.keys()
    moved = {name for name in before if not torch.equal(before[name], after[name])}
    assert moved and all(name.removeprefix("model.").split(".")[0] in REFIT for name in moved)
    _, old = load_tokenizer(out / "tokenizer" / "checkpoint.safetensors")
    _, card = load_tokenizer(out / "refit" / "tokenizer" / "checkpoint.safetensors")
    assert len(card.facts["refit"]) == 1
    assert card.facts["refit"][0]["from"] == old.hash[:12] and card.facts["refit"][0]["step"] == 3
    assert card.facts["step"] == old.facts["step"] and card.facts["validation"] != old.facts["validation"]
    _, generator = load_generator(out / "refit" / "generator" / "checkpoint.safetensors")
    assert generator.facts["tokenizer"] == card.hash[:12]
    same = load_file(out / "generator" / "checkpoint.safetensors")
    copied = load_file(out / "refit" / "generator" / "checkpoint.safetensors")
    assert all(torch.equal(same[name], copied[name]) for name in same)


def test_a_refit_can_add_convolutions_between_patches(trained, monkeypatch):
    path, out = trained
    monkeypatch.setitem(configs.REFITS, "tiny-refit", replace(configs.REFITS["tiny-refit"], seam=6))
    before, _ = load_tokenizer(out / "refit" / "tokenizer" / "checkpoint.safetensors")
    shutil.rmtree(out / "refit")
    run.train("tiny-refit", path, out, launch=CPU)
    after, card = load_tokenizer(out / "refit" / "tokenizer" / "checkpoint.safetensors")
    assert card.config == replace(before.config, seam=6)
    assert any(weight.abs().sum() > 0 for weight in after.seams.layers[-1].parameters())  # no longer nothing
    features, lengths = torch.randn(2, 40, TINY.columns), torch.tensor([40, 37])
    ids = [model.encode(features, lengths, None).tokens.ids for model in (before, after)]
    assert all(torch.equal(a, b) for a, b in zip(*ids, strict=True))


def test_drawn_tokens_are_true_up_to_a_scale_and_possible_after_it(trained):
    path, out = trained
    library = Library.open(path)
    tokenizer, _ = load_tokenizer(out / "tokenizer" / "checkpoint.safetensors")
    network, _ = load_generator(out / "generator" / "checkpoint.safetensors")
    source = BatchSource(library_samples(library, "train"), library.normaliser, BATCH, seed=3)
    store = FeatureStore.cached(path, [*source.captions(), ""], load_encoder("minilm"))
    config = replace(configs.REFITS["tiny-refit"], variants=3)
    bank = build_refit_bank(ScalewiseGenerator(network, tokenizer.quantizer), tokenizer, source, store, config)
    assert bank.true.shape == bank.drawn.shape == (21, sum(TINY.scales))
    assert bank.weights.sum() == pytest.approx(1.0)
    edges = np.cumsum((0, *TINY.scales))
    for row in range(21):
        batch = source.fill(bank.cuts.take(slice(row, row + 1)))
        tokens = tokenizer.encode(batch.features, batch.lengths, store.lookup(batch.captions)).tokens
        assert torch.cat(tokens.ids, dim=1)[0].tolist() == bank.true[row].tolist()
        differs = [
            not np.array_equal(bank.true[row, a:b], bank.drawn[row, a:b])
            for a, b in zip(edges, edges[1:], strict=False)
        ]
        assert not differs[0]  # true_scales = 1
    for level, (a, b) in enumerate(zip(edges, edges[1:], strict=False)):
        assert bank.drawn[:, a:b].min() >= 0 and bank.drawn[:, a:b].max() < TINY.codes[level]
    assert (bank.true != bank.drawn).any()


def test_the_velocity_loss_is_that_of_a_loop():
    rng = torch.Generator().manual_seed(1)
    out, features = (torch.randn(3, 7, 5, generator=rng) * 2 for _ in range(2))
    lengths = torch.tensor([7, 4, 1])
    total = 0.0
    for row, length in enumerate(lengths.tolist()):
        for frame in range(1, length):
            part = 0.0
            for column in range(5):
                made = out[row, frame, column] - out[row, frame - 1, column]
                error = abs(float(made - (features[row, frame, column] - features[row, frame - 1, column])))
                part += 0.5 * error**2 if error < 1 else error - 0.5
            total += part / 5
    assert float(velocity_loss(out, features, lengths, 12.0)) == pytest.approx(total / 12.0, rel=1e-5)


def test_the_loss_on_jumps_is_that_of_a_loop():
    rng = torch.Generator().manual_seed(2)
    out, features = (torch.randn(3, 7, 5, generator=rng) * scale for scale in (0.01, 0.02))
    lengths = torch.tensor([7, 4, 2])  # two rows have no second difference
    total = 0.0
    for row, length in enumerate(lengths.tolist()):
        for frame in range(2, length):
            for column in range(5):
                made, real = (rows[row, frame - 2 : frame + 1, column].tolist() for rows in (out, features))
                error = abs(made[2] - 2 * made[1] + made[0] - (real[2] - 2 * real[1] + real[0]))
                total += (0.5 * error**2 / JUMP if error < JUMP else error - 0.5 * JUMP) / 5
    assert float(jump_loss(out, features, lengths, 12.0)) == pytest.approx(total / 12.0, rel=1e-5)
    moved = out + torch.linspace(0.0, 3.0, 7)[:, None]  # steadily away from the truth: no jump
    assert float(jump_loss(moved, out, lengths, 12.0)) == pytest.approx(0.0, abs=1e-6)
