"""Training the root refiner: what its input suffers, that the error falls, resuming, what is written."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from playground.checkpoints import load_model
from playground.data.batches import BatchConfig
from playground.data.library import Library, LibraryClip, write_library
from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.generators.refiner import ROOT, RefinerConfig, RootRefiner, build_refiner
from playground.motion.measures import foot_sliding
from playground.motion.representation import from_features67, to_features67
from playground.motion.synthetic import corpus
from playground.training import configs, run, ship
from playground.training.configs import RefinerTraining, Schedule
from playground.training.loop import Launch
from playground.training.refiner import perturbed, root_figures, smoothed

CPU = Launch(accelerator="cpu", precision="32-true")
BATCH = BatchConfig(size=8, shortest=16, bucket=2)
PLAN = Schedule(steps=60, rate=3e-3, warmup=5, save_every=20, validate_every=30, clip=1.0)
TRAINING = RefinerTraining(RefinerConfig(width=24, blocks=2), BATCH, PLAN, synthetic=0.0)


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("refiner") / "library"
    clips = [
        LibraryClip(
            f"clip{n}", "A", "val" if n % 4 == 3 else "train", one.action, tuple(one.captions), one.motion.joints
        )
        for n, one in enumerate(corpus(16, seed=5))
    ]
    write_library(folder, clips, "tiny library")
    return folder


def train(library: Path, out: Path, *, resume: bool = False, stop: int | None = None) -> list[float]:
    seen: list[float] = []

    def on_step(step: int, loss: float) -> None:
        seen.append(loss)
        if step + 1 == stop:
            raise KeyboardInterrupt

    run.train("tiny-refiner", library, out, launch=CPU, on_step=on_step, resume=resume)
    return seen


def shipped(out: Path):
    return load_model(out / "refiner" / "checkpoint.safetensors", "refiner", RefinerConfig, build_refiner)


def test_a_few_dozen_steps_lower_the_error_and_a_killed_run_goes_on_as_if_it_had_not_been(
    library, tmp_path, monkeypatch
):
    monkeypatch.setitem(configs.REFINERS, "tiny-refiner", TRAINING)
    whole = train(library, tmp_path / "whole")
    assert np.mean(whole[-10:]) < 0.6 * np.mean(whole[:5])
    with pytest.raises(KeyboardInterrupt):
        train(library, tmp_path / "cut", stop=45)
    again = train(library, tmp_path / "cut", resume=True)
    assert again == whole[40:]
    first, second = (load_file(tmp_path / name / "refiner" / "checkpoint.safetensors") for name in ("whole", "cut"))
    assert first.keys() == second.keys() and all(torch.equal(first[name], second[name]) for name in first)

    network, card = shipped(tmp_path / "whole")
    assert isinstance(network, RootRefiner) and card.encoder.name == "none" and card.facts["step"] == 60
    (last,) = card.facts["validation"]
    opened = Library.open(library)
    figures, normaliser = [], card.normaliser
    for clip in opened.split("val"):
        rows = opened.features(clip)[:196]
        rows = rows[: len(rows) // 4 * 4]
        root = network(torch.from_numpy(normaliser.apply(rows))[None], torch.tensor([len(rows)]))[0].numpy()
        said = root * normaliser.std[:3] + normaliser.mean[:3]
        figures.append(root_figures(rows, np.concatenate([said, rows[:, 3:]], axis=1)))
    for key, value in figures[0].items():
        mean = np.nanmean([figure[key] for figure in figures])
        assert last[f"val_{key}"] == pytest.approx(mean, rel=0.05, abs=0.05), (key, value)  # half precision on disk


def test_shipping_puts_it_where_the_engine_looks(library, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(configs.REFINERS, "tiny-refiner", replace(TRAINING, schedule=replace(PLAN, steps=1)))
    assets = tmp_path / "assets"
    with pytest.raises(PlaygroundError, match="train root-refiner into"):
        ship.ship_refiner(tmp_path / "out", assets)
    train(library, tmp_path / "out")
    assert not Engine(assets).refines
    assert ship.main([str(tmp_path / "out"), "--refiner", "--assets", str(assets)]) == 0
    assert "step 1" in capsys.readouterr().out and Engine(assets).refines
    assert Engine(assets).refiner().checkpoint == shipped(tmp_path / "out")[1].hash[:12]
    saved = tmp_path / "out" / "refiner" / "checkpoint.safetensors"
    with safe_open(saved, framework="pt") as file:
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        metadata = file.metadata()
    save_file({name: value.float() for name, value in tensors.items()}, saved, metadata)
    with pytest.raises(PlaygroundError, match="is shipped is float16"):
        ship.ship_refiner(tmp_path / "out", assets)


def test_root_figures_are_those_of_the_recovered_motion():
    rows = to_features67(corpus(1, seed=3)[0].motion.joints)[:40]
    assert root_figures(rows, rows)["velocity_mm"] == root_figures(rows, rows)["heading_degrees"] == 0.0
    wrong = rows.copy()
    wrong[:, 0] += np.radians(0.5)
    wrong[:, 1] += 0.003
    wrong[:, 2] -= 0.004
    figures = root_figures(rows, wrong)
    assert figures["velocity_mm"] == pytest.approx(5.0, rel=1e-3)
    assert figures["heading_degrees"] == pytest.approx(40.0, rel=1e-3)
    assert figures["sliding_true"] == pytest.approx(foot_sliding(from_features67(rows)))
    assert figures["sliding"] == pytest.approx(foot_sliding(from_features67(wrong)))


def test_smoothing_is_that_of_a_loop_and_ends_where_the_motion_ends():
    rng = np.random.default_rng(0)
    lengths, times = [7, 4, 1], [2, 1, 3]
    x = rng.standard_normal((3, 7, 2)).astype(np.float32)
    found = smoothed(torch.from_numpy(x), torch.tensor(lengths), torch.tensor(times)).numpy()
    for row, (length, count) in enumerate(zip(lengths, times, strict=True)):
        own = x[row, :length].astype(np.float64)
        for _ in range(count):
            padded = np.concatenate([own[:1], own, own[-1:]])
            own = np.stack([0.25 * padded[n] + 0.5 * padded[n + 1] + 0.25 * padded[n + 2] for n in range(length)])
        np.testing.assert_allclose(found[row, :length], own, atol=1e-6)


def test_what_is_perturbed_is_the_body_alone_and_the_same_for_the_same_seed():
    features = torch.randn(40, 24, 67, generator=torch.Generator().manual_seed(0))
    lengths = torch.full((40,), 24)
    lengths[0] = 9
    one, same = (perturbed(features, lengths, TRAINING, torch.Generator().manual_seed(1)) for _ in range(2))
    assert torch.equal(one, same)
    assert torch.equal(one[..., :ROOT], features[..., :ROOT]) and torch.equal(one[0, 9:], features[0, 9:])
    changed = (one != features).any(dim=2).any(dim=1)
    assert 0 < int((~changed).sum()) < 25  # a quarter is shown as it is
    nobody = replace(TRAINING, true=1.0)
    assert torch.equal(perturbed(features, lengths, nobody, torch.Generator().manual_seed(1)), features)
    calm = replace(TRAINING, true=0.0, smoothing=0, tremble=0.0, drift=0.0)
    torch.testing.assert_close(perturbed(features, lengths, calm, torch.Generator().manual_seed(1)), features)
