"""What a motion does, read off its joints: turning, travelling, stepping, hands, feet, trunk. Pure numpy.

All functions take joints [F, 22, 3] (metres, Y up, 20 fps) as they are; neither the first heading nor the height of the
floor needs to be canonical.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.representation import facing
from playground.motion.skeleton import HUMAN22

Array = NDArray[np.floating]

ARMS = {"left": (16, 18, 20), "right": (17, 19, 21)}  # shoulder, elbow, wrist
LEGS = {"left": (7, 10), "right": (8, 11)}  # ankle, foot
HAND = 0.18  # metres from the wrist to the fingertips along the forearm: the skeleton has no hands
ANKLE_FLAT = 0.06  # height of the ankle above the sole
SWING = 0.05  # metres that a fingertip goes one way before it counts as a swing


def swings(track: Array, size: float) -> int:
    """How often a track [n] turns round after having gone more than `size` one way."""
    turns, direction = 0, 0
    low = high = float(track[0]) if len(track) else 0.0
    for value in map(float, track):
        if direction >= 0 and value < high - size:
            turns, direction, low = turns + (direction > 0), -1, value
        elif direction <= 0 and value > low + size:
            turns, direction, high = turns + (direction < 0), 1, value
        low, high = min(low, value), max(high, value)
    return turns


def longest(flags: NDArray[np.bool_]) -> int:
    """Length of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def rotate_level(vectors: Array, yaw: Array) -> Array:
    """World vectors [F, 3] seen by somebody who faces `yaw` [F]: left, up, forwards."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    left, ahead = vectors[:, 0] * cos - vectors[:, 2] * sin, vectors[:, 0] * sin + vectors[:, 2] * cos
    return np.stack([left, vectors[:, 1], ahead], axis=-1)


@dataclass(frozen=True, eq=False)
class Body:
    """Measurements of one motion. PlaygroundError unless joints are finite [F >= 8, 22, 3]."""

    joints: Array

    def __post_init__(self) -> None:
        joints = np.asarray(self.joints, np.float64)
        if (
            joints.ndim != 3
            or joints.shape[1:] != (HUMAN22.size, 3)
            or len(joints) < 8
            or not np.isfinite(joints).all()
        ):
            raise PlaygroundError(f"a motion to judge needs finite joints [8 or more, {HUMAN22.size}, 3]")
        object.__setattr__(self, "joints", joints)

    @property
    def seconds(self) -> float:
        """Length of the motion."""
        return len(self.joints) / LIMITS.fps

    @cached_property
    def yaw(self) -> Array:
        """[F] heading in radians, left positive, unwrapped, averaged over about a second (hips swing with steps)."""
        direction = facing(self.joints)
        yaw = np.unwrap(np.arctan2(direction[:, 0], direction[:, 2]))
        half = min(LIMITS.fps // 2, (len(yaw) - 1) // 2)
        padded = np.concatenate([np.full(half, yaw[0]), yaw, np.full(half, yaw[-1])])
        return np.convolve(padded, np.full(2 * half + 1, 1.0 / (2 * half + 1)), mode="valid")

    @cached_property
    def turned(self) -> float:
        """Net change of heading in degrees, left positive: mean of the last half second against the first."""
        direction = facing(self.joints)
        yaw = np.unwrap(np.arctan2(direction[:, 0], direction[:, 2]))
        edge = max(min(LIMITS.fps // 2, len(yaw) // 4), 1)
        return float(np.degrees(yaw[-edge:].mean() - yaw[:edge].mean()))

    def local(self, vectors: Array) -> Array:
        """World vectors [F, 3] seen by the body: left, up, forwards."""
        return rotate_level(vectors, self.yaw)

    @cached_property
    def velocity(self) -> Array:
        """[F, 2] pelvis velocity in m/s: to the left, forwards. The last frame repeats the one before."""
        step = np.diff(self.joints[:, 0], axis=0) * LIMITS.fps
        return self.local(np.concatenate([step, step[-1:]]))[:, [0, 2]]

    @cached_property
    def ahead(self) -> float:
        """Metres travelled along the facing direction, backwards negative."""
        return float(self.velocity[:-1, 1].sum() / LIMITS.fps)

    @cached_property
    def path(self) -> float:
        """Metres travelled in any direction, after averaging the velocity over half a second (swaying is no travel)."""
        window = min(LIMITS.fps // 2, len(self.velocity))
        kernel = np.full(window, 1.0 / window)
        smooth = np.stack([np.convolve(self.velocity[:, i], kernel, mode="same") for i in (0, 1)], axis=-1)
        return float(np.linalg.norm(smooth, axis=-1).sum() / LIMITS.fps)

    @cached_property
    def wandered(self) -> float:
        """Farthest that the pelvis gets from where it was first, over the floor, metres."""
        return float(np.linalg.norm((self.joints[:, 0] - self.joints[0, 0])[:, [0, 2]], axis=-1).max())

    @cached_property
    def speed(self) -> float:
        """Median speed of the pelvis over the floor while it is faster than a fifth of its fastest, m/s."""
        speed = np.linalg.norm(self.velocity, axis=-1)
        return float(np.median(speed[speed >= 0.2 * speed.max()]))

    @cached_property
    def soles(self) -> Array:
        """[F, 2] height of each foot's lowest point, left and right."""
        pairs = [(self.joints[:, a, 1] - ANKLE_FLAT, self.joints[:, f, 1]) for a, f in LEGS.values()]
        return np.stack([np.minimum(ankle, foot) for ankle, foot in pairs], axis=-1)

    @cached_property
    def airborne(self) -> NDArray[np.bool_]:
        """[F] both feet more than 3 cm above the lowest sole within 0.6 s (floors drift in recordings)."""
        lowest, reach = self.soles.min(axis=1), 12
        padded = np.pad(lowest, reach, mode="edge")
        floor = np.min([padded[i : i + len(lowest)] for i in range(2 * reach + 1)], axis=0)
        return np.asarray(lowest > floor + 0.03)

    @cached_property
    def flight(self) -> NDArray[np.bool_]:
        """[F] airborne with no ankle or foot joint slower than 0.7 m/s: the flight of a run, never a stance."""
        feet = self.joints[:, [joint for leg in LEGS.values() for joint in leg]]
        speed = np.linalg.norm(np.gradient(feet, axis=0), axis=-1) * LIMITS.fps
        return np.asarray(self.airborne & (speed.min(axis=1) > 0.7))

    @cached_property
    def steps(self) -> int:
        """How often one ankle passes the other by 8 cm along the facing direction."""
        lead = self.local(self.joints[:, 7] - self.joints[:, 8])[:, 2]
        signs = np.sign(lead[np.abs(lead) > 0.08])
        return int((np.diff(signs) != 0).sum() + 1) if len(signs) else 0

    def fingertips(self, side: str) -> Array:
        """[F, 3] where the fingertips of an outstretched hand would be."""
        _, elbow, wrist = ARMS[side]
        forearm = self.joints[:, wrist] - self.joints[:, elbow]
        return self.joints[:, wrist] + HAND * forearm / np.maximum(
            np.linalg.norm(forearm, axis=-1, keepdims=True), 1e-9
        )

    def hand_level(self, side: str) -> Array:
        """[F] height of the fingertips above the head joint, metres."""
        return self.fingertips(side)[:, 1] - self.joints[:, 15, 1]

    def hand_track(self, side: str, level: float) -> Array:
        """[n, 3] the fingertips in the frames where they are above `level`, from the shoulder, left, up and forwards as
        the shoulders face (a hand that only follows the twisting chest does not move here)."""
        across = self.joints[:, 16] - self.joints[:, 17]
        yaw = np.arctan2(-across[:, 2], across[:, 0])
        reach = self.fingertips(side) - self.joints[:, ARMS[side][0]]
        return rotate_level(reach, yaw)[self.hand_level(side) > level]

    def hand_swings(self, side: str, level: float) -> int:
        """Swings of the raised fingertips sideways or up and down, whichever is livelier."""
        track = self.hand_track(side, level)
        return max(swings(track[:, 0], SWING), swings(track[:, 1], SWING))

    @cached_property
    def pelvis_drop(self) -> Array:
        """[F] metres that the pelvis is below its highest standing height (95th percentile)."""
        return np.asarray(np.percentile(self.joints[:, 0, 1], 95) - self.joints[:, 0, 1])

    @cached_property
    def pelvis_behind(self) -> Array:
        """[F] metres that the pelvis is behind the middle of the ankles."""
        ankles = (self.joints[:, 7] + self.joints[:, 8]) / 2.0
        return np.asarray(-self.local(self.joints[:, 0] - ankles)[:, 2])

    @cached_property
    def trunk(self) -> Array:
        """[F] forward pitch of the line from pelvis to neck, degrees."""
        line = self.local(self.joints[:, 12] - self.joints[:, 0])
        return np.asarray(np.degrees(np.arctan2(line[:, 2], line[:, 1])))

    def leap(self, rise: float) -> float:
        """Longest time in seconds that the body is airborne and the pelvis `rise` metres above its median height."""
        high = self.joints[:, 0, 1] - np.median(self.joints[:, 0, 1]) > rise
        return longest(self.airborne & high) / LIMITS.fps

    def kick_height(self, side: str) -> float:
        """Highest that an ankle gets above the other one while away from the pelvis, not behind it; metres."""
        other = "right" if side == "left" else "left"
        ankle, support = self.joints[:, LEGS[side][0]], self.joints[:, LEGS[other][0]]
        place = self.local(ankle - self.joints[:, 0])
        away = (place[:, 2] > 0.1) & (np.hypot(place[:, 0], place[:, 2]) > 0.35)
        return float(np.where(away, ankle[:, 1] - support[:, 1], 0.0).max())
