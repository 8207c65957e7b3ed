"""What every source reader shares: its result, its row in the table, the step from joints to a library clip."""

import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from playground.data.actions import action_of
from playground.data.library import LibraryClip
from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.representation import canonicalise
from playground.motion.retarget import retarget
from playground.motion.skeleton import HUMAN22
from playground.motion.source import Source

SHORTEST = LIMITS.min_frames + 1  # poses of the shortest clip worth storing
CANONICAL = 2e-3  # metres by which the first pose may be off before it is moved and turned


@dataclass
class Reading:
    """A checked source: how many clips to expect, the clips (read lazily), and what was left out so far, by reason."""

    total: int
    clips: Iterator[LibraryClip]
    left_out: Counter[str] = field(default_factory=Counter)


@dataclass(frozen=True)
class SourceEntry:
    """One row of the table of sources."""

    read: Callable[[Path | None], Reading]
    needs_root: bool  # whether the reader is given a folder
    what: str  # what it reads, in words
    read_cut: Callable[[Path], Reading] | None = None  # the same with long takes cut at still moments


def folder(root: Path | None) -> Path:
    """The folder given to a reader that needs one. PlaygroundError without it."""
    if root is None:
        raise PlaygroundError("this source needs a folder")
    return root


def library_clip(
    joints: NDArray[np.floating],
    left_out: Counter[str],
    *,
    id: str,
    source: str,
    split: str,
    label: str,
    captions: tuple[str, ...],
    shortest: int = SHORTEST,
) -> LibraryClip | None:
    """Joints [F, 22, 3] in metres at 20 fps -> a canonical clip; None, counted in `left_out`, where it is not usable.

    label: whatever names the action; its group becomes the clip's action. A clip without captions gets an
    empty one, which is no text to a model. PlaygroundError for another shape.
    """
    if joints.ndim != 3 or joints.shape[1:] != (HUMAN22.size, 3):
        raise PlaygroundError(
            f"clip {id} holds an array {list(joints.shape)}; joints [frames, {HUMAN22.size}, 3] are needed"
        )
    if len(joints) < shortest:
        left_out[f"clips of fewer than {shortest} frames"] += 1
        return None
    if not np.isfinite(joints).all():
        left_out["clips with positions that are not finite numbers"] += 1
        return None
    if np.abs(joints).max() > LIMITS.max_metres:
        left_out[f"clips that leave the area of {LIMITS.max_metres:g} m around the origin"] += 1
        return None
    canonical = canonicalise(joints)
    if np.abs(canonical[0] - joints[0]).max() < CANONICAL:
        canonical = joints.astype(np.float32)  # the source did it already: keep its numbers, not their rounding
    return LibraryClip(id, source, split, action_of(label), captions or ("",), canonical)


def retargeted(
    rows: NDArray[np.floating],
    source_of: Callable[[NDArray[np.floating]], Source],
    left_out: Counter[str],
    *,
    upright: bool,
) -> NDArray[np.float32] | None:
    """Rows of a data set as joints [F, 22, 3], metres, 20 fps; None, counted in `left_out`, for no body understood."""
    if not np.isfinite(rows).all():
        left_out["clips with values that are not finite numbers"] += 1
        return None
    try:
        return retarget(source_of(rows), upright=upright).joints
    except PlaygroundError:
        left_out["clips whose body or path is not understood"] += 1
        return None


def split_of(take: str) -> str:
    """train, val or test for a take that has no split of its own: 80, 5, 15 %, by a hash of its name."""
    share = int.from_bytes(hashlib.sha256(take.encode()).digest()[:4], "big") / 2**32
    return "train" if share < 0.80 else "val" if share < 0.85 else "test"


def read_numbers(path: Path) -> NDArray[np.floating]:
    """The real numbers of one .npy file, mapped, not read. PlaygroundError if it holds anything else, or pickles."""
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise PlaygroundError(f"{path} is not an array file that numpy can read without pickle") from error
    if not isinstance(array, np.ndarray) or array.dtype.kind != "f" or not array.size:
        raise PlaygroundError(f"{path} holds no real numbers")
    return array


def check_ids(path: Path, ids: Iterable[str]) -> None:
    """PlaygroundError where a list of clips names something outside of its folder."""
    for id in ids:
        if "\\" in id or id.startswith("/") or ".." in id.split("/"):
            raise PlaygroundError(f"{path} holds {id!r}; one clip id a line is accepted")


def read_text(path: Path) -> str:
    """A text file in UTF-8. PlaygroundError if it is missing or is something else."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise PlaygroundError(f"{path} cannot be read: {error.strerror or 'unreadable'}") from error
    except UnicodeDecodeError as error:
        raise PlaygroundError(f"{path} is not a text file in UTF-8") from error
