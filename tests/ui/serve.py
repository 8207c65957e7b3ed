"""Serve the page on the engine's stand-in: python -m tests.ui.serve PORT [SECONDS_A_SCALE [denoises]].

For the browser tests. denoises: with a second system, which has no tokens.
"""

import sys
import time

from playground.analysis.results import write_result
from playground.ui.app import launch
from playground.ui.previews import write_previews
from playground.ui.services import Services
from tests.figures.test_sweep import swept
from tests.ui.double import FakeEngine


def main() -> None:
    """Every scale of a generation takes SECONDS_A_SCALE, so that a person, or a test, can see it grow."""
    port, pause = int(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else 0.0
    engine = FakeEngine(pause=lambda: time.sleep(pause), denoises="denoises" in sys.argv)
    write_result(swept(), engine.assets / "results")
    write_previews(Services(lambda: engine))  # type: ignore[arg-type, return-value]
    launch(port=port, engine=lambda: engine)


if __name__ == "__main__":
    main()
