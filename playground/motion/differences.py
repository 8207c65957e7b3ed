"""Where two motions differ, joint by joint and frame by frame, and which frames a change governs. numpy only."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from playground.errors import PlaygroundError
from playground.motion.representation import COLUMNS
from playground.motion.rotation import qrotate, yaw_quaternion

GOVERNED = 0.8  # share of a change's energy that the frames it governs hold


def body_joints(rows: ArrayLike) -> NDArray[np.float64]:
    """Feature rows [..., F, 67], un-normalised -> joints [..., F, 22, 3] seen from the body, in metres.

    Each frame is seen from where the pelvis stood, and as the body faced, one frame earlier (frame 0: from its own
    place). So a step or a turn counts in the frame in which it happens, and not in all later ones.
    """
    x = np.asarray(rows, np.float64)
    local = x[..., 4:].reshape(*x.shape[:-1], -1, 3)
    pelvis = np.zeros((*x.shape[:-1], 1, 3))
    pelvis[..., 0, 1] = x[..., 3]
    joints = np.concatenate([pelvis, local], axis=-2)
    step = np.zeros((*x.shape[:-2], x.shape[-2] - 1, 1, 3))
    step[..., 0, [0, 2]] = x[..., :-1, 1:3]
    turn = yaw_quaternion(-2.0 * x[..., :-1, 0])[..., None, :]
    joints[..., 1:, :, :] = qrotate(turn, joints[..., 1:, :, :] + step)
    return joints


def joint_differences(first: ArrayLike, second: ArrayLike) -> NDArray[np.float32]:
    """How far each joint is from itself in the other motion, frame by frame: float32 [..., F, 22], metres.

    first, second: un-normalised feature rows [..., F, 67] that broadcast; compared as `body_joints` sees them.
    PlaygroundError if they do not fit each other.
    """
    a, b = np.asarray(first, np.float64), np.asarray(second, np.float64)
    if a.ndim < 2 or b.ndim < 2 or a.shape[-2:] != b.shape[-2:] or a.shape[-1] != COLUMNS:
        raise PlaygroundError(f"two motions [frames, {COLUMNS}] are compared, got {list(a.shape)} and {list(b.shape)}")
    return np.linalg.norm(body_joints(a) - body_joints(b), axis=-1).astype(np.float32)


def governed_span(difference: ArrayLike, share: float = GOVERNED) -> tuple[int, int]:
    """The shortest run of frames (start, stop) that holds at least `share` of the energy of a difference [F, J].

    Energy is the square of the difference, summed over the joints. Of runs of one length the one that holds most, then
    the earliest; (0, 0) where there is no difference at all.
    """
    profile = np.square(np.asarray(difference, np.float64)).sum(axis=-1)
    total = np.concatenate([[0.0], np.cumsum(profile)])
    if not total[-1] > 0:
        return 0, 0
    wanted = share * total[-1] * (1 - 1e-12)
    stops = np.searchsorted(total, total[:-1] + wanted, side="left")  # first stop at which enough is held
    starts = np.flatnonzero(stops < len(total))
    lengths = stops[starts] - starts
    held = total[stops[starts]] - total[starts]
    best = np.lexsort((starts, -held, lengths))[0]
    return int(starts[best]), int(stops[starts[best]])
