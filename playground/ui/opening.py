"""First results of rooms and presets, stored: `python -m playground.ui.opening [--room NAME ...]` after each training.

The page reads them when it is built, so that it opens with finished examples and loads no model for that. They carry
the fingerprint of the checkpoints they came from and are ignored once these have changed.
"""

import argparse
import sys
from collections.abc import Callable, Sequence

from playground.engine import default_engine
from playground.errors import PlaygroundError
from playground.ui.previews import write_previews
from playground.ui.rooms import codebooks, compare, edit, embedding, endless, generate, guidance, tokenize
from playground.ui.services import Services
from playground.ui.view import View
from playground.ui.walking import is_here

OPENINGS: dict[str, Callable[[Services], View]] = {
    room.NAME: room.opening_view
    for room in (tokenize, embedding, codebooks, generate, guidance, edit, endless, compare)
}


PRESETS: dict[str, Callable[[Services, str], View]] = {tokenize.NAME: tokenize.preset_view}  # one an example


def write_openings(services: Services, names: Sequence[str] = ()) -> list[str]:
    """Compute and store the first result of the rooms named, all by default; returns their names."""
    chosen = [name for name in OPENINGS if not names or name in names]
    for name in chosen:
        if name == endless.NAME and not is_here(services):
            continue  # its system is not trained yet
        made = OPENINGS[name](services)
        made = OPENINGS[name](services) if made.kind == "live" else made  # the first run pays for loading the models
        made.stored(services.fingerprint()).write(services.opening_path(name))
        for example in services.examples() if name in PRESETS else ():
            preset = PRESETS[name](services, example.id)
            preset.stored(services.fingerprint()).write(services.opening_path(f"{name}-{example.id}"))
        if name == embedding.NAME:
            write_previews(services)
    return chosen


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its exit status."""
    parser = argparse.ArgumentParser(prog="python -m playground.ui.opening", description=__doc__.splitlines()[0])
    parser.add_argument("--room", action="append", choices=list(OPENINGS), default=[], help="only this one; repeatable")
    options = parser.parse_args(arguments)
    try:
        written = write_openings(Services(default_engine), options.room)
    except PlaygroundError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    sys.stdout.write(f"stored: {', '.join(written)}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
