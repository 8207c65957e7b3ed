"""Progress on stderr for work that takes longer than two seconds; shorter work stays silent."""

import sys
import threading
import time
from types import TracebackType
from typing import TextIO

PATIENCE = 2.0  # seconds of silence before the first word
PERIOD = {True: 0.5, False: 5.0}  # seconds between words: on a terminal, where the line is rewritten, and in a file


class Progress:
    """`with Progress("reading clips") as progress: ... progress(done, total)`; calling it is optional and cheap."""

    def __init__(self, what: str, stream: TextIO | None = None, patience: float = PATIENCE) -> None:
        self.what = what
        self.stream = stream or sys.stderr
        self.patience = patience
        self._terminal = self.stream.isatty()
        self._state: tuple[int, int] | None = None
        self._spoke = False
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._speak, daemon=True)

    def __call__(self, done: int, total: int) -> None:
        """Remember how far the work is."""
        self._state = (done, total)

    def __enter__(self) -> "Progress":
        self._started = time.monotonic()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self._thread.join()
        if self._spoke and self._terminal:
            self.stream.write("\r\x1b[K")
            self.stream.flush()

    def line(self, seconds: float) -> str:
        """What is said after so many seconds."""
        if self._state is None:
            return f"{self.what}, {seconds:.0f} s"
        done, total = self._state
        left = f", about {seconds / done * (total - done):.0f} s left" if done and total >= done else ""
        return f"{self.what}: {done} of {total}{left}"

    def _speak(self) -> None:
        wait = self.patience
        while not self._stop.wait(wait):
            self._spoke = True
            text = self.line(time.monotonic() - self._started)
            self.stream.write(f"\r\x1b[K{text}" if self._terminal else f"{text}\n")
            self.stream.flush()
            wait = PERIOD[self._terminal]
