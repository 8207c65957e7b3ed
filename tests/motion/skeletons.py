"""Other people's skeletons for the tests: one motion under the names, zero pose, unit and axes of many tools."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from playground.motion.skeleton import HUMAN22
from playground.motion.synthetic import synthesise

OFFSETS = np.asarray(HUMAN22.offsets)
SIDES = {"l": "Left", "r": "Right"}


def _sided(names: dict[str, str], pattern: str = "{side}{name}", sides: dict[str, str] = SIDES) -> dict[str, str]:
    """HUMAN22 name -> foreign name; keys without l_ or r_ stand for the middle or for both sides."""
    out = {}
    for joint in HUMAN22.joints:
        side, _, base = joint.partition("_")
        if base:
            out[joint] = pattern.format(side=sides[side], name=names[base])
        else:
            out[joint] = names[joint]
    return out


_TORSO = {"pelvis": "Hips", "spine1": "Spine", "spine2": "Spine1", "spine3": "Spine2", "neck": "Neck", "head": "Head"}
_IK = {"hip": "UpLeg", "knee": "Leg", "ankle": "Foot", "foot": "ToeBase", "collar": "Shoulder", "shoulder": "Arm",
       "elbow": "ForeArm", "wrist": "Hand"}  # fmt: skip
_CHESTS = {"pelvis": "Hips", "spine1": "Chest", "spine2": "Chest2", "spine3": "Chest3", "neck": "Neck", "head": "Head"}
STYLES: dict[str, dict[str, str]] = {
    "HumanIK": _sided(_TORSO | _IK),
    "Mixamo": {k: f"mixamorig:{v}" for k, v in _sided(_TORSO | _IK).items()},
    "CMU": _sided(_TORSO | _IK | {"spine1": "LowerBack"}),
    "Bandai Namco": _sided(
        {"pelvis": "Hips", "spine1": "Spine", "spine2": "Spine2", "spine3": "Chest", "neck": "Neck", "head": "Head",
         "hip": "UpperLeg", "knee": "LowerLeg", "ankle": "Foot", "foot": "Toes", "collar": "Shoulder",
         "shoulder": "UpperArm", "elbow": "LowerArm", "wrist": "Hand"}, "{name}_{side}", {"l": "L", "r": "R"}
    ),
    "Xsens": _sided(
        _CHESTS | {"hip": "Hip", "knee": "Knee", "ankle": "Ankle", "foot": "Toe", "collar": "Collar",
                   "shoulder": "Shoulder", "elbow": "Elbow", "wrist": "Wrist"}
    ),
    "Rokoko": _sided(_TORSO | _IK | {"hip": "Thigh", "knee": "Shin", "foot": "Toe"}),
    "Biovision": _sided(
        _CHESTS | {"hip": "UpLeg", "knee": "LowLeg", "ankle": "Foot", "foot": "Toe", "collar": "Collar",
                   "shoulder": "UpArm", "elbow": "LowArm", "wrist": "Hand"}
    ),
    "Unity": _sided(
        _TORSO | {"hip": "UpperLeg", "knee": "LowerLeg", "ankle": "Foot", "foot": "Toes", "collar": "Shoulder",
                  "shoulder": "UpperArm", "elbow": "LowerArm", "wrist": "Hand"}
    ),
    "Daz": _sided(
        {"pelvis": "hip", "spine1": "abdomen", "spine2": "waist", "spine3": "chest", "neck": "neck", "head": "head",
         "hip": "Thigh", "knee": "Shin", "ankle": "Foot", "foot": "Toe", "collar": "Collar", "shoulder": "Shldr",
         "elbow": "ForeArm", "wrist": "Hand"}, "{side}{name}", {"l": "l", "r": "r"}
    ),
    "Biped": _sided(
        {"pelvis": "Bip01 Pelvis", "spine1": "Bip01 Spine", "spine2": "Bip01 Spine1", "spine3": "Bip01 Spine2",
         "neck": "Bip01 Neck", "head": "Bip01 Head", "hip": "Thigh", "knee": "Calf", "ankle": "Foot", "foot": "Toe0",
         "collar": "Clavicle", "shoulder": "UpperArm", "elbow": "Forearm", "wrist": "Hand"},
        "Bip01 {side} {name}", {"l": "L", "r": "R"}
    ),
}  # fmt: skip
NONSENSE = {joint: f"bone{n:02d}" for n, joint in enumerate(HUMAN22.joints)}


@cache
def walk(seed: int = 1) -> np.ndarray:
    """A synthetic walk [F, 22, 3] with a turn: bones exact, standing feet stand."""
    return synthesise("turn_walk", np.random.default_rng(seed)).motion.joints


@dataclass
class Rig:
    """How a tool writes a motion: every field differs from the playground's own files."""

    names: dict[str, str] = field(default_factory=lambda: dict(STYLES["HumanIK"]))
    unit: float = 100.0  # file units a metre
    order: str = "ZXY"
    fps: int = 20
    axes: np.ndarray = field(default_factory=lambda: np.eye(3))  # world of the playground -> world of the file
    zero_pose: Rotation | None = None  # [22] turn of every joint's own axes, so that zero rotations are no T-pose
    positions_everywhere: bool = False
    drop: Sequence[str] = ()  # HUMAN22 joints without children in the file
    newline: str = "\n"


