"""Files that somebody uploads, for the tests."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from playground.errors import PlaygroundError
from playground.motion.formats import read_motion


def sentence(path: Path) -> str:
    """The one sentence that reading raises."""
    with pytest.raises(PlaygroundError) as caught:
        read_motion(path)
    text = str(caught.value)
    assert 10 < len(text) < 260 and "\n" not in text and "Traceback" not in text
    return text


def npz(path: Path, **arrays: Any) -> Path:
    np.savez(path, **arrays)
    return path


def npy(path: Path, array: Any) -> Path:
    np.save(path, array)
    return path
