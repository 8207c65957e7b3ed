"""Judges: does a motion do what a plain prompt asks? Joint geometry only, no network.

A judge takes a `Body` and returns its checks; a motion obeys when all of them pass. Every threshold stands in
THRESHOLDS; they were set on recorded clips so that at least 95 % of the clips of a label pass the judge of that label.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from playground.evaluation.geometry import Body, longest, swings
from playground.limits import LIMITS

Array = NDArray[np.floating]
ANY = float("inf")


@dataclass(frozen=True)
class Thresholds:
    """All numbers of all judges. Metres, m/s, degrees, seconds; what they were read off stands behind them."""

    travel: float = 1.0  # a walk or run goes at least this far along its facing; recorded: 2.2 and more
    travel_back: float = 0.8  # against the facing direction; recorded: 2.9 and more
    straight: float = 0.85  # share of the path that is along (against) the facing; recorded: 0.92 and more
    keeps_heading: float = 45.0  # a straight walk turns less; recorded straight walks: 21 at most
    turn: float = 30.0  # a turn turns at least this much; recorded: 48 and more in 98 %
    turn_most: float = 400.0  # more is spinning
    steps: int = 3  # changes of the leading foot; recorded: 5 and more
    walk_fastest: float = 1.85  # median speed; recorded walks: 1.8 at most
    walk_cadence: float = 2.65  # steps a second; recorded walks: 2.6 at most in 97 %
    walk_air: float = 0.03  # share of frames in flight; recorded walks: none
    run_fast: float = 1.85  # median speed of a run with flight; recorded: 1.98 and more but for weary ones
    run_air: float = 0.02  # share of frames in flight; recorded: 0.03 and more but for weary and old ones
    jog: float = 1.2  # or, without flight: jogging, recorded runs of an old person: 1.2 to 1.9 ...
    jog_cadence: float = 2.55  # ... in so many steps a second; recorded: 2.86 in the median, walks 2.0
    hand_level: float = -0.08  # fingertips against the head joint: at the chin or higher
    hand_apart: float = 0.3  # the raised hand is this much higher than the other one
    hand_down: float = -0.2  # the other hand stays below the shoulders
    hand_held: float = 0.4  # for this long
    hand_still: int = 2  # a raised hand swings no more than this; recorded: 2 at most
    wave_level: float = -0.15  # a waving hand is at the shoulders or higher
    wave_held: float = 0.8  # for this long
    wave_swings: int = 2  # there and back; recorded, even in the first 3 seconds: 2 and more in 98 %
    thrust: float = 0.4  # metres that a hand goes forwards or back ...
    thrusts: int = 2  # ... more often is punching; recorded waves: 2 at most in 98 %
    in_place: float = 0.6  # the pelvis of somebody who stays in place gets no farther than this
    kick_height: float = 0.35  # ankle above the other ankle, leg away from the body; recorded runs: 0.3 at most
    jump_air: float = 0.15  # seconds in the air
    jump_rise: float = 0.12  # pelvis above its median height while in the air
    squat_drop: float = 0.25  # pelvis below standing
    sit_drop: float = 0.3  # pelvis below standing
    sit_hold: float = 0.5  # seconds down there
    sit_back: float = 0.25  # pelvis behind the ankles while down; recorded: sitting 0.28 and more, squats 0.21 at most
    stands: float = 0.12  # pelvis drop of somebody who stands
    bow: float = 25.0  # trunk pitched forwards more than at its most upright


THRESHOLDS = Thresholds()


@dataclass(frozen=True)
class Check:
    """One condition: low <= value <= high."""

    what: str
    value: float
    low: float = -ANY
    high: float = ANY

    @property
    def passed(self) -> bool:
        """Whether the value is within its bounds."""
        return bool(self.low <= self.value <= self.high)

    def __str__(self) -> str:
        asked = f"at least {self.low:g}" if self.value < self.low else f"at most {self.high:g}"
        return f"{self.what}: {self.value:.2f}, {asked} asked"


Judge = Callable[[Body], list[Check]]


def _walks(body: Body, direction: float = 1.0) -> list[Check]:
    t = THRESHOLDS
    ahead = direction * body.ahead
    least = t.travel if direction > 0 else t.travel_back
    return [
        Check("metres forwards" if direction > 0 else "metres backwards", ahead, least),
        Check("share of the path in that direction", ahead / max(body.path, 1e-6), t.straight),
        Check("steps", body.steps, t.steps),
        Check("median speed", body.speed, high=t.walk_fastest),
        Check("steps a second", body.steps / body.seconds, high=t.walk_cadence),
        Check("share of frames in flight", float(body.flight.mean()), high=t.walk_air),
    ]


def walk_forward(body: Body) -> list[Check]:
    """Steps forwards along the facing direction, no flight, about the same heading at the end."""
    return [*_walks(body), Check("degrees turned either way", abs(body.turned), high=THRESHOLDS.keeps_heading)]


def walk_backwards(body: Body) -> list[Check]:
    """Displacement against the facing direction, in steps, about the same heading at the end."""
    return [*_walks(body, -1.0), Check("degrees turned either way", abs(body.turned), high=THRESHOLDS.keeps_heading)]


def turn_left(body: Body) -> list[Check]:
    """Walks forwards and faces at least 30 degrees farther left at the end."""
    return [*_walks(body), Check("degrees turned to the left", body.turned, THRESHOLDS.turn, THRESHOLDS.turn_most)]


def turn_right(body: Body) -> list[Check]:
    """Walks forwards and faces at least 30 degrees farther right at the end."""
    return [*_walks(body), Check("degrees turned to the right", -body.turned, THRESHOLDS.turn, THRESHOLDS.turn_most)]


def run(body: Body) -> list[Check]:
    """Forwards at the speed of a run with moments of flight, or jogging: quick short steps faster than a stroll."""
    t = THRESHOLDS
    cadence = body.steps / body.seconds
    jogs = body.speed >= t.jog and cadence >= t.jog_cadence
    checks = [Check("metres forwards", body.ahead, t.travel),
              Check("share of the path in that direction", body.ahead / max(body.path, 1e-6), t.straight),
              Check("steps", body.steps, t.steps)]  # fmt: skip
    if jogs:
        return [*checks, Check("steps a second", cadence, t.jog_cadence), Check("median speed", body.speed, t.jog)]
    return [*checks, Check("median speed", body.speed, t.run_fast),
            Check("share of frames in flight", float(body.flight.mean()), t.run_air)]  # fmt: skip


def raise_hand(body: Body, side: str) -> list[Check]:
    """One hand goes to the chin or higher and stays a while, clearly above the other one, without waving."""
    t, other = THRESHOLDS, "right" if side == "left" else "left"
    level, below = body.hand_level(side), body.hand_level(other)
    up = (level >= t.hand_level) & (level - below >= t.hand_apart)
    return [
        Check(f"seconds that the {side} hand is up and above the other", longest(up) / LIMITS.fps, t.hand_held),
        Check(f"seconds that the {other} hand is up", longest(below >= t.hand_down) / LIMITS.fps, high=t.hand_held),
        Check(f"swings of the {side} hand", body.hand_swings(side, t.hand_level), high=t.hand_still),
        Check("metres away from the start", body.wandered, high=t.in_place),
    ]


def raise_left_hand(body: Body) -> list[Check]:
    """The left hand of the body, whichever way it faces."""
    return raise_hand(body, "left")


def raise_right_hand(body: Body) -> list[Check]:
    """The right hand of the body, whichever way it faces."""
    return raise_hand(body, "right")


def wave_hands(body: Body, sides: Sequence[str]) -> list[Check]:
    """Every hand of `sides` is raised and swings to and fro; a hand that is not named stays down."""
    t = THRESHOLDS
    checks = []
    for side in ("left", "right"):
        level = body.hand_level(side)
        if side in sides:
            up = longest(level >= t.wave_level) / LIMITS.fps
            checks.append(Check(f"seconds that the {side} hand is up", up, t.wave_held))
            checks.append(Check(f"swings of the {side} hand", body.hand_swings(side, t.wave_level), t.wave_swings))
            thrusts = swings(body.hand_track(side, t.wave_level)[:, 2], t.thrust)
            checks.append(Check(f"forward thrusts of the {side} hand", thrusts, high=t.thrusts))
        else:
            up = longest(level >= t.hand_down) / LIMITS.fps
            checks.append(Check(f"seconds that the {side} hand is up", up, high=t.hand_held))
    checks.append(Check("seconds in the air", body.leap(t.jump_rise), high=t.jump_air))
    return [*checks, Check("metres away from the start", body.wandered, high=t.in_place)]


def wave_both_hands(body: Body) -> list[Check]:
    """Both hands are raised and both swing."""
    return wave_hands(body, ("left", "right"))


def wave_left_hand(body: Body) -> list[Check]:
    """The left hand is raised and swings, the right one stays down."""
    return wave_hands(body, ("left",))


def wave_right_hand(body: Body) -> list[Check]:
    """The right hand is raised and swings, the left one stays down."""
    return wave_hands(body, ("right",))


def kick(body: Body) -> list[Check]:
    """One ankle goes high in front of the body while the other foot stands; no travelling."""
    highest = max(body.kick_height("left"), body.kick_height("right"))
    return [Check("height of the kicking ankle above the other", highest, THRESHOLDS.kick_height)]


def jump(body: Body) -> list[Check]:
    """Both feet leave the floor for a moment and the pelvis rises; not the short flights of a run."""
    t = THRESHOLDS
    return [
        Check("seconds in the air", body.leap(t.jump_rise), t.jump_air),
        Check("share of frames in the air", float(body.airborne.mean()), high=0.5),
    ]


def squat(body: Body) -> list[Check]:
    """The pelvis goes far down over standing feet and comes up again."""
    t = THRESHOLDS
    lowest = int(body.pelvis_drop.argmax())
    return [
        Check("metres that the pelvis goes down", float(body.pelvis_drop.max()), t.squat_drop),
        Check("metres below standing at the end", float(body.pelvis_drop[lowest:].min()), high=t.stands),
        Check("metres that the pelvis is behind the feet", float(body.pelvis_behind[lowest]), high=t.sit_back),
        Check("seconds in the air", body.leap(t.jump_rise), high=t.jump_air),
        Check("metres away from the start", body.wandered, high=t.in_place),
    ]


def sit(body: Body) -> list[Check]:
    """The pelvis goes down behind the feet and stays there for a while."""
    t = THRESHOLDS
    down = (body.pelvis_drop > t.sit_drop) & (body.pelvis_behind > t.sit_back)
    return [Check("seconds that the pelvis is down and behind the feet", longest(down) / LIMITS.fps, t.sit_hold)]


def bow(body: Body) -> list[Check]:
    """The trunk bends forwards and comes back over standing legs."""
    t = THRESHOLDS
    lowest = int(body.trunk.argmax())
    upright = float(np.percentile(body.trunk, 10))
    return [
        Check("degrees that the trunk bends forwards", float(body.trunk.max()) - upright, t.bow),
        Check("degrees forwards at the end", float(body.trunk[lowest:].min()) - upright, high=t.bow / 2.0),
        Check("metres that the pelvis goes down", float(body.pelvis_drop.max()), high=t.squat_drop),
        Check("metres away from the start", body.wandered, high=t.in_place),
    ]


def judge_motion(judge: Judge, joints: Array) -> list[str]:
    """What a motion fails, one sentence each; empty if it does what was asked. joints [F, 22, 3]."""
    return [str(check) for check in judge(Body(joints)) if not check.passed]
