"""What the room Tokenize computes and remembers of one visit: the motion, its tokens, and the closer looks at them."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.figures import stage as scene
from playground.figures.stage import ORIGINAL_ID, Json
from playground.findings import ScaleSet
from playground.motion.motion import Motion
from playground.ui.beside import Companion, companion
from playground.ui.cutting import part_of
from playground.ui.energy import energy_bars
from playground.ui.facts import Fact, millimetres
from playground.ui.scenes import MPJPE_CARD, score, token_facts, words_strip
from playground.ui.services import Services
from playground.ui.state import Scales
from playground.ui.uploads import Source
from playground.ui.view import View

if TYPE_CHECKING:
    from playground.engine import SystemInfo, Tokenized
    from playground.findings import Attention, Language, ScaleStudy, Swap

NAME = "tokenize"
REBUILT_ID = "rebuilt"
NO_MOTION = "choose a motion or upload one first"


@dataclass
class Findings:
    """What has been measured of one tokenized motion. Goes with its tokens."""

    studies: dict[str, "ScaleStudy"] = field(default_factory=dict)  # kind of scale set -> all of that kind, decoded
    spans: dict[int, NDArray[np.int64]] = field(default_factory=dict)  # scale -> measured spans [s, 2]
    beside: dict[str, Companion] = field(default_factory=dict)  # system -> what it makes of the same motion
    swap: "Swap | None" = None
    language: "Language | None" = None
    attention: "Attention | None" = None
    marked: str = "bare"  # which flips the score marks: "bare" or "misled"


@dataclass
class Session:
    """What one visitor is looking at. Without a `source` it is a stored result, known by its example id."""

    example: str = ""  # id of an example, or UPLOADED
    source: Source | None = None
    start: float = 0.0  # second at which the window begins
    part: int = 0  # of a long recording, from 1, between two still moments; 0 for a window that begins at `start`
    caption: str = ""
    tokenized: "Tokenized | None" = None
    upload: Source | None = None  # stays in the menu when an example is chosen
    system: str = ""  # whose tokens are taken apart; "" for the one the page prefers
    beside: tuple[str, ...] = ()  # systems shown beside it
    scales: ScaleSet | None = None  # of the decode on the stage; None for all
    token: tuple[int, int] | None = None  # selected: scale from 1, position from 0
    wish: int | None = None  # code that a link wants the selected token to be replaced by
    found: Findings = field(default_factory=Findings)

    def forgetful(self, **changes: Any) -> "Session":
        """The session with changes that make other tokens of it."""
        return replace(self, tokenized=None, scales=None, token=None, wish=None, found=Findings(), **changes)


def open_session(services: Services, session: Session | None, opening: View) -> Session:
    """The session with its source loaded; a forgotten or fresh one starts at the opening example."""
    found = session or Session()
    if found.source is None:
        wanted = found.example or str(opening.controls.get("example", ""))
        if not wanted:
            raise PlaygroundError(NO_MOTION)
        example = services.example(wanted)
        caption = example.caption if found.example else str(opening.controls["caption"])
        found = replace(found, example=wanted, source=Source(example.motion(), example.title))
        found.caption = found.caption or caption
    return found


def system_of(services: Services, session: Session) -> "SystemInfo":
    """The system that a session tokenizes with. PlaygroundError if it is not shipped."""
    return services.system(session.system)


def window_of(session: Session) -> tuple[int, int]:
    """What is tokenized of the session's recording: its first pose and the pose after its last."""
    source = session.source
    if source is None:
        raise PlaygroundError(NO_MOTION)
    return part_of(source.motion, session.part) if session.part and source.is_long else source.edges(session.start)


def ready(services: Services, session: Session) -> Session:
    """The session with its motion tokenized."""
    if session.source is None:
        raise PlaygroundError(NO_MOTION)
    if session.tokenized is not None:
        return session
    window, name = session.source.motion.slice(*window_of(session)), system_of(services, session).name
    tokenized = services.engine().tokenize(window, session.caption, system=name)
    return replace(session, tokenized=tokenized, caption=tokenized.caption, found=Findings())


def study(services: Services, session: Session, kind: str) -> "ScaleStudy":
    """All decodes of one kind of scale set; made once, so that a slider only looks them up."""
    assert session.tokenized is not None
    studies = session.found.studies
    if kind not in studies:
        studies[kind] = services.engine().scale_study(session.tokenized, kind=kind)
    return studies[kind]


def run(services: Services, session: Session, scales: ScaleSet | None = None) -> tuple[Session, View]:
    """Tokenize what the session holds (unless it is already) and rebuild it from some of the scales."""
    began = time.perf_counter()
    held = replace(ready(services, session), scales=scales, token=None)
    held.found.swap = held.found.language = None
    return held, view_of(services, held, time.perf_counter() - began)


def view_of(services: Services, held: Session, seconds: float) -> View:
    """The room's main result: both figures, the score, numbers and bars."""
    tokenized = held.tokenized
    assert tokenized is not None
    count = len(tokenized.levels)
    used = held.scales or ScaleSet("upto", count)
    decodes = study(services, held, used.kind)
    levels = [tokenized.levels[n] for n in used.levels(count)]
    error = Fact(millimetres(float(decodes.mpjpe_mm[used.scale - 1])), "MPJPE, this clip", MPJPE_CARD)
    return View(
        stage=stage_of(services, held),
        facts=(error, *token_facts(levels)),
        charts={"energy": energy_bars(tokenized.residual_energy, levels_of(tokenized), decodes.mpjpe_mm, used.kind)},
        controls={
            "example": held.example, "caption": tokenized.caption, "scales": used.scale, "kind": used.kind,
            "count": count,
        },
        seconds=seconds,
    )  # fmt: skip


