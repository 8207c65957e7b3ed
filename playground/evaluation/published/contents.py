"""What a library holds, by source: `python -m playground.evaluation.published.contents --library DIR`.

contents  rows {"source", "clips", "hours", "captions", "words": {"mean", "ci95", "n"} of a caption, "different":
          captions that differ}; the last row is all of them. No caption is stored.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from playground.analysis.results import RESULTS, Result, write_result
from playground.data.library import Clip, Library
from playground.errors import PlaygroundError
from playground.evaluation.published.base import measured
from playground.limits import LIMITS

ALL = "all"


def contents(library: Library) -> Result:
    """Count a library."""
    sources = sorted({clip.source for clip in library.clips})
    rows = [_row(source, [clip for clip in library.clips if clip.source == source]) for source in sources]
    facts = {"data": library.name, "split": ALL, "n": len(library.clips), "seed": 0}  # nothing is drawn
    made_by = f"python -m playground.evaluation.published.contents --library {library.path.name}"
    return Result("contents", made_by, facts, [*rows, _row(ALL, library.clips)])


def _row(source: str, clips: Sequence[Clip]) -> dict[str, Any]:
    captions = [caption for clip in clips for caption in clip.captions]
    return {
        "source": source,
        "clips": len(clips),
        "hours": sum(clip.frames for clip in clips) / LIMITS.fps / 3600,
        "captions": len(captions),
        "words": measured([len(caption.split()) for caption in captions]),
        "different": len(set(captions)),
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its exit status."""
    about = "Count the clips, hours and captions of a library, by source."
    parser = argparse.ArgumentParser(prog="python -m playground.evaluation.published.contents", description=about)
    parser.add_argument("--library", type=Path, default=Path("library"), metavar="DIR")
    parser.add_argument("--out", type=Path, default=RESULTS, metavar="DIR")
    options = parser.parse_args(arguments)
    try:
        found = contents(Library.open(options.library))
        sys.stdout.write(f"{write_result(found, options.out)}: {found.line}\n")
    except (PlaygroundError, OSError) as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
