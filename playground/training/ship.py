"""Put a finished run into the assets: `python -m playground.training.ship RUN --system NAME`. Nothing else does that.

With --refiner in place of a system it is the root refiner's run, and RUN holds refiner/checkpoint.safetensors. Else RUN
holds tokenizer/checkpoint.safetensors and, for a system that generates, generator/checkpoint.safetensors (the
latter alone where another system lends the tokenizer, or there is none), as the train command leaves them: float16,
self-describing. Everything is checked before the first byte is copied.
"""

import argparse
import os
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from safetensors import safe_open

from playground.checkpoints import Card, load_generator, load_model, load_tokenizer, read_card
from playground.engine import ASSETS
from playground.engine.refining import refiner_path
from playground.errors import PlaygroundError
from playground.generators.refiner import RefinerConfig, build_refiner
from playground.limits import LIMITS
from playground.systems import checkpoint_path, row_of
from playground.training.queue import guarded, say


def ship(run: Path, system: str, assets: Path = ASSETS) -> list[str]:
    """Copy the checkpoints of a run to the files of a system; returns what was done, a line each.

    PlaygroundError if the system is unknown, a file is absent, broken, not float16 or not finite, the generator belongs
    to another tokenizer, or a size would pass its limit; the assets are then as before.
    """
    row = row_of(system)
    own = tuple(part for part in row.parts if part == "generator" or not row.lends)
    found = {part: run / part / "checkpoint.safetensors" for part in own}
    if not found[own[0]].is_file():
        raise PlaygroundError(f"{found[own[0]]} is absent; train the {own[0]} of {system} into {run} first")
    if "generator" in found and not found["generator"].is_file():
        del found["generator"]
    lent = checkpoint_path(assets, system, "tokenizer") if row.lends else None
    cards = _checked(found, lent)
    old = {part: checkpoint_path(assets, system, part) for part in own}
    total = _total(run, list(found.values()), list(old.values()), assets)
    notes = [_shipped(path, old[part], cards[part]) for part, path in found.items()]
    if "generator" in old and "generator" not in found and old["generator"].is_file():
        old["generator"].unlink()
        notes.append(f"{old['generator']}: removed, it drew the tokens of another tokenizer")
    return [*notes, total]


def ship_refiner(run: Path, assets: Path = ASSETS) -> list[str]:
    """Copy the root refiner of a run to its place; returns what was done, a line each. PlaygroundError as in `ship`."""
    path, target = run / "refiner" / "checkpoint.safetensors", refiner_path(assets)
    if not path.is_file():
        raise PlaygroundError(f"{path} is absent; train root-refiner into {run} first")
    card = load_model(path, "refiner", RefinerConfig, build_refiner)[1]
    if card.normaliser is None:
        raise PlaygroundError(f"{path} carries no normaliser; it is not a finished refiner checkpoint")
    _check_weights(path)
    total = _total(run, [path], [target], assets)
    return [_shipped(path, target, card), total]


def _total(run: Path, found: list[Path], old: list[Path], assets: Path) -> str:
    """What the assets will hold, in words. PlaygroundError if the files of a run are too large, alone or with them."""
    sizes = sum(path.stat().st_size for path in found)
    if sizes > LIMITS.max_system_bytes:
        raise PlaygroundError(f"{run} holds {_mb(sizes)}; a system may have {_mb(LIMITS.max_system_bytes)}")
    stays = sum(p.stat().st_size for p in assets.rglob("*") if p.is_file() and p not in old)
    if stays + sizes > LIMITS.max_asset_bytes:
        raise PlaygroundError(
            f"{assets} would hold {_mb(stays + sizes)}, at most {_mb(LIMITS.max_asset_bytes)} are accepted; ship less"
        )
    return f"{assets}: {_mb(stays + sizes)} of {_mb(LIMITS.max_asset_bytes)}"


def _shipped(path: Path, target: Path, card: Card) -> str:
    """Copy one file; what was done in words."""
    _copy(path, target)
    return f"{target}: {_mb(path.stat().st_size)}, step {card.facts.get('step')}, {card.hash[:12]}"


def _checked(found: dict[str, Path], lent: Path | None) -> dict[str, Card]:
    """The cards of the files, read whole. lent: the shipped tokenizer of another system that a generator draws for.

    PlaygroundError for what is wrong with them.
    """
    cards: dict[str, Card] = {}
    if "tokenizer" in found:
        cards["tokenizer"] = load_tokenizer(found["tokenizer"])[1]
    if "generator" in found:
        cards["generator"] = load_generator(found["generator"])[1]
    first = next(iter(found))
    if lent is None and cards[first].normaliser is None:
        raise PlaygroundError(f"{found[first]} carries no normaliser; it is not a finished {first} checkpoint")
    if lent is not None and not lent.is_file():
        raise PlaygroundError(f"{lent} is absent; ship the system that lends it first")
    tokenizer = cards.get("tokenizer") if lent is None else read_card(lent)
    drawn_from = cards["generator"].facts.get("tokenizer") if "generator" in cards else None
    if tokenizer is not None and "generator" in cards and drawn_from != tokenizer.hash[:12]:
        raise PlaygroundError(f"{found['generator']} was trained on the tokens of another tokenizer; train it again")
    for path in found.values():
        _check_weights(path)
    return cards


def _check_weights(path: Path) -> None:
    """PlaygroundError unless all weights of a file are float16 and finite."""
    with safe_open(str(path), framework="pt") as file:
        for name in file.keys():  # noqa: SIM118
            if not name.startswith("model."):
                continue
            weights = file.get_tensor(name)
            if str(weights.dtype) != "torch.float16":
                raise PlaygroundError(f"{path} holds {name} as {weights.dtype}; what is shipped is float16")
            if not bool(weights.isfinite().all()):
                raise PlaygroundError(f"{path} holds numbers in {name} that are not finite; train it again")


def _copy(source: Path, target: Path) -> None:
    """Whole or not at all."""
    target.parent.mkdir(parents=True, exist_ok=True)
    partial = target.with_suffix(".partial")
    try:
        shutil.copyfile(source, partial)
        os.replace(partial, target)
    finally:
        partial.unlink(missing_ok=True)


def _mb(size: int) -> str:
    return f"{size / 1e6:.1f} MB"


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its exit status."""
    about = (__doc__ or "").splitlines()[0]
    parser = argparse.ArgumentParser(prog="python -m playground.training.ship", description=about)
    parser.add_argument("run", type=Path, metavar="RUN", help="the folder that holds tokenizer/ and generator/")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--system", metavar="NAME", help="a name of the table of systems")
    what.add_argument("--refiner", action="store_true", help="the root refiner")
    parser.add_argument("--assets", type=Path, default=ASSETS, metavar="DIR", help="other assets than the repository's")
    options = parser.parse_args(arguments)

    def run() -> None:
        if options.refiner:
            say("\n".join(ship_refiner(options.run, options.assets)))
            return
        for note in ship(options.run, options.system, options.assets):
            say(note)
        say("next: python -m playground.analysis.store and python -m playground.ui.opening, which follow the files")

    return guarded(run)


if __name__ == "__main__":
    sys.exit(main())
