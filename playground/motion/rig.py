"""Body angles and ankle targets -> joints on HUMAN22's exact bone lengths: forward kinematics, leg IK. numpy only.

Side 0 is left, side 1 right, angles in radians. Arms are given as a swing (outwards, forwards) from hanging straight
down, a twist about the upper arm (outwards positive) and the bend of the elbow; legs by where the ankle is and how the
foot lies.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from playground.motion.curves import dilate, smooth
from playground.motion.rotation import qmul, qrotate, yaw_quaternion
from playground.motion.skeleton import HUMAN22

Array = NDArray[np.floating]

OFFSETS = np.asarray(HUMAN22.offsets, np.float64)
LENGTHS = np.linalg.norm(OFFSETS, axis=-1)
SIGN = np.array([1.0, -1.0])  # left, right: sign of the outward direction on X
HIP, KNEE, ANKLE, FOOT = (1, 2), (4, 5), (7, 8), (10, 11)
COLLAR, SHOULDER, ELBOW, WRIST = (13, 14), (16, 17), (18, 19), (20, 21)
FLAT = -OFFSETS[list(FOOT), 1]  # height of the ankle [2] when the foot lies flat on the floor
REACH = 0.997 * (LENGTHS[list(KNEE)] + LENGTHS[list(ANKLE)])  # longest hip to ankle distance [2] a pose may ask for
HIP_DROP = -OFFSETS[list(HIP), 1].mean()
STANDING = 0.955  # metres, height of the pelvis of somebody who stands with the knees a little bent
ARM_AT_REST = np.array([0.22, 0.03, -0.25, 0.36])  # outwards, forwards, twist, elbow of a hanging arm


@dataclass
class Pose:
    """Everything that moves, one row a frame; built by gait and gestures, turned into joints by `joints_of`."""

    root: Array  # [F, 3] pelvis, metres, world
    pelvis: Array  # [F, 3] yaw to the left, pitch forwards, roll (left side up)
    spine: Array  # [F, 3] yaw, pitch, roll of the chest against the pelvis
    head: Array  # [F, 3] yaw, pitch, roll of the head against the chest
    arm: Array  # [F, 2, 4] outwards, forwards, twist, elbow
    shrug: Array  # [F, 2] collar raised
    ankle: Array  # [F, 2, 3] metres, world
    foot: Array  # [F, 2, 2] yaw in the world, pitch (toes up positive, 0 flat)
    splay: Array  # [F, 2] knee turned outwards

    @classmethod
    def standing(cls, frames: int) -> "Pose":
        """A person at the origin facing +Z, arms hanging, feet flat."""
        shapes: tuple[tuple[int, ...], ...] = ((3,), (3,), (3,), (3,), (2, 4), (2,), (2, 3), (2, 2), (2,))
        pose = cls(*(np.zeros((frames, *shape)) for shape in shapes))
        pose.arm[:] = ARM_AT_REST
        pose.ankle[:, :, 0], pose.ankle[:, :, 1] = 0.09 * SIGN, FLAT
        pose.splay[:] = 0.12
        pose.root[:, 1] = STANDING
        return pose


def quaternion(axis: tuple[float, float, float], angle: Array) -> Array:
    """Rotation [..., 4] by `angle` [...] about a fixed unit axis."""
    half = np.asarray(angle)[..., None] / 2.0
    return np.concatenate([np.cos(half), np.sin(half) * np.asarray(axis)], axis=-1)


def turn(angles: Array) -> Array:
    """Yaw, pitch, roll [..., 3] -> quaternion [..., 4]: roll first, then pitch, then yaw."""
    pitch = quaternion((1.0, 0.0, 0.0), angles[..., 1])
    return qmul(yaw_quaternion(angles[..., 0]), qmul(pitch, quaternion((0.0, 0.0, 1.0), angles[..., 2])))


def arm_rotation(arm: Array, side: int) -> Array:
    """Rotation [F, 4] of the upper arm in the chest frame from (outwards, forwards, twist, elbow) [F, 4]."""
    angle = np.hypot(arm[:, 0], arm[:, 1])
    safe = np.maximum(angle, 1e-9)
    zero = np.zeros_like(angle)
    axis = np.stack([-arm[:, 1] / safe, zero, SIGN[side] * arm[:, 0] / safe], axis=-1)
    swing = np.concatenate([np.cos(angle / 2)[:, None], np.sin(angle / 2)[:, None] * axis], axis=-1)
    return qmul(swing, yaw_quaternion(SIGN[side] * arm[:, 2]))


def _arms(joints: Array, pose: Pose, chest: Array) -> None:
    for side in (0, 1):
        lifted = np.hypot(pose.arm[:, side, 0], pose.arm[:, side, 1])
        raised = pose.shrug[:, side] + 0.28 * np.clip(lifted - 1.0, 0.0, 2.0)  # the shoulder blade follows a raised arm
        collar = qmul(chest, quaternion((0.0, 0.0, SIGN[side]), raised))
        joints[:, COLLAR[side]] = joints[:, 9] + qrotate(chest, OFFSETS[COLLAR[side]])
        joints[:, SHOULDER[side]] = joints[:, COLLAR[side]] + qrotate(collar, OFFSETS[SHOULDER[side]])
        upper = qmul(chest, arm_rotation(pose.arm[:, side], side))
        bend = pose.arm[:, side, 3]
        down = np.array([0.0, -1.0, 0.0])
        fore = np.stack([np.zeros_like(bend), -np.cos(bend), np.sin(bend)], axis=-1)
        joints[:, ELBOW[side]] = joints[:, SHOULDER[side]] + LENGTHS[ELBOW[side]] * qrotate(upper, down)
        joints[:, WRIST[side]] = joints[:, ELBOW[side]] + LENGTHS[WRIST[side]] * qrotate(upper, fore)


def toe_offset(foot: Array, side: int) -> Array:
    """Ankle to foot joint [..., 3] for foot yaw and pitch [..., 2]; flat at pitch 0, pointing along the yaw."""
    rest = np.array([0.0, OFFSETS[FOOT[side], 1], np.hypot(*OFFSETS[FOOT[side], ::2])])
    return qrotate(qmul(yaw_quaternion(foot[..., 0]), quaternion((-1.0, 0.0, 0.0), foot[..., 1])), rest)


def _legs(joints: Array, pose: Pose) -> None:
    """Two-bone IK: the knee lies on the front side of the hip-ankle line. An ankle out of reach is pulled in."""
    for side in (0, 1):
        thigh, shin = LENGTHS[KNEE[side]], LENGTHS[ANKLE[side]]
        hip = joints[:, HIP[side]]
        line = pose.ankle[:, side] - hip
        distance = np.maximum(np.linalg.norm(line, axis=-1, keepdims=True), 1e-9)
        line, distance = line / distance, np.clip(distance, 0.3, REACH[side] / 0.997 * 0.9999)
        foot_yaw = pose.foot[:, side, 0] - pose.pelvis[:, 0]
        foot_yaw = (foot_yaw + np.pi) % (2 * np.pi) - np.pi
        yaw = pose.pelvis[:, 0] + 0.5 * foot_yaw + SIGN[side] * pose.splay[:, side]
        hinge = qrotate(yaw_quaternion(yaw), np.array([1.0, 0.0, 0.0]))
        front = np.cross(line, hinge)
        front /= np.maximum(np.linalg.norm(front, axis=-1, keepdims=True), 1e-9)
        along = (thigh**2 + distance**2 - shin**2) / (2.0 * distance)
        out = np.sqrt(np.maximum(thigh**2 - along**2, 0.0))
        joints[:, KNEE[side]] = hip + along * line + out * front
        joints[:, ANKLE[side]] = hip + distance * line
        joints[:, FOOT[side]] = joints[:, ANKLE[side]] + toe_offset(pose.foot[:, side], side)


def joints_of(pose: Pose) -> Array:
    """Pose -> joints [F, 22, 3] in metres; every bone has HUMAN22's length."""
    joints = np.zeros((len(pose.root), HUMAN22.size, 3))
    hips = turn(pose.pelvis)
    joints[:, 0] = pose.root
    for joint in (*HIP, 3):
        joints[:, joint] = pose.root + qrotate(hips, OFFSETS[joint])
    chest = hips
    for parent, joint in ((3, 6), (6, 9)):
        chest = qmul(chest, turn(pose.spine / 3.0))
        joints[:, joint] = joints[:, parent] + qrotate(chest, OFFSETS[joint])
    chest = qmul(chest, turn(pose.spine / 3.0))
    joints[:, 12] = joints[:, 9] + qrotate(chest, OFFSETS[12])
    joints[:, 15] = joints[:, 12] + qrotate(qmul(chest, turn(pose.head)), OFFSETS[15])
    _arms(joints, pose, chest)
    _legs(joints, pose)
    return joints


def lower_to_reach(pose: Pose) -> None:
    """Lower the pelvis, smoothly and only where needed, until both ankles can be reached."""
    hips = turn(pose.pelvis)
    drop = np.full(len(pose.root), -1.0)
    for side in (0, 1):
        gap = pose.root + qrotate(hips, OFFSETS[HIP[side]]) - pose.ankle[:, side]
        allowed = np.sqrt(np.maximum(REACH[side] ** 2 - gap[:, 0] ** 2 - gap[:, 2] ** 2, 0.09))
        drop = np.maximum(drop, gap[:, 1] - allowed)
    soft = 0.006  # metres; the leg stretches softly towards its limit, so that the knee does not snap
    drop = soft * np.logaddexp(0.0, np.maximum(drop + soft, -1.0) / soft)
    pose.root[:, 1] -= smooth(dilate(drop, 1), 1.0)
