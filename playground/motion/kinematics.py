"""Forward kinematics, rotations from positions, bone lengths and two-bone IK on HUMAN22. numpy only.

Rotations here are those of BVH and glTF: the rotation of a joint turns the offsets of its children; zero rotations are
the T-pose given by `offsets`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from playground.motion.rotation import fit_rotation, qbetween, qcontinuous, qinv, qmul, qrotate, slerp
from playground.motion.skeleton import HUMAN22

Array = NDArray[np.floating]

PARENTS = HUMAN22.parents
OFFSETS: Array = np.asarray(HUMAN22.offsets, np.float64)
CHILDREN = tuple(tuple(c for c, p in enumerate(PARENTS) if p == j) for j in range(HUMAN22.size))
LEGS = ((1, 4, 7, 10), (2, 5, 8, 11))  # hip, knee, ankle, foot of the left and the right leg
FOOT_TOLERANCE = 1e-3  # metres that an ankle may move before a knee is bent for it
CHANGE_WORTH_SAYING = 2e-3  # metres; smaller changes of a motion are not worth a word


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """A motion whose bones keep their lengths and whose torso is rigid, so that joint rotations describe it exactly."""

    joints: Array  # [F, 22, 3] metres
    offsets: Array  # [22, 3] T-pose offset from the parent, metres
    moved: float  # farthest that a joint was moved to get there, metres

    def changes(self) -> list[str]:
        """What a person should know: nothing, or one sentence."""
        if self.moved <= CHANGE_WORTH_SAYING:
            return []
        return [f"bones were set to their median lengths, which moved joints by up to {1e3 * self.moved:.0f} mm"]


def unit(v: Array) -> Array:
    """Vectors [..., 3] at length 1; zero stays zero."""
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12)


def _bone(bone: Array, joint: int) -> Array:
    """Direction [F, 3] of a bone [F, 3]; HUMAN22's own where the bone has no length."""
    return unit(np.where(np.linalg.norm(bone, axis=-1, keepdims=True) < 1e-9, OFFSETS[joint], bone))


def global_rotations(rotations: Array, parents: Sequence[int] = PARENTS) -> Array:
    """Local rotations [F, J, 4] -> rotations against the world [F, J, 4]."""
    out = np.array(rotations, np.float64)
    for joint, parent in enumerate(parents):
        if parent >= 0:
            out[:, joint] = qmul(out[:, parent], out[:, joint])
    return out


def forward_kinematics(
    rotations: Array, root: Array, offsets: Array = OFFSETS, parents: Sequence[int] = PARENTS
) -> Array:
    """Local rotations [F, J, 4], root positions [F, 3] and offsets [J, 3] (or [F, J, 3]) -> joints [F, J, 3]."""
    turned = global_rotations(rotations, parents)
    offsets = np.broadcast_to(offsets, (len(turned), len(parents), 3))
    joints = np.zeros((len(turned), len(parents), 3))
    for joint, parent in enumerate(parents):
        if parent < 0:
            joints[:, joint] = root
        else:
            joints[:, joint] = joints[:, parent] + qrotate(turned[:, parent], offsets[:, joint])
    return joints


def bone_lengths(joints: Array) -> Array:
    """Distance to the parent of every joint, [F, 22] in metres, of joints [F, 22, 3]; 0 for the pelvis."""
    lengths = np.zeros(joints.shape[:-1])
    lengths[..., 1:] = np.linalg.norm(np.asarray(joints[..., 1:, :] - joints[..., PARENTS[1:], :], np.float64), axis=-1)
    return lengths


