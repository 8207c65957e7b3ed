"""Progress speaks only when work takes long, and leaves a terminal clean."""

import io
import threading

import pytest

from playground.progress import Progress


class Screen(io.StringIO):
    """A stream that tells when it was first written to."""

    def __init__(self, terminal: bool = False) -> None:
        super().__init__()
        self.terminal = terminal
        self.spoken = threading.Event()

    def isatty(self) -> bool:
        return self.terminal

    def write(self, text: str) -> int:
        written = super().write(text)
        self.spoken.set()
        return written


def test_short_work_is_silent() -> None:
    screen = Screen()
    with Progress("counting", screen, patience=60.0) as progress:
        progress(1, 2)
    assert screen.getvalue() == ""


def test_long_work_is_reported_in_lines() -> None:
    screen = Screen()
    with Progress("counting", screen, patience=0.0) as progress:
        progress(3, 10)
        assert screen.spoken.wait(20)
    lines = screen.getvalue().splitlines()
    assert lines and all(line.startswith("counting") for line in lines)
    assert screen.getvalue().endswith("\n") and "\r" not in screen.getvalue()


def test_a_terminal_is_left_clean() -> None:
    screen = Screen(terminal=True)
    with Progress("counting", screen, patience=0.0):
        assert screen.spoken.wait(20)
    assert "\n" not in screen.getvalue() and screen.getvalue().endswith("\r\x1b[K")


def test_an_error_passes_through_and_ends_the_thread() -> None:
    before = threading.active_count()
    with pytest.raises(ZeroDivisionError), Progress("dividing", Screen(), patience=0.0):
        _ = 1 / 0
    assert threading.active_count() == before


@pytest.mark.parametrize(
    ("state", "seconds", "line"),
    [
        (None, 4.2, "counting, 4 s"),
        ((0, 10), 4.0, "counting: 0 of 10"),
        ((2, 10), 4.0, "counting: 2 of 10, about 16 s left"),
        ((10, 10), 4.0, "counting: 10 of 10, about 0 s left"),
        ((12, 10), 4.0, "counting: 12 of 10"),
    ],
)
def test_the_words(state: tuple[int, int] | None, seconds: float, line: str) -> None:
    progress = Progress("counting", Screen())
    if state:
        progress(*state)
    assert progress.line(seconds) == line
