"""The order of two actions: in a sentence "A and then B", in the motion made from it, and in attention to its words."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from playground.errors import PlaygroundError
from playground.motion.skeleton import HUMAN22

LINK = "then"  # the word between the two clauses
_EMPTY = frozenset(("a", "an", "the", "person", "someone", "and", ",", "."))
_PELVIS = 0
_WRISTS = [HUMAN22.joints.index(name) for name in ("l_wrist", "r_wrist")]

Floats = NDArray[np.float64]


def clauses(words: Sequence[str]) -> tuple[list[int], list[int]]:
    """Places of the telling words before and after the link: articles, marks such as [CLS] and "person" do not count.

    PlaygroundError if the link is not there exactly once, or one side says nothing.
    """
    places = [place for place, word in enumerate(words) if word == LINK]
    if len(places) != 1:
        raise PlaygroundError(f'a sentence of two clauses has the word "{LINK}" once, got {len(places)}')
    telling = [place for place, word in enumerate(words) if word not in _EMPTY and not word.startswith(("[", "<"))]
    first, second = [p for p in telling if p < places[0]], [p for p in telling if p > places[0]]
    if not first or not second:
        raise PlaygroundError(f'a sentence of two clauses says something on both sides of "{LINK}"')
    return first, second


def centre(signal: ArrayLike) -> float:
    """Where in time a signal of 0 or more has its weight: 0 at the first frame, 1 at the last; nan where it is 0."""
    values = np.asarray(signal, np.float64)
    total = float(values.sum())
    if values.ndim != 1 or len(values) < 2 or values.min() < 0:
        raise PlaygroundError(f"a centre in time needs 2 or more values of 0 or more, got {list(values.shape)}")
    return float(values @ np.linspace(0.0, 1.0, len(values))) / total if total > 0 else float("nan")


def attention_lag(weights: ArrayLike, first: Sequence[int], second: Sequence[int]) -> float:
    """How much later in time the words of the second clause are looked at than those of the first, -1 to 1.

    weights: [frames, words]. Every word counts by where its own attention lies in time, however much of it there is;
    nan where no word of a clause is looked at.
    """
    grid = np.asarray(weights, np.float64)
    if grid.ndim != 2 or not first or not second:
        raise PlaygroundError(f"a lag needs weights [frames, words] and words of both clauses, got {list(grid.shape)}")
    early, late = ([centre(grid[:, word]) for word in words] for words in (first, second))
    seen = [[value for value in side if np.isfinite(value)] for side in (early, late)]
    return float(np.mean(seen[1]) - np.mean(seen[0])) if all(seen) else float("nan")


def action_signal(action: str, joints: ArrayLike) -> Floats:
    """How much of an action each frame shows, 0 or more [F]: "walk" speed of the pelvis over the floor, "hands" how far
    the higher wrist is above its lowest place, "squat" how far the pelvis is below its highest one; metres (a step).

    joints: [F, 22, 3] metres. PlaygroundError for another action.
    """
    x = np.asarray(joints, np.float64)
    if action == "walk":
        steps = np.linalg.norm(np.diff(x[:, _PELVIS, [0, 2]], axis=0), axis=-1)
        return np.concatenate([steps[:1], steps])
    if action == "hands":
        height = x[:, _WRISTS, 1].max(axis=1)
        return np.asarray(height - height.min(), np.float64)
    if action == "squat":
        height = x[:, _PELVIS, 1]
        return np.asarray(height.max() - height, np.float64)
    raise PlaygroundError(f"no signal is known for the action {action[:40]!r}; walk, hands and squat are accepted")


def in_order(first: str, second: str, joints: ArrayLike) -> bool | None:
    """Whether the first action has its weight in time before the second; None where one of them is not there at all."""
    early, late = (centre(action_signal(action, joints)) for action in (first, second))
    return early < late if np.isfinite(early) and np.isfinite(late) else None
