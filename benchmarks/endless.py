"""Motion without end for five minutes: `python -m benchmarks.endless [THREADS SECONDS]` prints figures, then JSON.

As the room Endless does it, a second at a time, with another prompt every 20 seconds of motion. Where MOGO is not
trained, an untrained model of the same size tells speed and memory alone: neither depends on what the weights say.
"""

import json
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from benchmarks.timing import resident_bytes
from playground.engine import default_engine
from playground.engine.endless import EndlessSession
from playground.systems import SYSTEMS, checkpoint_path

if TYPE_CHECKING:
    from playground.runtime import Runtime

SYSTEM = "mogo"
SECONDS = 300  # of motion
SETTLED = 30  # seconds of motion after which memory should be flat
SAID_FOR = 20  # seconds of motion under one prompt
THREADS = 2
PROMPTS = (
    "a person strolls ahead at an easy pace",
    "a person turns left and keeps on walking",
    "a person jogs in a wide circle",
    "a person stops and waves with both arms",
    "a person takes small steps backwards",
    "a person hops twice and then stands still",
)
UNTRAINED = "mogo is not trained here: an untrained model of the same size tells speed and memory, and no jerk"


def untrained() -> "Runtime":
    """MOGO as it will be trained, with random weights."""
    from playground.architectures import build, caller, fitted
    from playground.motion.representation import COLUMNS, Normaliser
    from playground.runtime import Runtime
    from playground.text.encoders import CachedEncoder, load_encoder
    from playground.training.others import GENERATORS, TOKENIZERS

    encoder = load_encoder(SYSTEMS[SYSTEM].text)
    rng = torch.Generator().manual_seed(0)
    tokenizer = build(fitted(TOKENIZERS[f"{SYSTEM}-tokenizer"].model, text_width=encoder.width)).eval()
    for book in tokenizer.quantizer.codebooks:
        book.vectors.normal_(0.0, 0.1, generator=rng)
    c = tokenizer.config
    shapes = {"scales": c.scales, "codes": c.codes, "code_width": c.code_width, "text_width": encoder.width}
    network = build(fitted(GENERATORS[f"{SYSTEM}-generator"].model, **shapes)).eval()
    for module in (tokenizer, network):
        module.requires_grad_(False)
    still = Normaliser(np.zeros(COLUMNS, np.float32), np.full(COLUMNS, 0.05, np.float32))
    return Runtime(SYSTEM, tokenizer, caller(network, tokenizer), CachedEncoder(encoder), still, "", "")


def opened() -> tuple[EndlessSession, str]:
    """A session of the shipped system, or of an untrained one; and what is to be said of it."""
    engine = default_engine()
    if checkpoint_path(engine.assets, SYSTEM, "generator").is_file():
        return engine.endless(PROMPTS[0], system=SYSTEM, seed=0), ""
    return EndlessSession(untrained(), PROMPTS[0], 0, SYSTEMS[SYSTEM].sampling), UNTRAINED


def measure(
    session: EndlessSession,
    seconds: int = SECONDS,
    settled: int = SETTLED,
    said_for: int = SAID_FOR,
    resident: Callable[[], int] = resident_bytes,
) -> dict[str, Any]:
    """So many seconds of motion, a second at a time: speed, memory from `settled` seconds on, and seams.

    speed: seconds of motion per second of computing, mean and of the worst single second, and which one that was (from
    0). first: seconds of computing until the first second of motion was there, which counts for the mean alone: until
    then nothing plays. bytes: resident memory of this process; held: what the session keeps of the past.
    """
    took, sizes, held = [], [], []
    for second in range(seconds):
        start = time.perf_counter()
        if second and second % said_for == 0:
            session.say(PROMPTS[second // said_for % len(PROMPTS)])
        first = session.frames
        session.advance(1.0)
        session.levels(first, session.frames)
        seams = session.seams()
        took.append(time.perf_counter() - start)
        sizes.append(resident())
        held.append(session.held())
    worst = 1 + int(np.argmax(took[1:])) if seconds > 1 else 0
    at = min(settled, seconds) - 1
    return {
        "system": session.runtime.name,
        "checkpoint": session.runtime.checkpoint,
        "seconds": seconds,
        "threads": torch.get_num_threads(),
        "computing": sum(took),
        "first": took[0],
        "speed": {"mean": seconds / sum(took), "worst": 1 / took[worst], "worst_at": worst},
        "bytes": {"settled": sizes[at], "most": max(sizes[at:]), "end": sizes[-1]},
        "held": {"settled": held[at], "most": max(held[at:]), "end": held[-1]},
        "switches": seams.count,
        "jerk": {"at_switches": seams.at_switches, "elsewhere": seams.elsewhere},
    }


def main(arguments: list[str]) -> int:
    """Print a line a figure and, as the last line, the record as JSON; the exit status."""
    from playground.bench import endless_rows

    threads, seconds = (*map(int, arguments), *(THREADS, SECONDS)[len(arguments) :])
    session, note = opened()
    torch.set_num_threads(threads)
    answer = measure(session, seconds) | {"note": note}
    if note:
        answer["jerk"] = {"at_switches": None, "elsewhere": None}
        sys.stdout.write(f"{note}\n")
    for row in endless_rows(answer):
        sys.stdout.write(f"{row.line()}\n")
    sys.stdout.write(json.dumps(answer) + "\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
