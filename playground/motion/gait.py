"""Locomotion for the synthetic corpus: pelvis and trunk over planned footsteps, arms against legs. numpy only.

Cadence, stance share, foot pitch, pelvis and arm motion follow the speed; the constants were read off recorded walks
and runs.
"""

import numpy as np
from numpy.typing import NDArray

from playground.limits import LIMITS
from playground.motion.curves import wobble
from playground.motion.footsteps import Path, Stretch, Style, foot_track, plan_steps, stance_share
from playground.motion.rig import ARM_AT_REST, STANDING, Pose

Array = NDArray[np.floating]


def _upper(pose: Pose, path: Path, t: Array, front: Array, style: Style) -> None:
    """Arms and trunk: each arm against its own leg. front [F]: 1 when the left leg is in front, -1 the right one."""
    run, forward = path.at(path.running, t), path.at(path.velocity[:, 1], t)
    size = np.clip(np.abs(forward) / 1.1, 0.0, 1.3) * style.swing * np.where(forward < 0.0, 0.5, 1.0)
    still = np.zeros_like(front)
    for side, ahead in enumerate((-front, front)):
        walking = ARM_AT_REST + np.stack(
            [style.out + 0.05 * size, 0.3 * size * ahead, -0.12 * size * ahead,
             style.elbow + 0.24 * size * (ahead + 0.1)], axis=-1,
        )  # fmt: skip
        running = np.stack(
            [still + 0.45 + style.out, -0.2 + 0.55 * min(style.swing, 1.3) * ahead, -0.3 - 0.2 * ahead,
             1.6 + 0.35 * ahead], axis=-1,
        )  # fmt: skip
        arm = walking + run[:, None] * (running - walking)
        arm[:, 3] = np.maximum(arm[:, 3], 0.05)
        pose.arm[:, side] = arm
    twist = 2.0 * front * np.clip(size, 0.0, 1.1)
    pose.pelvis[:, 0] -= (0.05 + 0.025 * run) * twist
    pose.spine[:, 0] += (0.08 + 0.09 * run) * twist
    pose.head[:, 0] -= (0.035 + 0.055 * run) * twist
    pose.spine[:, 1] += style.lean + 0.2 * run + 0.02
    pose.head[:, 1] += style.nod - 0.4 * style.lean - 0.1 * run
    pose.pelvis[:, 1] += 0.06 * run + 0.2 * style.lean
    lead = path.at(path.yaw, t + 0.25) - path.at(path.yaw, t)  # look and lean into a turn
    pose.head[:, 0] += 0.6 * lead
    pose.spine[:, 0] += 0.25 * lead
    pose.pelvis[:, 2] -= 0.15 * lead * np.clip(forward, 0.0, 2.0)


def travel(
    parts: list[Stretch], style: Style, rng: np.random.Generator, before: bool = False, after: bool = False
) -> Pose:
    """Plan a trip and pose the body along it, one row a frame.

    before: the first part was already under way at frame 0; after: the last part goes on beyond the last frame.
    """
    path = Path(parts, before, after, style)
    first = int(rng.integers(2))  # the foot that steps first
    leading = next((part for part in parts if part.kind != "stand"), None)
    if leading is not None and leading.kind in ("side", "turn"):
        first = 0 if np.sin(leading.drift) > 0.1 or leading.turn > 0 else 1
    t = np.arange(round(path.total * LIMITS.fps)) / LIMITS.fps
    pose = Pose.standing(len(t))
    steps = plan_steps(path, first)
    for side in (0, 1):
        pose.ankle[:, side], pose.foot[:, side] = foot_track(path, steps, side, t, style)
    speed, running, moving = path.at(path.speed, t), path.at(path.running, t), path.at(path.moving, t)
    # 0 halfway between the landing of one foot and the lift of the other, 1 half a stride later
    phase = path.at(path.phase, t) - (1.5 - stance_share(speed, running)) + first
    _pelvis(pose, path, t, phase, style)
    front = np.cos(np.pi * phase) * moving  # 1 when the left leg is in front, -1 when the right one is
    _upper(pose, path, t, front, style)
    pose.root[:, [0, 2]] += wobble(t, rng, 0.006, 2) * (1.0 - 0.5 * moving)[:, None]
    pose.arm += wobble(t, rng, 0.03, 8).reshape(len(t), 2, 4) * np.array([1.0, 1.0, 1.0, 1.5])
    pose.head += wobble(t, rng, 0.05, 3, slowest=4.0)
    pose.spine += wobble(t, rng, 0.015, 3)
    return pose


def _pelvis(pose: Pose, path: Path, t: Array, phase: Array, style: Style) -> None:
    """The pelvis on its path: lowest with both feet down in a walk, highest in the flight of a run, over the leg that
    stands, dropped a little on the side of the leg that swings."""
    speed, running, moving = path.at(path.speed, t), path.at(path.running, t), path.at(path.moving, t)
    place, yaw = path.at(path.position, t), path.at(path.yaw, t)
    pace = np.clip(speed / 1.1, 0.0, 1.3) * style.bounce
    both = np.cos(2.0 * np.pi * phase)  # 1 halfway between landing and lift
    pose.root[:, 1] = STANDING - style.crouch - 0.016 * np.clip(pace, 0.0, 1.0) - 0.012 * running
    flying = 0.062 * running * np.clip(speed / 3.0, 0.3, 1.0)
    pose.root[:, 1] += both * (flying - 0.018 * pace * (1.0 - running))
    ahead = 0.02 * np.sin(2.0 * np.pi * phase) * np.clip(pace, 0.0, 1.0) * (1.0 - 2.0 * running)
    sway = np.sin(np.pi * phase) * moving  # towards the left when the left leg stands
    left = 0.018 * sway * style.bounce
    pose.pelvis[:, 0] = yaw
    pose.pelvis[:, 2] = -0.05 * sway * np.clip(pace, 0.0, 1.0)
    pose.root[:, 0] = place[:, 0] + ahead * np.sin(yaw) + left * np.cos(yaw)
    pose.root[:, 2] = place[:, 1] + ahead * np.cos(yaw) - left * np.sin(yaw)
