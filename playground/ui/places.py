"""What of a motion an address may point at: some scales, a token, a stretch of frames."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Scales:
    """Which scales a decode uses: "upto" 1..n, "only" n, "without" n; n counts from 1. In an address 8, only-8."""

    kind: str
    n: int

    def __str__(self) -> str:
        return str(self.n) if self.kind == "upto" else f"{self.kind}-{self.n}"


@dataclass(frozen=True)
class Token:
    """A selected token; scale from 1, position from 0. In an address lgtok.3.5."""

    system: str
    scale: int
    position: int

    def __str__(self) -> str:
        return f"{self.system}.{self.scale}.{self.position}"


@dataclass(frozen=True)
class Span:
    """Selected frames, stop not included. In an address 12-40."""

    start: int
    stop: int

    def __str__(self) -> str:
        return f"{self.start}-{self.stop}"
