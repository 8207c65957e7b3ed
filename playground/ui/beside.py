"""Other systems beside the one whose tokens are looked at in Tokenize: the same motion through each, in sync."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from playground.figures import stage as scene
from playground.figures.stage import ORIGINAL_ID, Json
from playground.limits import LIMITS
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


def companion(services: Services, tokenized: "Tokenized", name: str) -> Companion:
    """The motion of `tokenized`, with the same caption, through another system. PlaygroundError if it is not here."""
    engine = services.engine()
    other = engine.tokenize(tokenized.motion, tokenized.caption, system=name)
    return Companion(services.system(name), other, engine.reconstruct(other))


def side_by_side(services: Services, wanted: object) -> tuple[str, tuple[str, ...]]:
    """What a choice of systems means: the one whose tokens are taken apart, "" for the usual one, and the others.

    Names that are not shipped with a tokenizer are left out, and so is what is more than a stage holds.
    """
    shipped = {system.name for system in services.shipped("tokenizer")}
    names: Sequence[object] = wanted if isinstance(wanted, list | tuple) else [wanted]
    known = [name for name in dict.fromkeys(str(name) for name in names) if name in shipped]
    return (known[0], tuple(known[1 : MOST + 1])) if known else ("", ())
