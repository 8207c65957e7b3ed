"""A visitor's endless motion: the session behind it, what was said when, and the pieces that go to the stage."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from playground.errors import PlaygroundError
from playground.figures import stage as scene
from playground.limits import LIMITS
from playground.systems import checkpoint_path, row_of
from playground.text.prompts import normalise
from playground.text.rewriting import Rewritten
from playground.ui.cards import term
from playground.ui.facts import Fact, significant, table
from playground.ui.services import Services
from playground.ui.view import View

if TYPE_CHECKING:
    from playground.engine.endless import EndlessSession, Seams
    from playground.tokenizers.token_file import LevelTokens

SYSTEM = "mogo"
PIECE = 1.0  # seconds of motion that are made at once
AHEAD = 2 * LIMITS.fps  # frames before the end of what is there at which the stage asks for more
WINDOW = 12 * LIMITS.fps  # frames that the browser keeps
SWITCHES = 4  # that are listed
MARK = " | "  # between the instructions that follow, as text
NOT_HERE = (
    "motion without end needs the system MOGO, which is not trained here yet; the command "
    '"make others" trains it, and then it moves here'
)


@dataclass(frozen=True)
class Said:
    """One instruction and the frame from which it holds."""

    frame: int
    prompt: str

    def __str__(self) -> str:
        return f"{round(self.frame / LIMITS.fps, 2):g} {self.prompt}"


@dataclass
class Walk:
    """What one visit keeps: the newest instructions alone, however long it goes on."""

    session: "EndlessSession | None" = None
    run: int = 0  # how often it was started
    said: list[Said] = field(default_factory=list)
    planned: list[Said] = field(default_factory=list)

    def begin(self, services: Services, prompt: str, seed: float, then: str, play: bool) -> View:
        """Start anew with an instruction and those that follow, and give the first piece.

        play: whether it plays in any case, because the visitor asked for it.
        """
        planned = read_plan(then)
        words = clean(prompt)
        self.session = _session(services, words, whole_seed(seed))
        self.run, self.said, self.planned = self.run + 1, [Said(0, words)], planned
        return self.onward(services, play)

    def say(self, prompt: str) -> Said:
        """The next instruction, from the first frame on that is not drawn yet. What was planned is given up."""
        if self.session is None:
            raise PlaygroundError("nothing is moving yet; press Start first")
        said = self._say(clean(prompt))
        self.planned = []
        return said

    def onward(self, services: Services, play: bool = False) -> View:
        """The next piece."""
        session = self.session
        if session is None:
            raise PlaygroundError("this motion has ended; press Start to begin another one")
        while self.planned and self.planned[0].frame <= session.drawn:
            self._say(self.planned.pop(0).prompt)
        first = session.frames
        motion = session.advance(PIECE)
        last = first + motion.frames
        seen = [one for one, after in zip(self.said, [*self.said[1:], None], strict=True)
                if after is None or after.frame > first - WINDOW]  # fmt: skip
        grows = scene.growing(first, WINDOW, AHEAD, play)
        block = payload(services, motion.joints, session.levels(first, last), seen, f"endless {self.run}", grows)
        return _view(block, session.seams())

    def following(self) -> str:
        """What followed and what is to follow, as text that `read_plan` reads."""
        return write_plan([*self.said[1:], *self.planned])

    def _say(self, words: str) -> Said:
        assert self.session is not None
        said = Said(self.session.say(words), words)
        self.said = [*(one for one in self.said if one.frame != said.frame), said][-LIMITS.max_listed :]
        return said


def is_here(services: Services) -> bool:
    """Whether the system that can do this is shipped with this copy."""
    return checkpoint_path(services.engine().assets, SYSTEM, "generator").is_file()


def _session(services: Services, words: str, seed: int) -> "EndlessSession":
    try:
        return services.engine().endless(words, system=SYSTEM, seed=seed)
    except PlaygroundError as error:
        raise (error if is_here(services) else PlaygroundError(NOT_HERE)) from error


def payload(
    services: Services,
    joints: Any,
    levels: Sequence["LevelTokens"],
    said: Sequence[Said],
    name: str,
    growing: scene.Json | None = None,
) -> scene.Json:
    """A piece of the motion, or a whole one, as the stage takes it."""
    row, palettes = row_of(SYSTEM), services.palettes(SYSTEM)
    rows = [scene.level(one.ids, one.codes, colors) for one, colors in zip(levels, palettes, strict=False)]
    figure = scene.figure("walker", row.title, joints, SYSTEM)
    track = scene.track(SYSTEM, row.title, len(joints), rows)
    ribbon = [(one.frame, one.prompt) for one in said if one.frame < (growing or {"first": 0})["first"] + len(joints)]
    return scene.payload([figure], [track], scene=name, growing=growing, ribbon=ribbon)


def opening(services: Services, prompts: Sequence[str], seconds: int) -> View:
    """A stored look at it: the prompts for so many seconds each, as one motion that plays in a loop."""
    session = _session(services, prompts[0], 0)
    said, parts = [Said(0, prompts[0])], [session.advance(PIECE).joints for _ in range(seconds)]
    for prompt in prompts[1:]:
        said.append(Said(session.say(prompt), prompt))
        parts += [session.advance(PIECE).joints for _ in range(seconds)]
    joints = np.concatenate(parts)
    block = payload(services, joints, session.levels(0, len(joints)), said, "endless, opening")
    return _view(block, session.seams())


def _view(block: scene.Json, seams: "Seams") -> View:
    return View(stage=block, facts=seam_facts(seams), controls={"switches": switches_html(seams)})


def seam_facts(seams: "Seams") -> tuple[Fact, ...]:
    """Jerk at the switches against jerk elsewhere, and what it was measured on."""
    title, many = row_of(seams.system).title, "" if seams.count == 1 else "es"
    on = (
        f"{term('jerk')} Measured here on {significant(seams.frames / LIMITS.fps, 3)} s of {title} (checkpoint "
        f"{seams.checkpoint}, seed {seams.seed}), {seams.count} switch{many}."
    )
    near = "no switch yet" if seams.at_switches is None else f"{significant(seams.at_switches)} m/s³"
    far = "–" if seams.elsewhere is None else f"{significant(seams.elsewhere)} m/s³"
    made = significant(seams.frames / LIMITS.fps, 3)
    return Fact(near, "jerk at switches", on), Fact(far, "jerk elsewhere", on), Fact(f"{made} s", "made so far")


def switches_html(seams: "Seams") -> str:
    """The newest switches: second, instruction, jerk there. "" where there is none."""
    rows = [
        [one.prompt, f"{one.frame / LIMITS.fps:.1f}", "to come" if one.jerk is None else significant(one.jerk)]
        for one in seams.switches[-SWITCHES:][::-1]
    ]
    if not rows:
        return ""
    told = f"The newest {len(rows)} of {seams.count} switches" if seams.count > len(rows) else "Switches, newest first"
    return table(["Instruction", "from, s", "jerk, m/s³"], rows, told)


def clean(prompt: str) -> str:
    """An instruction as it may stand in a plan. PlaygroundError if it is none."""
    return normalise(normalise(prompt).replace("|", ","))


def whole_seed(seed: float) -> int:
    """PlaygroundError unless it is a whole number."""
    if seed is None or int(seed) != seed:
        raise PlaygroundError(f"the seed must be a whole number from 0 to {LIMITS.max_seed}")
    return int(seed)


def read_plan(text: str) -> list[Said]:
    """Instructions that follow, "4 a person jumps | 8.2 a person sits". PlaygroundError for any other text."""
    found: list[Said] = []
    for part in filter(None, map(str.strip, (text or "").split("|"))):
        second, _, prompt = part.partition(" ")
        try:
            frame = round(float(second) * LIMITS.fps)
        except (ValueError, OverflowError):
            raise PlaygroundError(f'"{part[:40]}" begins with no second; write such as: 4 a person jumps') from None
        if not frame > (found[-1].frame if found else 0):
            raise PlaygroundError(f'"{part[:40]}" begins too early; each instruction begins after the one before')
        found.append(Said(frame, clean(prompt)))
    if len(found) > LIMITS.max_listed:
        raise PlaygroundError(f"{len(found)} instructions follow; at most {LIMITS.max_listed} are accepted")
    return found


def write_plan(said: Sequence[Said], most: int = 2_000) -> str:
    """The same as text, as many of them as fit into an address."""
    text = ""
    for one in said:
        longer = f"{text}{MARK if text else ''}{one}"
        if len(longer) > most:
            break
        text = longer
    return text


def plan_of_steps(found: Rewritten) -> str:
    """The steps of a rewritten prompt after the first, each when the ones before it are over."""
    said: list[Said] = []
    at = 0.0
    for step, before in zip(found.steps[1:], found.steps, strict=False):
        at += before.seconds
        said.append(Said(round(at * LIMITS.fps), clean(step.text)))
    return write_plan(said)
