"""Joint positions of any skeleton -> a source with rotations, where a data set has positions alone. numpy only."""

from collections.abc import Sequence

import numpy as np

from playground.errors import PlaygroundError
from playground.motion.kinematics import unit
from playground.motion.rotation import Array, fit_rotation, qbetween, qmul, qrotate
from playground.motion.source import Source


def source_of_positions(
    positions: Array, names: Sequence[str], parents: Sequence[int], rest: Array, fps: float, kind: str
) -> Source:
    """positions [F, J, 3] and the directions [J, 3] of a standing pose's bones -> a source on median bone lengths.

    A joint with several children is fitted to all of them; one with a single child turns by the shortest way from its
    parent's rotation, so limbs get no twist of their own; ends follow their parent. PlaygroundError for a bone of no
    length or positions that are no finite numbers.
    """
    positions, parents = np.asarray(positions, np.float64), tuple(parents)
    if not np.isfinite(positions).all():
        raise PlaygroundError(f"the {kind} holds positions that are not finite numbers")
    bones = positions[:, 1:] - positions[:, list(parents[1:])]
    lengths = np.median(np.linalg.norm(bones, axis=-1), axis=0)
    if not lengths.min() > 0.0:
        raise PlaygroundError(f"the {kind} has joints that lie on each other, so it is no body")
    offsets = unit(np.asarray(rest, np.float64)) * np.concatenate([[0.0], lengths])[:, None]
    rotations = np.zeros((*positions.shape[:2], 4))
    rotations[..., 0] = 1.0
    for joint, parent in enumerate(parents):
        kids = [child for child, above in enumerate(parents) if above == joint]
        turned = rotations[:, parent] if parent >= 0 else rotations[:, joint]
        if len(kids) > 1:
            turned = fit_rotation(offsets[kids], positions[:, kids] - positions[:, joint, None])
        elif kids:
            bone = positions[:, kids[0]] - positions[:, joint]
            turned = qmul(qbetween(qrotate(turned, offsets[kids[0]]), bone), turned)
        rotations[:, joint] = turned
    return Source(tuple(names), parents, offsets, positions, rotations, fps, {}, kind)
