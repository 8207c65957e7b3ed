"""Which joint of a source is which of HUMAN22's: tables of joint names by style, and by shape where no table fits."""

import re
from dataclasses import dataclass, replace

import numpy as np

from playground.errors import PlaygroundError
from playground.motion.hierarchy import by_shape, meeting
from playground.motion.rotation import qrotate
from playground.motion.skeleton import HUMAN22
from playground.motion.source import Source


@dataclass(frozen=True)
class Style:
    """Names of one family of skeletons, lower case, without side, prefix and punctuation; alternatives by |."""

    label: str
    leg: tuple[str, str, str, str]  # thigh (at the hip), shin (at the knee), foot (at the ankle), toe
    arm: tuple[str, str, str, str]  # collar, upper arm (at the shoulder), forearm (at the elbow), hand (at the wrist)
    neck: str
    head: str
    sign: str = ""  # a pattern that one raw name must match


_IK = (("upleg", "leg", "foot", "toebase|toe"), ("shoulder", "arm", "forearm", "hand"), "neck1|neck", "head")
STYLES = (
    Style("HumanML3D", ("hip", "knee", "ankle", "foot"), ("collar", "shoulder", "elbow", "wrist"), "neck", "head",
          r"(?i)spine_?3$"),
    Style("Mixamo", *_IK, sign=r"(?i)^mixamorig"),
    Style("CMU", *_IK, sign=r"(?i)^(lhipjoint|lowerback)$"),
    Style("HumanIK", *_IK),
    Style("Bandai Namco", ("upperleg", "lowerleg", "foot", "toes"), ("shoulder", "upperarm", "lowerarm", "hand"),
          "neck", "head", r"^UpperLeg_L$"),
    Style("Xsens", ("hip", "knee", "ankle", "toe"), ("collar", "shoulder", "elbow", "wrist"), "neck", "head"),
    Style("Xsens", ("upperleg", "lowerleg", "foot", "toe"), ("shoulder", "upperarm", "forearm", "hand"), "neck", "head",
          r"(?i)^(l5|t8|t12)$"),
    Style("Rokoko", ("thigh", "shin", "foot", "toe|toebase"), ("shoulder", "arm|upperarm", "forearm|lowerarm", "hand"),
          "neck", "head"),
    Style("Unity", ("upperleg", "lowerleg", "foot", "toes|toe|toebase"),
          ("shoulder|clavicle|collar", "upperarm", "lowerarm|forearm", "hand"), "neck", "head"),
    Style("CMU ASF", ("femur", "tibia", "foot", "toes"), ("clavicle", "humerus", "radius", "wrist|hand"),
          "upperneck|lowerneck", "head"),
    Style("Daz", ("thigh", "shin", "foot", "toe|toes"), ("collar", "shldr|shoulder", "forearm|elbow", "hand"),
          "neck", "head"),
    Style("Biovision", ("upleg|upperleg", "lowleg|lowerleg", "foot", "toe"), ("collar", "uparm", "lowarm", "hand"),
          "neck", "head"),
    Style("Biped", ("thigh", "calf", "foot", "toe0|toe|ball"), ("clavicle", "upperarm", "forearm|lowerarm", "hand"),
          "neck|neck01", "head"),
)  # fmt: skip
LEG_ROLES = ("hip", "knee", "ankle", "foot")
ARM_ROLES = ("collar", "shoulder", "elbow", "wrist")
NEEDED = tuple(f"{s}_{role}" for s in "lr" for role in (*LEG_ROLES[:3], *ARM_ROLES[1:]))
_BASES = {part for style in STYLES for group in (*style.leg, *style.arm) for part in group.split("|")} | {"hipjoint"}


@dataclass(frozen=True, eq=False)
class JointMap:
    """HUMAN22 joint names -> joints of a source. pelvis and chest are where the legs and where the arms meet."""

    roles: dict[str, int]
    pelvis: int
    chest: int
    sentence: str  # which mapping was used, for people


def side_and_base(name: str) -> tuple[str, str]:
    """A joint name -> ("l", "r" or "", the name in lower case without side, prefix and punctuation)."""
    name = re.sub(r"^(?:.*:|(?i:mixamorig|character1|bip\d+|valvebiped|def|skel)[ _.\-:]*)", "", name.strip())
    spaced = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", name)
    words = [word for word in re.split(r"[^A-Za-z0-9]+", spaced.lower()) if word]
    sides = {"l": "l", "left": "l", "r": "r", "right": "r"}
    for at in (0, -1):
        if len(words) > 1 and words[at] in sides:
            return sides[words[at]], "".join(words[1:] if at == 0 else words[:-1])
    base = "".join(words)
    for prefix, side in (("left", "l"), ("right", "r"), ("l", "l"), ("r", "r")):
        if base.startswith(prefix) and base[len(prefix) :] in _BASES:
            return side, base[len(prefix) :]
    return "", base


