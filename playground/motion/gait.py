"""Locomotion for the synthetic corpus: pelvis and trunk over planned footsteps, arms against legs. numpy only.

Cadence, stance share, foot pitch, pelvis and arm motion follow the speed; the constants were read off recorded walks
and runs.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from playground.motion.curves import wobble
from playground.motion.footsteps import Path, Step, Stretch, Style, foot_track, plan_steps, stance_share
from playground.motion.rig import ARM_AT_REST, Pose

Array = NDArray[np.floating]


@dataclass
class Trip:
    """A planned trip: the pose of every frame plus what the tests and captions need to know."""

    pose: Pose
    steps: list[Step]
    moving: Array  # [F] 0 standing .. 1 travelling
    seconds: float


def _upper(pose: Pose, path: Path, t: Array, swing: Array, style: Style) -> None:
    """Arms and trunk: each arm against its own leg. swing [F, 2]: cosine of the leg's phase, 1 when it is in front."""
    run = path.at(path.running, t)
    forward = path.at(path.velocity[:, 1], t)
    size = np.clip(np.abs(forward) / 1.1, 0.0, 1.3) * style.swing
    size = np.where(forward < 0, 0.5 * size, size)
    for side in (0, 1):
        ahead = swing[:, 1 - side]
        arm = pose.arm[:, side]
        walking = np.stack([
            ARM_AT_REST[0] + style.out + 0.05 * size, ARM_AT_REST[1] + 0.30 * size * ahead,
            ARM_AT_REST[2] - 0.12 * size * ahead, ARM_AT_REST[3] + style.elbow + 0.24 * size * (ahead + 0.1),
        ], axis=-1)  # fmt: skip
        running = np.stack([
            0.45 + style.out + 0.0 * ahead, -0.2 + 0.55 * style.swing * ahead, -0.3 - 0.2 * ahead,
            1.6 + 0.35 * ahead,
        ], axis=-1)  # fmt: skip
        arm[:] = walking + run[:, None] * (running - walking)
        arm[:, 3] = np.maximum(arm[:, 3], 0.05)
    twist = swing[:, 0] - swing[:, 1]  # 2 when the left leg is in front
    pose.pelvis[:, 0] += -0.05 * twist * np.clip(size, 0, 1) * (1 + 0.5 * run)
    pose.spine[:, 0] += (0.09 + 0.1 * run) * twist * np.clip(size, 0, 1.2) * 0.9
    pose.head[:, 0] += -(0.04 + 0.06 * run) * twist * np.clip(size, 0, 1.2) * 0.9
    pose.spine[:, 1] += style.lean + 0.2 * run + 0.02
    pose.head[:, 1] += style.nod - 0.4 * style.lean - 0.1 * run
    pose.pelvis[:, 1] += 0.06 * run + 0.2 * style.lean
    lead = path.at(path.yaw, t + 0.25) - path.at(path.yaw, t)  # look and lean into a turn
    pose.head[:, 0] += 0.6 * lead
    pose.spine[:, 0] += 0.25 * lead
    pose.pelvis[:, 2] += -0.15 * lead * np.clip(forward, 0, 2)


def travel(
    parts: list[Stretch], style: Style, rng: np.random.Generator, before: bool = False, after: bool = False
) -> Trip:
    """Plan a trip and pose the body along it at 20 frames a second.

    before: the first part was already under way at frame 0; after: the last part goes on beyond the last frame.
    """
    path = Path(parts, before, after, style)
    leading = next((p for p in parts if p.kind != "stand"), None)
    first = int(rng.integers(2))
    if leading is not None and leading.kind in ("side", "turn"):
        first = 0 if (np.sin(leading.drift) > 0.1 or leading.turn > 0) else 1
    steps = plan_steps(path, first)
    frames = round(path.total * 20.0)
    t = np.arange(frames) / 20.0
    pose = Pose.standing(frames)
    for side in (0, 1):
        pose.ankle[:, side], pose.foot[:, side] = foot_track(path, steps, side, t, style)
    xz, yaw = path.at(path.position, t), path.at(path.yaw, t)
    speed, run, moving = path.at(path.speed, t), path.at(path.running, t), path.at(path.moving, t)
    phase = path.at(path.phase, t)
    share = stance_share(speed, run)
    middle = phase - (1.5 - 2.0 * share + 1.0) + 0.5  # 0 halfway between a landing and the other foot's lift
    pace = np.clip(speed / 1.1, 0.0, 1.3) * style.bounce
    up = np.cos(2 * np.pi * (middle - 0.0))
    pose.root[:, 1] = 0.948 - style.crouch - 0.016 * np.clip(pace, 0, 1) - 0.012 * run
    pose.root[:, 1] += up * (-0.018 * pace * (1 - run) + 0.062 * run * np.clip(speed / 3.0, 0.3, 1.0))
    ahead = 0.02 * np.sin(2 * np.pi * middle) * np.clip(pace, 0, 1) * (1 - 2 * run)
    legs = np.cos(np.pi * middle) * (1 if first == 0 else -1)  # 1 when the left leg is in front
    swing = np.stack([legs, -legs], axis=-1) * moving[:, None]
    sway = 0.018 * np.sin(np.pi * middle) * (1 if first == 0 else -1) * moving * style.bounce
    pose.pelvis[:, 0] = yaw
    pose.pelvis[:, 2] = 0.05 * np.sin(np.pi * middle) * (-1 if first == 0 else 1) * moving * np.clip(pace, 0, 1)
    pose.root[:, 0] = xz[:, 0] + ahead * np.sin(yaw) + sway * np.cos(yaw)
    pose.root[:, 2] = xz[:, 1] + ahead * np.cos(yaw) - sway * np.sin(yaw)
    _upper(pose, path, t, swing, style)
    idle = wobble(t, rng, 0.006, 2) * (1 - 0.5 * moving)[:, None]
    pose.root[:, [0, 2]] += idle
    pose.arm += wobble(t, rng, 0.03, 8).reshape(frames, 2, 4) * np.array([1.0, 1.0, 1.0, 1.5])
    pose.head += wobble(t, rng, 0.05, 3, slowest=4.0)
    pose.spine += wobble(t, rng, 0.015, 3)
    return Trip(pose, steps, moving, path.total)
