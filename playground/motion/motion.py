"""What a motion is: joint positions over time, with their skeleton. numpy only."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.skeleton import HUMAN22, Skeleton


@dataclass(frozen=True, eq=False)
class Motion:
    """Joint positions of one clip.

    joints: float32 [F, J, 3], metres, Y up, right-handed, left = +X when facing +Z.
    PlaygroundError if the array does not fit the skeleton, is empty or is not finite.
    """

    joints: NDArray[np.float32]
    fps: float = float(LIMITS.fps)
    skeleton: Skeleton = HUMAN22
    caption: str = ""
    name: str = ""

    def __post_init__(self) -> None:
        joints = np.ascontiguousarray(self.joints, dtype=np.float32)
        if joints.ndim != 3 or joints.shape[1:] != (self.skeleton.size, 3) or not len(joints):
            raise PlaygroundError(
                f"a motion on {self.skeleton.name} needs joints [frames, {self.skeleton.size}, 3],"
                f" got {list(joints.shape)}"
            )
        if not np.isfinite(joints).all():
            raise PlaygroundError("the motion holds positions that are not finite numbers; every value must be finite")
        object.__setattr__(self, "joints", joints)

    @property
    def frames(self) -> int:
        """Number of poses F."""
        return len(self.joints)

    @property
    def seconds(self) -> float:
        """Length in seconds, F / fps."""
        return self.frames / self.fps

    def slice(self, start: int, stop: int) -> "Motion":
        """The poses start..stop-1 as a motion of the same skeleton."""
        return replace(self, joints=self.joints[start:stop])
