"""A motion as a file gives it, before it is brought onto HUMAN22: any skeleton, unit, axes, frame rate. numpy only."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.rotation import Array, qmul, qrotate, slerp


def check_size(kind: str, frames: int, joints: int, fps: float) -> None:
    """PlaygroundError unless a clip has 4 to 12,000 frames, at most 120 joints and a sane frame rate (`LIMITS`)."""
    low, high = LIMITS.min_source_frames, LIMITS.max_source_frames
    if not low <= frames <= high:
        raise PlaygroundError(f"the {kind} has {frames:,} {plural(frames, 'frame')}; {low} to {high:,} are accepted")
    if not 1 <= joints <= LIMITS.max_source_joints:
        raise PlaygroundError(f"the {kind} has {joints:,} joints; at most {LIMITS.max_source_joints} are accepted")
    if not 0.0 < fps <= LIMITS.max_fps:
        raise PlaygroundError(
            f"the {kind} states {fps:g} frames a second; more than 0 and at most {LIMITS.max_fps:g} are accepted"
        )


def plural(count: int, noun: str) -> str:
    """The noun, with an s unless count is 1."""
    return noun if count == 1 else noun + "s"


@dataclass(frozen=True, eq=False)
class Source:
    """World positions and rotations of any skeleton over time. Rotations act on the T-pose that `offsets` describe."""

    names: tuple[str, ...]
    parents: tuple[int, ...]  # -1 for the root; parents come before their children
    offsets: Array  # [J, 3] from the parent when all rotations are zero, in the unit of the file
    positions: Array  # [F, J, 3]
    rotations: Array  # [F, J, 4] against the world, unit quaternions
    fps: float
    ends: dict[int, Array] = field(default_factory=dict)  # joint -> offset [3] of its End Site
    kind: str = "motion"  # what the file calls itself, for messages
    has_rest: bool = True  # False if the file has no T-pose and `offsets` were made up

    @property
    def frames(self) -> int:
        """Number of poses F."""
        return len(self.positions)

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """Child joints of every joint."""
        return tuple(tuple(c for c, p in enumerate(self.parents) if p == j) for j in range(len(self.names)))

    @cached_property
    def rest(self) -> Array:
        """Positions [J, 3] of the T-pose, the root at the origin."""
        out = np.zeros_like(self.offsets)
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                out[joint] = out[parent] + self.offsets[joint]
        return out

    def turned(self, quaternion: Array) -> "Source":
        """The same motion rotated by a quaternion [4] about the origin; the T-pose stays as the file has it."""
        return replace(self, positions=qrotate(quaternion, self.positions), rotations=qmul(quaternion, self.rotations))

    def scaled(self, factor: float) -> "Source":
        """The same motion with all lengths multiplied by a factor; End Sites are dropped."""
        return replace(self, offsets=self.offsets * factor, positions=self.positions * factor, ends={})

    def mirrored(self) -> "Source":
        """The same motion with x negated, which turns left-handed axes into right-handed ones; names stay."""
        flip, turn = np.array([-1.0, 1.0, 1.0]), np.array([1.0, 1.0, -1.0, -1.0])
        ends = {joint: offset * flip for joint, offset in self.ends.items()}
        return replace(
            self,
            offsets=self.offsets * flip,
            positions=self.positions * flip,
            rotations=self.rotations * turn,
            ends=ends,
        )

    def resampled(self, fps: float, start_seconds: float = 0.0) -> "Source":
        """The poses from `start_seconds` on at another frame rate: every k-th frame where that fits, else interpolated.

        Positions are interpolated linearly, rotations along the shorter way. PlaygroundError if nothing is left.
        """
        first = start_seconds * self.fps
        if not 0.0 <= first <= self.frames - 1:
            lasts = (self.frames - 1) / self.fps
            raise PlaygroundError(f"a start at {start_seconds:g} s is not inside the clip, which lasts {lasts:.2f} s")
        count = int(np.floor((self.frames - 1 - first) / self.fps * fps + 1e-6)) + 1
        if not 2 <= count <= LIMITS.max_source_frames:
            raise PlaygroundError(
                f"the {self.kind} gives {count:,} {plural(count, 'pose')} at {fps:g} frames a second; "
                f"2 to {LIMITS.max_source_frames:,} are accepted"
            )
        at = np.minimum(first + np.arange(count) * (self.fps / fps), self.frames - 1)
        low = np.floor(at + 1e-6).astype(int)
        share = np.clip(at - low, 0.0, 1.0)
        share[share < 1e-5] = 0.0
        high = np.minimum(low + (share > 0), self.frames - 1)
        mix = share[:, None, None]
        positions = self.positions[low] * (1.0 - mix) + self.positions[high] * mix
        weights = np.broadcast_to(share[:, None], self.rotations[low].shape[:2])
        rotations = slerp(self.rotations[low], self.rotations[high], weights)
        return replace(self, positions=positions, rotations=rotations, fps=fps)
