"""Training evaluators: losses against slow formulas, resume, and what is shipped."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.nn import functional as F

from playground.data.batches import BatchConfig
from playground.data.library import Library, LibraryClip, write_library
from playground.errors import PlaygroundError
from playground.evaluation.evaluators import open_evaluator
from playground.evaluation.networks import Gaussian
from playground.motion.representation import Normaliser
from playground.training import configs, run
from playground.training.configs import EvaluatorTraining, Schedule
from playground.training.evaluator import contrast, divergence, four_divergences, gathered, reconstruction_loss, shared
from playground.training.loop import Launch
from tests.evaluation.tiny import TINY_EVALUATOR, moving

PLAN = Schedule(steps=4, rate=1e-3, warmup=2, save_every=2, validate_every=2)
BATCH = BatchConfig(size=4, shortest=16, bucket=2)
CPU = Launch(accelerator="cpu", precision="32-true")
KINDS = ["tmr", "clip"]


def gaussians(seed: int) -> Gaussian:
    rng = torch.Generator().manual_seed(seed)
    return Gaussian(torch.randn(3, 5, generator=rng), torch.randn(3, 5, generator=rng))


def test_divergence_equals_that_of_torch_distributions():
    q, p = gaussians(0), gaussians(1)
    normals = [torch.distributions.Normal(g.mean, (g.log_variance / 2).exp()) for g in (q, p)]
    expected = torch.distributions.kl_divergence(*normals).mean()
    torch.testing.assert_close(divergence(q, p), expected)
    assert float(divergence(q, q)) == pytest.approx(0.0, abs=1e-7)
    unit = torch.distributions.Normal(torch.zeros(3, 5), torch.ones(3, 5))
    pairs = [(normals[1], normals[0]), (normals[0], normals[1]), (normals[0], unit), (normals[1], unit)]
    total = sum(float(torch.distributions.kl_divergence(*pair).mean()) for pair in pairs)
    assert float(four_divergences(q, p)) == pytest.approx(total, rel=1e-5)


@pytest.mark.parametrize("scale", [1.0, 10.0])
def test_contrast_equals_a_loop_over_pairs(scale):
    rng = np.random.default_rng(0)
    motions, texts = rng.standard_normal((2, 5, 7))
    alike = np.zeros((5, 5), bool)
    alike[0, 3] = alike[3, 0] = alike[2, 2] = True
    total, nearest = 0.0, 0
    for i in range(5):
        cosine = [texts[i] @ motions[j] / np.linalg.norm(texts[i]) / np.linalg.norm(motions[j]) for j in range(5)]
        other = [texts[j] @ motions[i] / np.linalg.norm(texts[j]) / np.linalg.norm(motions[i]) for j in range(5)]
        rivals = [j for j in range(5) if j == i or not alike[i, j]]
        for row in (cosine, other):
            total -= math.log(math.exp(scale * row[i]) / sum(math.exp(scale * row[j]) for j in rivals)) / 10
        nearest += max(rivals, key=lambda j, row=cosine: row[j]) == i
    loss, right = contrast(torch.tensor(motions), torch.tensor(texts), scale, torch.tensor(alike))
    assert float(loss) == pytest.approx(total, rel=1e-9) and float(right) == pytest.approx(nearest / 5)


def test_captions_that_are_alike_leave_no_gradient_between_them():
    motions = torch.randn(2, 4, generator=torch.Generator().manual_seed(0)).requires_grad_()
    loss, right = contrast(motions, torch.ones(2, 4), 10.0, torch.ones(2, 2, dtype=torch.bool))
    loss.backward()
    assert loss.item() == 0.0 and motions.grad.abs().max() == 0.0 and float(right) == 1.0


def test_reconstruction_equals_a_loop_over_frames():
    rng = torch.Generator().manual_seed(0)
    lengths, features = torch.tensor([6, 3]), torch.randn(2, 8, 67, generator=rng)
    decoded = torch.randn(4, 6, 67, generator=rng)
    total = 0.0
    for row in range(4):
        for frame in range(int(lengths[row % 2])):
            total += float(F.smooth_l1_loss(decoded[row, frame], features[row % 2, frame]))
    assert float(reconstruction_loss(decoded, features, lengths, 9.0)) == pytest.approx(total / 9, rel=1e-5)


def test_one_process_gathers_itself():
    rows = torch.ones(2, 3, requires_grad=True)
    assert gathered(rows) is rows and shared(rows.sum()).item() == 6.0


# ---- runs ---------------------------------------------------------------------------------------------------------


@pytest.fixture
def library(tmp_path) -> Path:
    clips = []
    for n in range(44):
        split = "train" if n < 6 else "val" if n < 10 else "test"
        clips.append(LibraryClip(f"c{n}", "A", split, "walk", (f"walks left {n}",), moving(24 + n % 5, n)))
    write_library(tmp_path / "library", clips, "tiny library")
    return tmp_path / "library"


@pytest.fixture(params=KINDS)
def kind(request, monkeypatch) -> str:
    """A run of a tiny network under the name `tiny-evaluator`."""
    model = replace(TINY_EVALUATOR, kind=request.param, dropout=0.1)
    monkeypatch.setitem(configs.EVALUATORS, "tiny-evaluator", EvaluatorTraining(model, BATCH, PLAN))
    return request.param


def losses(library: Path, out: Path, **options) -> list[float]:
    seen: list[float] = []

    def on_step(step: int, loss: float) -> None:
        seen.append(loss)
        if step + 1 == options.get("stop"):
            raise KeyboardInterrupt

    run.train("tiny-evaluator", library, out, launch=CPU, on_step=on_step, resume=options.get("resume", False))
    return seen


def test_a_run_killed_and_resumed_has_the_losses_of_one_that_never_stopped(library, tmp_path, kind):
    whole = losses(library, tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        losses(library, tmp_path / "broken", stop=3)
    with pytest.raises(PlaygroundError, match="--resume"):
        losses(library, tmp_path / "broken")
    assert len(whole) == 4 and losses(library, tmp_path / "broken", resume=True) == whole[2:]
    evaluator, card = open_evaluator(tmp_path / "whole" / kind / "checkpoint.safetensors", kind)
    assert card.data == "tiny library" and card.facts["step"] == 4 and card.facts["batch"] == 4
    assert card.facts["split"] == "test" and card.facts["seed"] == 0
    assert card.facts["retrieval"]["n"] == 34 and set(card.facts["retrieval"]) == {"n", "repeats", "seed", "pool32"}
    assert evaluator.embed_texts(["walks left 3"]).shape == (1, 12)
    opened = Library.open(library)
    rows = np.concatenate([opened.features(i) for i in opened.split("train")])
    np.testing.assert_allclose(card.normaliser.std, rows.std(axis=0), rtol=1e-4)
    assert isinstance(card.normaliser, Normaliser) and card.config == replace(
        TINY_EVALUATOR, kind=kind, dropout=0.1, text_width=384
    )


@pytest.mark.parametrize("size", [2, 6])
def test_the_size_of_the_contrastive_batch_is_a_number_of_the_run(library, size):
    opened = Library.open(library)
    config = EvaluatorTraining(TINY_EVALUATOR, replace(BATCH, size=size), PLAN)
    batch = run.training_batches(opened, config, opened.normaliser).batch(0)
    assert len(batch.features) == len(batch.captions) == size
