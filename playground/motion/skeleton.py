"""The 22-joint skeleton of HumanML3D: names, parents, mirrored pairs, reference offsets (systems.md A1). numpy only."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Skeleton:
    """A tree of joints. Parents come before their children; the root's parent is -1."""

    name: str
    joints: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: tuple[tuple[float, float, float], ...]  # T-pose offset from the parent, metres, Y up, left = +X

    @property
    def size(self) -> int:
        """Number of joints J."""
        return len(self.joints)

    @cached_property
    def bone_lengths(self) -> NDArray[np.float32]:
        """[J] distance to the parent in metres, 0 for the root."""
        return np.linalg.norm(np.asarray(self.offsets, np.float64), axis=-1).astype(np.float32)

    @cached_property
    def mirror(self) -> tuple[int, ...]:
        """Index of each joint's left/right twin, its own index for joints of the middle."""
        swap = {"l_": "r_", "r_": "l_"}
        twins = [swap.get(name[:2], name[:2]) + name[2:] for name in self.joints]
        return tuple(self.joints.index(twin) for twin in twins)

    def index(self, joint: str) -> int:
        """Index of a joint by name; ValueError if it is not there."""
        return self.joints.index(joint)


HUMAN22 = Skeleton(
    name="human22",
    joints=(
        "pelvis", "l_hip", "r_hip", "spine1", "l_knee", "r_knee", "spine2", "l_ankle", "r_ankle", "spine3", "l_foot",
        "r_foot", "neck", "l_collar", "r_collar", "head", "l_shoulder", "r_shoulder", "l_elbow", "r_elbow", "l_wrist",
        "r_wrist",
    ),
    parents=(-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19),
    offsets=(
        (0.0, 0.0, 0.0), (0.06228, -0.0819, -0.00609), (-0.06573, -0.08796, -0.00417), (-0.00293, 0.12775, -0.03132),
        (0.03614, -0.39193, -0.0047), (-0.03887, -0.38814, -0.00903), (0.00582, 0.14307, 0.00116),
        (-0.015, -0.42959, -0.04717), (0.01677, -0.42294, -0.04491), (0.00147, 0.0517, 0.02482),
        (0.02818, -0.05956, 0.12734), (-0.02814, -0.05339, 0.13669), (-0.00292, 0.21508, -0.04304),
        (0.07271, 0.11239, -0.03137), (-0.07851, 0.11412, -0.03705), (0.00646, 0.08072, 0.06371),
        (0.12424, 0.04169, -0.01216), (-0.11604, 0.03924, -0.01099), (0.2551, -0.01258, -0.02702),
        (-0.2618, -0.01372, -0.02208), (0.26584, 0.0096, -0.00117), (-0.26969, 0.00824, -0.00592),
    ),
)  # fmt: skip

FEET = tuple(HUMAN22.index(name) for name in ("l_ankle", "l_foot", "r_ankle", "r_foot"))
# The joints that facing is read from (A1): 2, 1, 17, 16.
ACROSS = tuple(HUMAN22.index(name) for name in ("r_hip", "l_hip", "r_shoulder", "l_shoulder"))
CHAINS = ((0, 2, 5, 8, 11), (0, 1, 4, 7, 10), (0, 3, 6, 9, 12, 15), (9, 14, 17, 19, 21), (9, 13, 16, 18, 20))
