"""Gestures and whole-body actions that are laid over a standing or travelling pose. numpy only.

Hands, punches, squats, bows, sitting, kicks, jumps. Every function changes a `Pose` in place between `start` and `stop`
(seconds; t [F] is the time of every frame). Arm targets are (outwards, forwards, twist, elbow) in radians, see rig.py;
they were read off recorded clips.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from playground.motion.curves import ease, hermite, keyed, window
from playground.motion.rig import FLAT, SIGN, Pose

Array = NDArray[np.floating]

GRAVITY = 9.81
RAISED = {  # where a raised hand may end up
    "beside the head": (0.95, 1.15, 0.42, 1.95),
    "overhead": (2.45, 0.45, 1.2, 0.15),
    "high and forward": (1.2, 2.1, 0.4, 0.35),
    "out and up": (1.95, 0.75, 0.6, 0.75),
}
WAVES = {  # base and swing of a wave; the swing is added and subtracted once a repetition
    "overhead": ((2.05, 1.1, 0.6, 0.62), (-0.12, 0.38, -0.38, 0.5)),
    "beside the head": ((0.95, 1.1, 0.5, 1.9), (0.05, -0.1, 0.5, -0.22)),
    "wide": ((1.95, 0.45, 0.75, 0.6), (0.5, 0.15, 0.05, 0.3)),
}
GUARD = (0.3, 0.45, -0.35, 2.25)
PUNCHED = (0.12, 1.5, -0.6, 0.12)


def forward_left(yaw: Array) -> tuple[Array, Array]:
    """Unit vectors [F, 3] that point forwards and to the left of a body with this yaw [F]."""
    cos, sin, zero = np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)
    return np.stack([sin, zero, cos], axis=-1), np.stack([cos, zero, -sin], axis=-1)


def _arm(pose: Pose, side: int, share: Array, target: ArrayLike) -> None:
    """Blend one arm towards a target [4] or [F, 4] by share [F]; the elbow bends a little more on the way."""
    arm = pose.arm[:, side]
    arm += share[:, None] * (np.asarray(target) - arm)
    arm[:, 3] += 1.6 * share * (1.0 - share)


def raise_hand(pose: Pose, t: Array, start: float, stop: float, side: int, place: str, move: float = 0.6) -> None:
    """Lift one hand to a place of RAISED in `move` seconds, hold it, lower it; up to the end if stop is beyond it."""
    share = window(t, start, stop, move)
    _arm(pose, side, share, RAISED[place])
    pose.spine[:, 2] += SIGN[side] * 0.05 * share
    pose.head[:, 1] -= 0.06 * share


def wave_hand(
    pose: Pose, t: Array, start: float, stop: float, side: int, place: str, times: int, size: float = 1.0,
    move: float = 0.5,
) -> None:  # fmt: skip
    """Lift one hand and wave it `times` times to and fro."""
    base, swing = (np.asarray(x) for x in WAVES[place])
    share = window(t, start, stop, move)
    begin, end = start + 0.8 * move, stop - 0.8 * move
    turns = np.clip((t - begin) / (end - begin), 0.0, 1.0) * times
    beat = np.sin(2.0 * np.pi * turns) * window(t, begin - 0.1, end + 0.1, 0.2)
    _arm(pose, side, share, base + size * swing * beat[:, None])
    pose.spine[:, 2] += SIGN[side] * (0.04 * share - 0.03 * beat * share)


def punch(pose: Pose, t: Array, start: float, stop: float, sides: list[int]) -> None:
    """Fists up, then one straight punch for every entry of `sides`."""
    guard = window(t, start, stop, 0.4)
    for side in (0, 1):
        _arm(pose, side, guard, GUARD)
    beat = (stop - start - 0.8) / len(sides)
    for number, side in enumerate(sides):
        begin = start + 0.4 + number * beat
        out = min(0.22, 0.4 * beat)
        share = window(t, begin, begin + 2.0 * out + 0.06, out)
        pose.arm[:, side] += share[:, None] * (np.asarray(PUNCHED) - pose.arm[:, side])
        pose.spine[:, 0] -= SIGN[side] * 0.35 * share
        pose.head[:, 0] += SIGN[side] * 0.3 * share
        pose.root += 0.05 * share[:, None] * forward_left(pose.pelvis[:, 0])[0]
    pose.root[:, 1] -= 0.04 * guard


def squat(pose: Pose, t: Array, start: float, stop: float, times: int, depth: float) -> None:
    """`times` knee bends of `depth` metres, arms stretched forwards."""
    beat = (stop - start) / times
    keys: list[tuple[float, float]] = [(start, 0.0)]
    for number in range(times):
        keys += [(start + (number + at) * beat, down) for at, down in ((0.42, 1.0), (0.54, 1.0), (0.98, 0.0))]
    down = keyed(t, keys)
    forward, _ = forward_left(pose.pelvis[:, 0])
    pose.root[:, 1] -= depth * down
    pose.root -= 0.3 * depth * down[:, None] * forward
    pose.pelvis[:, 1] += 0.7 * depth * down
    pose.spine[:, 1] += 0.75 * depth * down
    pose.head[:, 1] -= 0.85 * depth * down
    pose.splay += 0.5 * depth * down[:, None]
    for side in (0, 1):
        pose.arm[:, side] += down[:, None] * (np.array([0.15, 1.45, -0.3, 0.25]) - pose.arm[:, side])


def bow(pose: Pose, t: Array, start: float, stop: float, depth: float) -> None:
    """Bend the trunk forwards by `depth` radians, hold, straighten; the arms keep hanging."""
    move = 0.38 * (stop - start)
    share = window(t, start, stop, move)
    forward, _ = forward_left(pose.pelvis[:, 0])
    pose.pelvis[:, 1] += 0.45 * depth * share
    pose.spine[:, 1] += 0.55 * depth * share
    pose.head[:, 1] += 0.2 * depth * share
    pose.root -= (0.11 * depth * share)[:, None] * forward
    pose.root[:, 1] -= 0.015 * share
    pose.arm[:, :, 1] += (0.75 * depth * share)[:, None]


def sit(pose: Pose, t: Array, start: float, down: float, up: float | None, seat: float) -> None:
    """Sit down on a seat (pelvis height, metres) from `start` to `down` seconds; stand up again from `up` if given."""
    keys = [(start, 0.0), (down, 1.0)] + ([(up, 1.0), (up + down - start, 0.0)] if up is not None else [])
    seated = keyed(t, keys)
    moving = 4.0 * seated * (1.0 - seated)
    forward, _ = forward_left(pose.pelvis[:, 0])
    pose.root[:, 1] += seated * (seat - pose.root[:, 1])
    pose.root -= (0.40 * ease(seated * 1.05))[:, None] * forward
    pose.pelvis[:, 1] += 0.35 * moving - 0.08 * seated
    pose.spine[:, 1] += 0.35 * moving + 0.05 * seated
    pose.head[:, 1] -= 0.25 * moving
    for side in (0, 1):
        pose.arm[:, side] += seated[:, None] * (np.array([0.22, 0.62, -0.45, 0.75]) - pose.arm[:, side])
        pose.arm[:, side, 1] += 0.5 * moving


def kick(pose: Pose, t: Array, start: float, stop: float, side: int, times: int, height: float) -> None:
    """`times` front kicks that lift the ankle `height` metres; the weight goes to the other leg, the arms balance."""
    beat = (stop - start) / times
    ankle, foot = np.zeros((len(t), 3)), np.zeros(len(t))  # forwards, outwards, up
    swing = np.zeros(len(t))
    weight = window(t, start - 0.35, stop + 0.2, 0.4)
    reach = 0.9 * float(np.sqrt(max(0.8**2 - (0.86 - height) ** 2, 0.0)))  # forwards, with the leg almost stretched
    for number in range(times):
        at = lambda share, begin=start + number * beat: begin + share * beat  # noqa: E731
        path = [(at(0.0), (0, 0, 0)), (at(0.3), (-0.24, 0, 0.22)), (at(0.42), (0.12, 0, 0.30)),
                (at(0.56), (reach, 0, height)), (at(0.74), (0.22, 0, 0.28)),
                (at(0.98), (0, 0, 0))]  # fmt: skip
        ankle += _through(t, path)
        up = -0.35 + 0.5 * height
        foot += keyed(t, [(at(0.0), 0.0), (at(0.25), -0.8), (at(0.56), up), (at(0.75), -0.3), (at(0.95), 0.0)])
        swing += keyed(t, [(at(0.0), 0.0), (at(0.28), -0.35), (at(0.56), 1.0), (at(0.97), 0.0)])
    forward, left = forward_left(pose.pelvis[:, 0])
    pose.ankle[:, side] += ankle[:, :1] * forward + ankle[:, 2:] * np.array([0.0, 1.0, 0.0])
    pose.foot[:, side, 1] += foot
    pose.root -= (SIGN[side] * 0.07 * weight)[:, None] * left
    pose.root[:, 1] -= 0.015 * weight
    pose.root += (0.03 * swing)[:, None] * forward
    pose.pelvis[:, 1] -= 0.22 * np.maximum(swing, 0.0) * height
    pose.pelvis[:, 0] -= SIGN[side] * 0.15 * np.maximum(swing, 0.0)
    pose.spine[:, 1] += 0.05 * swing
    pose.arm[:, side, 1] -= 0.45 * swing
    pose.arm[:, 1 - side, 1] += 0.6 * np.maximum(swing, 0.0)
    pose.arm[:, :, 0] += 0.25 * weight[:, None]
    pose.arm[:, :, 3] += 0.35 * weight[:, None]


def _through(t: Array, keys: Sequence[tuple[float, tuple[float, float, float]]]) -> Array:
    """Smooth curve [F, 3] through keys without stopping at them (cubic Hermite, slopes from the neighbours)."""
    times = np.array([k[0] for k in keys])
    values = np.array([k[1] for k in keys], np.float64)
    slopes = np.zeros_like(values)
    slopes[1:-1] = (values[2:] - values[:-2]) / (times[2:] - times[:-2])[:, None]
    out = np.zeros((len(t), 3))
    for i in range(len(keys) - 1):
        span = times[i + 1] - times[i]
        here = (t >= times[i]) & (t < times[i + 1])
        u = ((t[here] - times[i]) / span)[:, None]
        out[here] = hermite(u, values[i], values[i + 1], slopes[i] * span, slopes[i + 1] * span)
    return out


def jump_seconds(height: float) -> float:
    """How long one jump takes: crouch, push, flight, landing, standing up."""
    return 0.45 + _push(height) + 2.0 * float(np.sqrt(2.0 * height / GRAVITY)) + 0.75


def _push(height: float) -> float:
    return 1.9 * (_crouch(height) + 0.07) / float(np.sqrt(2.0 * GRAVITY * height))


def _crouch(height: float) -> float:
    return 0.14 + 0.35 * height


def jump(pose: Pose, t: Array, start: float, height: float, distance: float) -> None:
    """One jump: the pelvis rises `height` metres above the stretched stance, lands `distance` metres farther on."""
    crouch, leave, speed = _crouch(height), 0.05, float(np.sqrt(2.0 * GRAVITY * height))
    off = start + 0.45 + _push(height)
    air = 2.0 * speed / GRAVITY
    land, soft = off + air, 0.22
    rise = -crouch * ease((t - start) / 0.45)
    push = (t >= start + 0.45) & (t < off)
    span = _push(height)
    rise[push] = hermite((t[push] - off) / span + 1.0, -crouch, leave, 0.0, speed * span)
    fly = (t >= off) & (t < land)
    rise[fly] = leave + speed * (t[fly] - off) - 0.5 * GRAVITY * (t[fly] - off) ** 2
    down = t >= land
    rise[down] = hermite((t[down] - land) / soft, leave, -0.8 * crouch, -speed * soft)
    rise[down] += 0.8 * crouch * ease((t[down] - land - soft) / 0.5)
    forward, _ = forward_left(pose.pelvis[:, 0])
    bent = np.clip(-rise / crouch, 0.0, 1.0)
    travelled = distance * np.clip((t - off) / air, 0.0, 1.0)
    early = 0.12 * min(distance, 1.0) * window(t, start + 0.2, land, 0.3)  # the body leads the feet
    pose.root += travelled[:, None] * forward + (early - 0.1 * bent)[:, None] * forward
    pose.root[:, 1] += rise
    pose.pelvis[:, 1] += 0.35 * bent
    pose.spine[:, 1] += 0.3 * bent
    pose.head[:, 1] -= 0.3 * bent
    lifted = np.where(fly, np.maximum(rise - leave, 0.0), 0.0)
    tuck = 0.12 * min(height / 0.4, 1.0) * np.sin(np.pi * np.clip((t - off) / air, 0.0, 1.0)) * fly
    point = keyed(t, [(off - 0.14, 0.0), (off, -0.55), (off + 0.6 * air, -0.4), (land, -0.2), (land + 0.1, 0.0)])
    for side in (0, 1):
        heel = 0.14 * np.sin(np.clip(-point, 0.0, 1.0)) * np.where(t < land + 0.1, 1.0, 0.0)
        pose.ankle[:, side] += travelled[:, None] * forward
        pose.ankle[:, side, 1] = np.maximum(FLAT[side] + lifted + tuck + heel, pose.ankle[:, side, 1])
        pose.foot[:, side, 1] += point
        swing = [(start, 0.0), (start + 0.4, -0.6), (off + 0.6 * air, 1.3), (land + 0.2, 0.5), (land + 0.8, 0.0)]
        back = keyed(t, swing)
        pose.arm[:, side, 1] += back
        pose.arm[:, side, 3] += 0.35 * np.abs(back)
