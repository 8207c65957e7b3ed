"""Any skeleton that walks on two legs -> HUMAN22 at 20 fps, on the reference bone lengths. numpy only.

The whole motion is scaled by leg length. Pelvis, spine, collars and head follow the rotations of the source against its
own neutral pose; upper arms and forearms keep their directions; ankles keep their scaled positions, with the knees bent
by two-bone IK and the pelvis lowered where a leg would not reach; a source foot that stands is a flat foot on HUMAN22.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.hierarchy import ancestors
from playground.motion.joint_maps import JointMap, map_joints, with_ends
from playground.motion.kinematics import (
    LEGS,
    OFFSETS,
    PARENTS,
    bone_lengths,
    knee_poles,
    two_bone_ik,
    unit,
)
from playground.motion.representation import canonicalise, heading
from playground.motion.rotation import Array, matrix_to_quaternion, qbetween, qinv, qmul, qnormalise, qrotate, slerp
from playground.motion.skeleton import HUMAN22
from playground.motion.source import Source
from playground.motion.upright import leg_length, made_upright, standing_rest, unit_of

LENGTHS: Array = np.linalg.norm(OFFSETS, axis=-1)
TARGET_LEG = float(LENGTHS[[4, 5, 7, 8]].sum() / 2.0)
SAME_BONES = 0.012  # metres; HUMAN22 joints whose median bones are this near to the reference are used as they are
JUMP_SPEED = 6.0  # m/s, mean over all joints against the pelvis; no body does that
_UP, _FRONT = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Retargeted:
    """What became of a source: canonical joints, which mapping was used, what was changed."""

    joints: NDArray[np.float32]  # [F, 22, 3] metres, 20 fps
    mapping: str  # one sentence
    changes: list[str]  # one clause each


@dataclass(frozen=True, eq=False)
class _Body:
    """Rotations [F, 4] against the world that take parts of HUMAN22's T-pose to each frame."""

    stands: bool  # the source has a T-pose that stands
    neutral: Array  # [4] HUMAN22's T-pose -> the source's, if that stands
    pelvis: Array
    chest: Array
    head: Array


def _basis(across: Array, up: Array, what: str) -> Array:
    """The rotation [4] from HUMAN22's axes to a left [3] and an up [3] direction of the source; up counts fully."""
    up = unit(up)
    x: Array = across - (across @ up) * up
    if np.linalg.norm(x) < 1e-6 or np.linalg.norm(up) < 0.5:
        raise PlaygroundError(f"this skeleton is not understood: its {what} has no width or no height")
    x = unit(x)
    return matrix_to_quaternion(np.stack([x, up, np.cross(x, up)], axis=-1))


def _below(source: Source, top: int, joint: int) -> Array:
    """T-pose direction [3] from a joint to where the way down to another joint first leaves it."""
    way = [j for j in ancestors(source, joint) if top in ancestors(source, j)]
    away = [source.rest[j] - source.rest[top] for j in reversed(way)]
    return next((v for v in away if np.linalg.norm(v) > 1e-9), np.zeros(3))


def _body(source: Source, joints: JointMap) -> _Body:
    """What pelvis, chest and head of the source do against a neutral pose.

    Where the T-pose stands, that is the neutral pose. Where it does not (bones all along one axis, say) pelvis and
    chest get their axes from the bones that are fixed to them; a head turned far on average is neutral there.
    """
    roles, rest = joints.roles, source.rest
    head = roles.get("head")
    above = source.parents[head] if head is not None else joints.chest
    parts = (joints.pelvis, joints.chest, above)
    pose = standing_rest(source, joints)
    hips = rest[roles["l_hip"]] - rest[roles["r_hip"]]
    if pose.stands:
        neutral = qmul(_basis(hips, pose.up, "pelvis"), qinv(_basis(OFFSETS[1] - OFFSETS[2], _UP, "pelvis")))
        return _Body(True, neutral, *(qmul(source.rotations[:, part], neutral) for part in parts))
    middle = (rest[roles["l_hip"]] + rest[roles["r_hip"]]) / 2.0 - rest[joints.pelvis]
    low = _basis(hips, _below(source, joints.pelvis, joints.chest) - middle, "pelvis")
    left, right = (_below(source, joints.chest, roles[f"{side}_shoulder"]) for side in "lr")
    high = _basis(left - right, _below(source, joints.chest, roles.get("neck", above)), "chest")
    pelvis, chest, top = (qmul(source.rotations[:, p], q) for p, q in zip(parts, (low, high, high), strict=True))
    nod = qmul(qinv(chest), top)
    calm = qnormalise(np.median(nod * np.sign(nod[:, :1] + 1e-12), axis=0))
    if abs(calm[0]) < np.cos(np.radians(20.0)):
        top = qmul(top, qinv(calm))
    return _Body(False, low, pelvis, chest, top)


def _place(out: Array, joint: int, rotation: Array) -> None:
    out[:, joint] = out[:, PARENTS[joint]] + qrotate(rotation, OFFSETS[joint])


