"""Sources: another frame rate, a later start, mirrored axes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from playground.errors import PlaygroundError
from playground.motion.rotation import qrotate
from playground.motion.source import Source, check_size


def source(frames: int, fps: float) -> Source:
    """Two joints; the root moves 1 a second along X, the child turns a radian a second about Z."""
    time = np.arange(frames) / fps
    rotations = np.zeros((frames, 2, 4))
    rotations[:, :, 0], rotations[:, :, 3] = np.cos(time / 2)[:, None], np.sin(time / 2)[:, None]
    offsets = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    root = np.stack([time, 0 * time, 0 * time], axis=-1)
    positions = np.stack([root, root + qrotate(rotations[:, 0], offsets[1])], axis=1)
    return Source(("a", "b"), (-1, 0), offsets, positions, rotations, fps, {1: np.array([0.0, 2.0, 0.0])})


def test_a_multiple_takes_every_kth_frame_untouched() -> None:
    given_ = source(61, 120.0)
    taken = given_.resampled(20.0)
    assert np.array_equal(taken.positions, given_.positions[::6]) and taken.fps == 20.0


@given(st.integers(4, 200), st.floats(5, 500), st.floats(0, 0.9))
@settings(max_examples=50)
def test_resampling_meets_the_clock_at_any_rate(frames: int, fps: float, share: float) -> None:
    clip = source(frames, fps)
    last = (frames - 1) / fps
    start = share * last
    count = int((last - start) * 20.0 + 1e-6) + 1
    if not 2 <= count <= 12_000:
        with pytest.raises(PlaygroundError):
            clip.resampled(20.0, start)
        return
    taken = clip.resampled(20.0, start)
    time = start + np.arange(taken.frames) / 20.0
    assert taken.frames == count
    assert np.allclose(taken.positions[:, 0, 0], time, atol=1e-4)
    half = np.arctan2(taken.rotations[:, 1, 3], taken.rotations[:, 1, 0])
    assert np.allclose(np.exp(2j * half), np.exp(1j * time), atol=1e-3)


@pytest.mark.parametrize("start", [-0.1, 3.1, float("nan"), float("inf")])
def test_a_start_outside_the_clip_is_one_sentence(start: float) -> None:
    with pytest.raises(PlaygroundError, match=r"not inside the clip, which lasts 3\.00 s"):
        source(61, 20.0).resampled(20.0, start)


def test_mirroring_twice_is_nothing_and_keeps_rotations_and_positions_together() -> None:
    clip = source(9, 20.0)
    once, twice = clip.mirrored(), clip.mirrored().mirrored()
    assert np.array_equal(twice.positions, clip.positions) and np.array_equal(twice.rotations, clip.rotations)
    rebuilt = once.positions[:, 0] + qrotate(once.rotations[:, 0], once.offsets[1])
    assert np.allclose(rebuilt, once.positions[:, 1])


@pytest.mark.parametrize(
    ("frames", "joints", "fps", "word"),
    [(3, 22, 20.0, "3 frames"), (1, 22, 20.0, "1 frame;"), (12_001, 22, 20.0, "12,001 frames"),
     (9, 121, 20.0, "121 joints"), (9, 0, 20.0, "0 joints"), (9, 22, 0.0, "0 frames a second"),
     (9, 22, 1001.0, "1001"), (9, 22, float("nan"), "nan"),
     (9, 22, -5.0, "-5")],
)  # fmt: skip
def test_sizes_outside_the_limits_are_named(frames: int, joints: int, fps: float, word: str) -> None:
    with pytest.raises(PlaygroundError, match=word):
        check_size("BVH file", frames, joints, fps)
