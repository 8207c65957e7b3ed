"""A synthetic motion while it is being specified: factors drawn or given, trip, overlays, clauses. numpy only."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.captions import Clause
from playground.motion.footsteps import Stretch, Style
from playground.motion.rig import Pose

Array = NDArray[np.floating]
SHORTEST, LONGEST = 2.0, LIMITS.max_seconds  # seconds of a synthetic motion
Overlay = Callable[[Pose, Array], None]  # changes a pose in place; gets the time of every frame in seconds

STYLES = {
    "neutral": Style(),
    "energetic": Style(speed=1.2, cadence=1.06, swing=1.5, bounce=1.4, lean=-0.02, elbow=0.35, out=0.05),
    "tired": Style(speed=0.8, cadence=0.97, swing=0.7, bounce=0.9, lean=0.18, nod=0.3, crouch=0.015),
    "proud": Style(speed=1.0, cadence=0.97, swing=1.15, lean=-0.08, nod=-0.1, out=0.16, width=0.015),
    "sad": Style(speed=0.75, cadence=0.95, swing=0.4, bounce=0.7, lean=0.12, nod=0.4),
    "old": Style(speed=0.65, cadence=1.12, swing=0.3, bounce=0.6, lean=0.26, nod=0.05, elbow=0.3, crouch=0.035),
}


def vary(style: Style, rng: np.random.Generator) -> Style:
    """The same style on another body: every habit a little different."""
    near = lambda spread: float(rng.uniform(1.0 - spread, 1.0 + spread))  # noqa: E731
    return replace(
        style,
        cadence=style.cadence * near(0.04), swing=style.swing * near(0.2), bounce=style.bounce * near(0.2),
        lean=style.lean + float(rng.normal(0.0, 0.03)), nod=style.nod + float(rng.normal(0.0, 0.05)),
        out=style.out + float(rng.uniform(-0.05, 0.09)), elbow=style.elbow + float(rng.uniform(-0.1, 0.2)),
        crouch=style.crouch + float(rng.uniform(0.0, 0.014)), width=style.width + float(rng.uniform(-0.015, 0.025)),
        stagger=float(rng.normal(0.0, 0.02)),
    )  # fmt: skip


def words(*parts: str) -> str:
    """The parts that are not empty, joined by spaces."""
    return " ".join(part for part in parts if part)


@dataclass
class Draft:
    """A motion being specified: factors drawn or given, the trip, what is laid over it, what is said about it."""

    rng: np.random.Generator
    given: dict[str, Any]
    factors: dict[str, Any] = field(default_factory=dict)
    parts: list[Stretch] = field(default_factory=list)
    overlays: list[Overlay] = field(default_factory=list)
    clauses: list[Clause] = field(default_factory=list)
    before: bool = False
    after: bool = False

    def value(self, name: str, low: float, high: float, digits: int = 2) -> float:
        """A number given by the caller or drawn between low and high; recorded as a factor."""
        return self.number(name, round(float(self.rng.uniform(low, high)), digits))

    def number(self, name: str, drawn: float) -> float:
        """A number given by the caller or else `drawn`; recorded as a factor. PlaygroundError if it is not finite."""
        given = self.given.pop(name, drawn)
        if not isinstance(given, int | float) or not np.isfinite(given):
            raise PlaygroundError(f"{name} must be a finite number, got {given!r}")
        self.factors[name] = float(given)
        return float(given)

    def choice(self, name: str, options: Sequence[Any], weights: Sequence[float] | None = None) -> Any:
        """One of the options, given or drawn; PlaygroundError for anything else."""
        share = None if weights is None else np.asarray(weights) / np.sum(weights)
        drawn = options[int(self.rng.choice(len(options), p=share))]
        chosen = self.given.pop(name, drawn)
        if chosen not in options:
            raise PlaygroundError(f"{name} must be one of {', '.join(map(str, options))}, got {chosen!r}")
        self.factors[name] = chosen
        return chosen

    @property
    def style(self) -> Style:
        """The drawn style; neutral before it is drawn."""
        return STYLES[self.factors.get("style", "neutral")]

    def draw(self, low: float, high: float) -> float:
        """A number that is not a factor."""
        return round(float(self.rng.uniform(low, high)), 2)

    def draw_style(self, names: Sequence[str] = tuple(STYLES)) -> Style:
        """Draw the style, neutral in half of the motions."""
        self.choice("style", names, [len(names) if name == "neutral" else 1.0 for name in names])
        return self.style

    @property
    def tempo(self) -> float:
        """Factor on the duration of a gesture in this style."""
        return 2.0 / (1.0 + self.style.speed)

    def stand(self, seconds: float) -> None:
        """Append a standing part."""
        self.parts.append(Stretch("stand", round(seconds, 2)))

    def draw_ends(self) -> None:
        """Begin and end a trip standing or in the middle of a step."""
        self.before = self.choice("starts", ("moving", "standing"), (3, 2)) == "moving"
        self.after = self.choice("ends", ("moving", "standing"), (3, 2)) == "moving"

    def trip(self, *parts: Stretch) -> None:
        """Append travelling parts with the standing parts that its ends ask for."""
        if not self.before:
            self.stand(self.draw(0.3, 0.7))
        self.parts += parts
        if not self.after:
            self.stand(self.draw(0.5, 0.9))

    @property
    def now(self) -> float:
        """Seconds planned so far."""
        return float(sum(part.seconds for part in self.parts))

    def say(self, *options: tuple[str, str]) -> None:
        """Append a clause with its alternatives."""
        self.clauses.append(Clause(options))
