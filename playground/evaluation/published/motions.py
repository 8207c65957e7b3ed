"""The items that are motions: pose strips of prompts (Figs 4, 9, 10) and edits with the benchmark masks (Fig 11).

strips  rows {"prompt", "seconds", "seed", "known": is such a motion frequent in the training data, "motion"}
edits   rows {"kind", and over clips of the split: "seam_mm", "unblended_mm", "source_mm", "kept_mm", "plain_error_mm",
        "gap_m", "gap_degrees", each {"mean", "ci95", "n"}}; "examples": [{"kind", "caption", "prompt", "seed",
        "drawn": [[start, stop], ...] frames, "seams": [{"frame", "jolt_mm", ...}], "source", "motion"}], made from a
        generated motion

All sentences are ours; motions are stored as analysis/motions.py tells.
"""

from typing import Any

import numpy as np

from playground.analysis.motions import packed
from playground.analysis.passes import first_caption, rows_of
from playground.analysis.results import Result
from playground.data.library import Library
from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.evaluation.published.base import Progress, Settings, about, measured
from playground.findings import Edited
from playground.limits import LIMITS
from playground.motion.motion import Motion
from playground.motion.stitch import runs

PROMPTS: tuple[tuple[str, float, bool], ...] = (  # what the pictures of the paper are of, in our words; then our own
    ("a person walks ahead with confidence", 5.0, True),
    ("a person walks along a narrow beam and keeps the balance", 5.0, False),
    ("a person takes a step forward with the right foot", 3.0, True),
    ("a person crawls forward on hands and knees", 5.0, False),
    ("a person bends down and picks something up", 4.0, False),
    ("a person waves both hands above the head", 3.0, True),
    ("a person is running straight ahead", 3.0, True),
)
BENCHMARK = ("inpaint", "outpaint", "prefix", "suffix")
LONG_ENOUGH = 64  # rows of a clip that is edited
SOURCE = ("a person is walking straight ahead without haste", 9.8)
EXAMPLES = (  # kind, span in frames as `Engine.edit` takes it (Fig 11: 5 s to 8 s; all but 3 s to 8 s), prompt
    ("inpaint", (100, 160), "a person waves both hands above the head"),
    ("outpaint", (60, 160), "a person waves both hands above the head"),
)
MEASURES = ("seam_mm", "unblended_mm", "source_mm", "kept_mm", "plain_error_mm", "gap_m", "gap_degrees")


def strips(system: str, settings: Settings, engine: Engine, progress: Progress | None) -> Result:
    """One motion a prompt, drawn with the seed. PlaygroundError if the system cannot generate."""
    rows = []
    for number, (prompt, seconds, known) in enumerate(PROMPTS, 1):
        made = engine.generate(prompt, seconds, system, seed=settings.seed, deadline=None)
        rows.append({"prompt": prompt, "seconds": made.motion.seconds, "seed": settings.seed, "known": known,
                     "motion": packed(made.motion.joints)})  # fmt: skip
        if progress:
            progress(number, len(PROMPTS))
    return Result("strips", "", about(engine, system) | {"seed": settings.seed, "sampling": vars(made.sampling)}, rows)


def edits(system: str, settings: Settings, engine: Engine, progress: Progress | None) -> Result:
    """Every benchmark mask on clips of the split, each with its own caption as the prompt; and examples.

    PlaygroundError if the system cannot generate, or the split holds no captioned clip of LONG_ENOUGH rows.
    """
    library = settings.opened()
    chosen = _chosen(library, settings)
    rows: list[dict[str, Any]] = []
    for number, kind in enumerate(BENCHMARK):
        found = []
        for place, index in enumerate(chosen):
            motion = Motion(library.joints(index), caption=first_caption(library.clips[index].captions))
            seed = settings.seed + place
            found.append(_measures(engine.edit(motion, None, motion.caption, seed, kind, system, deadline=None)))
            if progress:
                progress(number * len(chosen) + place + 1, len(BENCHMARK) * len(chosen))
        rows.append({"kind": kind} | {key: measured([one[key] for one in found]) for key in MEASURES})
    facts = {"data": library.name, "split": settings.split, "n": len(chosen), "motions": settings.motions,
             "seed": settings.seed}  # fmt: skip
    return Result("edits", "", about(engine, system) | facts, rows, {"examples": _examples(system, settings, engine)})


def _chosen(library: Library, settings: Settings) -> list[int]:
    """At most settings.motions long enough clips with a caption, evenly spread over the split."""
    found = [
        index
        for index in library.split(settings.split)
        if rows_of(library.clips[index].frames) >= LONG_ENOUGH and first_caption(library.clips[index].captions)
    ]
    if not found or settings.motions < 1:
        raise PlaygroundError(f"the split {settings.split} of {library.path} holds no clip that could be edited")
    count = min(settings.motions, len(found))
    return [found[int(place)] for place in np.linspace(0, len(found) - 1, count)]


def _measures(edited: Edited) -> dict[str, float]:
    """The numbers of one edit; those of a border are means over its borders."""
    kept = edited.kept
    moved = np.abs(edited.motion.joints[kept] - edited.source.joints[kept]).max()
    return {
        "seam_mm": float(np.mean([seam.jolt_mm for seam in edited.seams])),
        "unblended_mm": float(np.mean([seam.unblended_mm for seam in edited.seams])),
        "source_mm": float(np.mean([seam.source_mm for seam in edited.seams])),
        "kept_mm": 1000.0 * float(moved),
        "plain_error_mm": edited.plain_error_mm,
        "gap_m": edited.gap_m,
        "gap_degrees": edited.gap_degrees,
    }


def _examples(system: str, settings: Settings, engine: Engine) -> list[dict[str, Any]]:
    caption, seconds = SOURCE
    source = engine.generate(caption, seconds, system, seed=settings.seed, deadline=None)
    rows = []
    for kind, span, prompt in EXAMPLES:
        done = engine.edit(source, span, prompt, settings.seed, kind, deadline=None)
        rows.append({
            "kind": kind, "caption": caption, "prompt": prompt, "seed": settings.seed, "fps": LIMITS.fps,
            "drawn": [[int(start), int(stop)] for start, stop in runs(~done.kept)],
            "seams": [vars(seam) for seam in done.seams],
            "source": packed(done.source.joints), "motion": packed(done.motion.joints),
        })  # fmt: skip
    return rows
