"""Motion without end: a session that walks on for as long as it is asked, and listens for the next instruction."""

import threading
from collections import deque
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from playground.engine.checks import deadline_check
from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.motion import Motion
from playground.motion.representation import from_features67
from playground.motion.stitch import Track, rows_yaw
from playground.systems import SamplingDefaults
from playground.text.prompts import normalise
from playground.tokenizers.token_file import LevelTokens

if TYPE_CHECKING:
    from playground.runtime import Runtime

AROUND = LIMITS.fps // 2  # frames on either side of a switch that count as its seam
BURST = 8  # time steps that are drawn and decoded together
REMEMBERED = 2 * LIMITS.max_frames  # frames whose tokens can still be asked for

Floats = NDArray[np.float32]


class Trail:
    """Feature rows that keep coming -> joints in one world; what comes next starts where the last row left off."""

    def __init__(self) -> None:
        self._row: Floats | None = None  # the last row, with where its pose stands and what it faces
        self._place = np.zeros(2)
        self._yaw = 0.0

    def push(self, rows: Floats) -> Floats:
        """Un-normalised rows [n, 67] -> joints [n, 22, 3], metres."""
        if not len(rows):
            return np.zeros((0, 22, 3), np.float32)
        joined = rows if self._row is None else np.concatenate([self._row, rows])
        track = Track.of(from_features67(joined), rows_yaw(joined))
        if self._row is not None:
            track = track.moved(0, self._place, self._yaw)
        self._row, self._place, self._yaw = joined[-1:].copy(), track.place[-1].copy(), float(track.yaw[-1])
        return track.joints()[len(joined) - len(rows) :].astype(np.float32)


@dataclass(frozen=True)
class Switch:
    """One change of the prompt."""

    frame: int  # the first one under the new prompt, counted from the start of the session
    prompt: str
    jerk: float | None  # mean over its seam, m/s^3; None before anything of it was shown


@dataclass(frozen=True)
class Seams:
    """How smoothly a session changes from prompt to prompt, and what that was measured on.

    Jerk is the third difference of the joints' places, its length averaged over joints and frames, in m/s^3.
    """

    system: str
    checkpoint: str
    seed: int
    frames: int  # shown so far
    switches: tuple[Switch, ...]  # the newest LIMITS.max_listed
    count: int  # all of them
    at_switches: float | None  # mean jerk within half a second of any switch; None where there is none
    elsewhere: float | None


class _Jerk:
    """Running means of the jerk near switches and elsewhere; holds three poses and the newest switches."""

    def __init__(self) -> None:
        self.frames = 0
        self.count = 0
        self._poses = np.zeros((0, 22, 3), np.float32)
        self._sums = {True: [0.0, 0], False: [0.0, 0]}  # near a switch or not: sum, number
        self._switches: deque[tuple[int, str, list[float]]] = deque(maxlen=LIMITS.max_listed)

    def mark(self, frame: int, prompt: str) -> None:
        """A switch; one at the same frame as the last takes its place."""
        if self._switches and self._switches[-1][0] == frame:
            self._switches.pop()
            self.count -= 1
        self._switches.append((frame, prompt, [0.0, 0.0]))
        self.count += 1

    def push(self, joints: Floats) -> None:
        """The next poses [n, 22, 3]."""
        poses = np.concatenate([self._poses, joints])
        sizes = np.linalg.norm(np.diff(poses.astype(np.float64), 3, axis=0), axis=-1).mean(axis=-1) * LIMITS.fps**3
        last = self.frames + len(joints) - 1 - np.arange(len(sizes))[::-1]  # of the four poses of each difference
        middles = last - 1.5
        near = np.zeros(len(sizes), bool)
        for frame, _, sums in self._switches:
            here = np.abs(middles - (frame - 0.5)) <= AROUND  # the border lies before the first new frame
            sums[0] += float(sizes[here].sum())
            sums[1] += int(here.sum())
            near |= here
        for side, entry in self._sums.items():
            entry[0] += float(sizes[near == side].sum())
            entry[1] += int((near == side).sum())
        self._poses = poses[-3:].copy()
        self.frames += len(joints)

    def mean(self, near: bool) -> float | None:
        total, number = self._sums[near]
        return total / number if number else None

    def switches(self) -> tuple[Switch, ...]:
        return tuple(Switch(f, prompt, sums[0] / sums[1] if sums[1] else None) for f, prompt, sums in self._switches)


