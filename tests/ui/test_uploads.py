"""Uploads and numbers of controls: what is accepted, what sentence a bad one gives, which window is tokenized."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.engine import prepare
from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.motion import Motion
from playground.ui.uploads import WINDOW, Source, checked_number, read_upload
from tests.conftest import drifting


@given(st.integers(20, 900), st.floats(-5, 60))
def test_a_window_is_full_and_inside(frames: int, start: float) -> None:
    source = Source(Motion(np.broadcast_to(drifting(20)[:1], (frames, 22, 3)).copy()), "made up")
    window = source.window(start)
    assert window.frames == min(frames, WINDOW)
    assert source.is_long == (frames > WINDOW)
    assert 0 <= source.last_start == pytest.approx(max(0, frames - WINDOW) / 20)


def test_a_full_window_is_the_longest_motion_a_tokenizer_takes() -> None:
    source = Source(Motion(drifting(400)), "made up")
    _, cut = prepare(source.window(0.0))
    assert cut.frames == LIMITS.max_frames


def test_windows_start_where_they_are_told() -> None:
    joints = drifting(500)
    source = Source(Motion(joints), "made up")
    assert np.array_equal(source.window(3.0).joints[0], joints[60])
    assert np.array_equal(source.window(99.0).joints[-1], joints[-1])


@pytest.mark.parametrize("value", [None, "3", True, float("nan"), float("inf"), -1, 7, [1]])
def test_numbers_outside_their_bounds_are_refused_in_one_sentence(value: object) -> None:
    with pytest.raises(PlaygroundError, match=r"^g must be a number from 0 to 6$"):
        checked_number(value, "g", 0, 6)


@given(st.floats(0, 6) | st.integers(0, 6))
def test_numbers_inside_are_kept(value: float) -> None:
    assert checked_number(value, "g", 0, 6) == value


@pytest.mark.parametrize("name", ["motion.pkl", "motion", "motion.BVH.exe", "x" * 300 + ".pt"])
def test_only_motion_files_are_read(name: str) -> None:
    with pytest.raises(PlaygroundError, match=r"\.bvh, \.npy and \.npz are accepted$") as refusal:
        read_upload(f"/nowhere/{name}")
    assert len(str(refusal.value)) < 160


def test_no_file_is_said_so() -> None:
    with pytest.raises(PlaygroundError, match=r"no file arrived"):
        read_upload(None)


def test_an_npz_of_joints_is_read_with_a_note(tmp_path: Path) -> None:
    path = tmp_path / "mine.npz"
    np.savez(path, joints=drifting(60), fps=20.0, caption="somebody glides away")
    source = read_upload(str(path))
    assert source.caption == "somebody glides away"
    assert source.motion.frames == 60 and source.title == "mine.npz"
    assert source.note.endswith(".")
