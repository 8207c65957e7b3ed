"""Motions of our own in the forms that data sets are published in: KIT-ML's 21 joints, SMPL-X, SnapMoGen's columns."""

from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from playground.data.library import Library
from playground.data.sources import Prepared, prepare
from playground.motion.kinematics import OFFSETS, forward_kinematics, global_rotations, rotations_from_joints
from playground.motion.representation import canonicalise
from playground.motion.skeleton import HUMAN22
from playground.motion.synthetic import synthesise

HUMAN = {name: place for place, name in enumerate(HUMAN22.joints)}
KIT_LENGTHS = {"spine": (77, 107, 40, 27), "shoulder": 97, "arm": (138, 110), "hip": 45, "leg": (223, 226, 25, 43)}
SNAP_REST = {  # T-pose offsets of a 24-joint rig of SnapMoGen's kind, its unit: name, parent, offset
    "root": (-1, (0, 0, 0)), "spine1": (0, (0, 2, 0)), "spine2": (1, (0, 5, 0)), "spine3": (2, (0, 5, 0)),
    "neck": (3, (0, 17, 0)), "neck2": (4, (0, 3, 0)), "head": (5, (0, 5, 0)), "l_collar": (3, (5, 12, 1)),
    "l_shoulder": (7, (8, 0, -3)), "l_elbow": (8, (17, 0, 0)), "l_wrist": (9, (17, 0, 0)), "r_collar": (3, (-5, 12, 1)),
    "r_shoulder": (11, (-8, 0, -3)), "r_elbow": (12, (-17, 0, 0)), "r_wrist": (13, (-17, 0, 0)),
    "pelvis": (0, (0, 0, 0)), "l_hip": (15, (7, -6, 1)), "l_knee": (16, (0, -19, 0)), "l_ankle": (17, (0, -18, -1)),
    "l_foot": (18, (0, -5, 10)), "r_hip": (15, (-7, -6, 1)), "r_knee": (20, (0, -19, 0)), "r_ankle": (21, (0, -18, -1)),
    "r_foot": (22, (0, -5, 10)),
}  # fmt: skip
SNAP_OFFSETS = np.array([offset for _, offset in SNAP_REST.values()], float)
SNAP_PARENTS = [parent for parent, _ in SNAP_REST.values()]
R_WRIST, L_WRIST = HUMAN["r_wrist"], HUMAN["l_wrist"]
FOLLOWS = {"root": "pelvis", "neck2": "neck", "pelvis": "pelvis"}  # joints whose rotation has another name


@cache
def waving() -> np.ndarray:
    """Somebody waves with the right hand: joints [F, 22, 3] with the reference bones."""
    motion = synthesise("wave", np.random.default_rng(4), side="right").motion
    return canonicalise(motion.joints)


@cache
def turned() -> tuple[np.ndarray, np.ndarray]:
    """Local and global rotations [F, 22, 4] (w first) of that motion on the reference skeleton."""
    local = rotations_from_joints(waving(), OFFSETS)
    return local, global_rotations(local)


def rotation(quaternions: np.ndarray) -> Rotation:
    """scipy's rotations of quaternions [F, 4], w first."""
    return Rotation.from_quat(quaternions, scalar_first=True)


def kit_joints() -> np.ndarray:
    """The motion on a body of KIT-ML's tree, [F, 21, 3] in its unit; joints 11 to 15 are the right leg."""
    joints, world = waving().astype(float), turned()[1]
    pelvis, chest = rotation(world[:, HUMAN["pelvis"]]), rotation(world[:, HUMAN["spine3"]])
    out = np.zeros((len(joints), 21, 3))
    out[:, 0] = joints[:, 0] * 530
    spine = zip((pelvis, pelvis, chest, chest), (5.1, -5.7, 12.1, 34.9), KIT_LENGTHS["spine"], strict=True)
    for joint, (part, tilt, length) in enumerate(spine, start=1):
        ahead = np.radians(tilt)
        out[:, joint] = out[:, joint - 1] + part.apply([0, length * np.cos(ahead), length * np.sin(ahead)])
    for side, sign, arm, leg in (("r", -1, 5, 11), ("l", 1, 8, 16)):
        out[:, arm] = out[:, 3] + chest.apply([sign * KIT_LENGTHS["shoulder"], 0, 0])
        out[:, leg] = out[:, 0] + pelvis.apply([sign * KIT_LENGTHS["hip"], 0, 0])
        names = [f"{side}_{part}" for part in ("shoulder", "elbow", "wrist")]
        for step, length in enumerate(KIT_LENGTHS["arm"]):
            out[:, arm + 1 + step] = out[:, arm + step] + _bone(joints, *names[step : step + 2]) * length
        names = [f"{side}_{part}" for part in ("hip", "knee", "ankle", "foot", "foot")]
        for step, length in enumerate(KIT_LENGTHS["leg"]):
            pair = names[step : step + 2] if step < 3 else names[2:4]
            out[:, leg + 1 + step] = out[:, leg + step] + _bone(joints, *pair) * length
    return out


