"""A body round the 22 joints, as the stage draws it: spheres on the skeleton, limbs and trunk as their convex hulls.

The table is the stage's (ui/stage/skeleton.js): name -> (how the sphere is placed, radius in metres). numpy and scipy.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from playground.figures.colors import hex_to_rgb
from playground.motion.skeleton import HUMAN22

Floats = NDArray[np.float64]
Recipe = tuple[object, ...]

# ("off", joint, frame, (left, up, forward) metres), ("joint", name), ("between", a, b, share),
# ("beyond", a, b, metres), ("sole", knee, ankle, foot, (forward, up) metres, share of the way back to the knee)
_MIDDLE: dict[str, tuple[Recipe, float]] = {
    "waist": (("off", "spine1", "hips", (0, 0, 0.025)), 0.098),
    "belly": (("off", "pelvis", "hips", (0, 0.03, 0.012)), 0.102),
    "seat": (("off", "pelvis", "hips", (0, -0.045, -0.03)), 0.1),
    "hipL": (("off", "l_hip", "hips", (0.022, -0.01, 0)), 0.086),
    "hipR": (("off", "r_hip", "hips", (-0.022, -0.01, 0)), 0.086),
    "ribs": (("off", "spine2", "chest", (0, -0.02, 0.03)), 0.108),
    "chest": (("off", "spine3", "chest", (0, 0.06, 0.035)), 0.112),
    "breastL": (("off", "spine3", "chest", (0.075, 0.09, 0.025)), 0.085),
    "breastR": (("off", "spine3", "chest", (-0.075, 0.09, 0.025)), 0.085),
    "yokeL": (("between", "l_shoulder", "l_collar", 0.3), 0.056),
    "yokeR": (("between", "r_shoulder", "r_collar", 0.3), 0.056),
    "nape": (("off", "neck", "chest", (0, 0, 0)), 0.062),
    "throat": (("off", "neck", "chest", (0, 0.02, 0.01)), 0.05),
    "skullBase": (("off", "head", "head", (0, 0.015, -0.012)), 0.05),
    "jaw": (("off", "head", "head", (0, -0.002, 0.042)), 0.05),
    "brow": (("off", "head", "head", (0, 0.09, 0.026)), 0.077),
    "crown": (("off", "head", "head", (0, 0.102, -0.018)), 0.085),
    "eyeL": (("off", "head", "head", (0.042, 0.082, 0.068)), 0.0235),
    "eyes": (("off", "head", "head", (0, 0.08, 0.083)), 0.0245),
    "eyeR": (("off", "head", "head", (-0.042, 0.082, 0.068)), 0.0235),
    "bridge": (("off", "head", "head", (0, 0.078, 0.098)), 0.006),
    "nose": (("off", "head", "head", (0, 0.042, 0.106)), 0.012),
}


def _limb(side: str) -> dict[str, tuple[Recipe, float]]:
    s, out = ("l_", 1.0) if side == "L" else ("r_", -1.0)
    foot = (f"{s}knee", f"{s}ankle", f"{s}foot")
    table: dict[str, tuple[Recipe, float]] = {
        "shoulder": (("off", f"{s}shoulder", "chest", (-0.004 * out, -0.002, 0)), 0.06),
        "biceps": (("between", f"{s}shoulder", f"{s}elbow", 0.45), 0.049),
        "elbow": (("joint", f"{s}elbow"), 0.04),
        "forearm": (("between", f"{s}elbow", f"{s}wrist", 0.28), 0.043),
        "wrist": (("joint", f"{s}wrist"), 0.028),
        "palm": (("beyond", f"{s}elbow", f"{s}wrist", 0.065), 0.036),
        "fingers": (("beyond", f"{s}elbow", f"{s}wrist", 0.14), 0.02),
        "groin": (("off", f"{s}hip", "hips", (0.02 * out, -0.03, 0)), 0.086),
        "thigh": (("between", f"{s}hip", f"{s}knee", 0.35), 0.081),
        "knee": (("joint", f"{s}knee"), 0.055),
        "calf": (("sole", *foot, (-0.02, 0), 0.72), 0.054),
        "ankle": (("joint", f"{s}ankle"), 0.037),
        "heel": (("sole", *foot, (-0.045, -0.03), 0.0), 0.034),
        "ball": (("sole", *foot, (0.125, -0.028), 0.0), 0.036),
        "toe": (("sole", *foot, (0.185, -0.036), 0.0), 0.026),
    }
    return {name + side: entry for name, entry in table.items()}


SPHERES = {**_MIDDLE, **_limb("L"), **_limb("R")}
_NAMES = list(SPHERES)
RADII = np.array([radius for _, radius in SPHERES.values()])
_LIMBS = ("groin thigh knee", "knee calf ankle", "ankle heel ball toe", "shoulder biceps elbow", "elbow forearm wrist",
          "wrist palm fingers")  # fmt: skip
# (tone, spheres of a convex hull); tones: left, right, trunk, head, visor
PARTS: tuple[tuple[str, tuple[int, ...]], ...] = tuple(
    (tone, tuple(_NAMES.index(name) for name in names.split()))
    for tone, names in (
        ("M", "waist belly seat hipL hipR"), ("M", "waist ribs belly"),
        ("M", "ribs chest breastL breastR yokeL yokeR nape"), ("M", "throat skullBase"),
        ("H", "skullBase jaw brow crown"), ("H", "bridge nose"), ("V", "eyeL eyes"), ("V", "eyes eyeR"),
        *((side, " ".join(name + side for name in limb.split())) for side in "LR" for limb in _LIMBS),
    )
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles of a body. points, normals: [n, 3]; faces: int [m, 3]; tones: the letter of every point [n]."""

    points: Floats
    normals: Floats
    faces: NDArray[np.int64]
    tones: NDArray[np.str_]


