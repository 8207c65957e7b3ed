"""What a file does not say about its axes and units, read off the body in it: unit of length, up axis, handedness."""

from dataclasses import dataclass

import numpy as np

from playground.errors import PlaygroundError
from playground.motion.joint_maps import JointMap
from playground.motion.kinematics import unit
from playground.motion.rotation import Array, qbetween
from playground.motion.source import Source

UNITS = (  # name, metres, legs of a person in it
    ("metres", 1.0, 0.4, 1.3),
    ("feet", 0.3048, 1.3, 4.5),
    ("units of 5.6 cm (as in the CMU database)", 0.0254 / 0.45, 8.0, 19.0),
    ("inches", 0.0254, 19.0, 42.0),
    ("centimetres", 0.01, 42.0, 130.0),
    ("millimetres", 0.001, 400.0, 1300.0),
)
AXES = tuple(
    (sign * np.eye(3)[axis], f"{'-' if sign < 0 else ''}{'XYZ'[axis]}") for axis in range(3) for sign in (1, -1)
)


@dataclass(frozen=True)
class Standing:
    """How the T-pose of a source stands: its up direction [3], and whether legs and spine point opposite ways."""

    up: Array
    stands: bool


def leg_length(source: Source, joints: JointMap) -> float:
    """Mean over both legs of hip to knee to ankle, median over the clip, in the unit of the file."""
    total = 0.0
    for side in "lr":
        hip, knee, ankle = (source.positions[:, joints.roles[f"{side}_{role}"]] for role in ("hip", "knee", "ankle"))
        bones = np.linalg.norm(knee - hip, axis=-1) + np.linalg.norm(ankle - knee, axis=-1)
        total += float(np.median(bones)) / 2.0
    if not 1e-6 < total < 1e9:
        raise PlaygroundError(f"the legs of this skeleton are {total:.3g} long, so it cannot be brought to human size")
    return total


def unit_of(leg: float) -> tuple[str, float] | None:
    """Leg length in the unit of a file -> the unit's name and its metres; None if no usual unit fits."""
    return next(((name, metres) for name, metres, low, high in UNITS if low <= leg < high), None)


def standing_rest(source: Source, joints: JointMap) -> Standing:
    """The up direction of the T-pose: from the hips to where the arms meet or the neck, and whether legs point down."""
    rest = source.rest
    hips = [joints.roles[f"{side}_hip"] for side in "lr"]
    top = joints.roles.get("neck", joints.chest)
    spine = rest[top] - rest[hips].mean(0)
    if np.linalg.norm(spine) < 1e-9:
        spine = rest[[joints.roles["l_shoulder"], joints.roles["r_shoulder"]]].mean(0) - rest[hips].mean(0)
    up = unit(spine)
    legs = [unit(rest[joints.roles[f"{side}_ankle"]] - rest[joints.roles[f"{side}_hip"]]) for side in "lr"]
    stands = all(float(leg @ up) < -0.8 for leg in legs)
    snapped = max((axis for axis, _ in AXES), key=lambda axis: float(axis @ up))
    return Standing(snapped if stands and float(snapped @ up) > 0.94 else up, stands)


def up_axis(source: Source, joints: JointMap, leg: float) -> tuple[Array, str]:
    """The axis that points up, [3] and its name.

    Each axis is judged by how often the body stands along it, whether the T-pose does and whether the floor lies at 0
    on it, and Y is preferred.
    """
    positions, roles = source.positions, joints.roles
    ankles = (positions[:, roles["l_ankle"]] + positions[:, roles["r_ankle"]]) / 2.0
    body = unit(positions[:, roles.get("neck", joints.chest)] - ankles)
    rest = standing_rest(source, joints)

    def score(axis: Array, name: str) -> float:
        upright = float(np.mean(body @ axis > 0.7))
        lowest = float(np.percentile((positions @ axis).min(axis=1), 5))
        t_pose = source.has_rest and rest.stands and float(rest.up @ axis) > 0.94
        return upright + 0.6 * t_pose + 0.5 * (abs(lowest) < 0.15 * leg) + 0.3 * (name == "Y")

    return max(AXES, key=lambda entry: score(*entry))


def is_left_handed(source: Source, joints: JointMap) -> bool:
    """True if the feet point backwards whenever left is left: the file's axes are mirrored. Y must be up."""
    positions, roles = source.positions, joints.roles
    if "l_foot" not in roles or "r_foot" not in roles:
        return False
    forward = sum(positions[:, roles[f"{side}_foot"]] - positions[:, roles[f"{side}_ankle"]] for side in "lr")
    left = np.cross(np.array([0.0, 1.0, 0.0]), forward)
    across = positions[:, roles["l_hip"]] - positions[:, roles["r_hip"]]
    return float(np.mean(np.sum(across * left, axis=-1) < 0.0)) > 0.9


def made_upright(source: Source, joints: JointMap, leg: float) -> tuple[Source, list[str]]:
    """The source with Y up and right-handed axes, and sentences on what was turned."""
    changes = []
    axis, name = up_axis(source, joints, leg)
    if name != "Y":
        source = source.turned(qbetween(axis, np.array([0.0, 1.0, 0.0])))
        changes.append(f"the axes were turned, since {name} points up in the file")
    if is_left_handed(source, joints):
        source = source.mirrored()
        changes.append("left and right were mirrored, since the file's axes are left-handed")
    return source, changes