def levels_of(tokenized: "Tokenized") -> list[int]:
    """Tokens a scale."""
    return [int(level.size) for level in tokenized.levels]


def scales_of(asked: Scales | None, count: int) -> ScaleSet | None:
    """The set of scales that a link asks for; None for all, or where the system has no such scale."""
    if asked is None or not 1 <= asked.n <= count:
        return None
    return ScaleSet(asked.kind, asked.n)


# ---- the stage ---------------------------------------------------------------------------------------------------


def stage_of(services: Services, held: Session) -> Json:
    """What stands on the stage: the motion and what its tokens give back; with a token replaced; or caption by caption.

    Which of them it is says what the session has found last.
    """
    if held.found.swap is not None:
        return _swapped_scene(services, held, held.found.swap)
    if held.found.language is not None:
        return _language_scene(services, held, held.found.language)
    tokenized, system = held.tokenized, system_of(services, held)
    assert tokenized is not None
    used = held.scales or ScaleSet("upto", len(tokenized.levels))
    decodes = study(services, held, used.kind)
    error = f"MPJPE {millimetres(float(decodes.mpjpe_mm[used.scale - 1]))}"
    rebuilt = _rebuilt(system, decodes.motions[used.scale - 1], error)
    if held.beside:  # with others beside it, its name says more than where it comes from
        rebuilt = {**rebuilt, "name": system.title, "caption": error}
    figures = [_original(tokenized), rebuilt, *(one.figure() for one in companions(services, held))]
    return _scene(services, held, figures, _track(services, held, tokenized.levels))


def companions(services: Services, held: Session) -> list[Companion]:
    """The systems beside the first one, each with its tokens of the motion; made once."""
    assert held.tokenized is not None and held.source is not None
    made, first = held.found.beside, system_of(services, held).name
    for name in held.beside:
        if name != first and name not in made:
            made[name] = companion(services, held.source.motion.slice(*window_of(held)), held.tokenized.caption, name)
    return [made[name] for name in held.beside if name in made]


def _swapped_scene(services: Services, held: Session, swap: "Swap") -> Json:
    tokenized, system = held.tokenized, system_of(services, held)
    assert tokenized is not None
    changed = f"Scale {swap.scale}, token {swap.position + 1}: {swap.before} → {swap.code}"
    figures = [
        _original(tokenized),
        _rebuilt(system, swap.original, f"code {swap.before}"),
        scene.figure("swapped", "With the other code", swap.motion.joints, system.name, changed, ghost_of=REBUILT_ID),
    ]
    marks = [np.zeros(level.size, bool) for level in swap.levels]
    marks[swap.scale - 1][swap.position] = True
    strip = scene.joint_strip("difference", f"What moves when code {swap.before} becomes {swap.code}", swap.difference)
    return _scene(services, held, figures, _track(services, held, swap.levels, marks, "replaced"), [strip])


def _language_scene(services: Services, held: Session, language: "Language") -> Json:
    tokenized, system = held.tokenized, system_of(services, held)
    assert tokenized is not None
    texts = (("captioned", "With caption"), ("bare", "Without words"), ("misled", "Wrong words"))
    figures = [_original(tokenized)]
    for (id, name), motion, error in zip(texts, language.motions, language.mpjpe_mm, strict=True):
        told = f"MPJPE {millimetres(error)}"
        figures.append(scene.figure(id, name, motion.joints, system.name, told, ghost_of=ORIGINAL_ID))
    flips = language.bare_flips if held.found.marked == "bare" else language.misled_flips
    words = "another code without words" if held.found.marked == "bare" else "another code with the wrong words"
    track = _track(services, held, language.captioned, flips, words)
    found = held.found.attention
    strips = [] if found is None else [words_strip("Which words the detokenizer looks at", found.words, found.weights)]
    return _scene(services, held, figures, track, strips)


def _original(tokenized: "Tokenized") -> Json:
    return scene.figure(ORIGINAL_ID, "Original", tokenized.motion.joints)


def _rebuilt(system: "SystemInfo", motion: Motion, caption: str) -> Json:
    told = f"{system.title}, {caption}"
    return scene.figure(REBUILT_ID, "From tokens", motion.joints, system.name, told, ghost_of=ORIGINAL_ID)


def _track(
    services: Services, held: Session, levels: Sequence[Any], marks: Sequence[Any] | None = None, marked: str = ""
) -> Json:
    system = system_of(services, held)
    spans = [held.found.spans.get(scale) for scale in range(1, len(levels) + 1)]
    assert held.tokenized is not None
    frames = held.tokenized.motion.frames
    return score(system, frames, levels, services.palettes(system.name), spans=spans, marks=marks, marked=marked)


def _scene(services: Services, held: Session, figures: list[Json], track: Json, strips: Sequence[Json] = ()) -> Json:
    shown = f"{held.example}|{held.source and held.source.title}|{held.start}|{held.part}|{held.system}|{held.caption}"
    others = [one.track(services) for one in companions(services, held)]
    return scene.payload(figures, [track, *others], strips=strips, scene=shown)
