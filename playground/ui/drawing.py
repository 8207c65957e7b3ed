"""What the room Generate asks for and keeps: a wish, its motions scale by scale, changes to them, the visit's history.

A result is one wish drawn with one or several seeds. A `Change` draws one of its motions anew from a scale on, with one
token forced or with another seed; the address holds changes as `3.5.112_6.s17` (scale 3, position 5, code 112; then
from scale 6 on with seed 17).
"""

import re
import time
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.results import Generation, GenerationStep
from playground.systems import SYSTEMS, SamplingDefaults
from playground.text.prompts import normalise
from playground.ui.services import Services
from playground.ui.state import State
from playground.ui.uploads import checked_number

if TYPE_CHECKING:
    from playground.findings import Alignment

WISHES = (  # keys of CONTROLS
    "prompt", "free", "seconds", "seed", "g", "s", "temperature", "topk", "topp", "takes", "plant",
    "system",
)  # fmt: skip
MADE = "made_"  # how the value of `motion` begins that stands for a generated motion
MAX_NAME = 80  # characters of that value
MAX_CHANGES = 6  # of one motion, one after the other; what the address has room for
_CHANGE = re.compile(r"([1-9][0-9]?)\.(?:([0-9]{1,3})\.([0-9]{1,5})|s([0-9]{1,10}))")


@dataclass(frozen=True)
class Wish:
    """What is asked of the generator, checked."""

    prompt: str | None
    seconds: float
    seed: int
    guidance: float
    cfg: float
    temperature: float
    top_k: float
    top_p: float
    takes: int = 1  # motions side by side, with seeds seed, seed + 1, ...
    plant: bool = False  # does the root refiner compute the way over the ground?
    system: str = ""  # "" for the one the page prefers

    @classmethod
    def checked(cls, prompt: object, free: object, *numbers: object) -> "Wish":
        """From the controls as they come; PlaygroundError with one sentence for what does not fit."""
        words = None if free is True else normalise(prompt)  # type: ignore[arg-type]
        bounds = (
            ("the length in seconds", LIMITS.min_seconds, LIMITS.max_seconds),
            ("the seed", 0, LIMITS.max_seed),
            ("the decoder's guidance", 0, LIMITS.max_guidance),
            ("the generator's guidance", 0, LIMITS.max_guidance),
            ("the temperature", 0, LIMITS.max_temperature),
            ("top-k", 0.01, 1),
            ("top-p", 0.05, 1),
            ("the number of motions side by side", 1, LIMITS.max_seeds),
        )
        given, (plant, system) = (*numbers, 1)[: len(bounds)], (*numbers[len(bounds) :], False, "")[:2]
        sure = [checked_number(n, *bound) for n, bound in zip(given, bounds, strict=True)]
        return cls(
            words, sure[0], int(sure[1]), sure[2], sure[3], sure[4], sure[5], sure[6], int(sure[7]), plant is True,
            str(system or ""),
        )  # fmt: skip

    @property
    def seeds(self) -> tuple[int, ...]:
        """The seed of every motion."""
        return self.seeds_of(self.seed, self.takes)

    @staticmethod
    def seeds_of(seed: int, takes: int) -> tuple[int, ...]:
        """So many seeds from one on, all within the limit."""
        first = min(seed, LIMITS.max_seed - takes + 1)
        return tuple(range(first, first + takes))

    @property
    def sampling(self) -> SamplingDefaults:
        """The numbers of the draw and the decode."""
        return SamplingDefaults(self.guidance, self.cfg, self.temperature, self.top_k, self.top_p)


@dataclass(frozen=True)
class Change:
    """A motion drawn anew from a scale (from 1) on: with a code forced at a position (from 0), or with another seed."""

    scale: int
    position: int | None = None
    code: int | None = None
    seed: int | None = None

    def __str__(self) -> str:
        return f"{self.scale}.s{self.seed}" if self.code is None else f"{self.scale}.{self.position}.{self.code}"

    @property
    def words(self) -> str:
        """What was done, for people, who count tokens from 1."""
        if self.code is None:
            return f"drawn anew from scale {self.scale}, seed {self.seed}"
        return f"scale {self.scale}, token {(self.position or 0) + 1} set to code {self.code}"


