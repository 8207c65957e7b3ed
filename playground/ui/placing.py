"""A visitor's own point on the maps: an example, an upload or a generation, tokenized and placed, one system each."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from playground.figures import stage as scene
from playground.figures.stage import Json
from playground.ui.scenes import score
from playground.ui.services import Services
from playground.ui.uploads import Source

if TYPE_CHECKING:
    from playground.findings import Placed
    from playground.motion.motion import Motion
    from playground.results import Generation, Tokenized

SECONDS, SEED = 5.0, 0  # of a generation that is made to be placed


@dataclass(frozen=True, eq=False)
class Guest:
    """What was placed: per system its tokens, and where they lie for clips and for tokens."""

    title: str
    results: dict[str, "Tokenized | Generation"] = field(default_factory=dict)
    places: dict[tuple[str, str], "Placed"] = field(default_factory=dict)  # (system, each) -> places

    def on(self, services: Services, systems: tuple[str, ...], each: str) -> dict[str, "Placed"]:
        """System -> its places, measured the first time they are asked for."""
        engine = services.engine()
        for system in systems:
            if system not in self.results:
                first = next(iter(self.results.values()))
                self.results[system] = engine.tokenize(first.motion, first.caption, system)
            if (system, each) not in self.places:
                self.places[system, each] = engine.place(self.results[system], each=each)
        return {system: self.places[system, each] for system in systems}


def guest_of(services: Services, source: Source, caption: str, system: str) -> Guest:
    """A motion as a guest; its first window is tokenized."""
    tokenized = services.engine().tokenize(source.window(), caption, system)
    return Guest(source.title, {system: tokenized})


def generated_guest(services: Services, prompt: str, system: str) -> Guest:
    """A generation as a guest: 5 s, seed 0, the system's own sampling."""
    made = services.engine().generate(prompt, SECONDS, system=system, seed=SEED)
    return Guest(f"“{made.prompt}”, generated", {system: made})


def guest_scene(services: Services, guest: Guest, systems: tuple[str, ...]) -> Json:
    """The guest on the stage, with its tokens in every system shown."""
    titles = {one.name: one for one in services.engine().systems()}
    first: Any = guest.results[systems[0]]
    figure = scene.figure("guest", guest.title, _motion(first).joints, None, "placed in the map")
    tracks = [
        score(titles[name], first.motion.frames, guest.results[name].levels, services.palettes(name))
        for name in systems if name in guest.results
    ]  # fmt: skip
    return scene.payload([figure], tracks, scene=f"guest {guest.title}")


def _motion(result: Any) -> "Motion":
    motion: Motion = result.motion
    return motion