def _global(joints: np.ndarray) -> list[Rotation]:
    """World rotations of HUMAN22's joints, [F] each: three points where there are three, else the shortest turn."""
    turns: list[Rotation] = []
    for j in range(22):
        kids = [c for c in range(22) if HUMAN22.parents[c] == j]
        if len(kids) > 1:
            fits = [Rotation.align_vectors(bones, OFFSETS[kids])[0] for bones in joints[:, kids] - joints[:, j, None]]
            turns.append(Rotation.concatenate(fits))
            continue
        turn = turns[HUMAN22.parents[j]]
        if kids:
            start, goal = turn.apply(OFFSETS[kids[0]]), joints[:, kids[0]] - joints[:, j]
            axis = np.cross(start, goal)
            sine = np.linalg.norm(axis, axis=-1, keepdims=True)
            angle = np.arctan2(sine, np.sum(start * goal, axis=-1, keepdims=True))
            turn = Rotation.from_rotvec(axis / np.maximum(sine, 1e-12) * angle) * turn
        turns.append(turn)
    return turns


def bvh_text(joints: np.ndarray, rig: Rig) -> str:
    """The BVH file that a tool with this rig writes for HUMAN22 joints [F, 22, 3]."""
    frames = len(joints)
    world = Rotation.from_matrix(rig.axes)
    rest = rig.zero_pose or Rotation.identity(22)
    turns = [world * turn * rest[j].inv() for j, turn in enumerate(_global(joints))]
    offsets = np.zeros((22, 3))
    for j in range(1, 22):
        offsets[j] = rest[HUMAN22.parents[j]].apply(OFFSETS[j]) * rig.unit
    root = joints[:, 0] @ rig.axes.T * rig.unit
    lines, order = ["HIERARCHY"], []

    def write(j: int, depth: int) -> None:
        pad = "\t" * depth
        order.append(j)
        lines.append(f"{pad}{'JOINT' if depth else 'ROOT'} {rig.names[HUMAN22.joints[j]]}")
        lines.append(pad + "{")
        lines.append(f"{pad}\tOFFSET\t" + "\t".join(f"{v:.7f}" for v in offsets[j]))
        turn = " ".join(f"{a}rotation" for a in rig.order)
        full = depth == 0 or rig.positions_everywhere
        lines.append(f"{pad}\tCHANNELS " + (f"6 Xposition Yposition Zposition {turn}" if full else f"3 {turn}"))
        kids = [c for c in range(22) if HUMAN22.parents[c] == j and HUMAN22.joints[c] not in rig.drop]
        for c in kids:
            write(c, depth + 1)
        if not kids:
            dropped = [c for c in range(22) if HUMAN22.parents[c] == j]
            end = offsets[dropped[0]] if dropped else np.zeros(3)
            lines.extend([f"{pad}\tEnd Site", f"{pad}\t{{", f"{pad}\t\tOFFSET " + " ".join(f"{v:.7f}" for v in end)])
            lines.append(f"{pad}\t}}")
        lines.append(pad + "}")

    write(0, 0)
    columns = []
    for j in order:
        parent = HUMAN22.parents[j]
        local = turns[j] if parent < 0 else turns[parent].inv() * turns[j]
        if parent < 0 or rig.positions_everywhere:
            columns.append(root if parent < 0 else np.repeat(offsets[j][None], frames, axis=0))
        columns.append(local.as_euler(rig.order, degrees=True))
    rows = [" ".join(f"{v:.6f}" for v in row) for row in np.concatenate(columns, axis=-1)]
    lines += ["MOTION", f"Frames:\t{frames}", f"Frame Time: {1 / rig.fps:.7f}", *rows]
    return rig.newline.join(lines) + rig.newline