def _torso(out: Array, body: _Body) -> None:
    """Hips, spine, collars and head from the rotations; out[:, 0] is set."""
    shares = {3: 0.0, 6: 1.0 / 3.0, 9: 2.0 / 3.0, 12: 1.0, 13: 1.0, 14: 1.0}
    for joint in (1, 2):
        _place(out, joint, body.pelvis)
    for joint, share in shares.items():
        _place(out, joint, slerp(body.pelvis, body.chest, share))
    _place(out, 15, body.head)


def _arms(out: Array, source: Source, joints: JointMap, body: _Body) -> None:
    """Shoulders follow the turn of the source's collars, elbows and wrists the directions of its bones."""
    position = source.positions
    for side, collar, shoulder, elbow, wrist in (("l", 13, 16, 18, 20), ("r", 14, 17, 19, 21)):
        near = joints.roles.get(f"{side}_collar", joints.chest)
        ends = [joints.roles[f"{side}_{role}"] for role in ("shoulder", "elbow", "wrist")]
        bone = qrotate(qinv(body.chest), position[:, ends[0]] - position[:, near])
        if body.stands:
            calm = qrotate(qinv(body.neutral), source.rest[ends[0]] - source.rest[near])
        else:
            calm = np.median(bone, axis=0)
        turn = qbetween(calm, bone) if np.linalg.norm(calm) > 1e-9 else np.array([1.0, 0.0, 0.0, 0.0])
        _place(out, shoulder, qmul(body.chest, turn))
        for start, stop, joint in zip(ends, ends[1:], (elbow, wrist), strict=False):
            direction = unit(position[:, stop] - position[:, start])
            out[:, joint] = out[:, PARENTS[joint]] + direction * LENGTHS[joint]
        assert PARENTS[shoulder] == collar


def _planted(source: Source, joint: int) -> NDArray[np.bool_]:
    """Frames [F] in which a joint rests near its lowest height; metres."""
    height = source.positions[:, joint, 1]
    speed = np.linalg.norm(np.gradient(source.positions[:, joint], axis=0), axis=-1) * source.fps
    return (speed < 0.25) & (height < np.percentile(height, 5) + 0.06)


def _toe_direction(source: Source, joints: JointMap, body: _Body, side: str, foot: int) -> Array:
    """Direction [F, 3] from ankle to foot: fixed to the source's foot so that it lies flat while that stands."""
    ankle = joints.roles[f"{side}_ankle"]
    turn = source.rotations[:, ankle]
    toe = joints.roles.get(f"{side}_foot")
    flat = OFFSETS[foot] / LENGTHS[foot]
    down, ahead = float(flat[1]), float(np.hypot(flat[0], flat[2]))
    if toe is None:
        return qrotate(qmul(turn, body.neutral), flat) if body.stands else _ahead(body, flat)
    seen = unit(source.positions[:, toe] - source.positions[:, ankle])
    still = _planted(source, ankle) & _planted(source, toe)
    level = np.stack([seen[:, 0], np.zeros(len(seen)), seen[:, 2]], axis=-1)
    still &= np.linalg.norm(level, axis=-1) > 0.3
    if not still.any():
        return seen
    wanted = unit(level[still]) * ahead + _UP * down
    fixed = unit(np.median(qrotate(qinv(turn[still]), wanted), axis=0))
    return qrotate(turn, fixed)


def _ahead(body: _Body, flat: Array) -> Array:
    """A flat foot [F, 3] that points where the pelvis faces."""
    front = qrotate(body.pelvis, _FRONT)
    yaw = unit(np.stack([front[:, 0], np.zeros(len(front)), front[:, 2]], axis=-1))
    across = np.cross(np.broadcast_to(_UP, yaw.shape), yaw)
    return across * flat[0] + _UP * flat[1] + yaw * flat[2]


def _legs(out: Array, source: Source, joints: JointMap, body: _Body) -> None:
    """Ankles where the source has them, knees by two-bone IK, feet by `_toe_direction`; hips in out are set."""
    for side, (hip, knee, ankle, foot) in zip("lr", LEGS, strict=True):
        seen = [source.positions[:, joints.roles[f"{side}_{role}"]] for role in ("hip", "knee", "ankle")]
        pole = knee_poles(body.pelvis, *seen)
        reach = (float(LENGTHS[knee]), float(LENGTHS[ankle]))
        out[:, knee], out[:, ankle] = two_bone_ik(out[:, hip], seen[2], reach, pole)
        out[:, foot] = out[:, ankle] + _toe_direction(source, joints, body, side, foot) * LENGTHS[foot]