def with_ends(source: Source) -> Source:
    """The source with its End Sites as joints of their own, so that a hand or a head that is only an end counts."""
    ends = [(joint, offset) for joint, offset in source.ends.items() if np.linalg.norm(offset) > 1e-9]
    if not ends:
        return source
    joints = [joint for joint, _ in ends]
    tips = [source.positions[:, j] + qrotate(source.rotations[:, j], offset) for j, offset in ends]
    return replace(
        source,
        names=(*source.names, *(f"{source.names[j]} end" for j in joints)),
        parents=(*source.parents, *joints),
        offsets=np.concatenate([source.offsets, np.stack([offset for _, offset in ends])]),
        positions=np.concatenate([source.positions, np.stack(tips, axis=1)], axis=1),
        rotations=np.concatenate([source.rotations, source.rotations[:, joints]], axis=1),
        ends={},
    )


def _longest_child(source: Source, joint: int) -> int | None:
    """The child farthest from its parent, None if there is none away from it."""
    kids = list(source.children[joint])
    if not kids:
        return None
    lengths = np.linalg.norm(source.positions[:, kids] - source.positions[:, joint, None], axis=-1)
    longest = int(np.argmax(np.median(lengths, axis=0)))
    return kids[longest] if np.median(lengths[:, longest]) > 1e-9 else None


def _by_names(source: Source, style: Style) -> dict[str, int] | None:
    """The roles that a style finds, None unless it finds both legs and both arms."""
    if style.sign and not any(re.search(style.sign, name) for name in source.names):
        return None
    known: dict[tuple[str, str], int] = {}
    for joint, name in enumerate(source.names):
        known.setdefault(side_and_base(name), joint)
    roles: dict[str, int] = {}

    def put(role: str, side: str, names: str) -> None:
        found = [known[side, base] for base in names.split("|") if (side, base) in known]
        if found:
            roles[role] = found[0]

    for side in "lr":
        for role, names in zip((*LEG_ROLES, *ARM_ROLES), (*style.leg, *style.arm), strict=True):
            put(f"{side}_{role}", side, names)
        for tip, parent in (("ankle", "knee"), ("foot", "ankle"), ("wrist", "elbow")):
            if f"{side}_{tip}" not in roles and f"{side}_{parent}" in roles:
                child = _longest_child(source, roles[f"{side}_{parent}"])
                roles |= {f"{side}_{tip}": child} if child is not None else {}
    put("neck", "", style.neck)
    put("head", "", style.head)
    if "head" not in roles and "neck" in roles:
        child = _longest_child(source, roles["neck"])
        roles |= {"head": child} if child is not None else {}
    if any(role not in roles for role in NEEDED):
        return None
    return roles if len(set(roles.values())) == len(roles) else None


def _sentence(how: str, roles: dict[str, int]) -> str:
    """Which mapping was used and what had to be estimated."""
    estimated = [
        label
        for label, names in (("head", ("head",)), ("collars", ("l_collar", "r_collar")), ("toes", ("l_foot", "r_foot")))
        if any(name not in roles for name in names)
    ]
    missing = " and ".join(estimated)
    return f"Joints were mapped by {how}" + (f"; {missing} had no joint and were estimated." if missing else ".")


def map_joints(source: Source) -> JointMap:
    """Find HUMAN22's joints in a source (see `with_ends`): by names of a known style, else by the hierarchy's shape.

    PlaygroundError if neither works.
    """
    for style in STYLES:
        roles = _by_names(source, style)
        if roles is not None:
            how = f"their names, which are of the {style.label} style"
            break
    else:
        side = {joint: side_and_base(name)[0] for joint, name in enumerate(source.names)}
        roles = by_shape(source, side)
        how = "the shape of the hierarchy (two legs, spine, two arms, head), since their names are of no known style"
        if any(role not in roles for role in NEEDED):
            raise PlaygroundError(
                "the legs and arms of this skeleton need three joints each: hip to ankle, shoulder to wrist"
            )
    pelvis = meeting(source, roles["l_hip"], roles["r_hip"])
    chest = meeting(source, roles["l_shoulder"], roles["r_shoulder"])
    if chest in (roles["l_shoulder"], roles["r_shoulder"]) or pelvis in (roles["l_hip"], roles["r_hip"]):
        raise PlaygroundError("this skeleton is not understood: one arm or leg hangs from the other")
    assert set(roles) <= set(HUMAN22.joints)
    return JointMap(roles, pelvis, chest, _sentence(how, roles))
