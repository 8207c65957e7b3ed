"""Motions inside stored results: positions in whole millimetres, as text. Made by a system of ours, never recorded."""

import base64
import binascii
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from playground.errors import PlaygroundError
from playground.motion.skeleton import HUMAN22

MM = 1000.0
_LARGEST = np.iinfo(np.int16).max / MM  # metres


def packed(joints: ArrayLike) -> dict[str, Any]:
    """{"frames", "mm": base64 of little-endian int16 [F, 22, 3]} of joints in metres, rounded to the millimetre.

    PlaygroundError for another shape, or a position that does not fit (32.767 m).
    """
    array = np.asarray(joints, np.float64)
    if array.ndim != 3 or array.shape[1:] != (HUMAN22.size, 3) or not len(array):
        raise PlaygroundError(f"a stored motion has joints [frames, {HUMAN22.size}, 3], got {list(array.shape)}")
    if not np.isfinite(array).all() or np.abs(array).max() > _LARGEST:
        raise PlaygroundError(f"positions of a stored motion must be finite and within {_LARGEST:.3f} metres")
    whole = np.round(array * MM).astype("<i2")
    return {"frames": len(array), "mm": base64.b64encode(whole.tobytes()).decode("ascii")}


def unpacked(stored: object) -> NDArray[np.float32]:
    """Joints [F, 22, 3] in metres. PlaygroundError for anything that `packed` does not make."""
    try:
        frames, text = int(stored["frames"]), stored["mm"]  # type: ignore[index]
        whole = np.frombuffer(base64.b64decode(text, validate=True), "<i2").reshape(frames, HUMAN22.size, 3)
    except (TypeError, KeyError, ValueError, binascii.Error) as error:
        raise PlaygroundError("a stored motion is broken; `make figures` makes it again") from error
    return np.asarray(whole / MM, np.float32)
