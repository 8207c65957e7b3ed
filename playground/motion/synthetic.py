"""A parametric corpus of synthetic motions: every factor is known, every bone exact, planted feet stay put. numpy only.

    for item in corpus(100, seed=0): item.motion, item.captions, item.factors, item.action
    synthesise("walk", np.random.default_rng(1), speed=1.3, style="tired")

The same seed gives the same corpus; a longer corpus starts with the shorter one.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.actions import ACTIONS
from playground.motion.captions import captions
from playground.motion.draft import LONGEST, SHORTEST, Draft, vary
from playground.motion.footsteps import Stretch
from playground.motion.gait import travel
from playground.motion.motion import Motion
from playground.motion.representation import canonicalise
from playground.motion.rig import joints_of, lower_to_reach


@dataclass(frozen=True, eq=False)
class Synthetic:
    """One synthetic motion.

    factors: what was asked and what was drawn (seconds, style, speed in m/s, turn_degrees to the left, side,
    repetitions, ...); action: the key of ACTIONS."""

    motion: Motion
    captions: list[str]
    factors: dict[str, Any]
    action: str


def synthesise(action: str, rng: np.random.Generator, **factors: Any) -> Synthetic:
    """One motion of an action of ACTIONS; factors that are not given are drawn from `rng`.

    The motion is 2 to 9.8 seconds of canonical HUMAN22 joints at 20 fps. PlaygroundError for an unknown action or
    factor, or for factors that would make it longer.
    """
    if action not in ACTIONS:
        raise PlaygroundError(f"there is no synthetic action {action!r}; choose one of {', '.join(ACTIONS)}")
    for _ in range(20):
        draft = Draft(rng, dict(factors))
        ACTIONS[action].build(draft)
        if draft.given:
            wrong, right = ", ".join(draft.given), ", ".join(draft.factors)
            raise PlaygroundError(f"{action} has no factor {wrong}; it has {right}")
        if draft.now <= LONGEST:
            break
    else:
        raise PlaygroundError(f"these factors make a motion longer than {LONGEST} seconds; ask for less of it")
    if draft.now < SHORTEST:
        draft.parts.append(Stretch("walk" if draft.after else "stand", SHORTEST - draft.now, draft.parts[-1].speed))
    pose = travel(draft.parts, vary(draft.style, rng), rng, draft.before, draft.after)
    t = np.arange(len(pose.root)) / LIMITS.fps
    for overlay in draft.overlays:
        overlay(pose, t)
    lower_to_reach(pose)
    texts = captions(draft.clauses, draft.factors["style"], rng, int(rng.integers(3, 5)))
    motion = Motion(canonicalise(joints_of(pose)), caption=texts[0], name=action)
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
