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
from playground.ui.energy import energy_bars
from playground.ui.facts import Fact, millimetres
from playground.ui.scenes import MPJPE_CARD, score, token_facts
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
    caption: str = ""
    tokenized: "Tokenized | None" = None
    upload: Source | None = None  # stays in the menu when an example is chosen
    system: str = ""  # "" for the one the page prefers
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
    if not session.system:
        return services.default_system()
    for system in services.engine().systems():
        if system.name == session.system and system.checkpoint == "shipped":
            return system
    raise PlaygroundError(f"the system {session.system} is not shipped with this copy; choose another one")


def ready(services: Services, session: Session) -> Session:
    """The session with its motion tokenized."""
    if session.source is None:
        raise PlaygroundError(NO_MOTION)
    if session.tokenized is not None:
        return session
    window, name = session.source.window(session.start), system_of(services, session).name
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
    return _scene(held, [_original(tokenized), rebuilt], _track(services, held, tokenized.levels))


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
    return _scene(held, figures, _track(services, held, swap.levels, marks, "replaced"), [strip])


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
    strips = [] if found is None else [_attention_strip(found)]
    return _scene(held, figures, track, strips)


def _attention_strip(found: "Attention") -> Json:
    words, weights = readable_words(found.words, found.weights)
    return scene.strip("attention", "Which words the detokenizer looks at", "of its attention", words, weights.T)


def readable_words(pieces: Sequence[str], weights: NDArray[np.float32]) -> tuple[list[str], NDArray[np.float32]]:
    """Word pieces as words [W'], their weights [F, W'] added up, in order; the encoder's marks are put in plain words.

    "##ing" continues the word before it (WordPiece).
    """
    names: list[str] = []
    columns: list[NDArray[np.float32]] = []
    for n, piece in enumerate(pieces):
        if piece.startswith("##") and names:
            names[-1] += piece[2:]
            columns[-1] = columns[-1] + weights[:, n]
            continue
        names.append({"[CLS]": "(begin)", "[SEP]": "(end)"}.get(piece, piece))
        columns.append(weights[:, n])
    return names, np.stack(columns, axis=1)


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


def _scene(held: Session, figures: list[Json], track: Json, strips: Sequence[Json] = ()) -> Json:
    shown = f"{held.example}|{held.source and held.source.title}|{held.start}|{held.system}|{held.caption}"
    return scene.payload(figures, [track], strips=strips, scene=shown)