def read_changes(text: object) -> tuple[Change, ...]:
    """The changes that an address holds; none where it holds anything else."""
    parts = str(text or "").split("_")
    found = [match for match in map(_CHANGE.fullmatch, parts) if match]
    if len(found) != len(parts) or len(parts) > MAX_CHANGES:
        return ()
    numbers = [[None if one is None else int(one) for one in match.groups()] for match in found]
    return tuple(Change(scale or 1, position, code, seed) for scale, position, code, seed in numbers)


def write_changes(changes: Sequence[Change]) -> str:
    """The changes as the address holds them, "" for none."""
    return "_".join(map(str, changes))


@dataclass(frozen=True, eq=False)
class Result:
    """A finished wish: one motion a seed; after a change the one motion that was changed, and what it was before."""

    wish: Wish
    takes: tuple[Generation, ...]
    changes: tuple[Change, ...] = ()
    before: Generation | None = None

    @property
    def title(self) -> str:
        """Its words, for the list of the visit."""
        return self.wish.prompt or "no prompt"

    @property
    def tail(self) -> str:
        """What tells it from other results of the same words."""
        first, last = self.takes[0].seed, self.takes[-1].seed
        changed = f", changed at scale {self.changes[-1].scale}" if self.changes else ""
        return f"seed {first}" + (f" to {last}" if last != first else "") + changed

    @property
    def address(self) -> dict[str, object]:
        """Key of the table of controls -> value, as the room shows this result."""
        wish = self.wish
        own = (wish.prompt or "", wish.prompt is None, wish.seconds, wish.seed, wish.guidance, wish.cfg,
               wish.temperature, wish.top_k, wish.top_p, wish.takes, wish.plant, self.takes[0].system)  # fmt: skip
        return dict(zip(WISHES, own, strict=True))


@dataclass(eq=False)
class Visit:
    """What one visitor made, newest last, and the one object that a running generation and "Stop" share."""

    stop: bool = False
    halted: bool = False  # whether the motion on the screen was stopped on its way
    results: list[Result] = field(default_factory=list)
    shown: Result | None = None
    take: int = 0  # which motion's tokens are on the score
    wanted: tuple[Change, ...] = ()  # of a link, to be made after its wish
    picked: str = ""  # the code that was clicked in the card of a token, "" for none
    token: tuple[int, int] | None = None  # (scale, position) that the card is about
    words: bool = False  # whether the score shows which words each moment looked at
    looked: "tuple[Generation, Alignment] | None" = None  # what was looked at last

    def keep(self, result: Result) -> None:
        """Put a result on the screen and into the history, the oldest making room."""
        self.results = [*self.results, result][-LIMITS.history :]
        self.halted = False
        self.shown, self.take = result, min(self.take, len(result.takes) - 1)

    def open(self, place: int) -> Result:
        """Bring back a result of the visit. PlaygroundError if it is not kept any more."""
        if not 0 <= place < len(self.results):
            raise PlaygroundError("that result is not kept any more; generate it again")
        self.shown, self.take, self.token, self.halted = self.results[place], 0, None, False
        return self.results[place]


@dataclass(frozen=True, eq=False)
class Drawing:
    """A run on its way: what is known after some scales, and the result once all are there."""

    wish: Wish
    steps: tuple[GenerationStep, ...]  # one a seed
    seconds: float
    before: Generation | None = None  # the motion that is being changed
    result: Result | None = None  # with the last scale


def draw(services: Services, wish: Wish) -> Iterator[Drawing]:
    """A wish, scale by scale."""
    began = time.perf_counter()
    engine, system = services.engine(), services.system(wish.system)
    steps = engine.generate_many_steps(
        wish.prompt, wish.seconds, system.name, wish.seeds, guidance=wish.guidance, cfg=wish.cfg,
        temperature=wish.temperature, top_k=wish.top_k, top_p=wish.top_p,
    )  # fmt: skip
    for step in steps:
        taken = time.perf_counter() - began
        if not step[0].last:
            yield Drawing(wish, step, taken)
            continue
        finished = partial(_finish, services, wish, taken)
        takes = tuple(finished(one, seed) for one, seed in zip(step, wish.seeds, strict=True))
        yield Drawing(wish, step, taken, result=Result(wish, takes))