def place(joints: NDArray[np.floating]) -> Floats:
    """Poses [F, 22, 3] -> centres of the spheres [F, S, 3], in the order of RADII."""
    pose = np.asarray(joints, np.float64)
    at = {name: pose[:, index] for index, name in enumerate(HUMAN22.joints)}
    chest = _axes(at["l_shoulder"] - at["r_shoulder"], at["neck"] - at["spine2"])
    lean = _unit(at["head"] - at["neck"]) - 0.58 * chest[:, 2]  # a straight head leans 38 degrees forward
    frames = {
        "hips": _axes(at["l_hip"] - at["r_hip"], at["spine2"] - at["pelvis"]),
        "chest": chest,
        "head": _axes(chest[:, 0], lean),
    }
    return np.stack([_sphere(recipe, at, frames) for recipe, _ in SPHERES.values()], axis=1)


def surface(centres: Floats) -> Surface:
    """The skin of one pose, from its sphere centres [S, 3]. Where spheres of a hull coincide, the hull still stands."""
    from scipy.spatial import ConvexHull  # here, so that the page opens without it

    rays = _rays()
    points, faces, tones = [], [], []
    count = 0
    for tone, spheres in PARTS:
        chosen = list(spheres)
        cloud = (centres[chosen, None] + RADII[chosen, None, None] * rays).reshape(-1, 3)
        hull = ConvexHull(cloud)
        used, simplices = np.unique(hull.simplices, return_inverse=True)
        points.append(cloud[used])
        faces.append(_outward(cloud, hull.simplices, simplices.reshape(-1, 3), centres[chosen].mean(axis=0)) + count)
        tones.append(np.full(len(used), tone))
        count += len(used)
    corners, triangles = np.concatenate(points), np.concatenate(faces)
    return Surface(corners, _normals(corners, triangles), triangles, np.concatenate(tones))


def tones_of(color: str, dark: bool = False) -> dict[str, Floats]:
    """Colours [3], 0 to 255, of the tones of a figure: left limbs lighter, right limbs darker, as on the stage."""
    rgb = hex_to_rgb(color).astype(np.float64)
    white, black = np.full(3, 255.0), np.array([10.0, 12.0, 16.0])
    return {
        "L": mix(rgb, white, 0.3 if dark else 0.36),
        "M": mix(rgb, white, 0.1),
        "H": mix(rgb, white, 0.18),
        "V": mix(rgb, black, 0.36),
        "R": mix(rgb, black, 0.3 if dark else 0.24),
        "outline": mix(rgb, black, 0.62),
    }


def mix(first: Floats, second: Floats, share: float) -> Floats:
    """`first` moved towards `second` by a share of 0 to 1."""
    return np.asarray(first + (second - first) * share)


@lru_cache(maxsize=1)
def _rays() -> Floats:
    """Unit directions [n, 3], evenly spread over a sphere (a Fibonacci spiral)."""
    n = 72
    height = 1 - 2 * (np.arange(n) + 0.5) / n
    turn = np.pi * (1 + 5**0.5) * np.arange(n)
    ring = np.sqrt(1 - height**2)
    return np.stack([ring * np.cos(turn), height, ring * np.sin(turn)], axis=-1)


def _outward(
    cloud: Floats, simplices: NDArray[np.int32], faces: NDArray[np.int64], inside: Floats
) -> NDArray[np.int64]:
    """The triangles of a convex hull, corners in the order that makes them face away from the point inside."""
    a, b, c = (cloud[simplices[:, corner]] for corner in range(3))
    inward = (np.cross(b - a, c - a) * (a - inside)).sum(axis=-1) < 0
    return np.where(inward[:, None], faces[:, ::-1], faces)


def _normals(points: Floats, faces: NDArray[np.int64]) -> Floats:
    """Smooth normals [n, 3]: of a corner, the mean over its triangles weighted by their size."""
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    across = np.cross(b - a, c - a)
    total = np.stack(
        [np.bincount(faces.ravel(), np.repeat(across[:, axis], 3), len(points)) for axis in range(3)], axis=-1
    )
    return _unit(np.asarray(total, np.float64))


def _sphere(recipe: Recipe, at: dict[str, Floats], frames: dict[str, Floats]) -> Floats:
    kind, first, *rest = recipe
    here = at[str(first)]
    if kind == "joint":
        return here
    if kind == "off":
        frame, offset = rest
        return here + np.einsum("i,fij->fj", np.asarray(offset, np.float64), frames[str(frame)])
    there = at[str(rest[0])]
    if kind == "between":
        return here + (there - here) * float(rest[1])  # type: ignore[arg-type]
    if kind == "beyond":
        return there + _unit(there - here) * float(rest[1])  # type: ignore[arg-type]
    foot, offset, back = at[str(rest[1])], np.asarray(rest[2], np.float64), float(rest[3])  # type: ignore[arg-type]
    along = _unit(foot - there)  # from the ankle to the ball; the sole lies 25 degrees above it
    leg = here - there
    lift = _unit(leg - (leg * along).sum(-1, keepdims=True) * along)
    ahead, above = 0.906 * along + 0.423 * lift, 0.906 * lift - 0.423 * along
    return there + leg * back + offset[0] * ahead + offset[1] * above


def _axes(left: Floats, up: Floats) -> Floats:
    """Left, up and forward of a part of the body [F, 3, 3], as rows at right angles."""
    first = _unit(left)
    second = _unit(up - (up * first).sum(-1, keepdims=True) * first)
    return np.stack([first, second, np.cross(first, second)], axis=1)


def _unit(vector: Floats) -> Floats:
    return vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), 1e-9)
