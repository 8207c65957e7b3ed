"""BVH: a reader that forgives what files in the wild do, and a writer that Blender opens.

Written files: ROOT with 6 channels, every other joint with 3 rotation channels (Z X Y), an End Site at every end; a
Motion has HUMAN22 names, metres, Y up, a T-pose facing +Z. Read files: any names, channels in any order, positions on
any joint (they replace the OFFSET, as Blender and Maya do), tabs, CRLF, comments, names with spaces.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.kinematics import make_rigid, rotations_from_joints
from playground.motion.motion import Motion
from playground.motion.rotation import (
    Array,
    axis_quaternion,
    matrix_to_euler,
    qinv,
    qmul,
    qrotate,
    quaternion_to_matrix,
)
from playground.motion.skeleton import HUMAN22
from playground.motion.source import Source, check_size

CHANNELS = {f"{axis}{kind}": (kind, "xyz".index(axis)) for axis in "xyz" for kind in ("position", "rotation")}
MAX_VALUE = 1e7  # degrees, or lengths in the unit of the file
MAX_HEADER = 1_000_000  # characters of the HIERARCHY part
_CHUNK = 1_000_000  # characters of numbers that are parsed at a time
ORDER = "ZXY"
END_SITES = {
    15: (0.0, 0.16, 0.0),
    20: (0.09, 0.0, 0.0),
    21: (-0.09, 0.0, 0.0),
    10: (0.0, 0.0, 0.06),
    11: (0.0, 0.0, 0.06),
}


@dataclass
class _Hierarchy:
    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: list[list[float]] = field(default_factory=list)
    channels: list[list[tuple[str, int]]] = field(default_factory=list)
    ends: dict[int, list[float]] = field(default_factory=dict)


def _bad(what: str) -> PlaygroundError:
    return PlaygroundError(f"this BVH file cannot be read: {what}")


def _number(word: str, what: str) -> float:
    try:
        value = float(word)
    except ValueError:
        raise _bad(f"{what} says '{word[:20]}' where a number belongs") from None
    if not abs(value) <= MAX_VALUE:
        raise _bad(f"{what} holds a value that is not finite or beyond {MAX_VALUE:,.0f}")
    return value


def _words(header: str) -> Iterator[str]:
    """Words, braces and line ends of the HIERARCHY part, comments left out."""
    for line in header.splitlines():
        yield from re.findall(r"[{}]|[^\s{}]+", re.split(r"//|(?:^|\s)#", line, maxsplit=1)[0])
        yield "\n"


def _rest_of_line(words: Iterator[str]) -> tuple[str, bool]:
    """The words up to the line end or an opening brace, and whether it was the brace."""
    found: list[str] = []
    for word in words:
        if word in ("\n", "{"):
            return " ".join(found), word == "{"
        found.append(word)
    return " ".join(found), False


def _take(words: Iterator[str], count: int, what: str) -> list[str]:
    found: list[str] = []
    while len(found) < count:
        word = next(words, "}")
        if word in "{}":
            raise _bad(f"{what} has {len(found)} of {count} values")
        if word != "\n":
            found.append(word)
    return found


def _channels(words: Iterator[str], name: str) -> list[tuple[str, int]]:
    count = _take(words, 1, f"CHANNELS of joint '{name}'")[0]
    if not count.isdigit() or int(count) > 6:
        raise _bad(f"joint '{name}' has {count[:20]} channels; 0 to 6 are possible")
    found = _take(words, int(count), f"CHANNELS of joint '{name}'")
    unknown = [word for word in found if word.lower() not in CHANNELS]
    if unknown:
        raise _bad(f"joint '{name}' has a channel '{unknown[0][:20]}'; only X, Y, Z position and rotation are possible")
    if len({word.lower() for word in found}) < len(found):
        raise _bad(f"joint '{name}' has the same channel twice")
    return [CHANNELS[word.lower()] for word in found]


def _read_hierarchy(header: str) -> _Hierarchy:
    """The tree of joints. Every joint starts a level; an End Site is kept as an offset of its joint."""
    tree = _Hierarchy()
    stack: list[int] = []  # open joints; an End Site repeats its joint
    in_end = False
    words = _words(header)
    for word in words:
        key = word.upper()
        if key in ("\n", "{"):
            continue
        if key == "}":
            if not stack:
                raise _bad("there are more closing than opening braces")
            stack.pop()
            in_end = False
        elif key in ("ROOT", "JOINT"):
            if (key == "ROOT") != (not stack) or (key == "ROOT" and tree.names) or in_end:
                raise _bad("it must hold one ROOT with all joints inside")
            name = _rest_of_line(words)[0][:60] or f"joint {len(tree.names)}"
            tree.parents.append(stack[-1] if stack else -1)
            stack.append(len(tree.names))
            tree.names.append(name)
            tree.offsets.append([0.0, 0.0, 0.0])
            tree.channels.append([])
        elif key == "END" and stack:
            _rest_of_line(words)
            stack.append(stack[-1])
            in_end = True
        elif key == "OFFSET" and stack:
            name = tree.names[stack[-1]]
            values = [_number(w, f"OFFSET of '{name}'") for w in _take(words, 3, f"OFFSET of joint '{name}'")]
            if in_end:
                tree.ends.setdefault(stack[-1], values)
            else:
                tree.offsets[stack[-1]] = values
        elif key == "CHANNELS" and stack and not in_end:
            tree.channels[stack[-1]] = _channels(words, tree.names[stack[-1]])
        else:
            raise _bad(f"the hierarchy has '{word[:20]}' where ROOT, JOINT, End Site, OFFSET or CHANNELS belongs")
    if stack:
        raise _bad("the hierarchy ends before all braces are closed, so it looks cut off")
    return tree


def _read_values(body: str, frames: int, columns: int) -> Array:
    """The numbers of the MOTION part as [frames, columns]."""
    parts: list[Array] = []
    at = 0
    while at < len(body):
        stop = at + _CHUNK
        while stop < len(body) and not body[stop].isspace():
            stop += 1
        try:
            parts.append(np.fromiter(map(float, body[at:stop].split()), np.float64))
        except ValueError as error:
            raise _bad(f"among the motion values there is {str(error).split(':')[-1].strip()[:40]}") from None
        at = stop
    values = np.concatenate(parts) if parts else np.zeros(0)
    if not (np.abs(values) <= MAX_VALUE).all():
        raise _bad(f"the motion values must all be finite numbers up to {MAX_VALUE:,.0f}")
    if len(values) < frames * columns or len(values) % columns:
        raise _bad(
            f"{frames} frames of {columns} channels need {frames * columns:,} values, but there are {len(values):,}; "
            "the file looks cut off or its channels are wrong"
        )
    return values[: frames * columns].reshape(frames, columns)


def _source(tree: _Hierarchy, values: Array, fps: float) -> Source:
    """Forward kinematics: channel values [F, C] in degrees and file units -> world positions and rotations."""
    frames, joints = len(values), len(tree.names)
    offsets = np.asarray(tree.offsets, np.float64)
    positions = np.zeros((frames, joints, 3))
    rotations = np.zeros((frames, joints, 4))
    column = 0
    for joint, parent in enumerate(tree.parents):
        shift: Array = np.repeat(offsets[joint][None], frames, axis=0)
        turn: Array = np.zeros((frames, 4))
        turn[:, 0] = 1.0
        for kind, axis in tree.channels[joint]:
            if kind == "position":
                shift[:, axis] = values[:, column]
            else:
                turn = qmul(turn, axis_quaternion(axis, np.radians(values[:, column])))
            column += 1
        if parent >= 0:
            shift = positions[:, parent] + qrotate(rotations[:, parent], shift)
            turn = qmul(rotations[:, parent], turn)
        positions[:, joint], rotations[:, joint] = shift, turn
    ends: dict[int, Array] = {joint: np.asarray(offset, np.float64) for joint, offset in tree.ends.items()}
    return Source(tuple(tree.names), tuple(tree.parents), offsets, positions, rotations, fps, ends, "BVH file")


def read_bvh(data: bytes) -> Source:
    """The bytes of a BVH file -> its skeleton and world motion in the unit of the file.

    PlaygroundError with one sentence for anything that is not a sound BVH file within `LIMITS`.
    """
    text = data.decode("utf-8-sig", errors="replace")
    split = re.search(r"^[ \t]*MOTION\b", text, flags=re.MULTILINE | re.IGNORECASE)
    start = re.search(r"^[ \t]*HIERARCHY\b", text, flags=re.MULTILINE | re.IGNORECASE)
    if not start:
        raise _bad("it has no line that says HIERARCHY")
    if not split or split.start() < start.end():
        raise _bad("it has no line that says MOTION after the hierarchy, so it looks cut off")
    header = text[start.end() : split.start()]
    if len(header) > MAX_HEADER:
        raise _bad(f"its hierarchy has more than {MAX_HEADER:,} characters")
    check_joints = len(re.findall(r"^[^\S\n]*(?:ROOT|JOINT)\b", header, flags=re.MULTILINE | re.IGNORECASE))
    check_size("BVH file", LIMITS.min_source_frames, max(check_joints, 1), 1.0)
    tree = _read_hierarchy(header)
    columns = sum(map(len, tree.channels))
    if not columns:
        raise _bad("no joint has a channel")
    counted = re.compile(r"\s*Frames\s*:?\s*(\d{1,12})\b", flags=re.IGNORECASE).match(text, split.end())
    timed = (
        re.compile(r"\s*Frame\s+Time\s*:?\s*(\S+)", flags=re.IGNORECASE).match(text, counted.end()) if counted else None
    )
    if not counted or not timed:
        raise _bad("after MOTION it must state 'Frames: N' and 'Frame Time: seconds'")
    seconds = _number(timed.group(1), "Frame Time")
    fps = 1.0 / seconds if seconds > 1e-9 else 0.0
    fps = float(round(fps)) if abs(fps - round(fps)) < 5e-4 * fps else fps
    check_size("BVH file", int(counted.group(1)), len(tree.names), fps)
    return _source(tree, _read_values(text[timed.end() :], int(counted.group(1)), columns), fps)


def _hierarchy_lines(
    names: Sequence[str], parents: Sequence[int], offsets: Array, ends: Mapping[int, Sequence[float]]
) -> tuple[list[str], list[int]]:
    """The HIERARCHY part and the joints in the order of their channels."""
    lines, order = ["HIERARCHY"], []

    def joint_lines(joint: int, depth: int) -> None:
        tabs = "\t" * depth
        order.append(joint)
        root = depth == 0
        lines.append(f"{tabs}{'ROOT' if root else 'JOINT'} {names[joint]}")
        lines.append(tabs + "{")
        lines.append(f"{tabs}\tOFFSET " + " ".join(f"{v:.6f}" for v in (np.zeros(3) if root else offsets[joint])))
        rotations = " ".join(f"{axis}rotation" for axis in ORDER)
        lines.append(
            f"{tabs}\tCHANNELS " + (f"6 Xposition Yposition Zposition {rotations}" if root else f"3 {rotations}")
        )
        for child in (c for c, parent in enumerate(parents) if parent == joint):
            joint_lines(child, depth + 1)
        if joint in ends:
            end = " ".join(f"{v:.6f}" for v in ends[joint])
            lines.extend([f"{tabs}\tEnd Site", tabs + "\t{", f"{tabs}\t\tOFFSET {end}", tabs + "\t}"])
        lines.append(tabs + "}")

    joint_lines(0, 0)
    return lines, order


def _motion_lines(root: Array, local: Array, order: list[int], fps: float) -> list[str]:
    """The MOTION part: root positions [F, 3], local rotations [F, J, 4]."""
    angles = np.degrees(np.unwrap(matrix_to_euler(quaternion_to_matrix(local), ORDER), axis=0))
    values = np.concatenate([root, angles[:, order].reshape(len(root), -1)], axis=-1)
    head = ["MOTION", f"Frames: {len(root)}", f"Frame Time: {1.0 / fps:.8f}"]
    return head + [" ".join(f"{v:.6f}" for v in row) for row in values.tolist()]


def write_bvh(motion: Motion) -> tuple[str, list[str]]:
    """A motion on HUMAN22 -> the text of a BVH file, and sentences on what had to be changed.

    Bones that drift are set to their median lengths first. PlaygroundError for another skeleton.
    """
    if motion.skeleton.joints != HUMAN22.joints:
        raise PlaygroundError(f"only motions on {HUMAN22.name} can be written as BVH, not on {motion.skeleton.name}")
    rigid = make_rigid(motion.joints)
    local = rotations_from_joints(rigid.joints, rigid.offsets)
    lines, order = _hierarchy_lines(HUMAN22.joints, HUMAN22.parents, rigid.offsets, END_SITES)
    lines += _motion_lines(rigid.joints[:, 0], local, order, motion.fps)
    return "\n".join(lines) + "\n", rigid.changes()


def write_source(source: Source) -> str:
    """Any skeleton in its own unit -> the text of a BVH file, from the root's path, the offsets and the rotations."""
    local, parents = source.rotations.copy(), list(source.parents[1:])
    local[:, 1:] = qmul(qinv(source.rotations[:, parents]), source.rotations[:, 1:])
    closed = [joint for joint, kids in enumerate(source.children) if not kids]
    ends = {joint: source.ends[joint].tolist() if joint in source.ends else [0.0] * 3 for joint in closed}
    lines, order = _hierarchy_lines(source.names, source.parents, source.offsets, ends)
    return "\n".join(lines + _motion_lines(source.positions[:, 0], local, order, source.fps)) + "\n"
