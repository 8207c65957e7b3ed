"""The travelling actions of the synthetic corpus: walks, runs, turns, side steps, steps backwards. numpy only.

Every function fills a `Draft` and draws its factors there; speeds in m/s, angles in degrees, left positive.
"""

import numpy as np

from playground.motion.draft import Draft, words
from playground.motion.footsteps import Stretch


def pace(speed: float) -> tuple[str, str]:
    """An adverb and a phrase for a walking speed."""
    if speed < 0.8:
        return "slowly", "at a slow pace"
    if speed > 1.45:
        return "quickly", "at a brisk pace"
    return "", "at a normal pace"


def walk(draft: Draft) -> None:
    """Straight ahead; factors speed, travel_seconds."""
    style = draft.draw_style()
    draft.draw_ends()
    speed = draft.value("speed", 0.75 * style.speed, 1.6 * style.speed)
    draft.trip(Stretch("walk", draft.value("travel_seconds", 2.4, 7.0), speed))
    word, phrase = pace(speed)
    draft.say(
        ("walk", words("forward", word)), ("walk", f"straight ahead {phrase}"), ("walk", words(word, "forward")),
        ("take", words("steps forward", word)), ("walk", f"in a straight line {phrase}"), ("walk", "forward"),
    )  # fmt: skip


def run(draft: Draft) -> None:
    """Straight ahead, with flight between the steps; factors speed, travel_seconds."""
    draft.draw_style(("neutral", "energetic", "tired"))
    draft.draw_ends()
    speed = draft.value("speed", 2.1, 3.8)
    draft.trip(Stretch("run", draft.value("travel_seconds", 2.0, 4.0), speed))
    verb = "jog" if speed < 2.5 else "sprint" if speed > 3.5 else "run"
    word = "slowly" if speed < 2.5 else "fast" if speed > 3.2 else ""
    draft.say(
        ("run", "forward"), (verb, "forward"), ("run", words(word, "straight ahead")), ("run", words("forward", word)),
        (verb, "in a straight line"), ("run", ""),
    )  # fmt: skip


def turn_walk(draft: Draft) -> None:
    """Walk or run along an arc or round a corner; factors gait, speed, turn_degrees."""
    gait = draft.choice("gait", ("walk", "run"), (6, 1))
    style = draft.draw_style() if gait == "walk" else draft.draw_style(("neutral", "energetic"))
    draft.draw_ends()
    low, high = (0.8 * style.speed, 1.4 * style.speed) if gait == "walk" else (2.0, 2.9)
    speed = draft.value("speed", low, high)
    size = float(draft.rng.uniform(45, 180)) if draft.rng.random() < 0.9 else 360.0
    turn = draft.number("turn_degrees", round(size * float(draft.rng.choice([-1.0, 1.0])), 1))
    bend = max(abs(turn) / (55.0 if gait == "walk" else 75.0), 1.0) * draft.draw(0.9, 1.3)
    draft.trip(
        Stretch(gait, draft.draw(0.5, 1.8), speed),
        Stretch(gait, round(bend, 2), speed, np.radians(turn)),
        Stretch(gait, draft.draw(0.5, 1.8), speed),
    )
    side, clock = ("left", "counterclockwise") if turn > 0 else ("right", "clockwise")
    if abs(turn) > 270:
        draft.say((gait, f"in a circle to the {side}"), (gait, f"{clock} in a circle"), (gait, f"a {clock} circle"))
        return
    doing = "walking" if gait == "walk" else "running"
    word = pace(speed)[0] if gait == "walk" else ""
    draft.say(
        (gait, f"forward and turns {side}"), (gait, f"forward while turning to the {side}"),
        ("turn", f"{side} while {doing}"), (gait, words(word, f"and turns to the {side}")),
        (gait, f"in a curve to the {side}"), ("curve", f"to the {side} on a {clock} path"),
        (gait, f"ahead and makes a {side} turn"),
    )  # fmt: skip


def turn_place(draft: Draft) -> None:
    """Turn on the spot with small steps; factor turn_degrees."""
    draft.draw_style()
    size = float(draft.rng.choice([90.0, 180.0, 360.0], p=[0.45, 0.45, 0.1])) + draft.draw(-8.0, 8.0)
    turn = draft.number("turn_degrees", round(size * float(draft.rng.choice([-1.0, 1.0])), 1))
    draft.stand(draft.draw(0.4, 0.9))
    seconds = max(abs(turn) / 75.0, 1.0) * draft.draw(0.9, 1.2) * draft.tempo
    draft.parts.append(Stretch("turn", round(seconds, 2), 0.0, np.radians(turn)))
    draft.stand(draft.draw(0.6, 1.4))
    side, clock = ("left", "counterclockwise") if turn > 0 else ("right", "clockwise")
    amount = "a quarter turn" if abs(turn) < 135 else "a half turn" if abs(turn) < 270 else "a full turn"
    draft.say(
        ("turn", f"to the {side} on the spot"), ("make", f"{amount} to the {side}"), ("pivot", f"{side} in place"),
        ("turn", f"{clock} in place"), ("rotate", f"to the {side} with small steps"),
    )  # fmt: skip


def side_step(draft: Draft) -> None:
    """Steps to one side, still facing forwards; factors side, speed, travel_seconds."""
    draft.draw_style()
    side = draft.choice("side", ("left", "right"))
    speed = draft.value("speed", 0.25, 0.5)
    drift = np.pi / 2 if side == "left" else -np.pi / 2
    draft.trip(Stretch("side", draft.value("travel_seconds", 1.8, 4.5), speed, 0.0, drift))
    draft.say(
        ("step", f"sideways to the {side}"), ("move", f"sideways to the {side}"), ("take", f"side steps to the {side}"),
        ("shuffle", f"to the {side} without turning"), ("walk", f"sideways to the {side}"),
    )  # fmt: skip


def walk_back(draft: Draft) -> None:
    """Backwards, facing forwards; factors speed, travel_seconds."""
    draft.draw_style()
    draft.draw_ends()
    speed = draft.value("speed", 0.45, 1.0)
    draft.trip(Stretch("back", draft.value("travel_seconds", 2.2, 5.5), speed, 0.0, np.pi))
    word = "slowly" if speed < 0.6 else ""
    draft.say(
        ("walk", "backwards"), ("walk", words("backward", word)), ("step", words("backwards", word)),
        ("take", "several steps backwards"), ("move", "backward on foot"), ("walk", words(word, "in reverse")),
    )  # fmt: skip


def stand(draft: Draft) -> None:
    """Nothing but breathing and swaying; factor stand_seconds."""
    draft.draw_style()
    draft.stand(draft.value("stand_seconds", 2.0, 5.0))
    draft.say(("stand", "still"), ("stand", "in place"), ("wait", "without moving"), ("stand", "upright and waits"))
