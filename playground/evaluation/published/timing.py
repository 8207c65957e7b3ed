"""The item inference_time (Table 9): seconds from a sentence to a motion, one motion at a time.

inference_time  rows {"what": one of PARTS, the first alone where there are no tokens, "seconds": {"mean", "ci95",
                "n"}, "median", "best"}; the provenance names the machine and how busy it was
"""

import time

import numpy as np

from playground.analysis.passes import first_caption
from playground.analysis.results import Result
from playground.bench import this_machine
from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.evaluation.published.base import Progress, Settings, about, measured
from playground.limits import LIMITS
from playground.systems import row_of

PARTS = ("text to motion", "tokens to motion")  # the second is part of the first, timed by itself


def inference_time(system: str, settings: Settings, engine: Engine, progress: Progress | None) -> Result:
    """Generations of the longest motion from captions of the split, after one that is not counted.

    Text encoding is part of it; every caption is new to the encoder. PlaygroundError if the system cannot generate or
    the split has no caption.
    """
    import torch

    library = settings.opened()
    captions = sorted({first_caption(library.clips[index].captions) for index in library.split(settings.split)} - {""})
    if not captions or settings.motions < 1:
        raise PlaygroundError(f"the split {settings.split} of {settings.library} holds no caption to generate from")
    count = min(settings.motions, len(captions))
    chosen = [captions[int(place)] for place in np.linspace(0, len(captions) - 1, count)]
    engine.generate("a person warms up", LIMITS.max_seconds, system, deadline=None)
    parts = PARTS if row_of(system).tokenizer else PARTS[:1]
    rows: dict[str, list[float]] = {part: [] for part in parts}
    for number, caption in enumerate(chosen, 1):
        begun = time.perf_counter()
        made = engine.generate(caption, LIMITS.max_seconds, system, seed=settings.seed + number, deadline=None)
        rows[PARTS[0]].append(time.perf_counter() - begun)
        if PARTS[1] in rows:
            rows[PARTS[1]].append(engine.decode(made.token_file(), guidance=made.sampling.guidance).seconds)
        if progress:
            progress(number, count)
    known = this_machine()
    computer = {key: known[key] for key in ("processor", "cores", "load", "torch")} | {
        "threads": torch.get_num_threads(),
        "device": str(engine.runtime(system).device),
    }
    facts = {"data": library.name, "split": settings.split, "n": count, "motions": settings.motions,
             "seed": settings.seed, "frames": made.motion.frames, "machine": computer}  # fmt: skip
    listed = [
        {"what": part, "seconds": measured(found), "median": float(np.median(found)), "best": min(found)}
        for part, found in rows.items()
    ]
    return Result("inference_time", "", about(engine, system) | facts, listed)
