"""A parametric corpus of synthetic motions: every factor is known, every bone exact, planted feet stay put. numpy only.

    for item in corpus(100, seed=0): item.motion, item.captions, item.factors, item.action
    synthesise("walk", np.random.default_rng(1), speed=1.3, style="tired")

The same seed gives the same corpus; a longer corpus starts with the shorter one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion import gestures
from playground.motion.captions import Clause, captions, times
from playground.motion.gait import Stretch, Style, travel
from playground.motion.motion import Motion
from playground.motion.representation import canonicalise
from playground.motion.rig import Pose, joints_of, lower_to_reach

Array = NDArray[np.float64]
Overlay = Callable[[Pose, Array], None]

SHORTEST, LONGEST = 2.0, LIMITS.max_seconds
SIDES = ("left", "right", "both")
STYLES = {
    "neutral": Style(),
    "energetic": Style(speed=1.2, cadence=1.06, swing=1.5, bounce=1.4, lean=-0.02, elbow=0.35, out=0.05),
    "tired": Style(speed=0.8, cadence=0.97, swing=0.7, bounce=0.9, lean=0.18, nod=0.3, crouch=0.015),
    "proud": Style(speed=1.0, cadence=0.97, swing=1.15, lean=-0.08, nod=-0.1, out=0.16, width=0.015),
    "sad": Style(speed=0.75, cadence=0.95, swing=0.4, bounce=0.7, lean=0.12, nod=0.4),
    "old": Style(speed=0.65, cadence=1.12, swing=0.3, bounce=0.6, lean=0.26, nod=0.05, elbow=0.3, crouch=0.035, width=0.01),
}


@dataclass(frozen=True, eq=False)
class Synthetic:
    """One synthetic motion. factors: what was asked and what was drawn (seconds, style, speed in m/s, turn in degrees to
    the left, side, repetitions, ...); action: the key of ACTIONS."""

    motion: Motion
    captions: list[str]
    factors: dict[str, Any]
    action: str


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
        drawn = round(float(self.rng.uniform(low, high)), digits)
        self.factors[name] = float(self.given.pop(name, drawn))
        return float(self.factors[name])

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

    def stand(self, low: float, high: float) -> float:
        """Append a standing part; returns its length in seconds."""
        seconds = round(float(self.rng.uniform(low, high)), 2)
        self.parts.append(Stretch("stand", seconds))
        return seconds

    @property
    def now(self) -> float:
        """Seconds planned so far."""
        return float(sum(part.seconds for part in self.parts))

    def say(self, *options: tuple[str, str]) -> None:
        """Append a clause with its alternatives."""
        self.clauses.append(Clause(options))


def _pace(speed: float) -> tuple[str, str]:
    """Two words for a walking speed."""
    if speed < 0.8:
        return "slowly", "at a slow pace"
    if speed > 1.45:
        return "quickly", "at a brisk pace"
    return "", "at a normal pace"


def _join(*words: str) -> str:
    return " ".join(word for word in words if word)


def _style(draft: Draft) -> Style:
    draft.choice("style", tuple(STYLES), (5, 1, 1, 1, 1, 1))
    return draft.style


def _ends(draft: Draft) -> None:
    """Begin and end a trip standing or in the middle of a step."""
    draft.before = draft.choice("starts", ("moving", "standing"), (3, 2)) == "moving"
    draft.after = draft.choice("ends", ("moving", "standing"), (3, 2)) == "moving"


def _trip(draft: Draft, *parts: Stretch) -> None:
    if not draft.before:
        draft.stand(0.3, 0.7)
    draft.parts += parts
    if not draft.after:
        draft.stand(0.5, 0.9)


def walk(draft: Draft) -> None:
    """Straight ahead; factors speed, travel_seconds."""
    style = _style(draft)
    _ends(draft)
    speed = draft.value("speed", 0.75 * style.speed, 1.6 * style.speed)
    seconds = draft.value("travel_seconds", 2.4, 7.0)
    _trip(draft, Stretch("walk", seconds, speed))
    word, phrase = _pace(speed)
    draft.say(("walk", _join("forward", word)), ("walk", f"straight ahead {phrase}"), ("walk", _join(word, "forward")),
              ("take", _join("steps forward", word)), ("walk", f"in a straight line {phrase}"),
              ("walk", "forward"))  # fmt: skip


def run(draft: Draft) -> None:
    """Straight ahead, with flight between the steps; factors speed, travel_seconds."""
    draft.choice("style", ("neutral", "energetic", "tired"), (4, 1, 1))
    _ends(draft)
    speed = draft.value("speed", 2.0, 3.8)
    seconds = draft.value("travel_seconds", 2.0, 4.0)
    _trip(draft, Stretch("run", seconds, speed))
    verb = "jog" if speed < 2.5 else "sprint" if speed > 3.5 else "run"
    word = "slowly" if speed < 2.5 else "fast" if speed > 3.2 else ""
    draft.say(("run", "forward"), (verb, "forward"), ("run", _join(word, "straight ahead")), ("run", _join("forward", word)),
              (verb, "in a straight line"), ("run", ""))  # fmt: skip


def turn_walk(draft: Draft) -> None:
    """Walk along an arc or round a corner; factors speed, turn_degrees (left positive)."""
    style = _style(draft)
    _ends(draft)
    speed = draft.value("speed", 0.8 * style.speed, 1.4 * style.speed)
    size = round(float(draft.rng.uniform(45, 180)), 1) * float(draft.rng.choice([-1.0, 1.0]))
    turn = float(draft.given.pop("turn_degrees", size))
    draft.factors["turn_degrees"] = turn
    lead, tail = (round(float(x), 2) for x in draft.rng.uniform(0.6, 1.8, 2))
    bend = max(abs(turn) / 55.0, 1.0) * float(draft.rng.uniform(0.9, 1.3))
    _trip(draft, Stretch("walk", lead, speed), Stretch("walk", round(bend, 2), speed, np.radians(turn)),
          Stretch("walk", tail, speed))  # fmt: skip
    side = "left" if turn > 0 else "right"
    word, _ = _pace(speed)
    other = "counterclockwise" if turn > 0 else "clockwise"
    draft.say(("walk", f"forward and turns {side}"), ("walk", f"forward while turning to the {side}"),
              ("turn", f"{side} while walking"), ("walk", _join(word, f"and turns to the {side}")),
              ("walk", f"in a curve to the {side}"), ("curve", f"to the {side} on a {other} path"),
              ("walk", f"ahead and makes a {side} turn"))  # fmt: skip


def turn_place(draft: Draft) -> None:
    """Turn on the spot with small steps; factor turn_degrees (left positive)."""
    _style(draft)
    size = float(draft.rng.choice([90.0, 180.0, 360.0], p=[0.45, 0.45, 0.1])) * float(draft.rng.choice([-1.0, 1.0]))
    turn = float(draft.given.pop("turn_degrees", size + round(float(draft.rng.uniform(-8, 8)), 1)))
    draft.factors["turn_degrees"] = turn
    draft.stand(0.4, 0.9)
    draft.parts.append(Stretch("turn", round(max(abs(turn) / 75.0, 1.0) * float(draft.rng.uniform(0.9, 1.2)), 2), 0.0, np.radians(turn)))
    draft.stand(0.6, 1.4)
    side = "left" if turn > 0 else "right"
    amount = "a quarter turn" if abs(turn) < 135 else "a half turn" if abs(turn) < 270 else "a full turn"
    clock = "counterclockwise" if turn > 0 else "clockwise"
    draft.say(("turn", f"to the {side} on the spot"), ("make", f"{amount} to the {side}"), ("pivot", f"{side} in place"),
              ("turn", f"{clock} in place"), ("rotate", f"to the {side} with small steps"))  # fmt: skip


def side_step(draft: Draft) -> None:
    """Steps to one side, still facing forwards; factors side, speed."""
    _style(draft)
    side = draft.choice("side", ("left", "right"))
    speed = draft.value("speed", 0.25, 0.5)
    draft.stand(0.3, 0.7)
    draft.parts.append(Stretch("side", round(float(draft.rng.uniform(1.8, 4.5)), 2), speed, 0.0, np.pi / 2 if side == "left" else -np.pi / 2))
    draft.stand(0.5, 1.0)
    draft.say(("step", f"sideways to the {side}"), ("move", f"sideways to the {side}"), ("take", f"side steps to the {side}"),
              ("shuffle", f"to the {side} without turning"), ("walk", f"sideways to the {side}"))  # fmt: skip


def walk_back(draft: Draft) -> None:
    """Backwards, facing forwards; factor speed."""
    _style(draft)
    _ends(draft)
    speed = draft.value("speed", 0.45, 1.0)
    _trip(draft, Stretch("back", draft.value("travel_seconds", 2.2, 5.5), speed, 0.0, np.pi))
    word = "slowly" if speed < 0.6 else ""
    draft.say(("walk", "backwards"), ("walk", _join(word, "backward")), ("step", _join("backwards", word)),
              ("take", "several steps backwards"), ("move", "backward on foot"))  # fmt: skip


def _sides(draft: Draft) -> tuple[str, list[int]]:
    side = draft.choice("side", SIDES)
    return side, {"left": [0], "right": [1], "both": [0, 1]}[side]


def raise_hand(draft: Draft) -> None:
    """Lift the left, the right or both hands; factors side, place."""
    _style(draft)
    side, hands = _sides(draft)
    place = draft.choice("place", tuple(gestures.RAISED), (3, 3, 2, 2))
    move = draft.value("lift_seconds", 0.45, 0.95)
    total = max(float(draft.rng.uniform(2.0, 4.5)), 2.6 * move + 0.4)
    lowers = draft.choice("lowers", (True, False), (4, 1))
    start = float(draft.rng.uniform(0.1, 0.4))
    stop = total - float(draft.rng.uniform(0.05, 0.2)) if lowers else total + 5.0
    draft.parts.append(Stretch("stand", round(total, 2)))
    for hand in hands:
        late = float(draft.rng.uniform(0, 0.05))
        draft.overlays.append(lambda p, t, h=hand, d=late: gestures.raise_hand(p, t, start + d, stop, h, place, move))
    what = "both hands" if side == "both" else f"the {side} hand"
    arm = "both arms" if side == "both" else f"the {side} arm"
    end = " and lowers " + ("them" if side == "both" else "it") + " again" if lowers else " and keeps " + ("them" if side == "both" else "it") + " up"
    draft.say(("raise", what), ("lift", arm), ("raise", what + end), ("put", f"{what} up"), ("hold", f"{what} up in the air"),
              ("reach", f"up with {what}"))  # fmt: skip


def wave(draft: Draft) -> None:
    """Wave with the left, the right or both hands; factors side, repetitions, place."""
    _style(draft)
    side, hands = _sides(draft)
    place = draft.choice("place", tuple(gestures.WAVES), (3, 2, 2))
    count = int(draft.choice("repetitions", (2, 3, 4, 5, 6, 7, 8)))
    pace = float(draft.rng.uniform(1.4, 2.3)) * (0.75 if place == "wide" else 1.0) * min(draft.style.speed + 0.1, 1.1)
    start, move = float(draft.rng.uniform(0.1, 0.4)), float(draft.rng.uniform(0.4, 0.6))
    stop = start + 1.6 * move + count / pace
    total = min(max(stop + float(draft.rng.uniform(0.05, 0.4)), SHORTEST), LONGEST)
    draft.parts.append(Stretch("stand", round(total, 2)))
    size = float(draft.rng.uniform(0.8, 1.15))
    for hand in hands:
        draft.overlays.append(lambda p, t, h=hand: gestures.wave_hand(p, t, start, stop, h, place, count, size, move))
    what = "both hands" if side == "both" else f"the {side} hand"
    arm = "both arms" if side == "both" else f"the {side} arm"
    draft.say(("wave", f"with {what}"), ("wave", f"{what} {times(count)}"), ("wave", what), ("wave", f"{arm} to say hello"),
              ("raise", f"{what} and waves"), ("greet", f"somebody by waving {what}"))  # fmt: skip


def kick(draft: Draft) -> None:
    """Front kicks with one leg; factors side, repetitions, height (metres of the ankle)."""
    _style(draft)
    side = draft.choice("side", ("left", "right"))
    count = int(draft.choice("repetitions", (1, 2, 3), (3, 1, 1)))
    height = draft.value("height", 0.45, 0.95)
    start, beat = float(draft.rng.uniform(0.5, 0.8)), float(draft.rng.uniform(1.15, 1.5))
    stop = start + count * beat
    draft.parts.append(Stretch("stand", round(max(stop + float(draft.rng.uniform(0.3, 0.8)), SHORTEST), 2)))
    draft.overlays.append(lambda p, t: gestures.kick(p, t, start, stop, 0 if side == "left" else 1, count, height))
    word = "high" if height > 0.75 else "low" if height < 0.55 else "forward"
    often = "" if count == 1 else times(count)
    draft.say(("kick", _join(f"with the {side} leg", often)), ("kick", _join(f"{word} with the {side} foot", often)),
              ("do", f"{'a front kick' if count == 1 else 'front kicks'} with the {side} leg"),
              ("kick", _join(f"the {side} foot forward", often)), ("swing", _join(f"the {side} leg up in a kick", often)))  # fmt: skip


def squat(draft: Draft) -> None:
    """Knee bends; factors repetitions, depth (metres)."""
    _style(draft)
    count = int(draft.choice("repetitions", (1, 2, 3, 4), (4, 3, 2, 1)))
    depth = draft.value("depth", 0.28, 0.52)
    start, beat = float(draft.rng.uniform(0.2, 0.5)), float(draft.rng.uniform(1.6, 2.2))
    draft.parts.append(Stretch("stand", round(start + count * beat + float(draft.rng.uniform(0.1, 0.4)), 2)))
    draft.overlays.append(lambda p, t: gestures.squat(p, t, start, start + count * beat, count, depth))
    often = "" if count == 1 else times(count)
    draft.say(("squat", _join("down", often)), ("do", f"{'a squat' if count == 1 else 'squats'} with the arms stretched forward"),
              ("squat", _join("and stands up again", often)), ("bend", _join("the knees and gets up again", often)),
              ("crouch", _join("down and rises", often)))  # fmt: skip


def bow(draft: Draft) -> None:
    """Bend the trunk forwards and straighten; factor depth_degrees."""
    _style(draft)
    depth = draft.value("depth_degrees", 35, 85, 0)
    start, length = float(draft.rng.uniform(0.2, 0.5)), float(draft.rng.uniform(1.7, 3.2))
    draft.parts.append(Stretch("stand", round(start + length + float(draft.rng.uniform(0.1, 0.4)), 2)))
    draft.overlays.append(lambda p, t: gestures.bow(p, t, start, start + length, np.radians(depth)))
    word = "deeply" if depth > 60 else "slightly" if depth < 45 else ""
    draft.say(("bow", word), ("bow", _join(word, "and straightens up")), ("make", f"a {'deep ' if depth > 60 else ''}bow"),
              ("bend", "forward at the waist to bow"), ("bow", "to greet somebody"))  # fmt: skip


def sit(draft: Draft) -> None:
    """Sit down on a seat that is not there; factors rises (stands up again), seat (metres)."""
    _style(draft)
    rises = draft.choice("rises", (True, False))
    seat = draft.value("seat", 0.46, 0.56)
    start, move, hold = (float(x) for x in draft.rng.uniform((0.2, 1.1, 0.6), (0.6, 1.7, 2.2)))
    up = start + move + hold if rises else None
    draft.parts.append(Stretch("stand", round(start + move + hold + (move + 0.3 if rises else 0.2), 2)))
    draft.overlays.append(lambda p, t: gestures.sit(p, t, start, start + move, up, seat))
    if rises:
        draft.say(("sit", "down and stands up again"), ("sit", "down on a chair, then gets up"), ("take", "a seat and gets up again"),
                  ("sit", "for a moment and stands back up"))  # fmt: skip
    else:
        draft.say(("sit", "down"), ("sit", "down on a chair"), ("take", "a seat"), ("sit", "down and stays seated"))


def jump(draft: Draft) -> None:
    """Jumps on the spot or forwards; factors repetitions, height, distance (metres a jump)."""
    _style(draft)
    forward = draft.choice("travel", ("none", "forward")) == "forward"
    count = int(draft.choice("repetitions", (1, 2, 3), (4, 2, 1)))
    height = draft.value("height", 0.18, 0.42)
    distance = draft.value("distance", 0.4, 0.9) if forward else 0.0
    start, length = float(draft.rng.uniform(0.2, 0.5)), gestures.jump_seconds(height)
    draft.parts.append(Stretch("stand", round(start + count * length + float(draft.rng.uniform(0.2, 0.5)), 2)))
    for number in range(count):
        draft.overlays.append(lambda p, t, s=start + number * length: gestures.jump(p, t, s, height, distance))
    often = "" if count == 1 else times(count)
    where = "forward" if forward else "up"
    jumps = "a jump" if count == 1 else "jumps"
    draft.say(("jump", _join(where, often)), ("jump", _join(where, "with both feet", often)),
              ("make", f"{jumps} {'forward' if forward else 'on the spot'}"),
              ("leap", _join("forward" if forward else "straight up", often)))  # fmt: skip


def punch(draft: Draft) -> None:
    """Straight punches; factors side (both alternates), repetitions."""
    _style(draft)
    side = draft.choice("side", SIDES)
    count = int(draft.choice("repetitions", (2, 4, 6) if side == "both" else (1, 2, 3, 4)))
    first = int(draft.rng.integers(2))
    order = {"left": [0] * count, "right": [1] * count, "both": [(first + i) % 2 for i in range(count)]}[side]
    start, beat = float(draft.rng.uniform(0.1, 0.3)), float(draft.rng.uniform(0.5, 0.75))
    stop = start + 0.9 + count * beat
    draft.parts.append(Stretch("stand", round(max(stop + float(draft.rng.uniform(0.1, 0.4)), SHORTEST), 2)))
    draft.overlays.append(lambda p, t: gestures.punch(p, t, start, stop, order))
    often = "" if count == 1 else times(count)
    hand = "both fists in turn" if side == "both" else f"the {side} fist"
    draft.say(("punch", _join(f"with {hand}", often)), ("punch", _join("forward", often, f"with {hand}")),
              ("box", f"with {hand}"), ("strike", _join("the air", often, f"with {hand}")))  # fmt: skip


def walk_then(draft: Draft) -> None:
    """A sequence: walk or run forwards, stop, then wave, raise a hand, bow, turn round or squat; factors speed, second."""
    style = _style(draft)
    draft.before = draft.choice("starts", ("moving", "standing")) == "moving"
    runs = draft.choice("first", ("walk", "run"), (4, 1)) == "run"
    speed = draft.value("speed", 2.0, 2.8) if runs else draft.value("speed", 0.8 * style.speed, 1.4 * style.speed)
    if not draft.before:
        draft.stand(0.2, 0.5)
    draft.parts.append(Stretch("run" if runs else "walk", round(float(draft.rng.uniform(1.8, 3.0)), 2), speed))
    draft.say(*((("run", "forward"), ("jog", "forward")) if runs else (("walk", "forward"), ("walk", "ahead"), ("take", "some steps forward"))))
    second = draft.choice("second", ("wave", "raise_hand", "bow", "turn_place", "squat", "walk_back"))
    begin, inner = draft.now, Draft(draft.rng, {"style": "neutral"} if second == "walk_back" else {})
    if second == "walk_back":
        inner.given |= {"starts": "standing", "ends": "standing", "travel_seconds": round(float(draft.rng.uniform(1.8, 2.6)), 2)}
    ACTIONS[second].build(inner)
    pause = 0.45 if not runs else 0.8
    draft.parts.append(Stretch("stand", pause))
    draft.parts += inner.parts
    for overlay in inner.overlays:
        draft.overlays.append(lambda p, t, o=overlay: o(p, t - begin - pause))
    draft.clauses += inner.clauses
    draft.factors |= {name: v for name, v in inner.factors.items() if name not in ("style", "speed", "starts", "ends")}


def walk_and(draft: Draft) -> None:
    """At the same time: walk forwards while waving or with a hand raised; factors speed, side, second."""
    style = _style(draft)
    draft.before = draft.after = True
    speed = draft.value("speed", 0.8 * style.speed, 1.4 * style.speed)
    second = draft.choice("second", ("wave", "raise_hand"))
    inner = Draft(draft.rng, {"style": "neutral"} | ({"lowers": True} if second == "raise_hand" else {}))
    ACTIONS[second].build(inner)
    lead = round(float(draft.rng.uniform(0.2, 0.8)), 2)
    draft.parts.append(Stretch("walk", min(inner.now + lead + 0.3, LONGEST), speed))
    for overlay in inner.overlays:
        draft.overlays.append(lambda p, t, o=overlay: o(p, t - lead))
    draft.factors |= {name: v for name, v in inner.factors.items() if name != "style"}
    side = draft.factors["side"]
    what = "both hands" if side == "both" else f"the {side} hand"
    doing = "waving" if second == "wave" else "raising"
    draft.say(("walk", f"forward while {doing} {what}"), ("walk", f"ahead, {doing} {what}"),
              (participle_less(doing), f"{what} while walking forward"))  # fmt: skip


def participle_less(word: str) -> str:
    """waving -> wave, raising -> raise."""
    return word.removesuffix("ing") + "e"


@dataclass(frozen=True)
class Action:
    """One row of the corpus: how to draft it, and how often it is drawn."""

    build: Callable[[Draft], None]
    weight: float


ACTIONS: dict[str, Action] = {
    "walk": Action(walk, 12), "run": Action(run, 10), "turn_walk": Action(turn_walk, 16), "turn_place": Action(turn_place, 4),
    "side_step": Action(side_step, 4), "walk_back": Action(walk_back, 12), "jump": Action(jump, 6), "wave": Action(wave, 12),
    "raise_hand": Action(raise_hand, 12), "kick": Action(kick, 5), "squat": Action(squat, 5), "bow": Action(bow, 3),
    "sit": Action(sit, 4), "punch": Action(punch, 4), "walk_then": Action(walk_then, 8), "walk_and": Action(walk_and, 4),
}  # fmt: skip


def synthesise(action: str, rng: np.random.Generator, **factors: Any) -> Synthetic:
    """One motion of an action of ACTIONS; factors that are not given are drawn from `rng`.

    The motion is 2 to 9.8 seconds of canonical HUMAN22 joints at 20 fps. PlaygroundError for an unknown action or factor.
    """
    if action not in ACTIONS:
        raise PlaygroundError(f"there is no synthetic action {action!r}; choose one of {', '.join(ACTIONS)}")
    for _ in range(20):
        draft = Draft(rng, dict(factors))
        ACTIONS[action].build(draft)
        if draft.given:
            raise PlaygroundError(f"{action} has no factor {', '.join(draft.given)}; it has {', '.join(draft.factors)}")
        if draft.now <= LONGEST:
            break
    else:
        raise PlaygroundError(f"these factors make a motion longer than {LONGEST} seconds; ask for less of it")
    if draft.now < SHORTEST:
        draft.parts.append(Stretch("walk" if draft.after else "stand", SHORTEST - draft.now, draft.parts[-1].speed))
    trip = travel(draft.parts, draft.style, rng, draft.before, draft.after)
    t = np.arange(len(trip.pose.root)) / LIMITS.fps
    for overlay in draft.overlays:
        overlay(trip.pose, t)
    lower_to_reach(trip.pose)
    texts = captions(draft.clauses, draft.factors["style"], rng, int(rng.integers(3, 5)))
    motion = Motion(canonicalise(joints_of(trip.pose)), caption=texts[0], name=action)
    return Synthetic(motion, texts, draft.factors | {"seconds": motion.seconds}, action)


def corpus(count: int, seed: int) -> list[Synthetic]:
    """`count` motions, actions drawn by weight; every item has its own generator derived from (seed, index)."""
    names = list(ACTIONS)
    weights = np.array([ACTIONS[name].weight for name in names])
    items = []
    for index in range(count):
        rng = np.random.default_rng([seed, index])
        items.append(synthesise(names[int(rng.choice(len(names), p=weights / weights.sum()))], rng))
    return items
