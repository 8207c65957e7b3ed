"""The root refiner: against a loop over frames, blind to the root's own columns, padding and company."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from playground.generators.refiner import ROOT, SLOPE, RefinerConfig, RootRefiner, build_refiner


def tiny(seed: int = 0, **changes) -> RootRefiner:
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        model = build_refiner(RefinerConfig(**{"columns": 9, "width": 5, "blocks": 2, **changes}))
    return model.eval().requires_grad_(False)


def rows(batch: int, frames: int, columns: int = 9, seed: int = 0) -> torch.Tensor:
    return torch.randn(batch, frames, columns, generator=torch.Generator().manual_seed(seed))


def slow_conv(x: np.ndarray, layer: torch.nn.Conv1d, dilation: int) -> np.ndarray:
    """x [F, C]: every output frame is a sum over its taps, what lies outside counting as 0."""
    weight, bias = layer.weight.numpy().astype(np.float64), layer.bias.numpy().astype(np.float64)
    out = np.zeros((len(x), len(bias)))
    reach = weight.shape[2] // 2
    for frame in range(len(x)):
        out[frame] = bias
        for tap in range(weight.shape[2]):
            at = frame + (tap - reach) * dilation
            if 0 <= at < len(x):
                out[frame] += weight[:, :, tap] @ x[at]
    return out


def slow(model: RootRefiner, features: np.ndarray) -> np.ndarray:
    """One motion [F, columns] -> [F, 3], in float64, layer by layer."""
    x = slow_conv(features[:, 3:].astype(np.float64), model.stem, 1)
    x = np.where(x < 0, SLOPE * x, x)
    for block, dilation in zip(model.blocks, (3, 1), strict=True):
        inner = slow_conv(np.maximum(x, 0), block.wide, dilation)
        x = x + slow_conv(np.maximum(inner, 0), block.narrow, 1)
    return slow_conv(x, model.head, 1)


@pytest.mark.parametrize("frames", [1, 4, 13])
def test_it_equals_a_loop_over_frames_and_taps(frames):
    model, features = tiny(), rows(1, frames)
    found = model(features, torch.tensor([frames]))[0].numpy()
    np.testing.assert_allclose(found, slow(model, features[0].numpy()), atol=1e-5)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 1000), st.floats(-1e4, 1e4))
def test_the_root_columns_that_come_in_change_nothing(seed, wrong):
    model, features, lengths = tiny(), rows(2, 12, seed=seed), torch.tensor([12, 8])
    spoilt = features.clone()
    spoilt[..., :ROOT] = wrong
    assert torch.equal(model(features, lengths), model(spoilt, lengths))


@settings(max_examples=20, deadline=None)
@given(st.lists(st.integers(1, 12), min_size=2, max_size=4), st.sampled_from([0.0, 1e6, float("inf"), float("nan")]))
def test_padding_and_company_change_nothing(lengths, junk):
    model, longest = tiny(), max(lengths)
    features = rows(len(lengths), longest, seed=sum(lengths))
    for row, length in zip(features, lengths, strict=True):
        row[length:] = junk
    together = model(features, torch.tensor(lengths))
    for row, length in enumerate(lengths):
        alone = model(features[row : row + 1, :length], torch.tensor([length]))[0]
        torch.testing.assert_close(together[row, :length], alone, atol=1e-5, rtol=1e-5)
        assert not together[row, length:].any()


def test_it_sees_fifteen_frames_to_either_side():
    model = tiny(blocks=3)
    features = rows(1, 41).requires_grad_()
    model(features, torch.tensor([41]))[0, 20].sum().backward()
    reached = features.grad[0, :, ROOT:].abs().amax(dim=1) > 0
    assert reached.nonzero()[0] == 5 and reached.nonzero()[-1] == 35


def test_the_shipped_size_is_about_half_a_million_numbers():
    count = sum(parameter.numel() for parameter in RootRefiner(RefinerConfig()).parameters())
    assert 4e5 < count < 1e6
