"""Train what is missing of the other papers' systems: `python -m playground.training.train_others`.

Runs stand in OUT/SYSTEM/tokenizer and .../generator. Killed or stopped, it goes on when it is called again.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from playground.training.others import OTHERS
from playground.training.queue import Job, add_arguments, run_command


def other_jobs(out: Path) -> list[Job]:
    """Every training of the other systems, tokenizers first."""
    return [Job(name, training, out / name.rsplit("-", 1)[0], {"run": name}) for name, training in OTHERS.items()]


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its exit status."""
    about = (__doc__ or "").splitlines()[0]
    parser = argparse.ArgumentParser(prog="python -m playground.training.train_others", description=about)
    add_arguments(parser, "runs/others", sizes=())
    options = parser.parse_args(arguments)
    return run_command(options, other_jobs(options.out), options.out)


if __name__ == "__main__":
    sys.exit(main())
