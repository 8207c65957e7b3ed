"""Batches against slow loops: windows, speed, mirror, weights, slices of processes."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from playground.data.batches import BatchConfig, BatchSource, Cuts, Sample, sample_weights, whole_batches
from playground.motion.representation import COLUMNS, Normaliser, from_features67, mirror_features67, to_features67
from playground.text.prompts import mirror_caption
from tests.conftest import drifting

BATCH = BatchConfig(size=4, shortest=16, bucket=2, speed=0.5)


def source(size: int = 4, seed: int = 3, lengths: tuple[int, ...] = (), **changes) -> BatchSource:
    rows = lengths or tuple(30 + 7 * n for n in range(6))
    samples = [
        Sample(to_features67(drifting(count + 1, n)), (f"left {n}", f"one left {n}"), "AB"[n % 2], "walk")
        for n, count in enumerate(rows)
    ]
    normaliser = Normaliser.fit([s.features for s in samples])
    return BatchSource(samples, normaliser, replace(BATCH, size=size, **changes), seed=seed)


def slowly(drawn: BatchSource, cuts: Cuts, n: int) -> tuple[NDArray[np.float64], str]:
    """One window by the words of its definition: play, cut, mirror, normalise."""
    sample, speed = drawn.samples[cuts.sample[n]], cuts.speed[n]
    rows = []
    for row in range(cuts.start[n], cuts.start[n] + cuts.rows[n]):
        at = min(row * speed, len(sample.features) - 1)
        low = min(int(at), max(len(sample.features) - 2, 0))
        high = min(low + 1, len(sample.features) - 1)
        between = sample.features[low] * (1 - (at - low)) + sample.features[high] * (at - low)
        rows.append(np.concatenate([between[:3] * speed, between[3:]]))
    features = np.array(rows)
    caption = sample.captions[cuts.caption[n]]
    if cuts.mirrored[n]:
        features, caption = mirror_features67(features), mirror_caption(caption)
    return (features - drawn.normaliser.mean) / drawn.normaliser.std, caption


def test_a_batch_equals_a_loop_over_its_windows():
    drawn = source(size=40)
    chosen = np.random.default_rng(5).integers(0, 6, 40)
    cuts = drawn.draw(chosen, np.random.default_rng(7))
    batch = drawn.fill(cuts)
    assert set(cuts.mirrored) == {True, False} and len(set(cuts.speed)) > 5 and set(cuts.caption) == {0, 1}
    assert batch.features.dtype == torch.float32 and batch.features.shape == (40, max(cuts.rows), COLUMNS)
    for n in range(40):
        features, caption = slowly(drawn, cuts, n)
        np.testing.assert_allclose(batch.features[n, : cuts.rows[n]], features, atol=1e-4)
        assert not batch.features[n, cuts.rows[n] :].any()
        assert batch.captions[n] == caption and batch.sources[n] == drawn.samples[chosen[n]].source
    assert batch.lengths.tolist() == cuts.rows.tolist() and batch.mean_frames == cuts.rows.sum()


@given(
    st.lists(st.integers(4, 420), min_size=1, max_size=8), st.sampled_from([4, 8]), st.integers(4, 200),
    st.floats(0, 1), st.floats(0, 1), st.floats(0, 1), st.integers(0, 1000),
)  # fmt: skip
def test_windows_lie_inside_their_clips(lengths, unit, shortest, whole, shorter, speed, seed):
    samples = [Sample(np.zeros((n, COLUMNS), np.float32), ("a",), "A", "x") for n in lengths if n >= unit]
    if not samples:
        return
    normaliser = Normaliser(np.zeros(COLUMNS, np.float32), np.ones(COLUMNS, np.float32))
    config = BatchConfig(unit=unit, shortest=shortest, whole=whole, shorter=shorter, speed=speed)
    drawn = BatchSource(samples, normaliser, config, seed)
    chosen = np.tile(np.arange(len(samples)), 25)
    cuts = drawn.draw(chosen, np.random.default_rng(seed))
    played = np.array([len(samples[i].features) for i in chosen])
    assert (cuts.rows % unit == 0).all() and (cuts.rows >= unit).all() and (cuts.rows <= 196).all()
    assert (cuts.start >= 0).all() and ((cuts.speed >= 0.8) & (cuts.speed <= 1.25)).all()
    last = (cuts.start + cuts.rows - 1) * cuts.speed
    assert (last <= played - 1 + 1e-9).all()


def test_random_lengths_reach_both_ends_and_whole_windows_are_whole():
    drawn = source(lengths=(100,), whole=0.0, speed=0.0, shortest=64)
    cuts = drawn.draw(np.zeros(2000, np.int64), np.random.default_rng(0))
    assert set(cuts.rows) == set(range(64, 101, 4)) and cuts.start.max() == 36
    whole = source(lengths=(100,), whole=1.0, speed=0.0).draw(np.zeros(3000, np.int64), np.random.default_rng(0))
    assert set(whole.rows) == {96, 100} and (whole.rows == 96).mean() == pytest.approx(1 / 3, abs=0.03)


def test_a_batch_is_a_function_of_seed_and_step():
    first, again = source().batch(5), source().batch(5)
    assert torch.equal(first.features, again.features) and torch.equal(first.lengths, again.lengths)
    assert first.captions == again.captions and first.captions != source().batch(6).captions
    assert first.captions != source(seed=4).batch(5).captions
    assert all(length % 4 == 0 for length in first.lengths.tolist())


@pytest.mark.parametrize("world", [2, 3])
def test_the_slices_of_the_processes_are_the_whole_batch(world):
    whole, parts = source(size=6).batch(2), [source(size=6).batch(2, rank, world) for rank in range(world)]
    for rank, part in enumerate(parts):
        assert torch.equal(part.features, whole.features[rank::world])
        assert part.captions == whole.captions[rank::world]
    assert sum(part.mean_frames for part in parts) == pytest.approx(whole.mean_frames)


def test_mirrored_motion_comes_with_a_mirrored_caption():
    drawn = source(size=8, mirror=1.0, speed=0.0).batch(0)
    assert all("right" in caption for caption in drawn.captions)
    plain = source(size=8, mirror=0.0, speed=0.0).batch(0)
    assert all("left" in caption for caption in plain.captions)


def test_weights_balance_sources():
    samples = [Sample(np.zeros((8, 67), np.float32), (), source, "x") for source in "AAAAAAAAB"]
    equal = sample_weights(samples, replace(BATCH, source_balance=1.0, action_balance=1.0))
    assert equal[-1] == pytest.approx(0.5) and equal.sum() == pytest.approx(1.0)
    counted = sample_weights(samples, replace(BATCH, source_balance=0.0, action_balance=0.0))
    np.testing.assert_allclose(counted, 1 / 9)


def test_faster_motion_covers_the_same_ground_in_less_time():
    drawn = source(lengths=(80,))
    rows = np.array([80, 64])
    zeros = np.zeros(2, np.int64)
    cuts = Cuts(zeros, zeros, np.array([1.0, 1.25]), zeros, rows, zeros.astype(np.bool_))
    features = drawn.fill(cuts).features.numpy()
    ends = [from_features67(drawn.normaliser.invert(features[n, : rows[n]]))[-1, 0, [0, 2]] for n in range(2)]
    np.testing.assert_allclose(ends[1], ends[0], atol=0.05)
    np.testing.assert_allclose(drawn.normaliser.invert(features[0]), drawn.samples[0].features, atol=1e-5)


def test_whole_batches_hold_every_clip_once_with_its_first_caption():
    drawn = source(lengths=(3, 9, 41, 196, 230))
    batches = whole_batches([*drawn.samples, Sample(np.zeros((3, 67), np.float32), (), "A", "x")], drawn.normaliser, 3)
    assert [batch.lengths.tolist() for batch in batches] == [[8, 40, 196], [196]]
    assert [caption for batch in batches for caption in batch.captions] == ["left 1", "left 2", "left 3", "left 4"]
    expected = drawn.normaliser.apply(drawn.samples[0].features[:8])
    np.testing.assert_allclose(batches[0].features[0, :8], expected, atol=1e-5)
    assert batches[0].features.shape[1] == 196 and not batches[0].features[0, 8:].any()