def change(services: Services, result: Result, take: int, wanted: Change) -> Iterator[Drawing]:
    """One motion of a result drawn anew from a scale on, scale by scale. PlaygroundError after too many changes."""
    began = time.perf_counter()
    changes = (*result.changes, wanted)
    if len(changes) > MAX_CHANGES:
        raise PlaygroundError(f"a motion can be changed {MAX_CHANGES} times in a row; generate a new one to go on")
    old = result.takes[take]
    wish = replace(result.wish, seed=old.seed if not result.changes else result.wish.seed, takes=1)
    engine, count = services.engine(), len(old.levels)
    for step in engine.regenerate_steps(old, wanted.scale, wanted.position, wanted.code, wanted.seed):
        taken = time.perf_counter() - began
        if step.level < wanted.scale:
            continue  # as it was
        if step.level < count:
            yield Drawing(wish, (step,), taken, old)
            continue
        made = _finish(services, wish, taken, step, old.seed if wanted.seed is None else wanted.seed)
        yield Drawing(wish, (step,), taken, old, Result(wish, (made,), changes, old))


def wish_values(services: Services, state: State) -> tuple[Any, ...]:
    """What the address of the room Generate asks for, in the order of `Wish.checked`; the system that the page prefers
    where the one asked for cannot generate here."""
    able = {system.name for system in services.shipped("generator")}
    system = state.system if state.system in able else services.system().name
    usual = dict(zip(("g", "s", "temperature", "topk", "topp"), astuple(services.sampling(system)), strict=True))
    values = {key: state.values.get(key, usual.get(key, state[key])) for key in WISHES}
    return tuple((values | {"plant": values["plant"] and services.refines(), "system": system}).values())


def made_name(wish: Wish, seed: int, changes: Sequence[Change] = ()) -> str:
    """A generated motion as the value of `motion` in an address: all that it takes to draw it again but its prompt; the
    system only where the wish names it. "" where that is more than an address has room for.
    """
    numbers = (wish.seconds, wish.guidance, wish.cfg, wish.temperature, wish.top_k, wish.top_p)
    parts = [str(seed), *(repr(round(float(number), 3)).removesuffix(".0") for number in numbers)]
    name = MADE + "_".join([*parts, *filter(None, [wish.system]), *map(str, changes)])
    return name if len(name) <= MAX_NAME else ""


def read_name(name: str, prompt: str) -> tuple[Wish, tuple[Change, ...]]:
    """The wish and the changes that `made_name` names. PlaygroundError for any other name."""
    parts = name.removeprefix(MADE).split("_")
    try:
        seed, numbers = int(parts[0]), [float(part) for part in parts[1:7]]
        system = parts.pop(7) if len(parts) > 7 and parts[7] in SYSTEMS else ""
        changes = read_changes("_".join(parts[7:])) if parts[7:] else ()
        if not name.startswith(MADE) or len(numbers) != 6 or len(changes) != len(parts[7:]):
            raise ValueError(name)
    except ValueError:
        raise PlaygroundError("this link names no motion that can be drawn again; choose another one") from None
    return replace(Wish.checked(prompt, not prompt, numbers[0], seed, *numbers[1:]), system=system), changes


def made_again(services: Services, name: str, prompt: str, usual: str = "") -> Generation:
    """The motion that `made_name` names, by the system `usual` where it names none. PlaygroundError for other names."""
    wish, changes = read_name(name, prompt)
    result = last_of(draw(services, replace(wish, system=wish.system or usual)))
    for wanted in changes:
        result = last_of(change(services, result, 0, wanted))
    return result.takes[0]


def last_of(drawings: Iterator[Drawing]) -> Result:
    """The result at the end of a run."""
    *_, last = drawings
    assert last.result is not None
    return last.result


def _finish(services: Services, wish: Wish, seconds: float, step: GenerationStep, seed: int) -> Generation:
    system = services.system(wish.system).name
    made = Generation(
        system, services.checkpoint(system), wish.prompt or "", seed, step.levels, step.entropy, step.motion,
        step.features, seconds, wish.sampling,
    )  # fmt: skip
    return services.engine().refine(made) if wish.plant else made
