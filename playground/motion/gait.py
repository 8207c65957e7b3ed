"""Locomotion for the synthetic corpus: a pelvis path, footsteps planned in the world, arms against legs. numpy only.

A trip is a list of legs (`Stretch`): walk, run, backwards, sideways, turn on the spot, stand. The pelvis path is integrated
from their speeds and turns; every step is placed from the path at a moment of its own stance and then stays where it is.
Cadence, stance share, foot pitch and pelvis motion follow the speed; the constants were read off recorded walks and runs.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from playground.motion.curves import ease, hermite, smooth, wobble
from playground.motion.rig import ARM_AT_REST, FLAT, SIGN, Pose, toe_offset

Array = NDArray[np.float64]

FINE = 100.0  # samples a second while planning
LEAD = 2.0  # seconds planned before the first and after the last frame, so that a motion may start and end mid-step


@dataclass(frozen=True)
class Style:
    """How somebody moves. Multipliers are 1 and additions (radians, metres) 0 for a neutral person."""

    speed: float = 1.0  # of the pace
    cadence: float = 1.0  # of the steps a second
    swing: float = 1.0  # of the arm swing
    bounce: float = 1.0  # of the vertical and sideways motion of the pelvis
    lean: float = 0.0  # chest pitched forwards
    nod: float = 0.0  # head pitched forwards
    out: float = 0.0  # arms held away from the body
    elbow: float = 0.0  # more bend of the elbow
    crouch: float = 0.0  # pelvis lower, metres
    width: float = 0.0  # feet farther apart, metres a foot


@dataclass(frozen=True)
class Stretch:
    """One part of a trip. kind: walk, run, back, side, turn or stand; turn in radians to the left over the part;
    drift is the direction of travel against the facing (0 forwards, pi/2 left, pi backwards)."""

    kind: str
    seconds: float
    speed: float = 0.0
    turn: float = 0.0
    drift: float = 0.0


@dataclass(frozen=True)
class Step:
    """One foot's swing: lifts at `lift`, lands at `land` (seconds); on the ground from land to the foot's next lift."""

    side: int
    lift: float
    land: float


@dataclass
class Trip:
    """A planned trip: the pose of every frame plus what the tests and captions need to know."""

    pose: Pose
    steps: list[Step]
    moving: Array  # [F] 0 standing .. 1 travelling
    seconds: float


def cadence(speed: float, kind: str) -> float:
    """Steps a second at a speed (m/s)."""
    if kind == "run":
        return 2.5 + 0.1 * speed
    if kind == "turn":
        return 1.7
    if kind == "side":
        return 1.35 + 0.9 * speed
    if kind == "back":
        return 1.35 + 0.55 * speed
    return 1.2 + 0.6 * speed


def stance_share(speed: float, kind: str) -> float:
    """Part of a stride that a foot is on the ground: about 0.62 walking, 0.36 running."""
    return 0.63 - 0.27 * float(ease((speed - 1.0) / 1.6)) if kind == "run" else 0.65 - 0.03 * min(speed, 1.5)


class Path:
    """Pelvis path over the floor at FINE samples a second: position [n, 2] (x, z), yaw, speed, phase in steps."""

    def __init__(self, parts: list[Stretch], before: bool, after: bool, style: Style) -> None:
        self.parts = parts
        edges = np.cumsum([0.0] + [p.seconds for p in parts])
        self.total = float(edges[-1])
        self.t = np.arange(-LEAD, self.total + LEAD, 1.0 / FINE)
        which = np.clip(np.searchsorted(edges, self.t, side="right") - 1, 0, len(parts) - 1)
        inside = ((self.t >= 0) | before) & ((self.t < self.total) | after)
        self.kind = np.array([p.kind for p in parts])[which]
        self.kind[~inside] = "stand"
        speed = np.array([p.speed for p in parts])[which] * inside
        drift = np.array([p.drift for p in parts])[which]
        velocity = speed[:, None] * np.stack([np.sin(drift), np.cos(drift)], axis=-1)  # in the body frame: left, forwards
        velocity = smooth(velocity, (0.16 if speed.max() < 1.8 else 0.32) * FINE)
        self.yaw = np.zeros(len(self.t))
        for part, start in zip(parts, edges[:-1], strict=True):
            margin = 0.12 * part.seconds if part.kind != "turn" else 0.02
            self.yaw += part.turn * _turned((self.t - start - margin) / max(part.seconds - 2 * margin, 0.1), part.kind)
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        world = np.stack([velocity[:, 0] * cos + velocity[:, 1] * sin, velocity[:, 1] * cos - velocity[:, 0] * sin], -1)
        self.position = np.cumsum(world, axis=0) / FINE
        self.position -= self.at(self.position, 0.0)
        self.velocity, self.speed = velocity, np.linalg.norm(velocity, axis=-1)
        self.moving = smooth((self.kind != "stand").astype(np.float64), 0.12 * FINE)
        self.running = smooth((self.kind == "run").astype(np.float64), 0.15 * FINE) * ease((self.speed - 0.8) / 1.2)
        self.phase, self.blocks = self._phase(before, after, style)

    def at(self, values: Array, t: float | Array) -> Array:
        """Linear interpolation of a sampled quantity at t seconds."""
        if values.ndim == 1:
            return np.asarray(np.interp(t, self.t, values))
        return np.stack([np.interp(t, self.t, values[:, i]) for i in range(values.shape[1])], axis=-1)

    def _phase(self, before: bool, after: bool, style: Style) -> tuple[Array, list[tuple[float, float]]]:
        """Phase in steps [n]; whole numbers of steps in every block of travelling that starts and ends at rest."""
        active = self.kind != "stand"
        early, late = round((0.22 if self.speed.max() < 1.8 else 0.4) * FINE), round((0.12 if self.speed.max() < 1.8 else 0.3) * FINE)  # the first foot lifts before the body has gathered speed
        for i in np.flatnonzero(np.diff(active.astype(int)) == 1):
            active[max(i - early, 0) : i + 1] = True
            self.kind[max(i - early, 0) : i + 1] = self.kind[i + 1]
        for i in np.flatnonzero(np.diff(active.astype(int)) == -1):
            active[i : i + late] = True
            self.kind[i : i + late] = self.kind[i]
        flips = np.flatnonzero(np.diff(np.concatenate([[0], active.astype(int), [0]])))
        rate = np.zeros(len(self.t))
        blocks = []
        for start, stop in zip(flips[::2], flips[1::2], strict=True):
            goal = np.array([self._goal(i) for i in range(start, stop)])
            rhythm = np.array([cadence(g, str(k)) for g, k in zip(goal, self.kind[start:stop], strict=True)])
            rhythm = smooth(rhythm * style.cadence, 0.2 * FINE)
            steps = max(round(float(rhythm.sum() / FINE)), 2)
            whole = not (before and start == 0) and not (after and stop == len(self.t))
            rate[start:stop] = rhythm * (steps * FINE / rhythm.sum() if whole else 1.0)
            blocks.append((self.t[start], self.t[min(stop, len(self.t) - 1)]))
        return np.concatenate([[0.0], np.cumsum(rate)[:-1]]) / FINE, blocks

    def _goal(self, i: int) -> float:
        edges = np.cumsum([0.0] + [p.seconds for p in self.parts])
        return self.parts[int(np.clip(np.searchsorted(edges, self.t[i], side="right") - 1, 0, len(self.parts) - 1))].speed


def _turned(u: Array, kind: str) -> Array:
    """Share of a turn done: constant rate with soft ends, so that long turns are arcs."""
    if kind == "turn":
        return ease(u)
    soft = 0.2
    v = np.clip(u, 0.0, 1.0)
    ramp = np.where(v < soft, v**2 / (2 * soft), np.where(v > 1 - soft, 1 - soft - (1 - v) ** 2 / (2 * soft), v - soft / 2))
    return ramp / (1.0 - soft)


def plan_steps(path: Path, first: int) -> list[Step]:
    """Alternating steps: one lifts whenever the phase passes a whole number."""
    steps: list[Step] = []
    side = first
    total = path.phase[-1]
    for number in range(int(np.ceil(total - 1e-6))):
        lift = float(np.interp(number + 1e-9, path.phase, path.t)) if number else float(path.t[np.argmax(path.phase > 0)])
        index = min(int((lift - path.t[0]) * FINE) + 2, len(path.t) - 1)
        kind = str(path.kind[index])
        speed = float(path.at(path.speed, lift + 0.2))
        swing = 2.0 * (1.0 - stance_share(speed, kind))
        rate = max((path.phase[min(index + 10, len(path.t) - 1)] - path.phase[index]) * FINE / 10.0, 1.0)
        steps.append(Step(side, lift, lift + swing / rate))
        side = 1 - side
    return steps


def _placements(path: Path, steps: list[Step], side: int, style: Style) -> list[tuple[Array, float]]:
    """Ankle position [2] and yaw of every stance of one foot, the first before its first step."""
    own = [s for s in steps if s.side == side]
    spots = []
    for land, lift in zip([path.t[0]] + [s.land for s in own], [s.lift for s in own] + [np.inf], strict=True):
        if not np.isfinite(lift):
            moment, lateral, stood = path.t[-1], 0.09, True
        elif land <= path.t[0]:
            moment, lateral, stood = path.t[0], 0.09, True
        else:
            forward = float(path.at(path.velocity[:, 1], 0.5 * (land + lift)))
            moment = land + (lift - land) * (0.5 - 0.1 * np.clip(forward, -0.5, 1.0) - 0.1 * np.clip(forward - 1, 0, 2))
            sideways = abs(float(path.at(path.velocity[:, 0], moment)))
            lateral, stood = 0.055 + 0.5 * sideways / cadence(sideways, "side") + 0.02 * (sideways > 0.05), False
            if np.ptp(path.at(path.phase, np.array([lift, lift + 0.3]))) == 0:
                lateral, stood = 0.09, True
        yaw = float(path.at(path.yaw, moment))
        out = SIGN[side] * (lateral + style.width)
        back = -0.015
        spot = path.at(path.position, moment) + out * np.array([np.cos(yaw), -np.sin(yaw)])
        spots.append((spot + back * np.array([np.sin(yaw), np.cos(yaw)]), yaw + SIGN[side] * (0.12 if stood else 0.07)))
    return spots


def _pitches(path: Path, step: Step) -> tuple[float, float]:
    """Foot pitch when it leaves the ground and when it lands (radians, toes up positive)."""
    forward = float(path.at(path.velocity[:, 1], 0.5 * (step.lift + step.land)))
    after = float(path.at(path.velocity[:, 1], step.land + 0.15))
    if forward < -0.1:
        return 0.15, -0.45
    pace = float(np.clip(forward / 1.1, 0.0, 1.3))
    landing = 0.38 * float(np.clip(after / 1.1, 0.0, 1.0)) * (1.0 - 0.5 * float(path.at(path.running, step.land)))
    return -0.12 - 0.55 * pace, landing


def _foot_track(path: Path, steps: list[Step], side: int, t: Array, style: Style) -> tuple[Array, Array]:
    """Ankle [n, 3] and foot yaw and pitch [n, 2] of one side at times t. The toe stays put from flat to lift, the ankle
    from landing to heel-off."""
    own = [s for s in steps if s.side == side]
    spots = _placements(path, steps, side, style)
    pitches = [_pitches(path, s) for s in own]
    foot = np.zeros((len(t), 2))
    ankle = np.zeros((len(t), 3))
    for n, (spot, yaw) in enumerate(spots):
        land = own[n - 1].land if n else -np.inf
        lift = own[n].lift if n < len(own) else np.inf
        here = (t >= land) & (t <= lift)
        pitch = np.zeros(here.sum())
        if n:
            pitch += pitches[n - 1][1] * (1.0 - ease((t[here] - land) / 0.13))
        if n < len(own):
            length = min(0.3 * (own[n].land - own[n].lift) + 0.09, 0.7 * (lift - land))
            leave = pitches[n][0]
            pitch += leave * np.clip(1.0 - (lift - t[here]) / length, 0.0, 1.0) ** 2
        foot[here] = np.stack([np.full(here.sum(), yaw), pitch], axis=-1)
        base = np.array([spot[0], FLAT[side], spot[1]])
        down = np.minimum(pitch, 0.0)
        toe = base + toe_offset(np.array([yaw, 0.0]), side)
        ankle[here] = toe - toe_offset(np.stack([np.full(here.sum(), yaw), down], axis=-1), side)
    for n, step in enumerate(own):
        _swing(path, step, side, t, ankle, foot, (spots[n], spots[n + 1]), pitches[n])
    return ankle, foot


def _swing(
    path: Path, step: Step, side: int, t: Array, ankle: Array, foot: Array,
    spots: tuple[tuple[Array, float], tuple[Array, float]], pitches: tuple[float, float],
) -> None:  # fmt: skip
    """Fill the frames of one swing: from the pose at lift to the pose at landing, with a lift that grows with speed."""
    air = (t > step.lift) & (t < step.land)
    u = (t[air] - step.lift) / (step.land - step.lift)
    (old, old_yaw), (new, new_yaw) = spots
    start = np.array([old[0], FLAT[side], old[1]]) + toe_offset(np.array([old_yaw, 0.0]), side)
    start = start - toe_offset(np.array([old_yaw, min(pitches[0], 0.0)]), side)
    low = min(pitches[1], 0.0)
    stop = np.array([new[0], FLAT[side], new[1]]) + toe_offset(np.array([new_yaw, 0.0]), side)
    stop = stop - toe_offset(np.array([new_yaw, low]), side)
    speed = float(path.at(path.speed, 0.5 * (step.lift + step.land)))
    run = float(path.at(path.running, 0.5 * (step.lift + step.land)))
    stepping = float(np.clip(speed / 0.8, 0.0, 1.0))
    share = hermite(u, 0.0, 1.0, 0.25 + 0.5 * stepping)
    ankle[air, 0] = start[0] + share * (stop[0] - start[0])
    ankle[air, 2] = start[2] + share * (stop[2] - start[2])
    rise = 0.3 + 0.2 * stepping + run * (0.45 * speed)
    ankle[air, 1] = hermite(u, start[1], stop[1], rise, -0.1 * run)
    turned = (new_yaw - old_yaw + np.pi) % (2 * np.pi) - np.pi
    foot[air, 0] = old_yaw + ease(u) * turned
    foot[air, 1] = hermite(u, pitches[0], pitches[1], 2.2 * pitches[0], 0.0)
    clear = -toe_offset(foot[air], side)[:, 1] + 0.012 * np.sin(np.pi * u)
    ankle[air, 1] = np.maximum(ankle[air, 1], clear)


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
    pose.spine[:, 1] += style.lean + 0.2 * run - 0.02
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
        pose.ankle[:, side], pose.foot[:, side] = _foot_track(path, steps, side, t, style)
    xz, yaw = path.at(path.position, t), path.at(path.yaw, t)
    speed, run, moving = path.at(path.speed, t), path.at(path.running, t), path.at(path.moving, t)
    phase = path.at(path.phase, t)
    share = 0.63 - 0.27 * run
    middle = phase - (1.5 - 2.0 * share + 1.0) + 0.5  # 0 halfway between a landing and the other foot's lift
    pace = np.clip(speed / 1.1, 0.0, 1.3) * style.bounce
    up = np.cos(2 * np.pi * (middle - 0.0))
    pose.root[:, 1] = 0.948 - style.crouch - 0.016 * np.clip(pace, 0, 1) - 0.012 * run
    pose.root[:, 1] += up * (-0.018 * pace * (1 - run) + 0.062 * run * np.clip(speed / 3.0, 0.3, 1.0))
    ahead = 0.02 * np.sin(2 * np.pi * middle) * np.clip(pace, 0, 1) * (1 - run)
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
