"""What all tests share: hypothesis settings, the folder of recorded motions where it is there, tiny motions."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from numpy.typing import NDArray

from playground.motion.motion import Motion
from playground.motion.skeleton import HUMAN22

os.environ.setdefault("GRADIO_ANALYTICS_ENABLED", "False")

# The same examples on every run: a failure is the code's, not the dice's. HYPOTHESIS_PROFILE=explore rolls new ones.
_SLOW_IS_FINE = [HealthCheck.too_slow, HealthCheck.data_too_large]
settings.register_profile("repeatable", deadline=None, derandomize=True, suppress_health_check=_SLOW_IS_FINE)
settings.register_profile("explore", deadline=None, max_examples=500, suppress_health_check=_SLOW_IS_FINE)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))

ACROSS = ("r_hip", "l_hip", "r_shoulder", "l_shoulder")


@pytest.fixture(scope="session")
def library_data() -> Path:
    """The folder with motions.npz and clips.jsonl that PLAYGROUND_DATA names; the test is skipped without it."""
    folder = os.environ.get("PLAYGROUND_DATA")
    if not folder:
        pytest.skip("PLAYGROUND_DATA is not set: no recorded motions at hand")
    path = Path(folder)
    if not (path / "motions.npz").is_file():
        pytest.fail(f"PLAYGROUND_DATA names {path}, which holds no motions.npz")
    return path


def rest_pose() -> NDArray[np.float64]:
    """The T-pose [22, 3] of the reference skeleton, standing on the floor and facing exactly +Z."""
    joints = np.zeros((HUMAN22.size, 3))
    for joint, parent in enumerate(HUMAN22.parents):
        if parent >= 0:
            joints[joint] = joints[parent] + HUMAN22.offsets[joint]
    right_hip, left_hip, right_shoulder, left_shoulder = (joints[HUMAN22.index(name)] for name in ACROSS)
    x, _, z = left_hip - right_hip + left_shoulder - right_shoulder
    turned = joints @ (np.array([[x, 0.0, -z], [0.0, np.hypot(x, z), 0.0], [z, 0.0, x]]) / np.hypot(x, z))
    return turned - [0.0, turned[:, 1].min(), 0.0]


def drifting(frames: int = 48, seed: int = 0) -> NDArray[np.float32]:
    """Joints [frames, 22, 3] that glide forward and sway a little: bones exact, facing +Z, over the origin at first."""
    rng = np.random.default_rng(seed)
    time = np.arange(frames) / 20.0
    sway = 0.05 * np.sin(2 * np.pi * time * rng.uniform(0.5, 1.5))
    path = np.stack([sway, np.zeros(frames), rng.uniform(0.3, 1.2) * time], axis=-1)
    return (rest_pose()[None] + path[:, None]).astype(np.float32)


@pytest.fixture
def tiny_motion() -> Motion:
    """48 poses at 20 fps."""
    return Motion(drifting())


@pytest.fixture
def tiny_motions() -> list[Motion]:
    """Three motions of 20, 48 and 200 poses."""
    return [Motion(drifting(frames, seed=frames)) for frames in (20, 48, 200)]
