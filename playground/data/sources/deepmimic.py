"""Source `deepmimic`: the motions of DeepMimic (Peng et al., 2018; MIT) that an installed pybullet package carries.

Its folder pybullet_data holds the humanoid (humanoid/humanoid.urdf, four times life size, facing +X, right = +Z) and
the motions (data/motions/*.txt): JSON with `Frames`, each a duration in seconds, the root's position and rotation
(w, x, y, z), then every joint in the order of the URDF: four numbers for a ball joint, one angle for a hinge.
"""

import importlib.util
import json
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from playground.data.actions import words_of
from playground.data.library import LibraryClip
from playground.data.sources.base import Reading, library_clip, read_text, split_of
from playground.errors import PlaygroundError
from playground.motion.kinematics import forward_kinematics, global_rotations
from playground.motion.retarget import retarget
from playground.motion.rotation import axis_quaternion, qnormalise
from playground.motion.source import Source

SCALE = 0.25  # the humanoid is drawn four times life size
HEAD = np.array([0.0, 0.175, 0.0])  # metres from the neck joint to the middle of the head, which is no joint there
LEADING = 4  # duration and root position before the rotations of a frame
CAPTIONS = {
    "humanoid3d_backflip": "a person takes off and turns a backflip in the air",
    "humanoid3d_cartwheel": "a person turns over sideways on their hands in a cartwheel",
    "humanoid3d_crawl": "a person crawls on all fours",
    "humanoid3d_dance_a": "a person performs a short dance routine",
    "humanoid3d_dance_b": "a person dances with lively steps",
    "humanoid3d_getup_facedown": "a person lying face down pushes up and stands",
    "humanoid3d_getup_faceup": "a person lying on their back gets to their feet",
    "humanoid3d_jump": "a person bends their knees and jumps",
    "humanoid3d_kick": "a person steps in and kicks",
    "humanoid3d_punch": "a person steps forward and strikes with a fist",
    "humanoid3d_roll": "a person rolls over on the ground and comes up again",
    "humanoid3d_run": "a person runs",
    "humanoid3d_spin": "a person whirls around on one foot",
    "humanoid3d_spinkick": "a person turns around and kicks high",
    "humanoid3d_walk": "a person walks at an easy pace",
    "0walk_forward": "a person steadily walks straight ahead",
    "turn_left0": "a person walks and bears left",
    "turn_left1": "a person walks in a curve to the left",
    "turn_right0": "a person walks and bears right",
    "turn_right1": "a person walks in a curve to the right",
}


@dataclass(frozen=True, eq=False)
class Body:
    """The humanoid: one row a joint, in the order in which a frame lists them; fixed joints move with their parent."""

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: NDArray[np.float64]  # [J, 3] metres
    axes: tuple[int | None, ...]  # axis of a hinge, None for a ball joint
    fixed: tuple[bool, ...]

    @property
    def columns(self) -> int:
        """Numbers in one frame."""
        return LEADING + sum(
            0 if fixed else 4 if axis is None else 1 for axis, fixed in zip(self.axes, self.fixed, strict=True)
        )


def read_deepmimic(root: Path | None) -> Reading:
    """PlaygroundError where pybullet is not installed or its files are not there."""
    spec = importlib.util.find_spec("pybullet_data")
    if spec is None or spec.origin is None:
        raise PlaygroundError("deepmimic needs the package pybullet; pip install -r requirements-extra.txt brings it")
    folder = Path(spec.origin).parent
    body = read_body(folder / "humanoid" / "humanoid.urdf")
    files = sorted((folder / "data" / "motions").rglob("*.txt"))
    if not files:
        raise PlaygroundError(f"{folder} holds no motions; this pybullet package cannot be used")
    left_out: Counter[str] = Counter()
    return Reading(len(files), _clips(files, body, left_out), left_out)


def read_body(path: Path) -> Body:
    """The joints of a URDF file whose first joint is the root. PlaygroundError if it is something else."""
    try:
        joints = list(ElementTree.fromstring(read_text(path).rstrip("\0 \r\n")).iter("joint"))
        links = [_part(joint, "child", "link") for joint in joints]
        above = [_part(joint, "parent", "link") for joint in joints]
        origins = [_part(joint, "origin", "xyz").split() for joint in joints]
        turns = [_hinge(joint) for joint in joints]
        parents = [-1, *(links.index(link) for link in above[1:])]
        offsets = np.array(origins, np.float64) * SCALE
        if not joints or offsets.shape != (len(joints), 3):
            raise ValueError("no joints")
    except (ElementTree.ParseError, ValueError) as error:
        raise PlaygroundError(f"{path} is not the humanoid of DeepMimic") from error
    fixed = [False, *(joint.get("type") == "fixed" for joint in joints[1:])]
    return Body(tuple(links), tuple(parents), offsets, tuple(turns), tuple(fixed))


def _part(joint: ElementTree.Element, tag: str, name: str) -> str:
    found = joint.find(tag)
    if found is None or name not in found.attrib:
        raise ValueError(f"a joint without {tag} {name}")
    return found.attrib[name]


def _hinge(joint: ElementTree.Element) -> int | None:
    if joint.find("axis") is None:
        return None
    return int(np.argmax([float(part) for part in _part(joint, "axis", "xyz").split()]))


def _clips(files: list[Path], body: Body, left_out: Counter[str]) -> Iterator[LibraryClip]:
    for path in files:
        source = read_frames(path, body)
        if source is None:
            left_out["motions of another body"] += 1
            continue
        words = words_of(path.stem.removeprefix("humanoid3d_"))
        caption = CAPTIONS.get(path.stem, words)
        clip = library_clip(
            retarget(source).joints,
            left_out,
            id=f"deepmimic_{path.stem.removeprefix('humanoid3d_')}",
            source="DeepMimic",
            split=split_of(path.stem),
            label=f"{words} {caption}",
            captions=(caption,),
        )
        if clip:
            yield clip


def read_frames(path: Path, body: Body) -> Source | None:
    """One motion file on the humanoid; None if it is of another body. PlaygroundError if it is broken."""
    try:
        frames = np.array(json.loads(read_text(path))["Frames"], np.float64)
    except (ValueError, TypeError, KeyError) as error:
        raise PlaygroundError(f"{path} is not a motion file of DeepMimic") from error
    if frames.ndim != 2 or not np.isfinite(frames).all() or len(frames) < 2:
        raise PlaygroundError(f"{path} is not a motion file of DeepMimic")
    if frames.shape[1] != body.columns:
        return None
    rotations = np.zeros((len(frames), len(body.names), 4))
    rotations[..., 0] = 1.0
    column = LEADING
    for joint, (axis, fixed) in enumerate(zip(body.axes, body.fixed, strict=True)):
        if fixed:
            continue
        if axis is None:
            rotations[:, joint] = qnormalise(frames[:, column : column + 4])
        else:
            rotations[:, joint] = axis_quaternion(axis, frames[:, column])
        column += 4 if axis is None else 1
    duration = float(np.median(frames[:, 0]))
    if duration <= 0:
        raise PlaygroundError(f"{path} has frames of no duration")
    return Source(
        names=body.names,
        parents=body.parents,
        offsets=body.offsets,
        positions=forward_kinematics(rotations, frames[:, 1:LEADING], body.offsets, body.parents),
        rotations=global_rotations(rotations, body.parents),
        fps=round(1.0 / duration, 1),
        ends={body.names.index("neck"): HEAD} if "neck" in body.names else {},
        kind="DeepMimic motion",
    )
