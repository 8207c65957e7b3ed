"""What the room Edit asks for and shows: a source, the frames to draw anew, before and after with their seams."""

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from playground.errors import PlaygroundError
from playground.figures import stage as scene
from playground.figures.stage import Json
from playground.limits import LIMITS
from playground.motion.motion import Motion
from playground.results import Generation, Tokenized
from playground.systems import row_of
from playground.ui.comparing import EDIT_TITLES
from playground.ui.drawing import MADE, made_again
from playground.ui.facts import Fact, significant, table
from playground.ui.scenes import score
from playground.ui.services import Services
from playground.ui.state import OWN_FILE, control
from playground.ui.uploads import Source, checked_number
from playground.ui.view import View

if TYPE_CHECKING:
    from playground.findings import Edited

NAME = "edit"
OPENING = "clip-walk"  # the room opens with it: raising the arms there moves them farthest of what was tried
BEFORE, AFTER = "before", "after"
_DOES = {
    "inpaint": "The span is drawn anew between what comes before and after.",
    "outpaint": "The span stays; everything around it is drawn anew.",
    "prefix": "What comes before the span stays; the rest is drawn as its continuation.",
    "suffix": "What comes after the span stays; the way there is drawn.",
    "inbetween": "As in-painting, and no token that reaches into the span is kept.",
}
KINDS = {kind: (title, _DOES[kind]) for kind, title in EDIT_TITLES.items()}  # kind -> (name, what it does, in a line)
SEAM_CARD = (
    "The harder one of the seams: how much a joint is pushed where kept and drawn frames meet, the mean over joints of "
    "|x[f+1] - 2 x[f] + x[f-1]|. A motion has such pushes of its own; the table says how large they were there before."
)
ANEW_CARD = "Tokens that the generator drew again; the others hold the codes they had, at every scale."
KEPT_CARD = "Frames that are the source's own, copied back after decoding: equal to the last digit."


@dataclass(frozen=True)
class EditWish:
    """What is asked, checked. span in frames; None is the span of the published benchmark."""

    prompt: str
    kind: str
    span: tuple[int, int] | None
    seed: int
    guidance: float
    cfg: float
    anchor: str
    measured: bool

    @classmethod
    def checked(
        cls, prompt: object, kind: object, start: object, stop: object, seed: object, g: object, s: object,
        anchor: object, measured: object,
    ) -> "EditWish":  # fmt: skip
        """From the controls as they come; PlaygroundError with one sentence for what does not fit."""
        if kind not in KINDS:
            raise PlaygroundError(f"the edit is one of {', '.join(KINDS)}")
        span = None
        if start is not None and stop is not None:
            edges = [checked_number(n, f"the {e} of the span", 0, LIMITS.max_seconds)
                     for n, e in ((start, "start"), (stop, "end"))]  # fmt: skip
            span = round(edges[0] * LIMITS.fps), round(edges[1] * LIMITS.fps)
            if span[1] <= span[0]:
                raise PlaygroundError("the span ends before it begins; give a later end")
        number = int(checked_number(seed, "the seed", 0, LIMITS.max_seed))
        guidance = checked_number(g, "the decoder's guidance", 0, LIMITS.max_guidance)
        cfg = checked_number(s, "the generator's guidance", 0, LIMITS.max_guidance)
        return cls(str(prompt or ""), str(kind), span, number, guidance, cfg, str(anchor), measured is True)


@dataclass(frozen=True, eq=False)
class EditSession:
    """What one visitor edits: the motion by the name that the address has for it, and its tokens."""

    name: str = ""
    title: str = ""
    caption: str = ""
    base: Tokenized | Generation | None = None
    upload: Source | None = None
    start: float = 0.0  # second at which the window of a long file begins
    system: str = ""  # that edits; "" for the one the page prefers


def editor_of(services: Services, wanted: str | None) -> tuple[str, str]:
    """The system that edits where this one is wanted, and a sentence where it is another one."""
    usual = services.system()
    if wanted is None or wanted in [one.name for one in services.editors()]:
        return wanted or usual.name, ""
    return usual.name, f"{row_of(wanted).title} cannot edit here; this is {usual.title}."


def opening_motion(services: Services) -> str:
    """The id of the example that the room opens with."""
    return OPENING if OPENING in {one.id for one in services.examples()} else services.opening_example().id


def open_source(
    services: Services, held: EditSession, name: str, caption: str | None = None, start: float = 0.0
) -> EditSession:
    """A motion of the library, the visitor's own file or a generated motion, tokenized. caption None: its own; start:
    second of a long file at which the window begins."""
    held = replace(held, start=start if name.startswith(OWN_FILE) else 0.0)
    system = services.system(held.system).name
    if name.startswith(MADE):
        made = made_again(services, name, caption or "", system)
        base: Tokenized | Generation = made
        if made.system != system:  # another system's motion is read as tokens first, as any other motion is
            base = services.engine().tokenize(made.motion, made.prompt, system=system)
        return replace(held, name=name, title=made.prompt or "A generated motion", caption=made.prompt, base=base)
    if name.startswith(OWN_FILE):
        if held.upload is None:
            raise PlaygroundError(
                f"this link was made with a file of its maker's own, {name.removeprefix(OWN_FILE)}; upload it"
            )
        motion, title, own = held.upload.window(held.start), held.upload.title, held.upload.caption
    else:
        found = services.example(name)
        motion, title, own = found.motion(), found.title, found.caption
    text = own if caption is None else caption
    read = services.engine().tokenize(motion, text, system=system)
    return replace(held, name=name, title=title, caption=read.caption, base=read)


