"""Where the pelvis goes and where the feet land: a path over the floor and footsteps planned in the world. numpy only.

A trip is a list of parts (`Stretch`): walk, run, back, side, turn on the spot, stand. The pelvis path is integrated
from their speeds and turns; every step is placed from the path at a moment of its own stance and then stays there.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from playground.motion.curves import ease, hermite, smooth
from playground.motion.rig import FLAT, SIGN, toe_offset

Array = NDArray[np.floating]

FINE = 100.0  # samples a second while planning
ROLL = 1.4  # how the pitch of the foot grows from heel-off to lift: time to this power
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
    stagger: float = 0.0  # left foot ahead and right foot behind by this much while standing, metres


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


def stance_share(speed: Array, running: Array) -> Array:
    """Part of a stride that a foot is on the ground: about 0.62 walking, down to 0.28 in a fast run; running 0..1."""
    walk = 0.65 - 0.03 * np.minimum(speed, 1.5)
    return np.asarray(walk + running * (0.63 - 0.35 * ease((speed - 0.8) / 2.0) - walk))


class Path:
    """Pelvis path over the floor at FINE samples a second.

    t [n] seconds; position [n, 2] (x, z) metres; yaw [n]; velocity [n, 2] in the body frame (left, forwards);
    speed [n]; kind [n]; moving and running [n] 0..1; phase [n] in steps: a foot lifts at every whole number.
    """

    def __init__(self, parts: list[Stretch], before: bool, after: bool, style: Style) -> None:
        edges = np.cumsum([0.0] + [p.seconds for p in parts])
        self.total = float(edges[-1])
        self.t = np.arange(-LEAD, self.total + LEAD, 1.0 / FINE)
        which = np.clip(np.searchsorted(edges, self.t, side="right") - 1, 0, len(parts) - 1)
        inside = ((self.t >= 0) | before) & ((self.t < self.total) | after)
        self.kind = np.where(inside, np.array([p.kind for p in parts])[which], "stand")
        goal = np.array([p.speed for p in parts])[which] * inside
        drift = np.array([p.drift for p in parts])[which]
        self.ramp = 0.1 + 0.07 * float(goal.max())  # seconds; it takes longer to reach the speed of a run
        velocity = goal[:, None] * np.stack([np.sin(drift), np.cos(drift)], axis=-1)
        self.velocity = smooth(velocity, self.ramp * FINE)
        self.speed = np.linalg.norm(self.velocity, axis=-1)
        self.yaw = np.zeros(len(self.t))
        for part, start in zip(parts, edges[:-1], strict=True):
            margin = 0.02 if part.kind == "turn" else 0.12 * part.seconds
            done = (self.t - start - margin) / max(part.seconds - 2.0 * margin, 0.1)
            self.yaw += part.turn * (ease(done) if part.kind == "turn" else _arc(done))
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        left, ahead = self.velocity.T
        world = np.stack([left * cos + ahead * sin, ahead * cos - left * sin], axis=-1)
        self.position = np.cumsum(world, axis=0) / FINE
        self.position -= self.at(self.position, 0.0)
        self.moving = smooth((self.kind != "stand").astype(np.float64), 0.12 * FINE)
        self.running = smooth((self.kind == "run").astype(np.float64), 0.15 * FINE) * ease((self.speed - 0.8) / 1.2)
        self.phase = self._phase(goal, after, style)

    def at(self, values: Array, t: Array | float) -> Array:
        """Linear interpolation of a sampled quantity [n] or [n, k] at t seconds."""
        if values.ndim == 1:
            return np.asarray(np.interp(t, self.t, values))
        return np.stack([np.interp(t, self.t, values[:, i]) for i in range(values.shape[1])], axis=-1)

    def passes(self, start: float, stop: float, share: float) -> float:
        """When, between start and stop, this share of the way and of the turn between them is done."""
        t = np.linspace(start, stop, 50)
        way = self.at(self.speed, t) * (stop - start) / 50.0
        way[1:] += 0.2 * np.abs(np.diff(self.at(self.yaw, t))) + 1e-9  # metres; a turn on the spot counts too
        done = np.cumsum(way) - way[0]
        return float(np.interp(share * done[-1], done, t))

    def _phase(self, goal: Array, after: bool, style: Style) -> Array:
        """Phase in steps [n]; a block of travelling that ends at rest gets a whole number of steps.

        The first foot lifts before the body has gathered speed, the last one lands after it has slowed down."""
        active = self.kind != "stand"
        early, late = round((0.1 + 0.9 * self.ramp) * FINE), round(2.3 * self.ramp * FINE)
        change = np.diff(active.astype(int))
        for i in np.flatnonzero(change == 1):
            active[max(i - early, 0) : i + 1] = True
            self.kind[max(i - early, 0) : i + 1] = self.kind[i + 1]
            goal[max(i - early, 0) : i + 1] = goal[i + 1]
        for i in np.flatnonzero(change == -1):
            active[i + 1 : i + 1 + late] = True
            self.kind[i + 1 : i + 1 + late] = self.kind[i]
            goal[i + 1 : i + 1 + late] = goal[i]
        flips = np.flatnonzero(np.diff(np.concatenate([[0], active.astype(int), [0]])))
        rate = np.zeros(len(self.t))
        for start, stop in zip(flips[::2], flips[1::2], strict=True):
            pairs = zip(goal[start:stop], self.kind[start:stop], strict=True)
            rhythm = smooth(np.array([cadence(float(g), str(k)) for g, k in pairs]) * style.cadence, 0.2 * FINE)
            steps = max(round(float(rhythm.sum() / FINE)), 2)
            whole = not (after and stop == len(self.t))
            rate[start:stop] = rhythm * (steps * FINE / rhythm.sum() if whole else 1.0)
        return np.concatenate([[0.0], np.cumsum(rate)[:-1]]) / FINE


def _arc(done: Array) -> Array:
    """Share of a turn done: constant rate with soft ends, so that long turns are arcs."""
    soft = 0.2
    u = np.clip(done, 0.0, 1.0)
    middle = np.where(u > 1.0 - soft, 1.0 - soft - (1.0 - u) ** 2 / (2.0 * soft), u - soft / 2.0)
    return np.where(u < soft, u**2 / (2.0 * soft), middle) / (1.0 - soft)


def plan_steps(path: Path, first: int) -> list[Step]:
    """Alternating steps, `first` is the side of the first one."""
    steps: list[Step] = []
    begin = float(path.t[np.argmax(path.phase > 0)])
    for number in range(int(np.ceil(path.phase[-1] - 1e-6))):
        lift = float(np.interp(number + 1e-9, path.phase, path.t)) if number else begin
        speed, running = path.at(path.speed, lift + 0.4), path.at(path.running, lift + 0.4)
        swing = 2.0 * (1.0 - float(stance_share(speed, running)))  # in steps
        rate = float(path.at(path.phase, lift + 0.12) - path.at(path.phase, lift + 0.02)) / 0.1
        steps.append(Step((first + number) % 2, lift, lift + swing / max(rate, 1.0)))
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
            share = 0.5 - 0.1 * np.clip(forward, -0.5, 1.0) - 0.1 * np.clip(forward - 1.0, 0.0, 2.0)
            moment = path.passes(land, lift, share)
            sideways = abs(float(path.at(path.velocity[:, 0], moment)))
            lateral, stood = 0.055 + 0.5 * sideways / cadence(sideways, "side") + 0.02 * (sideways > 0.05), False
            if np.ptp(path.at(path.phase, np.array([lift, lift + 0.3]))) == 0:
                lateral, stood = 0.09, True
        yaw = float(path.at(path.yaw, moment))
        out = SIGN[side] * (lateral + style.width)
        back = SIGN[side] * style.stagger - 0.04 if stood else -0.015
        spot = path.at(path.position, moment) + out * np.array([np.cos(yaw), -np.sin(yaw)])
        spots.append((spot + back * np.array([np.sin(yaw), np.cos(yaw)]), yaw + SIGN[side] * (0.12 if stood else 0.07)))
    return spots


def _pitches(path: Path, step: Step) -> tuple[float, float]:
    """Foot pitch when it leaves the ground and when it lands (radians, toes up positive)."""
    forward = float(path.at(path.velocity[:, 1], 0.5 * (step.lift + step.land)))
    after = float(path.at(path.velocity[:, 1], step.land + 0.15))
    if forward < -0.1:
        return -0.05, -0.35
    pace = float(np.clip(forward / 1.1, 0.0, 1.2))
    landing = 0.38 * float(np.clip(after / 1.1, 0.0, 1.0)) * (1.0 - 0.5 * float(path.at(path.running, step.land)))
    return -0.1 - 0.85 * pace, landing


def _roll(base: Array, yaw: float, pitch: Array, side: int) -> Array:
    """Ankle [n, 3] of a foot whose toe stays where a flat foot with its ankle at `base` has it; pitch [n] below 0."""
    angles = np.stack([np.full(len(pitch), yaw), np.minimum(pitch, 0.0)], axis=-1)
    return np.asarray(base + toe_offset(np.array([yaw, 0.0]), side) - toe_offset(angles, side))


def foot_track(path: Path, steps: list[Step], side: int, t: Array, style: Style) -> tuple[Array, Array]:
    """Ankle [n, 3] and foot yaw and pitch [n, 2] of one side at times t. The toe stays put from flat to lift, the ankle
    from landing to heel-off."""
    own = [s for s in steps if s.side == side]
    spots = _placements(path, steps, side, style)
    pitches = [_pitches(path, s) for s in own]
    bases = [np.array([spot[0], FLAT[side], spot[1]]) for spot, _ in spots]
    lengths = [np.inf] * len(spots)  # seconds from heel-off to lift
    foot, ankle = np.zeros((len(t), 2)), np.zeros((len(t), 3))
    for n, (_, yaw) in enumerate(spots):
        land = own[n - 1].land if n else -np.inf
        lift = own[n].lift if n < len(own) else np.inf
        here = (t >= land) & (t <= lift)
        pitch = np.zeros(int(here.sum()))
        if n:
            pitch += pitches[n - 1][1] * (1.0 - ease((t[here] - land) / min(0.13, 0.4 * (lift - land))))
        if n < len(own):
            lengths[n] = min(0.3 * (own[n].land - own[n].lift) + 0.09, 0.75 * (lift - land))
            pitch += pitches[n][0] * np.clip(1.0 - (lift - t[here]) / lengths[n], 0.0, 1.0) ** ROLL
        foot[here] = np.stack([np.full(len(pitch), yaw), pitch], axis=-1)
        ankle[here] = _roll(bases[n], yaw, pitch, side)
    for n, step in enumerate(own):
        air = (t > step.lift) & (t < step.land)
        rate = ROLL * pitches[n][0] / lengths[n]
        ends = ((bases[n], spots[n][1], pitches[n][0]), (bases[n + 1], spots[n + 1][1], pitches[n][1]))
        ankle[air], foot[air] = _swing(path, step, t[air], ends, rate)
    return ankle, foot


End = tuple[Array, float, float]  # ankle of the flat foot [3], foot yaw, foot pitch


def _swing(path: Path, step: Step, t: Array, ends: tuple[End, End], rate: float) -> tuple[Array, Array]:
    """Ankle [n, 3] and foot [n, 2] of one swing.

    It leaves with the velocity of the heel-off (`rate` radians a second of pitch) and lands at rest, with a lift that
    grows with the speed."""
    (old, old_yaw, leave), (new, new_yaw, arrive) = ends
    span, side = step.land - step.lift, step.side
    u = (t - step.lift) / span
    middle = 0.5 * (step.lift + step.land)
    speed, run = float(path.at(path.speed, middle)), float(path.at(path.running, middle))
    around = _roll(old, old_yaw, np.array([leave - 1e-3, leave]), side)
    slope = (around[1] - around[0]) / 1e-3 * rate * span if leave < 0 else np.zeros(3)
    stop = _roll(new, new_yaw, np.array([arrive]), side)[0]
    level = hermite(u[:, None], around[1], stop, slope, 0.25 * run * (stop - around[1]))
    height = hermite(u, around[1, 1], stop[1], slope[1], -0.35 * run)
    extra = 0.035 + 0.015 * min(speed, 1.2)
    height += (extra + run * (0.085 * speed - 0.03)) * u**2 * (1.0 - u) ** 3 / 0.03456
    turned = (new_yaw - old_yaw + np.pi) % (2 * np.pi) - np.pi
    foot = np.stack([old_yaw + ease(u) * turned, hermite(u, leave, arrive, max(rate * span, -0.8))], axis=-1)
    clear = -toe_offset(foot, side)[:, 1] + 0.022 * np.sin(np.pi * u)
    height = 0.5 * (height + clear + np.sqrt((height - clear) ** 2 + 0.012**2 * np.sin(np.pi * u) ** 2))  # soft maximum
    return np.stack([level[:, 0], height, level[:, 2]], axis=-1), foot
