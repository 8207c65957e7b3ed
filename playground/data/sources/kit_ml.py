"""Source `kit-ml`: KIT-ML in the folders that the authors of HumanML3D publish it in (systems.md A1).

    new_joints/ID.npy       float [F, 21, 3], 12.5 fps, in units of about 1.9 mm; or, where it is missing,
    new_joint_vecs/ID.npy   float [F, 251], of which the first 64 columns are root and positions
    texts/ID.txt, train.txt val.txt test.txt   as in HumanML3D

What becomes of it is the playground's 22 joints at 20 fps, like every other library, so that it can be shown, compared
and mixed. The skeleton is another tree: the legs hang from the root, the spine has four joints and ends at the neck,
the arms hang from its third. The motion is retargeted (motion/retarget.py): scaled by leg length, the head held upright
on the neck, which KIT-ML does not record. Sides are named by the body's geometry: joints 11 to 15 are the leg on the
right of somebody who faces forwards. Clips of fewer than 24 or of 200 and more frames are left out, as in the loaders.
"""

from pathlib import Path

import numpy as np

from playground.data.sources.base import Reading, read_numbers
from playground.data.sources.humanml3d import Joints, Layout, read_layout
from playground.errors import PlaygroundError
from playground.motion.positions import source_of_positions
from playground.motion.representation import from_features67
from playground.motion.source import Source

FPS = 12.5
SHORTEST = 24  # frames (A1)
NAMES = (
    "root", "belly", "back", "chest", "neck", "r_shoulder", "r_elbow", "r_wrist", "l_shoulder", "l_elbow", "l_wrist",
    "r_hip", "r_knee", "r_ankle", "r_midfoot", "r_toe", "l_hip", "l_knee", "l_ankle", "l_midfoot", "l_toe",
)  # fmt: skip
PARENTS = (-1, 0, 1, 2, 3, 3, 5, 6, 3, 8, 9, 0, 11, 12, 13, 14, 0, 16, 17, 18, 19)
_DOWN, _AHEAD, _RIGHT, _LEFT = (0, -1, 0), (0, 0, 1), (-1, 0, 0), (1, 0, 0)
_SPINE = ((0, 0.996, 0.089), (0, 0.995, -0.1), (0, 0.978, 0.209), (0, 0.82, 0.573))  # of the published mean pose
_ARM, _LEG = (_DOWN, _DOWN), (_DOWN, _DOWN, _AHEAD, _AHEAD)
REST = np.array(
    [(0, 0, 0), *_SPINE, _RIGHT, *_ARM, _LEFT, *_ARM, _RIGHT, *_LEG, _LEFT, *_LEG], np.float64
)  # directions of the bones of somebody who stands with the arms down
POSITION_COLUMNS = 4 + 3 * (len(NAMES) - 1)  # 64
COLUMNS = (POSITION_COLUMNS, POSITION_COLUMNS + 6 * (len(NAMES) - 1) + 3 * len(NAMES) + 4)  # 64, 251


def read_kit_ml(root: Path | None) -> Reading:
    """PlaygroundError where the split files, the texts or the motions are missing."""
    return read_layout(root, Layout("KIT-ML", read_joints, FPS, SHORTEST, source_of=source_of))


def read_joints(path: Path) -> Joints:
    """Joints [F, 21, 3] of one .npy file that holds them, 64 or 251 columns. PlaygroundError for anything else."""
    array = read_numbers(path)
    if array.ndim == 3 and array.shape[1:] == (len(NAMES), 3):
        return np.array(array, np.float64)
    if array.ndim == 2 and array.shape[1] in COLUMNS:
        return from_features67(np.array(array[:, :POSITION_COLUMNS], np.float64))
    raise PlaygroundError(
        f"{path} holds {array.dtype} {list(array.shape)}; float [frames, {len(NAMES)}, 3], [frames, {COLUMNS[0]}] or"
        f" [frames, {COLUMNS[1]}] is needed"
    )


def source_of(joints: Joints) -> Source:
    """KIT-ML joints [F, 21, 3] -> a source at 12.5 fps."""
    return source_of_positions(joints, NAMES, PARENTS, REST, FPS, "KIT-ML motion")
