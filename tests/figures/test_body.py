"""The body round the joints: closed, outward, left and right where they belong, moving with the pose."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from playground.figures.body import PARTS, RADII, SPHERES, mix, place, surface, tones_of
from playground.figures.colors import FAMILIES, ORIGINAL
from playground.motion.skeleton import HUMAN22
from tests.conftest import drifting, rest_pose


def test_spheres_lie_where_their_names_say() -> None:
    centres = dict(zip(SPHERES, place(rest_pose()[None])[0], strict=True))
    pose = {name: rest_pose()[n] for n, name in enumerate(HUMAN22.joints)}
    assert np.allclose(centres["kneeL"], pose["l_knee"]) and np.allclose(centres["wristR"], pose["r_wrist"])
    assert centres["hipL"][0] > 0.05 > -0.05 > centres["hipR"][0]  # left is +X when facing +Z
    assert centres["nose"][2] > centres["crown"][2] + 0.08  # the face looks forward
    assert centres["crown"][1] > pose["head"][1] > centres["throat"][1]
    assert centres["toeL"][2] > centres["heelL"][2] + 0.15
    out = np.linalg.norm(centres["fingersL"] - pose["l_wrist"])
    assert out == pytest.approx(0.14, abs=1e-6)


def test_the_body_turns_and_moves_with_the_pose() -> None:
    pose = rest_pose()
    turn, step = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]), np.array([2.0, 0.1, -3.0])
    assert np.allclose(place((pose @ turn + step)[None]), place(pose[None]) @ turn + step, atol=1e-9)


def test_the_skin_is_closed_and_faces_outward() -> None:
    skin = surface(place(drifting(3))[1])
    corners = skin.points[skin.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    volume = np.einsum("ij,ij->i", corners[:, 0], across).sum() / 6
    assert 0.05 < volume < 0.12  # cubic metres; a person has about 0.07, and parts of the skin overlap
    edges = np.sort(np.concatenate([skin.faces[:, [0, 1]], skin.faces[:, [1, 2]], skin.faces[:, [2, 0]]]), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert (count == 2).all()  # every edge belongs to two triangles: no hole
    assert np.allclose(np.linalg.norm(skin.normals, axis=-1), 1)
    assert set(skin.tones) == set("LRMHV")


def test_left_is_left() -> None:
    skin = surface(place(rest_pose()[None])[0])
    assert skin.points[skin.tones == "L"][:, 0].min() > -0.05 and skin.points[skin.tones == "R"][:, 0].max() < 0.05


@settings(max_examples=10)
@given(st.integers(0, 2**16), st.sampled_from([0.0, 0.05, 3.0]))
def test_any_pose_has_a_skin(seed: int, spread: float) -> None:
    pose = np.random.default_rng(seed).normal(scale=spread, size=(22, 3))  # 0: all joints on one spot
    skin = surface(place(pose[None])[0])
    assert np.isfinite(skin.points).all() and np.isfinite(skin.normals).all() and len(skin.faces) > 500


def test_the_shades_tell_left_from_right() -> None:
    for color in (ORIGINAL, *FAMILIES.values()):
        for shade, dark in ((color.light, False), (color.dark, True)):
            tones = tones_of(shade, dark)
            assert tones["L"].sum() > tones["M"].sum() > tones["R"].sum() > tones["outline"].sum()
    assert np.allclose(mix(np.zeros(3), np.full(3, 10.0), 0.25), 2.5)


def test_parts_name_spheres_of_both_sides_alike() -> None:
    names = list(SPHERES)
    left = [tuple(names[n] for n in spheres) for tone, spheres in PARTS if tone == "L"]
    right = [tuple(names[n] for n in spheres) for tone, spheres in PARTS if tone == "R"]
    assert [tuple(name.removesuffix("L") for name in part) for part in left] == [
        tuple(name.removesuffix("R") for name in part) for part in right
    ]
    assert (RADII > 0).all()
