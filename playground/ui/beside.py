"""Other systems beside the one whose tokens are looked at in Tokenize: the same motion through each, in sync."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from playground.figures import stage as scene
from playground.figures.stage import ORIGINAL_ID, Json
from playground.limits import LIMITS
from playground.motion.motion import Motion
from playground.ui.facts import millimetres
from playground.ui.scenes import score
from playground.ui.services import Services

if TYPE_CHECKING:
    from playground.engine import Decoded, SystemInfo, Tokenized

MOST = LIMITS.max_figures - 2  # systems beside the first one: the original has a figure too


@dataclass(frozen=True, eq=False)
class Companion:
    """One other system's tokens of the motion, and what they give back."""

    system: "SystemInfo"
    tokenized: "Tokenized"
    decoded: "Decoded"

    def figure(self) -> Json:
        """Its figure, with its own error."""
        told = f"MPJPE {millimetres(self.decoded.mpjpe_mm)}"
        name = self.system.name
        return scene.figure(f"beside-{name}", self.system.title, self.decoded.motion.joints, name, told, ORIGINAL_ID)

    def track(self, services: Services) -> Json:
        """Its rows of the score."""
        frames, palettes = self.tokenized.motion.frames, services.palettes(self.system.name)
        return score(self.system, frames, self.tokenized.levels, palettes)


def companion(services: Services, motion: Motion, caption: str, name: str) -> Companion:
    """The motion with its caption through another system. PlaygroundError if it is not here."""
    engine = services.engine()
    other = engine.tokenize(motion, caption, system=name)
    return Companion(services.system(name), other, engine.reconstruct(other))


def beside_it(services: Services, wanted: Sequence[object]) -> tuple[str, ...]:
    """The systems of a choice that are shipped with a tokenizer, as many as a stage holds."""
    shipped = {system.name for system in services.shipped("tokenizer")}
    return tuple(name for name in dict.fromkeys(map(str, wanted)) if name in shipped)[:MOST]
