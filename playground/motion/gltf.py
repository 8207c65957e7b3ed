"""Animated GLB (glTF 2.0, one binary file) of a motion on HUMAN22: a skinned body of capsules, metres, Y up, +Z front.

Nodes 0..21 are the joints in HUMAN22's order, node 22 carries the mesh; one animation with rotations and the pelvis's
translation at the motion's frame rate. The left side is blue, the right side orange. numpy only.
"""

import json
import struct
from typing import Any

import numpy as np

from playground.errors import PlaygroundError
from playground.motion.kinematics import CHILDREN, PARENTS, make_rigid, rotations_from_joints, unit
from playground.motion.motion import Motion
from playground.motion.rotation import Array, qbetween, qrotate
from playground.motion.skeleton import HUMAN22

FLOAT, USHORT, UBYTE = 5126, 5123, 5121
_SIZES = {FLOAT: 4, USHORT: 2, UBYTE: 1}
_PARTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
RADII = {  # metres, at both ends of the bone that leads to a joint
    "hip": (0.075, 0.08), "knee": (0.08, 0.052), "ankle": (0.052, 0.036), "foot": (0.04, 0.03), "spine1": (0.1, 0.1),
    "spine2": (0.1, 0.105), "spine3": (0.105, 0.11), "neck": (0.09, 0.05), "head": (0.05, 0.05), "collar": (0.08, 0.06),
    "shoulder": (0.055, 0.05), "elbow": (0.046, 0.036), "wrist": (0.036, 0.028),
}  # fmt: skip
TIPS = {15: ((0.0, 0.06, 0.01), 0.095), 20: ((0.09, 0.0, 0.0), 0.03), 21: ((-0.09, 0.0, 0.0), 0.03),
        10: ((0.0, 0.0, 0.05), 0.025), 11: ((0.0, 0.0, 0.05), 0.025)}  # fmt: skip
COLOURS = {"l": (60, 120, 200, 255), "r": (235, 140, 50, 255), "": (150, 150, 158, 255)}


def _capsule(start: Array, end: Array, radii: tuple[float, float], sides: int = 10) -> tuple[Array, Array, Array]:
    """A round tapered bar between two points [3]: vertices, normals [n, 3], triangles [m, 3] (outside first)."""
    length = float(np.linalg.norm(end - start))
    angles = np.linspace(-np.pi / 2, np.pi / 2, 9)
    around = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    rings, tilts = [], []
    for angle in angles:
        radius, base = (radii[0], 0.0) if angle < 1e-9 else (radii[1], length)
        rings.append((radius * np.cos(angle), base + radius * np.sin(angle)))
        tilts.append(angle)
        if abs(angle) < 1e-9:  # the equator twice: at the start and at the end
            rings.append((radii[1], length))
            tilts.append(angle)
    vertices = np.array([[r * np.cos(a), y, r * np.sin(a)] for r, y in rings for a in around])
    normals = np.array([[np.cos(t) * np.cos(a), np.sin(t), np.cos(t) * np.sin(a)] for t in tilts for a in around])
    faces = []
    for ring in range(len(rings) - 1):
        for k in range(sides):
            a, b = ring * sides + k, ring * sides + (k + 1) % sides
            faces += [(a, a + sides, b), (b, a + sides, b + sides)]
    turn = qbetween(np.array([0.0, 1.0, 0.0]), end - start) if length > 1e-9 else np.array([1.0, 0.0, 0.0, 0.0])
    return qrotate(turn, vertices) + start, qrotate(turn, normals), np.array(faces)


def _mesh(offsets: Array) -> dict[str, Array]:
    """The body in T-pose, pelvis at the origin: one capsule a bone, bound to the joint that turns it."""
    rest = np.zeros((HUMAN22.size, 3))
    for joint in range(1, HUMAN22.size):
        rest[joint] = rest[PARENTS[joint]] + offsets[joint]
    bars = [
        (PARENTS[j], rest[PARENTS[j]], rest[j], RADII[HUMAN22.joints[j].split("_")[-1]], j)
        for j in range(1, HUMAN22.size)
    ]
    bars += [(j, rest[j], rest[j] + np.asarray(tip), (radius, radius), j) for j, (tip, radius) in TIPS.items()]
    out: dict[str, list[Array]] = {"POSITION": [], "NORMAL": [], "COLOR_0": [], "JOINTS_0": [], "faces": []}
    count = 0
    for bone, start, end, radii, joint in bars:
        vertices, normals, faces = _capsule(start, end, radii)
        name = HUMAN22.joints[joint]
        colour = np.array(COLOURS[name[0] if name[1] == "_" else ""])
        out["POSITION"].append(vertices)
        out["NORMAL"].append(unit(normals))
        out["COLOR_0"].append(np.repeat(colour[None], len(vertices), axis=0))
        out["JOINTS_0"].append(np.repeat(np.array([[bone, 0, 0, 0]]), len(vertices), axis=0))
        out["faces"].append(faces + count)
        count += len(vertices)
    mesh = {key: np.concatenate(parts) for key, parts in out.items()}
    mesh["WEIGHTS_0"] = np.repeat(np.array([[1.0, 0.0, 0.0, 0.0]]), count, axis=0)
    return mesh | {"rest": rest}


