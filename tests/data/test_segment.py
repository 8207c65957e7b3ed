"""Takes with stops at known times, made on the spot, and what must hold for any take."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from playground.data.segment import LONGEST, MEASURED, SHORTEST, mean_speed, segment
from tests.conftest import rest_pose

FPS = 20


def take(seconds: float, stops: tuple[float, ...], speed: float = 1.5, dip: float = 0.0) -> np.ndarray:
    """A body that glides to and fro, standing still (down to `dip` of its speed) for a moment at each stop."""
    time = np.arange(int(seconds * FPS)) / FPS
    pace = np.full(len(time), speed)
    for stop in stops:
        pace *= 1.0 - (1.0 - dip) * np.exp(-0.5 * ((time - stop) / 0.4) ** 2)
    way = np.cumsum(pace * (1.0 + 0.02 * np.sin(5.1 * time))) / FPS
    path = np.stack([np.sin(way), np.zeros(len(way)), np.cos(way)], axis=-1)
    return rest_pose()[None] + path[:, None]


def test_stops_at_known_times_are_the_cuts() -> None:
    stops = (6.0, 13.0, 19.5, 29.0)
    found = segment(take(36.0, stops), FPS)
    np.testing.assert_allclose(found.cuts / FPS, stops, atol=0.15)
    assert not found.forced.any() and len(found.spans) == 5
    assert found.spans[0][0] == 0 and found.spans[-1][1] == len(found.speed) == 36 * FPS


def test_the_curve_is_the_smoothed_mean_speed() -> None:
    rng = np.random.default_rng(0)
    joints = np.cumsum(rng.normal(size=(60, 22, 3)), axis=0)
    raw = np.zeros(60)
    for frame in range(60):
        before, after = max(frame - 1, 0), min(frame + 1, 59)
        for joint in MEASURED:
            raw[frame] += np.linalg.norm(joints[after, joint] - joints[before, joint]) / (after - before) * FPS / 6
    expected = np.zeros(60)
    for frame in range(60):
        offsets = np.arange(-20, 21)
        weights = np.exp(-0.5 * (offsets / (0.25 * FPS)) ** 2)
        expected[frame] = (weights * raw[np.clip(frame + offsets, 0, 59)]).sum() / weights.sum()
    np.testing.assert_allclose(mean_speed(joints, FPS), expected, rtol=1e-6)


def test_the_chance_falls_from_the_stillest_to_the_fastest_minimum() -> None:
    joints = take(60.0, (10.0,), dip=0.0)
    joints = np.concatenate([joints, take(60.0, (20.0,), dip=0.5), take(60.0, (30.0,), dip=0.8)])
    found = segment(joints, FPS)
    speeds = found.speed[found.minima]
    low, high = speeds.min(), speeds.max()
    np.testing.assert_allclose(found.chance, 1 - (speeds - low) / (high - low))
    assert found.chance.max() == 1.0 and found.chance.min() == 0.0


def test_the_same_seed_gives_the_same_cuts_and_another_one_others() -> None:
    rng = np.random.default_rng(3)
    stops = tuple(np.cumsum(rng.uniform(2.0, 4.0, 40)).tolist())
    joints = take(120.0, stops, dip=0.2)
    joints[:, :, 0] += np.cumsum(np.repeat(rng.uniform(0, 0.02, 24), 100))[:, None]
    cuts = [segment(joints, FPS, seed).cuts.tolist() for seed in (0, 0, 1, 2)]
    assert cuts[0] == cuts[1] and (cuts[0] != cuts[2] or cuts[0] != cuts[3])


def test_a_steady_take_is_cut_for_its_length_alone() -> None:
    joints = np.zeros((40 * FPS, 22, 3))
    joints[..., 2] = np.arange(len(joints))[:, None] * 0.05
    found = segment(joints, FPS)
    assert not len(found.minima) and found.forced.all()
    lengths = [(stop - start) / FPS for start, stop in found.spans]
    assert min(lengths) >= SHORTEST and max(lengths) <= LONGEST


@settings(max_examples=40)
@given(
    st.integers(2, 1500),
    st.integers(0, 5),
    st.sampled_from([(4.0, 12.0), (1.0, 2.0), (3.0, 40.0)]),
    st.sampled_from(["walk", "noise", "still", "jump"]),
)
def test_parts_are_the_whole_take_within_the_limits(frames, seed, limits, kind) -> None:
    rng = np.random.default_rng(seed)
    joints = np.zeros((frames, 22, 3))
    if kind == "noise":
        joints = rng.normal(size=joints.shape)
    elif kind == "walk":
        joints = np.cumsum(rng.normal(size=joints.shape), axis=0)
    elif kind == "jump":
        joints[frames // 2 :] = 1.0
    found = segment(joints, FPS, seed, *limits)
    edges = [0, *found.cuts.tolist(), frames]
    assert [start for start, _ in found.spans] == edges[:-1] and [stop for _, stop in found.spans] == edges[1:]
    lengths = np.diff(edges) / FPS
    assert lengths.max() <= limits[1] and (len(lengths) == 1 or lengths.min() >= limits[0])
    assert len(found.chance) == len(found.minima) and ((found.chance >= 0) & (found.chance <= 1)).all()
    voluntary = found.cuts[~found.forced]
    assert set(voluntary.tolist()) <= set(found.minima.tolist())


@pytest.mark.parametrize(("frames", "limits"), [(1, (4.0, 12.0)), (100, (4.0, 7.9)), (100, (0.0, 1.0)), (100, (-1, 9))])
def test_limits_between_which_nothing_fits_are_refused(frames, limits) -> None:
    with pytest.raises(ValueError, match="twice"):
        segment(np.zeros((frames, 22, 3)), FPS, 0, *limits)
