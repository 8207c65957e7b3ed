"""Train what is missing of the LG-Tok family, one part after another: `python -m playground.training.train_family`.

Runs stand in OUT/SIZE/SYSTEM/tokenizer and .../generator. Killed or stopped, it goes on when it is called again.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from playground.training.family import FAMILY
from playground.training.queue import Job, add_arguments, run_command


def family_jobs(out: Path, size: str) -> list[Job]:
    """Every training of a size, the flagship's first."""
    return [
        Job(name, training, out / size / name.rsplit("-", 1)[0], {"run": name, "size": size})
        for name, training in FAMILY[size].items()
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its exit status."""
    about = (__doc__ or "").splitlines()[0]
    parser = argparse.ArgumentParser(prog="python -m playground.training.train_family", description=about)
    add_arguments(parser, "runs/family")
    options = parser.parse_args(arguments)
    return run_command(options, family_jobs(options.out, options.size), options.out / options.size)


if __name__ == "__main__":
    sys.exit(main())
