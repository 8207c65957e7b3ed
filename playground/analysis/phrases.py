"""Sentences of our own for stored motions: a small table from action group and side to what a caption could say.

Stored results must not hold the captions of a data set. The captions of a clip are only read to tell left from right.
"""

import re
from collections.abc import Sequence

from playground.data.actions import GROUPS, action_of

_SENTENCES: dict[tuple[str, str], str] = {
    ("walk", ""): "a person steadily walks forward",
    ("walk", "left"): "a person walks to the left",
    ("walk", "right"): "a person walks to the right",
    ("walk", "back"): "a person is walking backwards",
    ("walk and turn", ""): "a person walks and turns",
    ("walk and turn", "left"): "a person steadily walks forward and turns left",
    ("walk and turn", "right"): "a person steadily walks forward and turns right",
    ("run", ""): "a person is running forward",
    ("run", "left"): "a person runs in a curve to the left",
    ("run", "right"): "a person runs in a curve to the right",
    ("turn", ""): "a person turns around on the spot",
    ("turn", "left"): "a person turns to the left",
    ("turn", "right"): "a person turns to the right",
    ("raise hands", ""): "a person raises a hand",
    ("raise hands", "left"): "a person raises the left hand",
    ("raise hands", "right"): "a person raises the right hand",
    ("raise hands", "both"): "a person raises both hands",
    ("wave", ""): "a person waves",
    ("wave", "left"): "a person is waving with the left hand",
    ("wave", "right"): "a person is waving with the right hand",
    ("wave", "both"): "a person is waving with both hands",
    ("kick", ""): "a person kicks",
    ("kick", "left"): "a person kicks with the left foot",
    ("kick", "right"): "a person kicks with the right foot",
    ("step", ""): "a person takes a step",
    ("jump", ""): "a person jumps",
    ("dance", ""): "a person dances",
    ("fight", ""): "a person fights with a sword and a shield",
    ("play ball", ""): "a person plays with a ball",
    ("squat or bow", ""): "a person bends down and comes up again",
    ("sit", ""): "a person sits down and stands up",
    ("climb", ""): "a person climbs",
    ("floor", ""): "a person gets down to the floor",
    ("reach", ""): "a person reaches for something",
    ("gesture", ""): "a person makes a gesture with the arms",
    ("stand", ""): "a person is standing still",
    ("other", ""): "a person moves",
}
_KNOWN = {name for name, _ in GROUPS}


def group_of(action: str, captions: Sequence[str] = ()) -> str:
    """The action group of a clip: its action where that is or names a group, else what its first caption says."""
    if action in _KNOWN:
        return action
    found = action_of(action)
    return action_of(captions[0]) if found == "other" and captions else found


def side_of(captions: Sequence[str]) -> str:
    """'both', 'left', 'right', 'back' or '' from the first caption; '' where it names left and right."""
    words = set(re.findall(r"[a-z]+", captions[0].lower())) if captions else set()
    if "both" in words:
        return "both"
    named = [side for side in ("left", "right") if side in words]
    if len(named) == 1:
        return named[0]
    return "back" if not named and words & {"back", "backward", "backwards"} else ""


def sentence(action: str, captions: Sequence[str] = ()) -> str:
    """What we say a clip of this action shows; its own captions only choose the side."""
    group = group_of(action, captions)
    return _SENTENCES.get((group, side_of(captions))) or _SENTENCES.get((group, "")) or _SENTENCES["other", ""]