def source_view(services: Services, session: EditSession) -> View:
    """The motion before anything is done to it."""
    began = time.perf_counter()
    base = _base(session)
    system = services.system(session.system)
    figure = scene.figure(BEFORE, "Before", base.motion.joints, None, session.title)
    track = score(system, base.motion.frames, base.levels, services.palettes(system.name))
    shown = f"source {session.name} {session.start:g} {base.motion.frames} {system.name}"
    stage = scene.payload([figure], [track], scene=shown)
    return View(stage=stage, seconds=max(base.seconds, time.perf_counter() - began))


def run(services: Services, session: EditSession, wish: EditWish) -> View:
    """The edit of the session's motion: before and after in sync, kept frames hatched."""
    base = _base(session)
    edited = services.engine().edit(
        base, wish.span, wish.prompt, wish.seed, wish.kind, anchor=wish.anchor, measured=wish.measured,
        guidance=wish.guidance, cfg=wish.cfg,
    )  # fmt: skip
    start, stop = (edge / LIMITS.fps for edge in edited.span)
    return View(
        stage=edited_scene(services, session, edited),
        facts=edit_facts(edited),
        controls={"motion": session.name, "caption": session.caption, "prompt": edited.prompt, "kind": edited.kind,
                  "from": start, "to": stop, "seams": seam_table(edited), "promise": edited.promise},
        seconds=edited.seconds,
    )  # fmt: skip


def edited_scene(services: Services, session: EditSession, edited: "Edited") -> Json:
    """Both motions on one clock, with the score of the new one; tokens that were drawn anew are marked."""
    system = services.system(session.system)
    figures = [
        scene.figure(BEFORE, "Before", edited.source.joints, None, session.title),
        scene.figure(AFTER, "After", edited.motion.joints, edited.system, f"“{edited.prompt}”", ghost_of=BEFORE),
    ]
    track = score(
        system, edited.motion.frames, edited.levels, services.palettes(system.name), marks=edited.redrawn,
        marked="drawn anew",
    )  # fmt: skip
    shown = f"edited {session.name} {edited.span} {edited.kind} {system.name}"
    return scene.payload(figures, [track], hatch=scene.spans_of(edited.kept), scene=shown)


def edit_facts(edited: "Edited") -> tuple[Fact, ...]:
    """Frames kept, tokens drawn anew, the hardest seam."""
    anew, all_tokens = sum(int(mask.sum()) for mask in edited.redrawn), sum(level.size for level in edited.levels)
    facts = [
        Fact(f"{int(edited.kept.sum())}/{len(edited.kept)}", "frames kept", KEPT_CARD),
        Fact(f"{anew}/{all_tokens}", "tokens anew", ANEW_CARD),
    ]
    if edited.seams:
        worst = max(edited.seams, key=lambda seam: seam.jolt_mm)
        facts.append(Fact(f"{significant(worst.jolt_mm)} mm", "seam", SEAM_CARD))
    return tuple(facts)


def seam_table(edited: "Edited") -> str:
    """One row a border, and what the numbers were measured on."""
    rows = [
        [
            f"{seam.frame / LIMITS.fps:.2f} s",
            *(significant(v) for v in (seam.jolt_mm, seam.unblended_mm, seam.source_mm)),
        ]
        for seam in edited.seams
    ]
    caption = f"Push at each seam in mm. This clip, {edited.system}, seed {edited.seed}"
    return table(["seam at", "after", "not blended", "before"], rows, caption)


def file_name(source: Source) -> str:
    """The visitor's own file as the value of `motion`, as state.js writes it."""
    kept = "".join(c if c.isascii() and (c.isalnum() or c in " _.+-") else "_" for c in source.title)
    return OWN_FILE + kept[-60:].lstrip(" .+-")


def opening_view(services: Services) -> View:
    """The room's first result: somebody who walks raises both arms on the way."""
    session = open_source(services, EditSession(), opening_motion(services))
    own = services.sampling()
    prompt = str(control(NAME, "prompt").default)
    return run(services, session, EditWish(prompt, "inpaint", None, 0, own.guidance, own.cfg, "place", False))


def _base(session: EditSession) -> Tokenized | Generation:
    if session.base is None:
        raise PlaygroundError("choose a motion, upload one or take your last generation first")
    return session.base


def motion_of(session: EditSession) -> Motion:
    """The motion that is edited."""
    return _base(session).motion
