"""The evaluator networks: padding is invisible, every real row counts, shapes and refusals."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from playground.evaluation.networks import EvaluatorConfig, Gaussian, build_evaluator, patches
from tests.evaluation.tiny import invented_states, tiny_network
from tests.tiny import text_features

KINDS = ["tmr", "clip"]


def motions(*lengths: int, padded: int = 0, filler: float = 0.0, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    rng = torch.Generator().manual_seed(seed)
    out = torch.full((len(lengths), max(lengths) + padded, 67), filler)
    for row, length in enumerate(lengths):
        out[row, :length] = torch.randn(length, 67, generator=rng)
    return out, torch.tensor(lengths)


@given(st.lists(st.integers(1, 30), min_size=1, max_size=4), st.integers(1, 6), st.integers(0, 9))
def test_patches_equal_a_loop(lengths, patch, padded):
    features, counts = motions(*lengths, padded=padded, filler=7.0)
    tokens, mask = patches(features, counts, patch)
    for row, length in enumerate(lengths):
        used = -(-length // patch)
        real = torch.ones(tokens.shape[1], dtype=torch.bool) if mask is None else mask[row]
        assert real.tolist() == [i < used for i in range(tokens.shape[1])]
        for frame in range(used * patch):
            cell = tokens[row, frame // patch, frame % patch * 67 : (frame % patch + 1) * 67]
            expected = features[row, frame] if frame < length else torch.zeros(67)
            assert torch.equal(cell, expected)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lengths", [(5,), (16, 3), (21, 20, 1), (196, 40)])
def test_padding_and_neighbours_never_change_a_motion_embedding(kind, lengths):
    network = tiny_network(kind)
    features, counts = motions(*lengths)
    together = network.embed_motion(features, counts)
    wider = torch.cat([features, torch.full((len(lengths), 13, 67), 99.0)], dim=1)
    for row, length in enumerate(lengths):
        wider[row, length:] = torch.inf if length % 2 else 1e4
    torch.testing.assert_close(network.embed_motion(torch.nan_to_num(wider), counts), together, atol=2e-5, rtol=1e-4)
    for row, length in enumerate(lengths):
        alone = network.embed_motion(features[row : row + 1, :length], counts[row : row + 1])
        torch.testing.assert_close(alone[0], together[row], atol=2e-5, rtol=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_padding_and_neighbours_never_change_a_text_embedding(kind):
    network = tiny_network(kind)
    texts = ["one", "two words", "and a text of many more words than that"]
    together = network.embed_text(invented_states(texts))
    for row, text in enumerate(texts):
        alone = network.embed_text(invented_states([text]))
        torch.testing.assert_close(alone[0], together[row], atol=2e-5, rtol=1e-4)
    padded = network.embed_text(text_features((4, 2), padded=9))
    torch.testing.assert_close(padded, network.embed_text(text_features((4, 2))), atol=2e-5, rtol=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_every_real_row_and_its_place_count(kind):
    network = tiny_network(kind)
    features, counts = motions(22)
    plain = network.embed_motion(features, counts)
    for row in (0, 9, 21):
        changed = features.clone()
        changed[0, row, 5] += 1.0
        assert (network.embed_motion(changed, counts) - plain).abs().max() > 1e-4
    assert (network.embed_motion(features.flip(1), counts) - plain).abs().max() > 1e-3


def test_decoded_motion_ends_where_its_length_ends():
    network = tiny_network("tmr")
    latent = torch.randn(3, 12, generator=torch.Generator().manual_seed(0))
    lengths = torch.tensor([18, 7, 4])
    rows = network.decode(latent, lengths)
    assert rows.shape == (3, 18, 67)
    for row, length in enumerate(lengths.tolist()):
        assert rows[row, length:].abs().sum() == 0 and (rows[row, :length].abs().sum(-1) > 0).all()
        alone = network.decode(latent[row : row + 1], lengths[row : row + 1])
        torch.testing.assert_close(alone[0], rows[row, :length], atol=2e-5, rtol=1e-4)


def test_distributions_have_the_embeddings_as_means_and_bounded_spread():
    network = tiny_network("tmr")
    network.motion_spread.weight.mul_(1e4)
    features, counts = motions(20, 9)
    found = network.motion_distribution(features, counts)
    torch.testing.assert_close(found.mean, network.embed_motion(features, counts))
    assert found.log_variance.abs().max() == 10.0
    text = text_features((4, 2))
    torch.testing.assert_close(network.text_distribution(text).mean, network.embed_text(text))


def test_samples_are_mean_plus_noise_times_deviation():
    what = Gaussian(torch.tensor([[1.0, -2.0]]), torch.tensor([[0.0, float(np.log(9.0))]]))
    torch.testing.assert_close(what.sample(torch.tensor([[0.5, -1.0]])), torch.tensor([[1.5, -5.0]]))


def test_the_scale_of_the_logits_starts_as_published_and_is_bounded():
    network = tiny_network("clip")
    assert float(network.scale()) == pytest.approx(1 / 0.07)
    network.log_scale.fill_(50.0)
    assert float(network.scale()) == pytest.approx(100.0)


def test_an_unknown_kind_is_refused():
    with pytest.raises(ValueError, match="accepted: tmr, clip"):
        build_evaluator(EvaluatorConfig(kind="guo"))
