"""The actions of the synthetic corpus that stay in place, sequences, and the table of all actions. numpy only.

Every function fills a `Draft`: what is drawn, what is laid over the trip and when, and how it is told.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from playground.motion import gestures
from playground.motion.captions import times
from playground.motion.draft import LONGEST, SHORTEST, Draft, Overlay, words
from playground.motion.footsteps import Stretch
from playground.motion.trips import run, side_step, stand, turn_place, turn_walk, walk, walk_back

SIDES = ("left", "right", "both")


def _hands(draft: Draft) -> tuple[str, str, list[int]]:
    """Words for the drawn hands and arms, and their sides."""
    side = draft.choice("side", SIDES)
    if side == "both":
        return "both hands", "both arms", [0, 1]
    return f"the {side} hand", f"the {side} arm", [SIDES.index(side)]


def raise_hand(draft: Draft) -> None:
    """Lift the left, the right or both hands; factors side, place, lift_seconds, lowers."""
    draft.draw_style()
    what, arm, hands = _hands(draft)
    place = draft.choice("place", tuple(gestures.RAISED), (3, 3, 2, 2))
    move = draft.value("lift_seconds", 0.45, 0.85) * draft.tempo
    total = max(draft.draw(2.0, 4.5), 2.6 * move + 0.4)
    lowers = draft.choice("lowers", (True, False), (4, 1))
    start = draft.draw(0.1, 0.4)
    stop = total - draft.draw(0.05, 0.2) if lowers else total + 5.0
    draft.stand(total)
    for hand in hands:
        late = draft.draw(0.0, 0.05)
        draft.overlays.append(
            partial(gestures.raise_hand, start=start + late, stop=stop, side=hand, place=place, move=move)
        )
    them = "them" if len(hands) == 2 else "it"
    end = f" and lowers {them} again" if lowers else f" and keeps {them} up"
    draft.say(("raise", what), ("lift", arm), ("raise", what + end), ("put", f"{what} up"),
              ("hold", f"{what} up in the air"), ("reach", f"up with {what}"))  # fmt: skip


def wave(draft: Draft) -> None:
    """Wave with the left, the right or both hands; factors side, place, repetitions."""
    draft.draw_style()
    what, arm, hands = _hands(draft)
    place = draft.choice("place", tuple(gestures.WAVES), (3, 2, 2))
    count = int(draft.choice("repetitions", (2, 3, 4, 5, 6, 7, 8)))
    rate = draft.draw(1.4, 2.2) * (0.75 if place == "wide" else 1.0) / max(draft.tempo, 0.95)
    start, move = draft.draw(0.1, 0.4), draft.draw(0.4, 0.6) * draft.tempo
    stop = start + 1.6 * move + count / rate
    draft.stand(max(stop + draft.draw(0.05, 0.4), SHORTEST))
    size = draft.draw(0.8, 1.15)
    for hand in hands:
        draft.overlays.append(
            partial(
                gestures.wave_hand, start=start, stop=stop, side=hand, place=place, times=count, size=size, move=move
            )
        )
    draft.say(("wave", f"with {what}"), ("wave", f"{what} {times(count)}"), ("wave", what),
              ("wave", f"{arm} to say hello"), ("raise", f"{what} and waves"),
              ("greet", f"somebody by waving {what}"))  # fmt: skip


def kick(draft: Draft) -> None:
    """Front kicks with one leg; factors side, repetitions, height (metres of the ankle)."""
    draft.draw_style()
    side = draft.choice("side", ("left", "right"))
    count = int(draft.choice("repetitions", (1, 2, 3), (3, 1, 1)))
    height = draft.value("height", 0.45, 0.95)
    start, beat = draft.draw(0.5, 0.8), draft.draw(1.15, 1.5) * draft.tempo
    stop = start + count * beat
    draft.stand(max(stop + draft.draw(0.3, 0.8), SHORTEST))
    draft.overlays.append(
        partial(gestures.kick, start=start, stop=stop, side=SIDES.index(side), times=count, height=height)
    )
    word = "high" if height > 0.75 else "low" if height < 0.55 else "forward"
    often = "" if count == 1 else times(count)
    kicks = "a front kick" if count == 1 else "front kicks"
    draft.say(("kick", words(f"with the {side} leg", often)), ("kick", words(f"{word} with the {side} foot", often)),
              ("do", f"{kicks} with the {side} leg"), ("kick", words(f"the {side} foot forward", often)),
              ("swing", words(f"the {side} leg up in a kick", often)))  # fmt: skip


def squat(draft: Draft) -> None:
    """Knee bends; factors repetitions, depth (metres)."""
    draft.draw_style()
    count = int(draft.choice("repetitions", (1, 2, 3, 4), (4, 3, 2, 1)))
    depth = draft.value("depth", 0.32, 0.6)
    start, beat = draft.draw(0.2, 0.5), draft.draw(1.6, 2.2) * draft.tempo
    draft.stand(max(start + count * beat + draft.draw(0.1, 0.4), SHORTEST))
    stop = start + count * beat
    draft.overlays.append(partial(gestures.squat, start=start, stop=stop, times=count, depth=depth))
    often = "" if count == 1 else times(count)
    squats = "a squat" if count == 1 else "squats"
    draft.say(("squat", words("down", often)), ("do", f"{squats} with the arms stretched forward"),
              ("squat", words("and stands up again", often)), ("bend", words("the knees and gets up again", often)),
              ("crouch", words("down and rises", often)))  # fmt: skip


def bow(draft: Draft) -> None:
    """Bend the trunk forwards and straighten; factor depth_degrees."""
    draft.draw_style()
    depth = draft.value("depth_degrees", 35, 85, 0)
    start, length = draft.draw(0.2, 0.5), draft.draw(1.7, 3.0) * draft.tempo
    draft.stand(max(start + length + draft.draw(0.1, 0.4), SHORTEST))
    draft.overlays.append(partial(gestures.bow, start=start, stop=start + length, depth=float(np.radians(depth))))
    word = "deeply" if depth > 60 else "slightly" if depth < 45 else ""
    draft.say(("bow", word), ("bow", words(word, "and straightens up")),
              ("make", f"a {'deep ' if depth > 60 else ''}bow"), ("bend", "forward at the waist to bow"),
              ("bow", "to greet somebody"))  # fmt: skip


def sit(draft: Draft) -> None:
    """Sit down on a seat that is not there; factors rises (stands up again), seat (metres)."""
    draft.draw_style()
    rises = draft.choice("rises", (True, False))
    seat = draft.value("seat", 0.46, 0.56)
    start, move, hold = draft.draw(0.2, 0.6), draft.draw(1.1, 1.6) * draft.tempo, draft.draw(0.6, 2.0)
    up = start + move + hold if rises else None
    draft.stand(max(start + move + hold + (move + 0.3 if rises else 0.2), SHORTEST))
    draft.overlays.append(partial(gestures.sit, start=start, down=start + move, up=up, seat=seat))
    if rises:
        draft.say(("sit", "down and stands up again"), ("sit", "down on a chair and gets up"),
                  ("take", "a seat and gets up again"), ("sit", "for a moment and stands back up"))  # fmt: skip
    else:
        draft.say(("sit", "down"), ("sit", "down on a chair"), ("take", "a seat"), ("sit", "down and stays seated"))


def jump(draft: Draft) -> None:
    """Jumps on the spot or forwards; factors travel, repetitions, height, distance (metres a jump)."""
    draft.draw_style()
    forward = draft.choice("travel", ("none", "forward")) == "forward"
    count = int(draft.choice("repetitions", (1, 2, 3), (4, 2, 1)))
    height = draft.value("height", 0.18, 0.42)
    distance = draft.value("distance", 0.4, 0.9) if forward else 0.0
    start, length = draft.draw(0.2, 0.5), gestures.jump_seconds(height)
    draft.stand(max(start + count * length + draft.draw(0.2, 0.5), SHORTEST))
    for number in range(count):
        begin = start + number * length
        draft.overlays.append(partial(gestures.jump, start=begin, height=height, distance=distance))
    often = "" if count == 1 else times(count)
    where = "forward" if forward else "up"
    place = "forward" if forward else "on the spot"
    draft.say(("jump", words(where, often)), ("jump", words(where, "with both feet", often)),
              ("make", f"a jump {place}" if count == 1 else f"jumps {place}"),
              ("leap", words("forward" if forward else "straight up", often)))  # fmt: skip


def punch(draft: Draft) -> None:
    """Straight punches; factors side (both alternates), repetitions."""
    draft.draw_style()
    side = draft.choice("side", SIDES)
    count = int(draft.choice("repetitions", (2, 4, 6) if side == "both" else (1, 2, 3, 4)))
    first = int(draft.rng.integers(2))
    order = [(first + i) % 2 for i in range(count)] if side == "both" else [SIDES.index(side)] * count
    start, beat = draft.draw(0.1, 0.3), draft.draw(0.5, 0.75) * draft.tempo
    stop = start + 0.9 + count * beat
    draft.stand(max(stop + draft.draw(0.1, 0.4), SHORTEST))
    draft.overlays.append(partial(gestures.punch, start=start, stop=stop, sides=order))
    often = "" if count == 1 else times(count)
    hand = "both fists in turn" if side == "both" else f"the {side} fist"
    draft.say(("punch", words(f"with {hand}", often)), ("punch", words("forward", often, f"with {hand}")),
              ("box", f"with {hand}"), ("strike", words("the air", often, f"with {hand}")))  # fmt: skip


def _later(overlay: Overlay, seconds: float) -> Overlay:
    return lambda pose, t: overlay(pose, t - seconds)


def _adopt(draft: Draft, inner: Draft, seconds: float) -> None:
    """Lay what `inner` does over the draft, `seconds` later, and take over its factors."""
    draft.overlays += [_later(overlay, seconds) for overlay in inner.overlays]
    kept = {name: value for name, value in inner.factors.items() if name not in draft.factors}
    draft.factors |= {name: value for name, value in kept.items() if name not in ("starts", "ends")}


def walk_then(draft: Draft) -> None:
    """A sequence: walk or run forwards, stop, then one more action; factors starts, first, second, speed."""
    style = draft.draw_style()
    draft.before = draft.choice("starts", ("moving", "standing")) == "moving"
    first = draft.choice("first", ("walk", "run"), (4, 1))
    low, high = (2.0, 2.8) if first == "run" else (0.8 * style.speed, 1.4 * style.speed)
    speed = draft.value("speed", low, high)
    if not draft.before:
        draft.stand(draft.draw(0.2, 0.5))
    draft.parts.append(Stretch(first, draft.draw(1.8, 3.0), speed))
    draft.stand(0.8 if first == "run" else 0.45)
    if first == "run":
        draft.say(("run", "forward"), ("jog", "forward"))
    else:
        draft.say(("walk", "forward"), ("walk", "ahead"), ("take", "some steps forward"))
    second = draft.choice("second", ("wave", "raise_hand", "bow", "turn_place", "squat", "walk_back", "kick"))
    inner = Draft(draft.rng, {"style": draft.factors["style"]})
    if second == "walk_back":
        inner.given |= {"starts": "standing", "ends": "standing", "travel_seconds": draft.draw(1.8, 2.6)}
    ACTIONS[second].build(inner)
    _adopt(draft, inner, draft.now)
    draft.parts += inner.parts
    draft.clauses += inner.clauses


def walk_and(draft: Draft) -> None:
    """At the same time: walk forwards while waving or with a hand raised; factors speed, second, side."""
    style = draft.draw_style()
    draft.before = draft.after = True
    speed = draft.value("speed", 0.8 * style.speed, 1.4 * style.speed)
    second = draft.choice("second", ("wave", "raise_hand"))
    inner = Draft(draft.rng, {"style": draft.factors["style"]})
    for name in ("side", "repetitions", "place"):
        if name in draft.given:
            inner.given[name] = draft.given.pop(name)
    ACTIONS[second].build(inner)
    lead = draft.draw(0.2, 0.8)
    draft.parts.append(Stretch("walk", min(inner.now + lead + 0.3, LONGEST), speed))
    _adopt(draft, inner, lead)
    side = draft.factors["side"]
    what = "both hands" if side == "both" else f"the {side} hand"
    verb, doing = ("wave", "waving") if second == "wave" else ("raise", "raising")
    draft.say(("walk", f"forward while {doing} {what}"), ("walk", f"ahead, {doing} {what}"),
              (verb, f"{what} while walking forward"))  # fmt: skip


@dataclass(frozen=True)
class Action:
    """One row of the corpus: how to draft it, and how often it is drawn."""

    build: Callable[[Draft], None]
    weight: float


ACTIONS: dict[str, Action] = {
    "walk": Action(walk, 12), "run": Action(run, 10), "turn_walk": Action(turn_walk, 16),
    "turn_place": Action(turn_place, 4), "side_step": Action(side_step, 4), "walk_back": Action(walk_back, 12),
    "stand": Action(stand, 1), "jump": Action(jump, 6), "wave": Action(wave, 12), "raise_hand": Action(raise_hand, 12),
    "kick": Action(kick, 5), "squat": Action(squat, 5), "bow": Action(bow, 3), "sit": Action(sit, 4),
    "punch": Action(punch, 4), "walk_then": Action(walk_then, 8), "walk_and": Action(walk_and, 4),
}  # fmt: skip
