"""The synthetic corpus against formulas of its own: bones, floor, planted feet, and every factor measured again."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.motion.actions import ACTIONS
from playground.motion.skeleton import HUMAN22
from playground.motion.synthetic import Synthetic, corpus, synthesise

Joints = NDArray[np.float64]
FPS = 20
PLACED = {"starts": "standing", "ends": "standing", "style": "neutral"}


@pytest.fixture(scope="module")
def items() -> list[Synthetic]:
    return corpus(200, seed=5)


def joints_of(item: Synthetic) -> Joints:
    return item.motion.joints.astype(np.float64)


def make(action: str, seed: int = 0, **factors: object) -> Joints:
    return joints_of(synthesise(action, np.random.default_rng(seed), **factors))


def heading(joints: Joints, frames: slice) -> float:
    """Mean yaw of the hip line in degrees, left positive: at yaw 0 it points along +X."""
    across = joints[frames, HUMAN22.index("l_hip")] - joints[frames, HUMAN22.index("r_hip")]
    mean = across.mean(axis=0)
    return float(np.degrees(np.arctan2(-mean[2], mean[0])))


def turned(joints: Joints) -> float:
    """Change of heading in degrees with the turns counted: sum of the small steps between neighbouring frames."""
    across = joints[:, HUMAN22.index("l_hip")] - joints[:, HUMAN22.index("r_hip")]
    total = 0.0
    for a, b in zip(across[:-1], across[1:], strict=True):
        total += float(np.degrees(np.arctan2(a[2] * b[0] - a[0] * b[2], a[0] * b[0] + a[2] * b[2])))
    return total


def crossings(track: NDArray[np.float64], level: float) -> int:
    """How often a track rises through a level."""
    above = track > level
    return int((above[1:] & ~above[:-1]).sum())


def test_every_action_is_drawn(items: list[Synthetic]) -> None:
    assert {item.action for item in items} == set(ACTIONS)
    assert len(items) == 200


def test_bones_are_exact(items: list[Synthetic]) -> None:
    for item in items:
        joints = joints_of(item)
        for joint, parent in enumerate(HUMAN22.parents):
            if parent >= 0:
                length = np.sqrt(((joints[:, joint] - joints[:, parent]) ** 2).sum(axis=-1))
                wanted = np.sqrt(sum(x * x for x in HUMAN22.offsets[joint]))
                assert np.abs(length - wanted).max() < 1e-5, (item.action, HUMAN22.joints[joint])


def test_motions_are_canonical_and_of_a_proper_length(items: list[Synthetic]) -> None:
    for item in items:
        joints = joints_of(item)
        assert 40 <= len(joints) <= 196
        assert item.factors["seconds"] == pytest.approx(len(joints) / FPS)
        assert abs(joints[..., 1].min()) < 1e-6
        assert np.abs(joints[0, 0, [0, 2]]).max() < 1e-6
        left = joints[0, 1] - joints[0, 2] + joints[0, 16] - joints[0, 17]
        assert abs(left[2]) < 1e-5
        assert left[0] > 0


def test_the_lowest_foot_touches_the_floor(items: list[Synthetic]) -> None:
    for item in items:
        if item.action in {"jump", "run", "turn_walk", "walk_then"}:
            continue  # these may fly
        feet = joints_of(item)[:, [10, 11], 1].min(axis=1)
        ankles = joints_of(item)[:, [7, 8], 1].min(axis=1) - 0.06
        assert np.minimum(feet, ankles).max() < 0.025, item.action


def test_planted_feet_do_not_slide(items: list[Synthetic]) -> None:
    """A toe that is on the floor for at least 5 frames stays within a centimetre between the first and the last two."""
    stances = 0
    for item in items:
        toes = joints_of(item)[:, [10, 11]]
        for side in (0, 1):
            low = np.concatenate([[False], toes[:, side, 1] < 0.008, [False]])
            edges = np.flatnonzero(low[1:] != low[:-1])
            for start, stop in zip(edges[::2], edges[1::2], strict=True):
                if stop - start >= 5:
                    place = toes[start + 1 : stop - 1, side][:, [0, 2]]
                    away = np.linalg.norm(place - np.median(place, axis=0), axis=-1)
                    assert np.percentile(away, 80) < 0.01, (item.action, item.factors, start, stop)
                    stances += 1
    assert stances > 200


def test_knees_bend_forwards_and_nothing_pops(items: list[Synthetic]) -> None:
    for item in items:
        joints = joints_of(item)
        across = joints[:, 1] - joints[:, 2]
        for hip, knee, ankle in ((1, 4, 7), (2, 5, 8)):
            thigh, shin = joints[:, knee] - joints[:, hip], joints[:, ankle] - joints[:, knee]
            hinge = np.cross(thigh, shin)  # a bent knee turns the shin backwards, about the axis to the left
            assert (hinge * across).sum(axis=-1).min() > -1e-3, (item.action, item.factors)
        acceleration = np.linalg.norm(np.diff(joints, n=2, axis=0), axis=-1) * FPS**2
        assert acceleration.max() < 160.0, (item.action, item.factors)


def test_arms_swing_against_the_legs() -> None:
    for seed in range(4):
        joints = make("walk", seed, style="neutral", starts="moving", ends="moving", speed=1.2)
        for ankle, wrist in ((7, 20), (8, 21)):
            leg, arm = joints[:, ankle, 2] - joints[:, 0, 2], joints[:, wrist, 2] - joints[:, 0, 2]
            assert np.corrcoef(leg, arm)[0, 1] < -0.6


@pytest.mark.parametrize(
    ("action", "speed"),
    [("walk", 0.7), ("walk", 1.2), ("walk", 1.6), ("run", 2.3), ("run", 3.5), ("walk_back", 0.5), ("walk_back", 0.9)],
)
def test_speed_is_recovered(action: str, speed: float) -> None:
    joints = make(action, speed=speed, style="neutral", starts="moving", ends="moving", travel_seconds=3.5)
    way = joints[-1, 0] - joints[0, 0]
    measured = way[2] / ((len(joints) - 1) / FPS)
    assert measured == pytest.approx(-speed if action == "walk_back" else speed, rel=0.06)
    assert abs(way[0]) < 0.1 * abs(way[2])  # straight ahead, but for the twist of the first pose


@pytest.mark.parametrize("side", ["left", "right"])
def test_side_steps_go_to_their_side(side: str) -> None:
    joints = make("side_step", side=side, speed=0.4, travel_seconds=3.0, style="neutral")
    way = joints[-1, 0] - joints[0, 0]
    assert way[0] * (1 if side == "left" else -1) == pytest.approx(1.2, abs=0.12)
    assert abs(way[2]) < 0.1
    assert abs(turned(joints)) < 6


@pytest.mark.parametrize("degrees", [-170.0, -90.0, -45.0, 45.0, 90.0, 170.0, 360.0])
@pytest.mark.parametrize("action", ["turn_walk", "turn_place"])
def test_heading_change_is_recovered(action: str, degrees: float) -> None:
    factors = PLACED | {"gait": "walk"} if action == "turn_walk" else {"style": "neutral"}
    factors |= {"speed": 1.0} if action == "turn_walk" else {}
    joints = make(action, turn_degrees=degrees, **factors)
    assert turned(joints) == pytest.approx(degrees, abs=6)
    travelled = np.linalg.norm(np.diff(joints[:, 0, [0, 2]], axis=0), axis=-1).sum()
    assert travelled > 1.5 if action == "turn_walk" else travelled < 0.6


@pytest.mark.parametrize("side", ["left", "right", "both"])
@pytest.mark.parametrize("action", ["raise_hand", "wave"])
def test_the_named_hands_go_up(action: str, side: str) -> None:
    for seed in range(4):
        joints = make(action, seed, side=side, style="neutral")
        for name, wrist, shoulder in (("left", 20, 16), ("right", 21, 17)):
            highest = (joints[:, wrist, 1] - joints[:, shoulder, 1]).max()
            assert highest > 0.1 if side in (name, "both") else highest < -0.3


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_named_leg_kicks(side: str) -> None:
    kicking, standing = (7, 8) if side == "left" else (8, 7)
    joints = make("kick", side=side, repetitions=1, height=0.8, style="neutral")
    assert joints[:, kicking, 1].max() == pytest.approx(0.86, abs=0.05)
    assert joints[:, standing, 1].max() < 0.1
    top = joints[:, kicking, 1].argmax()
    assert joints[top, kicking, 2] - joints[top, 0, 2] > 0.5


@pytest.mark.parametrize("times", [1, 2, 3])
def test_repetitions_of_the_legs_are_recovered(times: int) -> None:
    kicks = make("kick", repetitions=times, side="left", height=0.7, style="neutral")
    assert crossings(kicks[:, 7, 1], 0.5) == times
    squats = make("squat", repetitions=times, depth=0.45, style="neutral")
    assert crossings(-squats[:, 0, 1], -0.7) == times
    jumps = make("jump", repetitions=times, height=0.35, travel="none", style="neutral")
    assert crossings(jumps[:, [10, 11], 1].min(axis=1), 0.15) == times


@pytest.mark.parametrize("times", [2, 4, 7])
def test_repetitions_of_the_hands_are_recovered(times: int) -> None:
    waves = make("wave", repetitions=times, side="right", place="overhead", style="neutral")
    raised = waves[waves[:, 21, 1] > waves[:, 17, 1] + 0.25]
    sideways = raised[:, 21, 0] - raised[:, 19, 0]
    assert crossings(sideways, float(sideways.mean())) in (times, times + 1)
    punches = make("punch", repetitions=4, side="left", style="neutral")
    assert crossings(np.linalg.norm(punches[:, 20] - punches[:, 16], axis=-1), 0.5) == 4 + 1  # and the lowered arm


def test_jumps_rise_as_high_as_they_should() -> None:
    joints = make("jump", height=0.4, repetitions=1, travel="forward", distance=0.7, style="neutral")
    assert joints[:, 0, 1].max() - joints[0, 0, 1] == pytest.approx(0.4, abs=0.08)
    assert joints[-1, 0, 2] - joints[0, 0, 2] == pytest.approx(0.7, abs=0.08)


def test_sitting_and_bowing() -> None:
    seated = make("sit", rises=False, seat=0.5, style="neutral")
    assert seated[-1, 0, 1] == pytest.approx(0.5, abs=0.02)
    stood = make("sit", rises=True, seat=0.5, style="neutral")
    assert stood[:, 0, 1].min() == pytest.approx(0.5, abs=0.02)
    assert stood[-1, 0, 1] == pytest.approx(stood[0, 0, 1], abs=0.03)
    bowed = make("bow", depth_degrees=80.0, style="neutral")
    trunk = bowed[:, 12] - bowed[:, 0]
    pitch = np.degrees(np.arctan2(trunk[:, 2], trunk[:, 1]))
    assert 45 < pitch.max() - pitch[0] < 85
    assert abs(pitch[-1] - pitch[0]) < 5


@pytest.mark.parametrize("style", ["tired", "sad", "old"])
def test_weary_styles_bend_forwards(style: str) -> None:
    def lean(kind: str) -> float:
        joints = make("walk", style=kind, speed=0.9, starts="moving", ends="moving")
        return float(np.mean(joints[:, 15, 2] - joints[:, 0, 2]))

    assert lean(style) > lean("neutral") + 0.03 > lean("proud") + 0.03


def test_the_same_seed_gives_the_same_corpus_and_touches_no_global_state() -> None:
    before = np.random.get_state()[1].tolist()
    first, again, longer, other = corpus(6, 3), corpus(6, 3), corpus(9, 3), corpus(6, 4)
    assert np.random.get_state()[1].tolist() == before
    for a, b, c in zip(first, again, longer, strict=False):
        assert np.array_equal(a.motion.joints, b.motion.joints)
        assert np.array_equal(a.motion.joints, c.motion.joints)
        assert (
            (a.captions, a.factors, a.action) == (b.captions, b.factors, b.action) == (c.captions, c.factors, c.action)
        )
    assert any(
        a.motion.joints.shape != b.motion.joints.shape or not np.array_equal(a.motion.joints, b.motion.joints)
        for a, b in zip(first, other, strict=True)
    )


def test_sequences_are_told_in_order() -> None:
    item = synthesise("walk_then", np.random.default_rng(2), second="wave", first="walk")
    for text in item.captions:
        first, second = re.search("walk|steps", text), re.search("wav", text)
        assert first and second and first.start() < second.start(), text
    joints = joints_of(item)
    raised = np.flatnonzero(joints[:, [20, 21], 1].max(axis=1) > joints[:, 12, 1])
    gone = np.linalg.norm(joints[:, 0, [0, 2]] - joints[-1, 0, [0, 2]], axis=-1)
    assert gone[raised].max() < 0.25  # it has arrived before the hand is up


@settings(max_examples=25)
@given(st.sampled_from(sorted(ACTIONS)), st.integers(0, 2**31 - 1))
def test_any_seed_makes_a_sound_motion(action: str, seed: int) -> None:
    item = synthesise(action, np.random.default_rng(seed))
    assert 40 <= item.motion.frames <= 196
    assert item.motion.joints[:, 0, 1].min() > 0.3
    assert item.motion.joints[..., 1].max() < 2.7
    assert item.factors["style"] in ("neutral", "energetic", "tired", "proud", "sad", "old")


@pytest.mark.parametrize(
    ("action", "factors", "says"),
    [
        ("fly", {}, "no synthetic action"),
        ("walk", {"colour": "red"}, "no factor colour"),
        ("walk", {"speed": float("nan")}, "finite"),
        ("walk", {"speed": "fast"}, "finite"),
        ("walk", {"travel_seconds": 60.0}, "longer"),
        ("wave", {"side": "middle"}, "side must be one of"),
        ("walk", {"style": "angry"}, "style must be one of"),
    ],
)
def test_bad_requests_are_one_sentence(action: str, factors: dict[str, object], says: str) -> None:
    with pytest.raises(PlaygroundError, match=says) as caught:
        synthesise(action, np.random.default_rng(0), **factors)
    assert "\n" not in str(caught.value)
