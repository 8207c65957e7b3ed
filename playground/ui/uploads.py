"""What a visitor brings along, an uploaded motion and numbers, checked before any model is touched."""

from dataclasses import dataclass, replace
from pathlib import Path

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.motion import Motion
from playground.ui.facts import as_sentence

SUFFIXES = (".bvh", ".npy", ".npz")
WINDOW = LIMITS.max_frames + 1  # poses that a tokenizer sees at once: its rows are steps between poses


@dataclass(frozen=True)
class Source:
    """The motion a room works on, whole; a tokenizer sees a window of it."""

    motion: Motion  # 22 joints, 20 fps, canonical, possibly longer than one window
    title: str
    note: str = ""  # what was read and changed, for an upload

    @property
    def caption(self) -> str:
        """The caption that came with the motion, cut to what is accepted."""
        return self.motion.caption[: LIMITS.max_prompt_chars]

    @property
    def is_long(self) -> bool:
        """Whether there is a window to choose."""
        return self.motion.frames > WINDOW

    @property
    def last_start(self) -> float:
        """The latest second at which a full window can start."""
        return max(0.0, (self.motion.frames - WINDOW) / LIMITS.fps)

    def window(self, start_seconds: float = 0.0) -> Motion:
        """The part that is tokenized: one window from `start_seconds`, moved back where it would run out."""
        return self.motion.slice(*self.edges(start_seconds))

    def edges(self, start_seconds: float = 0.0) -> tuple[int, int]:
        """First pose of that window and the pose after its last."""
        start = round(min(max(0.0, float(start_seconds)), self.last_start) * LIMITS.fps)
        return start, min(start + WINDOW, self.motion.frames)


def read_upload(path: str | None) -> Source:
    """Read an uploaded file. PlaygroundError with one sentence if it is no motion that we read."""
    if not path:
        raise PlaygroundError(f"no file arrived; choose a {_listed(SUFFIXES)} file of at most {_megabytes()} MB")
    file = Path(path)
    if file.suffix.lower() not in SUFFIXES:
        raise PlaygroundError(f"the file {_short(file.name)} is no motion; {_listed(SUFFIXES)} are accepted")
    from playground.motion.formats import read_motion

    read = read_motion(file)
    motion = replace(read.motion, name=_short(file.stem))
    note = " ".join([as_sentence(text) for text in (read.mapping, *read.changes) if text])
    return Source(motion, title=_short(file.name), note=note)


def checked_number(value: object, name: str, low: float, high: float) -> float:
    """A number of a control, inside its bounds. PlaygroundError otherwise."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise PlaygroundError(f"{name} must be a number from {low:g} to {high:g}")
    return float(value)


def _short(name: str) -> str:
    return name if len(name) <= 40 else name[:37] + "..."


def _listed(words: tuple[str, ...]) -> str:
    return f"{', '.join(words[:-1])} and {words[-1]}"


def _megabytes() -> int:
    return LIMITS.max_upload_bytes // 2**20
