"""Serve the page on the real engine with tiny checkpoints of the whole table, which it writes into a folder:

    python -m tests.ui.serve_systems PORT FOLDER

For the browser tests that go through every system; what the figures do is noise, what the rooms say is not.
"""

import sys
from pathlib import Path

import numpy as np

from playground.analysis.bundle import write_bundle
from playground.data.examples import StoredExample, write_examples
from playground.engine import Engine
from playground.limits import LIMITS
from playground.motion.representation import Normaliser
from playground.ui.app import launch
from tests.conftest import drifting
from tests.tiny_systems import TRAINED, tiny_system
from tests.ui.double import stored_analysis

POSES = 65  # of an example: 64 frames, 3.2 s

ANALYSED = ("lgtok", "momask", "t2mgpt")


def tiny_assets(folder: Path) -> Path:
    """A folder of assets: every system that this repository trains, and two motions."""
    normaliser = Normaliser(np.zeros(67, np.float32), np.full(67, 0.05, np.float32))
    for name in TRAINED:
        tiny_system(folder, name, normaliser)
    examples = [
        StoredExample(f"drift-{n}", f"Drifting {n}", "a person drifts along", "walk", "synthetic", "made up", POSES,
                      drifting(POSES, seed=n)) for n in (1, 2)
    ]  # fmt: skip
    write_examples(folder / "examples", examples)
    return folder


def with_analysis(engine: Engine) -> Engine:
    """The engine with a made-up map and made-up counts of systems with ten scales, six levels and one."""
    for name in ANALYSED:
        sizes, codes = zip(*engine.scales(name), strict=True)
        write_bundle(engine.assets / "analysis", stored_analysis(name, sizes, codes, LIMITS.max_frames))
    return engine


def main() -> None:
    """Until the process is stopped."""
    engine = with_analysis(Engine(tiny_assets(Path(sys.argv[2]))))
    launch(port=int(sys.argv[1]), engine=lambda: engine)


if __name__ == "__main__":
    main()