def two_bone_ik(start: Array, end: Array, lengths: tuple[float, float], pole: Array) -> tuple[Array, Array]:
    """Bend a chain of two bones so that it reaches from start [F, 3] to end [F, 3].

    lengths: upper and lower bone in metres; pole [F, 3]: the side to which the middle joint bends, any length, not
    along the chain. Returns the middle joint and the end joint [F, 3]; an end out of reach is pulled in.
    """
    upper, lower = lengths
    line = np.asarray(end, np.float64) - start
    distance = np.linalg.norm(line, axis=-1, keepdims=True)
    line = np.where(distance > 1e-9, line / np.maximum(distance, 1e-9), np.array([0.0, -1.0, 0.0]))
    distance = np.clip(distance, abs(upper - lower) + 1e-6, upper + lower - 1e-9)
    side = pole - np.sum(pole * line, axis=-1, keepdims=True) * line
    spare = np.cross(line, np.where(np.abs(line[:, :1]) < 0.9, np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])))
    side = unit(np.where(np.linalg.norm(side, axis=-1, keepdims=True) > 1e-9, side, spare))
    along = (upper**2 + distance**2 - lower**2) / (2.0 * distance)
    out = np.sqrt(np.maximum(upper**2 - along**2, 0.0))
    return start + along * line + out * side, start + distance * line


def knee_poles(pelvis: Array, hips: Array, knees: Array, ankles: Array) -> Array:
    """The side [F, 3] to which a knee bends: where it is now, and to the front where the leg is nearly straight.

    pelvis: rotation [F, 4] of the pelvis against the world, T-pose facing +Z; hips, knees, ankles [F, 3] metres.
    """
    line = unit(np.asarray(ankles, np.float64) - hips)
    down = qrotate(pelvis, np.array([0.0, -1.0, 0.0]))
    front = qrotate(qbetween(down, line), qrotate(pelvis, np.array([0.0, 0.0, 1.0])))
    bent = knees - hips
    bent = bent - np.sum(bent * line, axis=-1, keepdims=True) * line
    return bent + 0.01 * front


def _hold_feet(placed: Array, joints: Array, lengths: Array) -> None:
    """Bend the legs of placed [F, 22, 3] in place until the ankles are back where joints [F, 22, 3] have them.

    What is nearer than `FOOT_TOLERANCE` stays: a straight knee would jump by far more than the ankle gains.
    """
    kids = list(CHILDREN[0])
    pelvis = fit_rotation(OFFSETS[kids], joints[:, kids] - joints[:, :1])
    for hip, knee, ankle, foot in LEGS:
        pole = knee_poles(pelvis, placed[:, hip], placed[:, knee], placed[:, ankle])
        missed = joints[:, ankle] - placed[:, ankle]
        distance = np.linalg.norm(missed, axis=-1, keepdims=True)
        share = np.maximum(0.0, 1.0 - FOOT_TOLERANCE / np.maximum(distance, 1e-12))
        toe = placed[:, foot] - placed[:, ankle]
        reach = (float(lengths[knee]), float(lengths[ankle]))
        bent = two_bone_ik(placed[:, hip], placed[:, ankle] + share * missed, reach, pole)
        moved = share[:, 0] > 0
        placed[moved, knee], placed[moved, ankle] = bent[0][moved], bent[1][moved]
        placed[:, foot] = placed[:, ankle] + toe


def set_bone_lengths(joints: Array, lengths: Array, keep_feet: bool = True) -> Array:
    """Joints [F, 22, 3] with every bone at lengths [22] (metres) and its old direction, rebuilt from the pelvis.

    keep_feet: ankles stay where they were if the legs reach, and the knees give way, so that a standing foot stands.
    """
    joints = np.asarray(joints, np.float64)
    out = joints.copy()
    for joint, parent in enumerate(PARENTS[1:], start=1):
        out[:, joint] = out[:, parent] + _bone(joints[:, joint] - joints[:, parent], joint) * lengths[joint]
    if keep_feet:
        _hold_feet(out, joints, lengths)
    return out