def _root(source: Source, joints: JointMap, body: _Body) -> Array:
    """Pelvis [F, 3]: the middle of the hips where the source has it, lowered smoothly where a leg would not reach."""
    hips = [joints.roles[f"{side}_hip"] for side in "lr"]
    root = source.positions[:, hips].mean(axis=1) - qrotate(body.pelvis, OFFSETS[1:3].mean(axis=0))
    drop = np.zeros(len(root))
    for side, (hip, knee, ankle, _) in zip("lr", LEGS, strict=True):
        gap = root + qrotate(body.pelvis, OFFSETS[hip]) - source.positions[:, joints.roles[f"{side}_ankle"]]
        reach = 0.9995 * (LENGTHS[knee] + LENGTHS[ankle])
        level = gap[:, 0] ** 2 + gap[:, 2] ** 2
        needed = gap[:, 1] - np.sqrt(np.maximum(reach**2 - level, 0.0))
        drop = np.maximum(drop, np.where(level < 0.9 * reach**2, np.clip(needed, 0.0, 0.03), 0.0))
    root[:, 1] -= gaussian_filter1d(maximum_filter1d(drop, 7), 1.5)
    return root


def _onto_human22(source: Source, joints: JointMap) -> Array:
    """A source in metres at human size, upright -> joints [F, 22, 3] on the reference bone lengths."""
    body = _body(source, joints)
    out = np.zeros((source.frames, HUMAN22.size, 3))
    out[:, 0] = _root(source, joints, body)
    _torso(out, body)
    _arms(out, source, joints, body)
    _legs(out, source, joints, body)
    return out


def _is_canonical(joints: Array) -> bool:
    """True for HUMAN22 joints that stand on the floor at the origin, facing +Z, as the playground writes them."""
    start = np.array([joints[0, 0, 0], joints[0, 0, 2], joints[..., 1].min()])
    return bool(np.abs(start).max() < 2e-3 and abs(heading(joints[:1], smooth=False)[0]) < 0.02)


def _as_it_is(source: Source) -> Array | None:
    """The joints [F, 22, 3] in metres of a source that is HUMAN22 at its reference size already, else None."""
    if not set(HUMAN22.joints) <= set(source.names):
        return None
    joints = source.positions[:, [source.names.index(name) for name in HUMAN22.joints]]
    return joints if np.abs(np.median(bone_lengths(joints), axis=0) - LENGTHS).max() < SAME_BONES else None


def _finished(joints: Array, mapping: str, changes: list[str]) -> Retargeted:
    """Canonical joints within the limits. PlaygroundError if somebody travels farther than `LIMITS.max_metres`."""
    canonical = joints.astype(np.float32) if _is_canonical(joints) else canonicalise(joints)
    farthest = float(np.abs(canonical).max())
    if not farthest <= LIMITS.max_metres:
        raise PlaygroundError(
            f"the motion reaches {farthest:.0f} m from its start; at most {LIMITS.max_metres:g} m are accepted"
        )
    return Retargeted(canonical, mapping, changes)


def _without_jump(source: Source, leg: float) -> Source:
    """Drops a first frame from which the body jumps: a T-pose before the take, as converted CMU files have it."""
    if source.frames <= LIMITS.min_source_frames:
        return source
    pose = source.positions[:8] - source.positions[:8, :1]
    steps = np.linalg.norm(np.diff(pose, axis=0), axis=-1).mean(axis=-1)
    speed = steps[0] * source.fps * TARGET_LEG / leg
    if speed > JUMP_SPEED and steps[0] > 5.0 * float(steps[1:].max()):
        return replace(source, positions=source.positions[1:], rotations=source.rotations[1:])
    return source


def _sized(leg: float) -> tuple[float, str]:
    """The factor that brings a leg to the reference length, and a clause on it."""
    unit_name, metres = unit_of(leg) or ("an unknown unit", TARGET_LEG / leg)
    factor = TARGET_LEG / leg
    return factor, f"lengths were taken to be in {unit_name} and scaled by {factor / metres:.3f} to the reference leg"


def retarget(source: Source, start_seconds: float = 0.0, upright: bool = False) -> Retargeted:
    """A motion on any two-legged skeleton -> canonical HUMAN22 joints at 20 fps from `start_seconds` on.

    upright: the source is known to have Y up. Otherwise axes are looked for unless it is canonical already.
    HUMAN22 motions that have the reference bones already keep their joints. PlaygroundError if the skeleton is not
    understood, nothing is left after the start, or the motion does not fit the limits.
    """
    source = with_ends(source)
    joints = map_joints(source)
    leg = leg_length(source, joints)
    changes: list[str] = []
    known = unit_of(leg)
    frames = source.frames
    source = _without_jump(source, leg)
    same = _as_it_is(source)
    if not upright and (same is None or not _is_canonical(same)):
        source, changes = made_upright(source, joints, leg)
    if source.frames < frames:
        changes.append("the first frame, a pose from which the body jumps, was left out")
    if abs(source.fps - LIMITS.fps) > 1e-9 * LIMITS.fps:
        changes.append(f"{source.fps:g} frames a second were resampled to {LIMITS.fps}")
    source = source.resampled(float(LIMITS.fps), start_seconds)
    direct = _as_it_is(source.scaled(known[1] if known else 1.0))
    if direct is not None:
        return _finished(direct, "Joints are those of the playground's own skeleton.", changes)
    factor, clause = _sized(leg)
    return _finished(_onto_human22(source.scaled(factor), joints), joints.sentence, [*changes, clause])