class _Buffer:
    """Collects arrays into one binary chunk with its views and accessors."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: Array, kind: str, component: int = FLOAT, **options: Any) -> int:
        """Append values [n, ...] as an accessor of a kind such as VEC3; returns its index. bounds: state min, max."""
        dtype = {FLOAT: "<f4", USHORT: "<u2", UBYTE: "u1"}[component]
        array = np.ascontiguousarray(values, dtype=dtype)
        self.data += b"\0" * (-len(self.data) % 4)
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self.data), "byteLength": array.nbytes}
        if "target" in options:
            view["target"] = options["target"]
        accessor: dict[str, Any] = {
            "bufferView": len(self.views), "componentType": component, "count": len(array), "type": kind
        }  # fmt: skip
        if options.get("normalised"):
            accessor["normalized"] = True
        if options.get("bounds"):
            flat = array.reshape(len(array), -1).astype(float)
            accessor |= {"min": flat.min(0).tolist(), "max": flat.max(0).tolist()}
        self.data += array.tobytes()
        self.views.append(view)
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def _animation(buffer: _Buffer, rotations: Array, root: Array, fps: float) -> dict[str, Any]:
    time = buffer.add(np.arange(len(root)) / fps, "SCALAR", bounds=True)
    samplers = [{"input": time, "output": buffer.add(root, "VEC3"), "interpolation": "LINEAR"}]
    channels: list[dict[str, Any]] = [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]
    for joint in (j for j in range(HUMAN22.size) if CHILDREN[j]):
        xyzw = rotations[:, joint][:, [1, 2, 3, 0]]
        channels.append({"sampler": len(samplers), "target": {"node": joint, "path": "rotation"}})
        samplers.append({"input": time, "output": buffer.add(xyzw, "VEC4"), "interpolation": "LINEAR"})
    return {"name": "motion", "samplers": samplers, "channels": channels}


def write_glb(motion: Motion) -> tuple[bytes, list[str]]:
    """A motion on HUMAN22 -> the bytes of a GLB file, and sentences on what had to be changed.

    Bones that drift are set to their median lengths first. PlaygroundError for another skeleton.
    """
    if motion.skeleton.joints != HUMAN22.joints:
        raise PlaygroundError(f"only motions on {HUMAN22.name} can be written as GLB, not on {motion.skeleton.name}")
    rigid = make_rigid(motion.joints)
    rotations = rotations_from_joints(rigid.joints, rigid.offsets)
    mesh = _mesh(rigid.offsets)
    buffer = _Buffer()
    attributes = {
        "POSITION": buffer.add(mesh["POSITION"], "VEC3", target=34962, bounds=True),
        "NORMAL": buffer.add(mesh["NORMAL"], "VEC3", target=34962),
        "COLOR_0": buffer.add(mesh["COLOR_0"], "VEC4", UBYTE, target=34962, normalised=True),
        "JOINTS_0": buffer.add(mesh["JOINTS_0"], "VEC4", UBYTE, target=34962),
        "WEIGHTS_0": buffer.add(mesh["WEIGHTS_0"], "VEC4", target=34962),
    }
    faces = buffer.add(mesh["faces"].reshape(-1), "SCALAR", USHORT, target=34963)
    inverse = np.repeat(np.eye(4)[None], HUMAN22.size, axis=0)
    inverse[:, 3, :3] = -mesh["rest"]  # glTF stores columns, so the translation is the last row here
    bind = buffer.add(inverse.reshape(-1, 16), "MAT4")
    nodes: list[dict[str, Any]] = []
    for joint, name in enumerate(HUMAN22.joints):
        shift = rigid.joints[0, 0] if joint == 0 else rigid.offsets[joint]
        nodes.append({"name": name, "translation": [round(float(v), 7) for v in shift]})
        if CHILDREN[joint]:
            nodes[-1]["children"] = list(CHILDREN[joint])
    nodes.append({"name": "body", "mesh": 0, "skin": 0})
    document = {
        "asset": {"version": "2.0", "generator": "Motion Token Playground", "extras": {"caption": motion.caption}},
        "scene": 0,
        "scenes": [{"nodes": [0, len(nodes) - 1]}],
        "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": attributes, "indices": faces, "material": 0}]}],
        "materials": [{"name": "body", "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.7}}],
        "skins": [{"joints": list(range(HUMAN22.size)), "inverseBindMatrices": bind, "skeleton": 0}],
        "animations": [_animation(buffer, rotations, rigid.joints[:, 0], motion.fps)],
    }
    return _packed(document, buffer), rigid.changes()


def _packed(document: dict[str, Any], buffer: _Buffer) -> bytes:
    """The two chunks behind the 12-byte header."""
    binary = bytes(buffer.data) + b"\0" * (-len(buffer.data) % 4)
    document |= {"buffers": [{"byteLength": len(binary)}], "bufferViews": buffer.views, "accessors": buffer.accessors}
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<III", _MAGIC, 2, 12 + 8 + len(text) + 8 + len(binary))
    return head + struct.pack("<II", len(text), _JSON) + text + struct.pack("<II", len(binary), _BIN) + binary


def _fail(what: str) -> PlaygroundError:
    return PlaygroundError(f"this GLB file is not sound: {what}")


def parse_glb(data: bytes) -> tuple[dict[str, Any], list[Array]]:
    """The document and every accessor's values of a GLB file that `write_glb` could have written.

    PlaygroundError where header, chunks, views, accessors, node tree, skin or animation do not fit together.
    """
    if len(data) < 28 or struct.unpack("<III", data[:12]) != (_MAGIC, 2, len(data)):
        raise _fail("its header does not say glTF 2 with the file's own length")
    size, kind = struct.unpack("<II", data[12:20])
    if kind != _JSON or size % 4 or 28 + size > len(data):
        raise _fail("its first chunk is not JSON")
    length, second = struct.unpack("<II", data[20 + size : 28 + size])
    if second != _BIN or 28 + size + length != len(data):
        raise _fail("its second chunk is not binary data that ends with the file")
    document = json.loads(data[20 : 20 + size])
    binary = data[28 + size :]
    arrays: list[Array] = []
    for accessor in document["accessors"]:
        view = document["bufferViews"][accessor["bufferView"]]
        parts = _PARTS[accessor["type"]]
        wanted = accessor["count"] * parts * _SIZES[accessor["componentType"]]
        if view["byteOffset"] % 4 or view["byteOffset"] + view["byteLength"] > length or view["byteLength"] != wanted:
            raise _fail("an accessor reaches outside its view")
        dtype = {FLOAT: "<f4", USHORT: "<u2", UBYTE: "u1"}[accessor["componentType"]]
        array = np.frombuffer(binary, dtype, accessor["count"] * parts, view["byteOffset"])
        arrays.append(array.reshape(accessor["count"], parts).astype(np.float64))
    _check_tree(document, arrays)
    return document, arrays


def _check_tree(document: dict[str, Any], arrays: list[Array]) -> None:
    nodes = document["nodes"]
    below = [child for node in nodes for child in node.get("children", [])] + document["scenes"][0]["nodes"]
    if sorted(below) != list(range(len(nodes))):
        raise _fail("its nodes do not form a tree")
    primitive = document["meshes"][0]["primitives"][0]
    positions = arrays[primitive["attributes"]["POSITION"]]
    if arrays[primitive["indices"]].max() >= len(positions):
        raise _fail("a triangle names a vertex that is not there")
    skin = document["skins"][0]
    if len(arrays[skin["inverseBindMatrices"]]) != len(skin["joints"]):
        raise _fail("its skin has not one matrix a joint")
    animation = document["animations"][0]
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        time, values = arrays[sampler["input"]], arrays[sampler["output"]]
        if len(time) != len(values) or not (np.diff(time[:, 0]) > 0).all():
            raise _fail("an animation has not one value at every rising moment")
        if channel["target"]["path"] == "rotation" and np.abs(np.linalg.norm(values, axis=-1) - 1.0).max() > 1e-3:
            raise _fail("a rotation is not a unit quaternion")