def _bone(joints: np.ndarray, start: str, stop: str) -> np.ndarray:
    bone = joints[:, HUMAN[stop]] - joints[:, HUMAN[start]]
    return bone / np.linalg.norm(bone, axis=-1, keepdims=True)


def columns(joints: np.ndarray, total: int) -> np.ndarray:
    """Root and positions of joints [F, J, 3] as [F - 1, total] with the heading left at 0; other columns are noise."""
    rows = np.random.default_rng(0).normal(size=(len(joints) - 1, total))
    rows[:, 0] = 0.0
    rows[:, 1:3] = np.diff(joints[:, 0], axis=0)[:, [0, 2]]
    rows[:, 3] = joints[:-1, 0, 1]
    local = joints[:-1, 1:] - joints[:-1, :1] * [1, 0, 1]
    rows[:, 4 : 4 + local[0].size] = local.reshape(len(local), -1)
    return rows


def smplx() -> np.ndarray:
    """The motion as SMPL-X parameters [F, 322]: axis-angle of root and body, translation; the rest is noise."""
    local = turned()[0]
    rows = np.random.default_rng(1).normal(size=(len(local), 322))
    rows[:, :66] = Rotation.from_quat(local.reshape(-1, 4), scalar_first=True).as_rotvec().reshape(len(local), -1)
    rows[:, 309:312] = forward_kinematics(local, waving()[:, 0])[:, 0]
    return rows


def snap_motion() -> tuple[np.ndarray, np.ndarray]:
    """The motion on the 24-joint rig: positions [F, 24, 3] and rotations against the world [F, 24, 4], w first."""
    world = turned()[1]
    quaternions = np.stack([world[:, HUMAN[FOLLOWS.get(name, name)]] for name in SNAP_REST], axis=1)
    positions = np.zeros((len(world), 24, 3))
    positions[:, 0] = waving()[:, 0] * 45.0
    for joint, parent in enumerate(SNAP_PARENTS):
        if parent >= 0:
            offset = rotation(quaternions[:, parent]).apply(SNAP_OFFSETS[joint])
            positions[:, joint] = positions[:, parent] + offset
    return positions, quaternions


def snap_features(positions: np.ndarray, quaternions: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """[F - 1, 296], frame by frame; yaw [F]: any heading that starts at 0, radians."""
    rows = []
    for t in range(len(positions) - 1):
        heading = Rotation.from_euler("Y", yaw[t])
        step = heading.apply(positions[t + 1, 0] - positions[t, 0])
        row = [yaw[t + 1] - yaw[t], step[0], step[2], positions[t, 0, 1]]
        for joint in range(24):
            matrix = (heading * rotation(quaternions[t, joint])).as_matrix()
            row += [*matrix[:, 0], *matrix[:, 1]]
        for joint in range(24):
            row += [*heading.apply(positions[t, joint] - positions[t, 0] * [1, 0, 1])]
        rows.append([*row, *np.zeros(76)])
    return np.array(rows)


def text(path: Path, content: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content, encoding="utf-8")


def array(path: Path, values: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.save(path, values)


def made(source: str, root: Path) -> tuple[Library, Prepared]:
    out = root.with_name(f"{root.name}-out")
    done = prepare(source, root, out)
    return Library.open(out), done


def apart(joints: np.ndarray, expected: np.ndarray) -> float:
    """Mean distance in millimetres of joints from the pelvis's point of view, over the frames that both have."""
    frames = min(len(joints), len(expected))
    a, b = joints[:frames], expected[:frames]
    return float(np.linalg.norm((a - a[:, :1]) - (b - b[:, :1]), axis=-1).mean() * 1e3)


def at_20(joints: np.ndarray, fps: float) -> np.ndarray:
    """The poses of a motion of another rate that fall on, or lie between its frames at, 20 frames a second."""
    places = np.arange(0, len(joints) - 1 + 1e-9, fps / 20.0)
    low = places.astype(int)
    share = (places - low)[:, None, None]
    return joints[low] * (1 - share) + joints[np.minimum(low + 1, len(joints) - 1)] * share
