"""What the room Compare does: one prompt, motion or edit through two to six settings or systems, how they differ.

A row of VARIATIONS is one thing that may differ; systems are a row like the others and appear as soon as a second one
is shipped. `settings_of` gives the settings of a wish, `run` their results one after the other.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.measures import foot_sliding, mpjpe
from playground.motion.motion import Motion
from playground.systems import DEFAULT_SYSTEM, SystemInfo, row_of
from playground.text.prompts import normalise
from playground.tokenizers.token_file import LevelTokens
from playground.ui.facts import bits
from playground.ui.services import SIDE_BY_SIDE, Services
from playground.ui.state import State, control
from playground.ui.uploads import checked_number

PROMPT, MOTION, EDIT = "prompt", "motion", "edit"
WRONG = "a person lies down"
EDIT_TITLES = {  # kind of edit -> its name
    "inpaint": "In-painting", "outpaint": "Out-painting", "prefix": "Prefix", "suffix": "Suffix",
    "inbetween": "In-between",
}  # fmt: skip
ALONE = "scales"  # what differs where there is one system only
DRAWN = (DEFAULT_SYSTEM, "momask", "t2mgpt-casim")  # from a prompt
Choices = Callable[[Services], Sequence[tuple[str, str]]]


@dataclass(frozen=True)
class Setting:
    """One way to make a motion from a prompt, or to send a motion through tokens."""

    name: str = ""
    system: str = ""
    text: str = ""  # the prompt, or the motion's caption; for an edit what should happen
    seconds: float = 0.0
    seed: int = 0
    cfg: float = 0.0
    temperature: float = 1.0
    guidance: float = 0.0
    scales: int | None = None  # None: all
    kind: str = ""  # of an edit
    span: tuple[float, float] | None = None  # of an edit, in seconds; None is that of the published benchmark


@dataclass(frozen=True)
class Variation:
    """One thing that may differ. choices: (what the screen says, what the address says); usual: chosen at first."""

    title: str
    of: str  # PROMPT | MOTION | EDIT
    choices: Choices
    usual: tuple[str, ...]
    apply: Callable[[Setting, str], Setting]
    called: str = "{}"  # what one of them is called, from what the screen says of it

    @property
    def most(self) -> int:
        """Settings at once; the original motion takes one figure."""
        return LIMITS.max_figures - (self.of != PROMPT)


def _listed(*values: str) -> Choices:
    return lambda services: [(value, value) for value in values]


def _scales(services: Services) -> list[tuple[str, str]]:
    count = len(services.scales(services.default_system().name)) if services.shipped() else 0
    return [(str(n), str(n)) for n in range(1, count + 1)]


def _systems(drawing: bool) -> Choices:
    def shipped(services: Services) -> list[tuple[str, str]]:
        able = services.shipped("generator" if drawing else "tokenizer")
        return [(one.title, one.name) for one in able if drawing or not row_of(one.name).lends]  # no tokenizer twice

    return shipped


def _with_its_sampling(setting: Setting, system: str) -> Setting:
    own = row_of(system).sampling
    return replace(setting, system=system, cfg=own.cfg, guidance=own.guidance, temperature=own.temperature)


def _kinds(services: Services) -> list[tuple[str, str]]:
    return [(title, kind) for kind, title in EDIT_TITLES.items()]


_WORDS = {"own": "Its caption", "none": "No caption", "wrong": f"“{WRONG}”"}
VARIATIONS: dict[str, Variation] = {
    "system": Variation("Systems", MOTION, _systems(False), SIDE_BY_SIDE, lambda s, v: replace(s, system=v)),
    "scales": Variation(
        "Scales kept", MOTION, _scales, ("2", "5", "10"), lambda s, v: replace(s, scales=int(v)),
        "Scales 1 to {}"),
    "caption": Variation(
        "Caption", MOTION, lambda services: [(text, key) for key, text in _WORDS.items()], tuple(_WORDS),
        lambda s, v: s if v == "own" else replace(s, text=WRONG if v == "wrong" else "")),
    "g": Variation(
        "Guidance g, decoder", MOTION, _listed("0", "0.5", "1", "2", "3", "4", "6"), ("0", "2", "4"),
        lambda s, v: replace(s, guidance=float(v)),
        "g = {}"),
    "maker": Variation("Systems", PROMPT, _systems(True), DRAWN, lambda s, v: _with_its_sampling(s, v)),
    "seed": Variation(
        "Seed", PROMPT, _listed(*map(str, range(10))), ("0", "1", "2", "3"),
        lambda s, v: replace(s, seed=int(v)),
        "Seed {}"),
    "s": Variation(
        "Guidance s, generator", PROMPT, _listed("0", "1", "2", "3", "4", "6"), ("0", "3", "6"),
        lambda s, v: replace(s, cfg=float(v)),
        "s = {}"),
    "temperature": Variation(
        "Temperature", PROMPT, _listed("0", "0.5", "1", "1.5", "2"), ("0", "1", "2"),
        lambda s, v: replace(s, temperature=float(v)),
        "Temperature {}"),
    "redraw": Variation(
        "Seed", EDIT, _listed(*map(str, range(10))), ("0", "1", "2"),
        lambda s, v: replace(s, seed=int(v)),
        "Seed {}"),
    "kind": Variation("Kind", EDIT, _kinds, ("inpaint", "outpaint", "prefix"), lambda s, v: replace(s, kind=v)),
}  # fmt: skip


def offered(services: Services) -> list[tuple[str, str]]:
    """(title, key) of the variations that have at least two choices here."""
    of = {PROMPT: "from a prompt", MOTION: "of a motion", EDIT: "of an edit"}
    return [(f"{v.title}, {of[v.of]}", key) for key, v in VARIATIONS.items() if len(v.choices(services)) > 1]


def chosen(services: Services, vary: str, wanted: Sequence[str]) -> list[tuple[str, str]]:
    """The choices that are wanted, in their order on the screen; the usual ones where these are less than two, or the
    first."""
    variation = VARIATIONS[vary]
    choices = list(variation.choices(services))
    for names in (wanted, variation.usual):
        found = [choice for choice in choices if choice[1] in names]
        if len(found) > 1:
            return found
    return choices[: variation.most]


def variation_of(services: Services, wanted: object) -> str:
    """The variation that is wanted, or where it has nothing to choose from here, the number of scales."""
    return str(wanted) if wanted in [key for _, key in offered(services)] else ALONE


def first_variation(services: Services) -> str:
    """What differs when the room is opened: systems, where there are several."""
    return variation_of(services, control("compare", "vary").default)


def settings_of(
    services: Services, vary: str, values: Sequence[str], text: str, seconds: object = 4.0, seed: object = 0,
    kind: str = "inpaint", span: tuple[float, float] | None = None, system: str | None = None,
) -> list[Setting]:  # fmt: skip
    """The settings side by side. text: the prompt, or the caption of the motion; kind and span (seconds): of an edit;
    system: of all of them, where it can do that. PlaygroundError for a wrong number."""
    if vary not in VARIATIONS:
        raise PlaygroundError(f"what differs is one of {', '.join(VARIATIONS)}")
    variation, usual = VARIATIONS[vary], services.default_system()
    known = {name for _, name in variation.choices(services)}
    picked = [value for value in values if value in known]
    if not 2 <= len(picked) <= variation.most:
        raise PlaygroundError(f"choose 2 to {variation.most} of them to see side by side; {len(picked)} are chosen")
    words = text if variation.of == MOTION else normalise(text)
    long = checked_number(seconds, "the length in seconds", LIMITS.min_seconds, LIMITS.max_seconds)
    number = int(checked_number(seed, "the seed", 0, LIMITS.max_seed))
    whole = next((one for one in _able(services, vary) if one.name == system), usual)
    own = whole.sampling
    base = Setting("", whole.name, words, long, number, own.cfg, own.temperature, own.guidance)
    base = replace(base, guidance=0.0) if variation.of == MOTION else base
    base = replace(base, kind=kind, span=span) if variation.of == EDIT else base
    return [
        variation.apply(replace(base, name=variation.called.format(title)), name)
        for title, name in chosen(services, vary, picked)
    ]


def _able(services: Services, vary: str) -> list[SystemInfo]:
    """The systems that such a comparison can be made with; none but the usual one where its scales are chosen from."""
    if VARIATIONS[vary].of == MOTION:
        return services.readers() if vary == "g" else []
    return services.editors() if VARIATIONS[vary].of == EDIT else services.shipped("generator")


@dataclass(frozen=True, eq=False)
class Compared:
    """What one setting gave. error_mm: MPJPE to the original, or where there is none to the first result."""

    setting: Setting
    motion: Motion
    levels: tuple[LevelTokens, ...]
    error_mm: float | None
    seconds: float

    @property
    def tokens(self) -> int:
        """Tokens that were used."""
        return sum(level.size for level in self.levels)

    @property
    def bits(self) -> float:
        """What it takes to write them down."""
        return bits([level.size for level in self.levels], [level.codes for level in self.levels])

    @property
    def sliding(self) -> float:
        """Foot sliding in mm/s, nan where no toe touches the ground."""
        return foot_sliding(self.motion.joints)


def run(services: Services, settings: Sequence[Setting], source: Motion | None) -> Iterator[list[Compared]]:
    """The results so far, after each setting. source: the motion that goes through, None for motions from a prompt."""
    done: list[Compared] = []
    for system in {setting.system for setting in settings}:
        services.palettes(system)  # loads its models, so that no setting is timed with them
    for setting in settings:
        if source is None:
            done.append(_generated(services, setting, done))
        else:
            done.append((_edited if setting.kind else _rebuilt)(services, setting, source))
        yield list(done)


def _generated(services: Services, setting: Setting, done: Sequence[Compared]) -> Compared:
    began = time.perf_counter()
    made = services.engine().generate(
        setting.text, setting.seconds, setting.system, setting.seed, guidance=setting.guidance, cfg=setting.cfg,
        temperature=setting.temperature,
    )  # fmt: skip
    taken = time.perf_counter() - began
    error = mpjpe(done[0].motion.joints, made.motion.joints) if done else None
    return Compared(setting, made.motion, made.levels, error, taken)


def _rebuilt(services: Services, setting: Setting, source: Motion) -> Compared:
    engine = services.engine()
    tokenized = engine.tokenize(source, setting.text, system=setting.system)
    decoded = engine.reconstruct(tokenized, guidance=setting.guidance, scales=setting.scales)
    taken = tokenized.seconds + decoded.seconds
    return Compared(setting, decoded.motion, tokenized.levels[: setting.scales], decoded.mpjpe_mm, taken)


def _edited(services: Services, setting: Setting, source: Motion) -> Compared:
    began = time.perf_counter()
    span = None if setting.span is None else [round(edge * LIMITS.fps) for edge in setting.span]
    made = services.engine().edit(
        source, span, setting.text, setting.seed, setting.kind, system=setting.system, caption=source.caption,
        guidance=setting.guidance, cfg=setting.cfg,
    )  # fmt: skip
    error = mpjpe(made.source.joints, made.motion.joints)
    return Compared(setting, made.motion, made.levels, error, time.perf_counter() - began)


def span_of(state: State) -> tuple[float, float] | None:
    """The span of an edit that an address holds, in seconds, or None."""
    start, stop = state.values.get("from"), state.values.get("to")
    return None if start is None or stop is None or stop <= start else (float(start), float(stop))
