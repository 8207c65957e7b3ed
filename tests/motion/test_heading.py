"""The two rules of the heading against scalar loops; recovery does not depend on the rule."""

from math import atan2, exp, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from playground.motion.features263 import to_features263
from playground.motion.representation import HEADINGS, canonicalise, from_features67, heading, to_features67
from playground.motion.skeleton import HUMAN22
from tests.motion.skeletons import walk


def slow_heading(joints: np.ndarray, rule: str) -> list[float]:
    """Yaw of every frame, written out: across, forward = up x across, a Gaussian of 20 frames, frame 0 set to 0."""
    place = {name: HUMAN22.joints.index(name) for name in ("r_hip", "l_hip", "r_shoulder", "l_shoulder")}
    forward = []
    for pose in joints.astype(np.float64):
        hips = pose[place["r_hip"]] - pose[place["l_hip"]]
        shoulders = pose[place["r_shoulder"]] - pose[place["l_shoulder"]]
        across = shoulders + hips if rule == "body" else shoulders - hips
        x, z = across[2], -across[0]
        length = sqrt(x * x + z * z) if rule == "body" else sqrt(float(across @ across))
        forward.append((x / length, z / length))
    weights = [exp(-0.5 * (k / 20.0) ** 2) for k in range(-80, 81)]
    yaws = []
    for t in range(len(joints)):
        near = [min(max(t + k, 0), len(joints) - 1) for k in range(-80, 81)]
        x = sum(w * forward[n][0] for w, n in zip(weights, near, strict=True))
        z = sum(w * forward[n][1] for w, n in zip(weights, near, strict=True))
        yaws.append(-atan2(x, z))
    return [0.0, *yaws[1:]]


def twisting(frames: int = 50) -> np.ndarray:
    """A walk whose shoulders lean and turn against its hips."""
    joints = walk()[:frames].astype(np.float64).copy()
    for t in range(frames):
        for joint, sign in ((16, 1.0), (17, -1.0)):
            joints[t, joint] += sign * np.array([0.0, 0.05 * np.sin(t / 9), 0.12 * np.sin(t / 7)])
        for joint, sign in ((1, 1.0), (2, -1.0)):
            joints[t, joint] += sign * np.array([0.0, 0.02, 0.04 * np.cos(t / 5)])
    return canonicalise(joints)


@pytest.mark.parametrize("rule", HEADINGS)
def test_heading_against_scalar_loops(rule: str) -> None:
    joints = twisting()
    np.testing.assert_allclose(heading(joints, rule=rule), slow_heading(joints, rule), atol=1e-9)


def test_the_body_rule_is_the_default_and_the_rules_differ() -> None:
    joints = twisting()
    assert np.array_equal(to_features67(joints), to_features67(joints, "body"))
    assert np.array_equal(to_features263(joints)[:, :67], to_features67(joints))
    assert np.array_equal(to_features263(joints, "humanml3d")[:, :67], to_features67(joints, "humanml3d"))
    apart = np.abs(heading(joints) - heading(joints, rule="humanml3d"))
    assert apart.max() > np.radians(2.0)


@given(st.integers(0, 2**16))
@settings(max_examples=20)
def test_recovery_is_the_same_for_every_rule(seed: int) -> None:
    rng = np.random.default_rng(seed)
    joints = canonicalise(twisting(30) + rng.normal(size=(30, 22, 3)) * 0.03)
    start = joints - joints[:1, :1] * np.array([1.0, 0.0, 1.0], np.float32)
    for rule in HEADINGS:
        assert np.abs(from_features67(to_features67(start, rule)) - start[:-1]).max() < 1e-4


def test_a_body_without_width_faces_ahead_and_another_rule_is_refused() -> None:
    flat = np.zeros((5, 22, 3))
    assert not heading(flat, rule="humanml3d").any()
    with pytest.raises(ValueError, match="body, humanml3d"):
        heading(flat, rule="smpl")
