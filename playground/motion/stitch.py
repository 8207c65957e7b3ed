"""Frames drawn anew put between frames that stay: placed on the floor, blended on their own side. numpy only.

The frames that stay are copied, never computed, so they are the source's own numbers. The new frames start from where
the body stood, lean towards the kept pose for a few frames on their side of each border, and the way that is missing
on the floor when the kept frames go on is closed in one of two ways (ANCHORS):

    place   the new frames share it out among them; every kept frame stays exactly where it was
    body    the kept frames that follow are moved on the floor as one piece, turn included
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.motion.rotation import qrotate, yaw_quaternion

ANCHORS = ("place", "body")
BLEND = 8  # frames on the edited side of a border that lean towards the kept side, fewer in a short run

Array = NDArray[np.floating]
Floats64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Track:
    """A motion as places on the floor, headings, and poses seen from there."""

    place: Floats64  # [F, 2] of the pelvis, x and z
    yaw: Floats64  # [F] radians
    pose: Floats64  # [F, 22, 3], the pelvis over the origin, facing as the rows say

    @classmethod
    def of(cls, joints: Array, yaw: Array) -> "Track":
        """Joints [F, 22, 3] with the yaw [F] that turns each pose from its own axes into the world's."""
        x, angle = np.asarray(joints, np.float64), np.asarray(yaw, np.float64)
        pose = qrotate(yaw_quaternion(-angle)[:, None], x - x[:, :1] * np.array([1.0, 0.0, 1.0]))
        return cls(x[:, 0, [0, 2]], angle, np.asarray(pose, np.float64))

    def joints(self) -> Floats64:
        """[F, 22, 3] in the world."""
        turned = np.array(qrotate(yaw_quaternion(self.yaw)[:, None], self.pose), np.float64)
        turned[..., [0, 2]] += self.place[:, None]
        return turned

    def moved(self, frame: int, place: Floats64, yaw: float) -> "Track":
        """The whole track turned and shifted on the floor so that one frame stands at a place and faces a yaw."""
        turn = yaw - self.yaw[frame]
        return Track(place + _turned(self.place - self.place[frame], turn), self.yaw + turn, self.pose)


@dataclass(frozen=True, eq=False)
class Stitched:
    """The result of `stitch`."""

    joints: NDArray[np.float32]  # [F, 22, 3]
    gap_m: float  # largest way on the floor that had to be closed
    gap_degrees: float  # largest turn that had to be closed


def check_anchor(anchor: str) -> None:
    """PlaygroundError unless it is one of ANCHORS."""
    if anchor not in ANCHORS:
        raise PlaygroundError(f"the anchor is {str(anchor)[:40]!r}; {' or '.join(ANCHORS)} is accepted")


def rows_yaw(rows: Array) -> Floats64:
    """Un-normalised feature rows [F, 67] -> yaw [F] of the recovered motion, the first pose facing +Z (A1)."""
    return -2.0 * np.concatenate([[0.0], np.cumsum(np.asarray(rows, np.float64)[:-1, 0])])


def stitch(source: Array, source_yaw: Array, made: Array, made_yaw: Array, kept: NDArray[np.bool_], *,
           anchor: str = "place", blend: int = BLEND) -> Stitched:  # fmt: skip
    """Source frames where kept (bool [F]), made frames elsewhere; joints [F, 22, 3] with the yaw [F] of each frame.

    blend 0 puts the made poses in as they are. PlaygroundError for an unknown anchor.
    """
    check_anchor(anchor)
    old, new = Track.of(source, source_yaw), Track.of(made, made_yaw)
    out = np.array(source, np.float32)
    gap_m = gap_yaw = 0.0
    for start, stop in runs(~kept):
        left, right = start > 0, stop < len(kept)
        piece = new
        if left:
            piece = new.moved(start - 1, old.place[start - 1], float(old.yaw[start - 1]))
        elif right:
            piece = new.moved(stop, old.place[stop], float(old.yaw[stop]))
        if left and right:
            way, turn = old.place[stop] - piece.place[stop], _wrapped(float(old.yaw[stop] - piece.yaw[stop]))
            gap_m, gap_yaw = max(gap_m, float(np.linalg.norm(way))), max(gap_yaw, abs(turn))
            if anchor == "place":
                share = _ease((np.arange(len(kept)) - (start - 1)) / (stop - start + 1))
                piece = Track(piece.place + share[:, None] * way, piece.yaw + share * turn, piece.pose)
            else:
                old = old.moved(stop, piece.place[stop], float(piece.yaw[stop]))
                out[stop:] = old.joints()[stop:]
        size = min(blend, (stop - start) // (left + right) if left or right else 0)
        out[start:stop] = _lean(piece.joints(), out, start, stop, size)
    return Stitched(out, gap_m, float(np.degrees(gap_yaw)))


def runs(flags: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """(start, stop) of every run of True in bool [F]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    yield from ((int(a), int(b)) for a, b in edges.reshape(-1, 2))


def jolt_mm(joints: Array, frame: int) -> float:
    """How abruptly joints [F, 22, 3] go over the border before `frame`: mean over joints of |x[f+1] - 2 x[f] + x[f-1]|
    in mm, the larger one of f = frame - 1 and f = frame; 0 where there are too few frames."""
    x = np.asarray(joints, np.float64)
    at = [f for f in (frame - 1, frame) if 1 <= f < len(x) - 1]
    sizes = [np.linalg.norm(x[f + 1] - 2 * x[f] + x[f - 1], axis=-1).mean() for f in at]
    return 1000.0 * float(max(sizes, default=0.0))


def _lean(made: Floats64, kept: Array, start: int, stop: int, blend: int) -> Floats64:
    """Made joints from start to stop, of which the first and last `blend` frames lean towards the kept ones beyond.

    What is missing at a border, in place and in speed, is added and fades out along a cubic.
    """
    joints, missing = made[start:stop].copy(), kept - made
    if blend and start > 0:
        joints[:blend] += _fade(missing[max(start - 2, 0) : start], blend)
    if blend and stop < len(made):
        joints[-blend:] += _fade(missing[stop : stop + 2][::-1], blend)[::-1]
    return joints


def _fade(missing: Floats64, blend: int) -> Floats64:
    """A difference that fades to 0 within `blend` frames: [1 or 2, ...] at the last frames before -> [blend, ...].

    Cubic Hermite curve: place and speed (where two frames give one) of the difference at its start, none at its end.
    """
    u = (np.arange(1, blend + 1) / (blend + 1)).reshape(-1, *[1] * (missing.ndim - 1))
    speed = (missing[-1] - missing[0]) * (blend + 1)
    return (1 - _ease(u)) * missing[-1] + u * np.square(1 - u) * speed


def _ease(x: Floats64) -> Floats64:
    """0 below 0, 1 above 1, smooth in between."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def _turned(places: Floats64, yaw: float) -> Floats64:
    """Places [..., 2] (x, z) turned about Y."""
    x, z = places[..., 0], places[..., 1]
    return np.stack([np.cos(yaw) * x + np.sin(yaw) * z, np.cos(yaw) * z - np.sin(yaw) * x], axis=-1)


def _wrapped(angle: float) -> float:
    """The same angle from -pi to pi."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
