"""The engine's verb for the root: the body and the tokens stay, the way over the ground is the network's."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from playground.engine.refining import ABSENT, SHARE, open_refiner, refiner_path
from playground.errors import PlaygroundError
from playground.motion.representation import from_features67
from tests.tiny import tiny_refiner


@pytest.fixture
def refining(engine):
    """The tiny engine with a refiner, which is gone afterwards, and its network."""
    normaliser = engine.runtime("lgtok").normaliser
    network = tiny_refiner(engine.assets, replace(normaliser, mean=normaliser.mean + 0.01, std=normaliser.std * 2))
    yield engine, network
    refiner_path(engine.assets).unlink()


def test_without_a_checkpoint_it_says_so_in_one_sentence(engine, generation):
    assert not engine.refines
    with pytest.raises(PlaygroundError, match="no root refiner is shipped") as told:
        engine.refine(generation)
    assert str(told.value) == ABSENT


def test_the_body_and_the_tokens_stay_and_the_root_is_what_the_network_says(refining, generation):
    engine, network = refining
    assert engine.refines and generation.refiner == ""
    before = generation.features.copy()
    made = engine.refine(generation)
    assert made.levels is generation.levels and np.array_equal(generation.features, before)
    assert made.refiner == engine.refiner().checkpoint and made.prompt == generation.prompt

    runtime, own = engine.runtime("lgtok"), engine.refiner().normaliser
    rows, changed = (runtime.normaliser.invert(one.features) for one in (generation, made))
    np.testing.assert_allclose(np.delete(changed, (1, 2), axis=1), np.delete(rows, (1, 2), axis=1), atol=1e-5)
    seen = torch.from_numpy(own.apply(rows))[None]
    root = network(seen, torch.tensor([len(rows)]))[0, :, 1:].numpy() * own.std[1:3] + own.mean[1:3]
    np.testing.assert_allclose(changed[:, 1:3], (1 - SHARE) * rows[:, 1:3] + SHARE * root, atol=1e-5)
    np.testing.assert_allclose(made.motion.joints, from_features67(changed), atol=1e-3)
    assert engine.refine(made) is made


def test_motions_of_several_lengths_are_each_what_they_are_alone(refining):
    engine, _ = refining
    refiner, rng = engine.refiner(), np.random.default_rng(0)
    motions = [rng.standard_normal((frames, 67)).astype(np.float32) for frames in (16, 5, 40)]
    for one, found in zip(motions, refiner.rows(motions), strict=True):
        (alone,) = refiner.rows([one])
        assert found.dtype == np.float32
        assert np.array_equal(np.delete(found, (1, 2), axis=1), np.delete(one, (1, 2), axis=1))
        np.testing.assert_allclose(found, alone, atol=1e-5)


def test_a_file_of_another_kind_is_refused(refining):
    engine, _ = refining
    path = refiner_path(engine.assets)
    path.write_bytes((engine.assets / "checkpoints" / "lgtok" / "tokenizer.safetensors").read_bytes())
    with pytest.raises(PlaygroundError, match="no refiner checkpoint"):
        open_refiner(engine.assets)