class EndlessSession:
    """One endless motion of one visitor. Memory does not grow with its length; calls from threads wait in line.

    `frames` counts what was shown, `prompt` is the instruction in force at the newest token.
    """

    def __init__(
        self, runtime: "Runtime", prompt: str, seed: int, how: SamplingDefaults, carry: int | None = None
    ) -> None:
        """carry: time steps of the past that stay in sight at a switch (default: all that the generator holds).

        PlaygroundError if the system cannot draw step by step without end, or the prompt is no prompt.
        """
        from playground.generators.hierarchical import HierarchicalGenerator
        from playground.generators.streaming import Stream, WindowDecoder
        from playground.nn.sampling import Sampling

        generator = runtime.generator
        if not isinstance(generator, HierarchicalGenerator):
            raise PlaygroundError(
                f"the system {runtime.name} draws motions of a given length; endless motion needs mogo's generator"
            )
        self.runtime = runtime
        self.seed = seed
        self.prompt = normalise(prompt)
        self.carry = carry
        numbers = asdict(how)
        numbers.pop("guidance")
        self._stream = Stream(generator, runtime.prompt(self.prompt), Sampling(seed=seed, **numbers))
        self._decoder = WindowDecoder(generator.tokenizer)
        self._trail, self._jerk = Trail(), _Jerk()
        self._spare = np.zeros((0, 22, 3), np.float32)  # poses that are made and not shown
        self._ids: deque[NDArray[np.int64]] = deque(maxlen=REMEMBERED // self._decoder.unit)  # [N], the newest steps
        self._given = 0  # steps that have gone to the decoder
        self._lock = threading.Lock()

    @property
    def drawn(self) -> int:
        """Frames whose tokens are drawn; the next instruction begins there."""
        return self._stream.drawn * self._decoder.unit

    @property
    def frames(self) -> int:
        """Frames shown so far."""
        return self._jerk.frames

    def say(self, prompt: str) -> int:
        """Another prompt from the next token on -> the first frame that follows it; what was drawn stays.

        Some tokens are drawn ahead of what is shown, so that frame lies up to a second in the future.
        PlaygroundError if it is no prompt.
        """
        line = normalise(prompt)
        text = self.runtime.prompt(line)
        with self._lock:
            frame = self.drawn
            self._stream.switch(text, self.carry)
            self.prompt = line
            if frame:
                self._jerk.mark(frame, line)
            return frame

    def advance(self, seconds: float, deadline: float | None = LIMITS.deadline_seconds) -> Motion:
        """The next frames, floor(20 seconds) of them, going on from the last ones shown.

        PlaygroundError for a length out of range, or past the deadline; then nothing of the motion is lost.
        """
        if not 1 / LIMITS.fps <= seconds <= LIMITS.max_seconds:
            raise PlaygroundError(
                f"{seconds:g} seconds were asked for; {1 / LIMITS.fps:g} to {LIMITS.max_seconds:g} are accepted"
            )
        frames, check = int(LIMITS.fps * seconds + 1e-6), deadline_check(deadline)
        with self._lock:
            while len(self._spare) < frames:
                missing = -(-(frames - len(self._spare)) // self._decoder.unit)
                ids = self._stream.next(min(missing, BURST), check)
                self._ids.extend(np.stack([level[0].numpy() for level in ids], axis=1))
                self._given += ids[0].shape[1]
                rows = self._decoder.push(ids)[0].numpy()
                joints = self._trail.push(self.runtime.normaliser.invert(rows))
                self._spare = np.concatenate([self._spare, joints])
            shown, self._spare = self._spare[:frames].copy(), self._spare[frames:].copy()
            self._jerk.push(shown)
            return Motion(shown, caption=self.prompt)

    def levels(self, start: int, stop: int) -> tuple[LevelTokens, ...]:
        """Every level's tokens of the frames start to stop, which are made: all that stand for some of them.

        PlaygroundError for frames that are not made yet or were longer ago than REMEMBERED.
        """
        unit = self._decoder.unit
        with self._lock:
            oldest = self._given - len(self._ids)
            first, last = start // unit, -(-stop // unit)
            if not oldest <= first < last <= self._given:
                held = f"{oldest * unit} to {self._given * unit}"
                raise PlaygroundError(f"frames {start} to {stop} were asked for; tokens of frames {held} are held")
            ids = np.stack([self._ids[step - oldest] for step in range(first, last)], axis=1)
        codes = self._decoder.tokenizer.quantizer.codes
        return tuple(LevelTokens(len(row), int(count), row) for row, count in zip(ids, codes, strict=True))

    def seams(self) -> Seams:
        """The jerk at the switches against the jerk elsewhere, of all that was shown."""
        with self._lock:
            jerk = self._jerk
            return Seams(
                self.runtime.name, self.runtime.checkpoint, self.seed, jerk.frames, jerk.switches(), jerk.count,
                jerk.mean(True), jerk.mean(False),
            )  # fmt: skip

    def held(self) -> int:
        """Bytes of the past that the session holds."""
        with self._lock:
            ids = sum(step.nbytes for step in self._ids)
            return self._stream.held() + self._decoder.held() + self._spare.nbytes + ids
