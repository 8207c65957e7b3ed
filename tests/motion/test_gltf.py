"""Animated GLB: the animation poses the joints, the mesh is closed and faces outwards, broken files are noticed."""

import json
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from playground.errors import PlaygroundError
from playground.motion.gltf import parse_glb, write_glb
from playground.motion.motion import Motion
from playground.motion.skeleton import HUMAN22, Skeleton
from tests.motion.skeletons import walk


def posed(document: dict, arrays: list[np.ndarray], frame: int) -> tuple[np.ndarray, list[np.ndarray]]:
    """World positions [22, 3] and matrices of the joints at one key, by walking the nodes as the glTF text says."""
    animation = document["animations"][0]
    values: dict[tuple[int, str], np.ndarray] = {}
    for channel in animation["channels"]:
        target = channel["target"]
        values[target["node"], target["path"]] = arrays[animation["samplers"][channel["sampler"]]["output"]][frame]
    matrices: list[np.ndarray] = [np.eye(4)] * 22

    def visit(node: int, above: np.ndarray) -> None:
        matrix = np.eye(4)
        matrix[:3, :3] = Rotation.from_quat(values.get((node, "rotation"), [0, 0, 0, 1])).as_matrix()
        matrix[:3, 3] = values.get((node, "translation"), document["nodes"][node]["translation"])
        matrices[node] = above @ matrix
        for child in document["nodes"][node].get("children", []):
            visit(child, matrices[node])

    visit(0, np.eye(4))
    return np.stack([matrix[:3, 3] for matrix in matrices]), matrices


def test_every_key_poses_the_joints_at_its_time() -> None:
    joints = walk()
    data, changes = write_glb(Motion(joints, caption="someone turns"))
    document, arrays = parse_glb(data)
    assert not changes and document["asset"]["extras"]["caption"] == "someone turns"
    assert [node["name"] for node in document["nodes"]] == [*HUMAN22.joints, "body"]
    time = arrays[document["animations"][0]["samplers"][0]["input"]][:, 0]
    assert np.allclose(time, np.arange(len(joints)) / 20.0, atol=1e-6)
    for frame in (0, 7, len(joints) - 1):
        assert np.abs(posed(document, arrays, frame)[0] - joints[frame]).max() < 1e-4


def test_the_skin_lies_around_the_bones() -> None:
    joints = walk()[:30]
    document, arrays = parse_glb(write_glb(Motion(joints))[0])
    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    vertices = np.concatenate([arrays[attributes["POSITION"]], np.ones((2600, 1))], axis=-1)
    bound = arrays[attributes["JOINTS_0"]][:, 0].astype(int)
    inverse = arrays[document["skins"][0]["inverseBindMatrices"]].reshape(-1, 4, 4).transpose(0, 2, 1)
    positions, matrices = posed(document, arrays, 20)
    skinned = np.stack([(matrices[j] @ inverse[j] @ v)[:3] for j, v in zip(bound, vertices, strict=True)])
    nearest = np.full(len(skinned), np.inf)
    for j in range(1, 22):
        start, bone = positions[HUMAN22.parents[j]], positions[j] - positions[HUMAN22.parents[j]]
        along = np.clip((skinned - start) @ bone / (bone @ bone), 0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(skinned - start - along[:, None] * bone, axis=-1))
        assert np.linalg.norm(skinned - positions[j], axis=-1).min() < 0.12, "every joint has skin around it"
    assert nearest.max() < 0.17 and np.median(nearest) > 0.02
    assert np.array_equal(np.unique(arrays[attributes["WEIGHTS_0"]][:, 0]), [1.0])


def test_the_mesh_is_closed_and_its_triangles_face_outwards() -> None:
    document, arrays = parse_glb(write_glb(Motion(walk()[:4]))[0])
    primitive = document["meshes"][0]["primitives"][0]
    points, normals = arrays[primitive["attributes"]["POSITION"]], arrays[primitive["attributes"]["NORMAL"]]
    faces = arrays[primitive["indices"]].reshape(-1, 3).astype(int)
    a, b, c = (points[faces[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    full = np.linalg.norm(cross, axis=-1) > 1e-9
    outward = np.sum(cross * normals[faces].mean(axis=1), axis=-1)
    assert (outward[full] > 0).all() and full.mean() > 0.8
    assert np.sum(np.sum(a * np.cross(b, c), axis=-1)) > 0, "the enclosed volume is positive"
    assert np.allclose(np.linalg.norm(normals, axis=-1), 1.0, atol=1e-5)


def test_left_is_blue_and_right_is_orange() -> None:
    document, arrays = parse_glb(write_glb(Motion(walk()[:4]))[0])
    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    x, colour = arrays[attributes["POSITION"]][:, 0], arrays[attributes["COLOR_0"]]
    assert (colour[x > 0.3, 2] > colour[x > 0.3, 0]).all() and (colour[x < -0.3, 0] > colour[x < -0.3, 2]).all()


def test_drifting_bones_are_reported() -> None:
    joints = walk()[:20] + np.random.default_rng(0).normal(size=(20, 22, 3)) * 0.01
    assert "median" in write_glb(Motion(joints))[1][0]


def test_another_skeleton_is_refused() -> None:
    two = Skeleton("two", ("a", "b"), (-1, 0), ((0, 0, 0), (0, 1, 0)))
    with pytest.raises(PlaygroundError, match="not on two"):
        write_glb(Motion(np.zeros((5, 2, 3)), 20.0, two))


def rewritten(change) -> bytes:
    """A GLB whose JSON was changed and repacked."""
    data = write_glb(Motion(walk()[:4]))[0]
    size = struct.unpack("<I", data[12:16])[0]
    document = json.loads(data[20 : 20 + size])
    change(document)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + size :]
    return (
        struct.pack("<III", 0x46546C67, 2, 20 + len(text) + len(rest))
        + struct.pack("<II", len(text), 0x4E4F534A)
        + (text + rest)
    )


@pytest.mark.parametrize(
    "change",
    [
        lambda d: d["nodes"][0]["children"].append(5),
        lambda d: d["nodes"][4].pop("children"),
        lambda d: d["bufferViews"][0].update(byteLength=4),
        lambda d: d["bufferViews"][-1].update(byteOffset=10**9),
        lambda d: d["accessors"][0].update(count=10**6),
        lambda d: d["skins"][0]["joints"].pop(),
        lambda d: d["animations"][0]["samplers"][1].update(input=0),
    ],
)
def test_documents_that_do_not_fit_together_are_noticed(change) -> None:
    parse_glb(rewritten(lambda d: None))
    with pytest.raises(PlaygroundError):
        parse_glb(rewritten(change))


@given(st.integers(0, 27))
@settings(max_examples=10)
def test_a_cut_file_is_noticed(at: int) -> None:
    data = rewritten(lambda d: None)
    for cut in (data[:at], data[:-4], data + b"1234"):
        with pytest.raises(PlaygroundError):
            parse_glb(cut)