def _rigid_offsets(bones: Array, rest: Array) -> Array:
    """Bones [F, K, 3] of one joint -> the fixed offsets [K, 3] that fit all frames best, turned like rest [K, 3]."""
    offsets = rest
    for _ in range(8):
        offsets = qrotate(qinv(fit_rotation(offsets, bones))[:, None], bones).mean(0)
    return qrotate(fit_rotation(offsets, rest), offsets)


def make_rigid(joints: Array) -> RigidMotion:
    """The nearest motion that joint rotations can describe: joints [F, 22, 3] with drifting bones -> `RigidMotion`.

    Every bone gets its median length; the bones of pelvis and chest (spine3), which share a rotation, also keep
    their angles. Ankles stay in place where the legs reach.
    """
    joints = np.asarray(joints, np.float64)
    lengths = np.median(bone_lengths(joints), axis=0)
    offsets = unit(OFFSETS) * lengths[:, None]
    placed = joints.copy()
    torso: dict[int, Array] = {}
    for parent, kids_of in enumerate(CHILDREN):
        kids = list(kids_of)
        if len(kids) > 1:
            bones = unit(joints[:, kids] - joints[:, parent : parent + 1]) * lengths[kids][:, None]
            offsets[kids] = _rigid_offsets(bones, OFFSETS[kids])
            if parent == 0:  # the pelvis may give way too, by the mean of what its children miss
                missed = bones - qrotate(fit_rotation(offsets[kids], bones)[:, None], offsets[kids])
                placed[:, 0] += missed.sum(axis=1) / (1 + len(kids))
            torso[parent] = fit_rotation(offsets[kids], joints[:, kids] - placed[:, parent : parent + 1])
        for joint in kids:
            if parent in torso:
                bone = qrotate(torso[parent], offsets[joint])
            else:
                bone = _bone(joints[:, joint] - placed[:, parent], joint) * lengths[joint]
            placed[:, joint] = placed[:, parent] + bone
    _hold_feet(placed, joints, np.linalg.norm(offsets, axis=-1))
    placed += (joints - placed).mean(axis=1, keepdims=True)
    return RigidMotion(placed, offsets, float(np.linalg.norm(placed - joints, axis=-1).max()))


def rotations_from_joints(joints: Array, offsets: Array | None = None) -> Array:
    """Local joint rotations [F, 22, 4] of joints [F, 22, 3], so that `forward_kinematics` gives the joints back.

    offsets: T-pose [22, 3], by default HUMAN22's at the clip's median lengths. Pelvis and spine3 are fitted to all
    their children and the spine shares the twist between them; a joint with one child turns by the shortest way from
    its parent, so limbs get no twist of their own; ends follow their parent. Exact for a `RigidMotion`.
    """
    joints = np.asarray(joints, np.float64)
    if offsets is None:
        offsets = unit(OFFSETS) * np.median(bone_lengths(joints), axis=0)[:, None]
    offsets = np.asarray(offsets, np.float64)
    turned = np.zeros((len(joints), HUMAN22.size, 4))
    turned[..., 0] = 1.0
    for joint in (0, 9):
        kids = list(CHILDREN[joint])
        turned[:, joint] = fit_rotation(offsets[kids], joints[:, kids] - joints[:, joint : joint + 1])
    base = {3: slerp(turned[:, 0], turned[:, 9], 1.0 / 3.0), 6: slerp(turned[:, 0], turned[:, 9], 2.0 / 3.0)}
    for joint, kids_of in enumerate(CHILDREN):
        if joint in (0, 9):
            continue
        turned[:, joint] = base.get(joint, turned[:, PARENTS[joint]])
        if kids_of:
            rest = qrotate(turned[:, joint], offsets[kids_of[0]])
            swing = qbetween(rest, joints[:, kids_of[0]] - joints[:, joint])
            turned[:, joint] = qmul(swing, turned[:, joint])
    local = turned.copy()
    local[:, 1:] = qmul(qinv(turned[:, PARENTS[1:]]), turned[:, 1:])
    return qcontinuous(local)
