"""Which joint is which: every style of names by its table, nonsense names by the shape of the hierarchy."""

import numpy as np
import pytest

from playground.errors import PlaygroundError
from playground.motion.bvh import read_bvh
from playground.motion.hierarchy import by_shape
from playground.motion.joint_maps import NEEDED, map_joints, side_and_base, with_ends
from playground.motion.skeleton import HUMAN22
from playground.motion.source import Source
from tests.motion.skeletons import NONSENSE, STYLES, Rig, bvh_text, walk

ROLES = [name for name in HUMAN22.joints if not name.startswith(("pelvis", "spine"))]


def source(names: dict[str, str], **options) -> Source:
    joints = walk()[:12]
    return with_ends(read_bvh(bvh_text(joints, Rig(names, **options)).encode()))


def found(source: Source, roles: dict[str, int]) -> dict[str, str]:
    return {role: source.names[joint] for role, joint in roles.items()}


@pytest.mark.parametrize("style", list(STYLES))
def test_names_of_a_known_style(style: str) -> None:
    given = source(STYLES[style])
    mapped = map_joints(given)
    assert found(given, mapped.roles) == {role: STYLES[style][role] for role in ROLES}
    assert (
        given.names[mapped.pelvis] == STYLES[style]["pelvis"] and given.names[mapped.chest] == STYLES[style]["spine3"]
    )
    assert style in mapped.sentence and mapped.sentence.endswith(".") and "estimated" not in mapped.sentence


@pytest.mark.parametrize("mirrored", [False, True])
def test_nonsense_names_go_by_shape_and_the_feet_tell_left_from_right(mirrored: bool) -> None:
    names = dict(NONSENSE)
    if mirrored:  # the other side comes first in the file's names; only geometry can tell
        for joint, twin in enumerate(HUMAN22.mirror):
            names[HUMAN22.joints[joint]] = NONSENSE[HUMAN22.joints[twin]]
    given = source(names)
    mapped = map_joints(given)
    assert found(given, mapped.roles) == {role: names[role] for role in ROLES}
    assert "shape of the hierarchy" in mapped.sentence


def test_without_toes_the_knees_tell_left_from_right() -> None:
    joints = walk()
    rig = Rig(NONSENSE, drop=("l_foot", "r_foot"))
    text = bvh_text(joints[:30], rig).replace("OFFSET 2.8180000", "OFFSET 0").replace("OFFSET -2.8140000", "OFFSET 0")
    given = read_bvh(text.encode())
    roles = by_shape(given, {})
    assert given.names[roles["l_knee"]] == NONSENSE["l_knee"] and given.names[roles["r_wrist"]] == NONSENSE["r_wrist"]


def test_sides_in_unknown_names_are_believed() -> None:
    names = {joint: joint.replace("l_", "Left_zz").replace("r_", "Right_zz") for joint in HUMAN22.joints}
    names = {joint: name.replace("hip", "qq").replace("shoulder", "ww") for joint, name in names.items()}
    given = source(names)
    assert found(given, map_joints(given).roles)["l_hip"] == "Left_zzqq"


def test_missing_ends_are_taken_from_end_sites_and_the_rest_is_said() -> None:
    drop = ("l_wrist", "r_wrist", "head")
    given = source(STYLES["HumanIK"], drop=drop)
    mapped = map_joints(given)
    assert (
        found(given, mapped.roles)["l_wrist"] == "LeftForeArm end" and found(given, mapped.roles)["head"] == "Neck end"
    )
    assert all(role in mapped.roles for role in NEEDED)


@pytest.mark.parametrize(
    ("name", "side", "base"),
    [("LeftUpLeg", "l", "upleg"), ("mixamorig:RightHand", "r", "hand"), ("UpperArm_L", "l", "upperarm"),
     ("Bip01 R Thigh", "r", "thigh"), ("lThigh", "l", "thigh"), ("rfemur", "r", "femur"), ("L_Hip", "l", "hip"),
     ("Character1_LeftFoot", "l", "foot"), ("LowerBack", "", "lowerback"), ("Root", "", "root"), ("neck", "", "neck"),
     ("l_shoulder", "l", "shoulder"), ("LHipJoint", "l", "hipjoint"), ("thigh.R", "r", "thigh"), ("", "", "")],
)  # fmt: skip
def test_sides_are_read_off_names(name: str, side: str, base: str) -> None:
    assert side_and_base(name) == (side, base)


def chain(parents: list[int], offsets: list[tuple[float, float, float]]) -> Source:
    """A skeleton that stands still."""
    shifts = np.array(offsets, float)
    positions = np.zeros((5, len(parents), 3))
    for joint, parent in enumerate(parents):
        positions[:, joint] = shifts[joint] + (positions[:, parent] if parent >= 0 else 0.0)
    rotations = np.tile([1.0, 0, 0, 0], (5, len(parents), 1))
    return Source(tuple(f"b{n}" for n in range(len(parents))), tuple(parents), shifts, positions, rotations, 20.0)


@pytest.mark.parametrize("legs", [0, 1, 4])
def test_what_is_no_biped_is_refused_in_one_sentence(legs: int) -> None:
    parents, offsets = [-1], [(0.0, 1.0, 0.0)]
    for leg in range(legs):
        top = len(parents)
        parents += [0, top, top + 1]
        offsets += [(0.2 * (leg + 1), 0, 0), (0, -0.4 - 0.2 * leg, 0), (0, -0.4, 0)]
    with pytest.raises(PlaygroundError) as caught:
        map_joints(chain(parents, offsets))
    assert "not understood" in str(caught.value) and "\n" not in str(caught.value)


def test_a_long_snake_is_refused_quickly() -> None:
    with pytest.raises(PlaygroundError, match="not understood"):
        map_joints(chain(list(range(-1, 119)), [(0.0, 0.1, 0.0)] * 120))
