"""What one repeat of an evaluation measures: a window and a caption of every clip, drawn anew (systems.md F2).

The length of a window is the clip's, floored to 4 rows with probability 2/3 and 4 rows shorter with probability 1/3;
its start and the caption are drawn too. Everything comes from (seed, repeat), nothing from the process that draws.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from playground.analysis.passes import UNIT, rows_of
from playground.data.library import Library
from playground.errors import PlaygroundError
from playground.evaluation.prompts_obeyed import PROMPTS, Prompt
from playground.limits import LIMITS
from playground.text.prompts import normalise

SHORTER = 1 / 3  # chance that a window is one unit shorter
BATCH = 32  # motions of similar length that run together
PROMPT_SEEDS = 3  # a prompt, a repeat
ITEMS, AGAIN, SAMPLES, POOLS, PAIRS, TEXT_PAIRS = range(6)  # streams of random numbers of one repeat


@dataclass(frozen=True)
class Item:
    """One motion to measure or to make: rows start..start+rows-1 of a clip, a caption ("" for none), its own seed."""

    index: int  # clip of the library; -1 where there is none
    caption: str
    start: int
    rows: int
    seed: int


def stream(seed: int, repeat: int, what: int) -> np.random.Generator:
    """One of the independent streams of random numbers of a repeat."""
    return np.random.default_rng([seed, repeat, what])


def measurable(library: Library, indices: Sequence[int]) -> list[int]:
    """The clips that are long enough. PlaygroundError if there is none."""
    found = [i for i in indices if rows_of(library.clips[i].frames)]
    if not found:
        raise PlaygroundError(f"{library.path} holds no clip long enough to be measured in this split")
    return found


def draw_items(library: Library, indices: Sequence[int], rng: np.random.Generator) -> list[Item]:
    """A window, a caption and a seed for every clip, in their order."""
    items = []
    for index in indices:
        clip = library.clips[index]
        rows = rows_of(clip.frames)
        if rng.random() < SHORTER:
            rows = max(rows - UNIT, LIMITS.min_frames)
        start = int(rng.integers(0, clip.frames - 1 - rows + 1))
        place = int(rng.integers(0, max(len(clip.captions), 1)))
        caption = normalise(clip.captions[place], what="caption", allow_empty=True) if clip.captions else ""
        items.append(Item(index, caption, start, rows, int(rng.integers(0, LIMITS.max_seed))))
    return items


def draw_samples(items: Sequence[Item], texts: int, samples: int, rng: np.random.Generator) -> list[Item]:
    """`samples` copies of `texts` captioned items, text by text, with seeds of their own; fewer texts if there are."""
    captioned = [item for item in items if item.caption]
    chosen = [captioned[place] for place in rng.permutation(len(captioned))[:texts]]
    return [replace(item, seed=int(seed)) for item in chosen for seed in rng.integers(0, LIMITS.max_seed, size=samples)]


def prompt_items(seed: int, repeat: int) -> tuple[list[Prompt], list[Item]]:
    """The plain prompts, each with the seeds of this repeat; the first repeat of seed 0 has the seeds 0, 1 and 2."""
    seeds = [(1000 * seed + PROMPT_SEEDS * repeat + k) % LIMITS.max_seed for k in range(PROMPT_SEEDS)]
    pairs = [(prompt, one) for prompt in PROMPTS if prompt.plain for one in seeds]
    items = [
        Item(-1, normalise(prompt.text), 0, int(LIMITS.fps * prompt.seconds + 1e-6) // UNIT * UNIT, one)
        for prompt, one in pairs
    ]
    return [prompt for prompt, _ in pairs], items


def portions(items: Sequence[Item], size: int = BATCH) -> list[list[int]]:
    """Places of the items in batches of similar length, captioned and bare ones apart, long batches first."""
    order = sorted(range(len(items)), key=lambda place: (not items[place].caption, -items[place].rows, place))
    bare = next((n for n, place in enumerate(order) if not items[place].caption), len(order))
    parts = (order[:bare], order[bare:])
    return [part[start : start + size] for part in parts for start in range(0, len(part), size)]
