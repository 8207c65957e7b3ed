"""Builds the stored analysis of a system: `python -m playground.analysis.store --system NAME --library DIR --out DIR`.

Tokenizes the clips of one split with their own captions (first one, at both ends, g = 0: the numbers of an evaluation)
and keeps maps of clips and of single tokens, counts and token ids. What is kept and how: `playground/stored.py`.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np

from playground.analysis.bundle import (
    DECODED_NOTE,
    Bundle,
    BundleClip,
    counts_of,
    padded_ids,
    read_bundle,
    stored_systems,
    write_bundle,
)
from playground.analysis.embedding import EmbeddingMap, neighbour_agreement
from playground.analysis.passes import ClipPass, clip_passes, first_caption
from playground.analysis.phrases import group_of, sentence
from playground.analysis.results import files_of, why_absent
from playground.analysis.tokenmap import map_tokens
from playground.data.library import Library
from playground.engine import ASSETS, Engine, default_engine
from playground.errors import PlaygroundError
from playground.systems import row_of

NOTE = (
    f"Each clip is kept as {DECODED_NOTE}; neither the recorded motion nor a caption of the data set is stored. "
    "Counts, errors and maps come from tokens made with the clip's own first caption at both ends, g = 0."
)


def build_bundle(
    system: str,
    library_path: Path,
    split: str = "test",
    *,
    seed: int = 0,
    limit: int | None = None,
    engine: Engine | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Bundle:
    """The analysis of a system on a split. limit: take so many clips at most, evenly spread (small settings).

    PlaygroundError if the system has no checkpoint, the library is none, or the split holds no clip to measure.
    """
    library = Library.open(Path(library_path))
    chosen = _spread(library.split(split), limit)
    runtime = (engine or default_engine()).runtime(system)
    captions = [first_caption(library.clips[i].captions) for i in chosen]
    passes = list(clip_passes(runtime, library, chosen, captions, progress=progress))
    if not passes:
        raise PlaygroundError(f"the split {split} of {library_path} holds no clip long enough to be analysed")
    passes.sort(key=lambda one: one.index)
    clips = tuple(_clip(library, one) for one in passes)
    ids = padded_ids([one.ids for one in passes], runtime.tokenizer.config.scales)
    means = np.stack([one.mean_embedding for one in passes]).astype(np.float32)
    tsne, pca = EmbeddingMap().fit(means, "tsne", seed), EmbeddingMap().fit(means, "pca", seed)
    agreement, chance = neighbour_agreement(means, [clip.action for clip in clips])
    codes = runtime.tokenizer.config.codes
    return Bundle(
        system=system,
        checkpoint=runtime.checkpoint,
        data=library.name,
        split=split,
        seed=seed,
        perplexity=tsne.perplexity_,
        explained=(float(pca.explained_[0]), float(pca.explained_[1])),
        agreement=agreement,
        chance=chance,
        sizes=tuple(level.shape[1] for level in ids),
        codes=tuple(codes),
        versions={name: version(name) for name in ("numpy", "scikit-learn", "torch")},
        note=NOTE,
        clips=clips,
        means=means,
        tsne=tsne.points_.astype(np.float32),
        pca=pca.points_.astype(np.float32),
        pca_centre=pca.centre_.astype(np.float32),
        pca_axes=pca.axes_.astype(np.float32),
        tokens=np.concatenate(ids, axis=1).astype(np.int16),
        counts=counts_of(ids, codes),
        energy=np.stack([one.energy for one in passes]).astype(np.float32),
        errors_mm=np.array([one.errors_mm.mean() for one in passes], np.float32),
        **vars(map_tokens(runtime, ids, [one.rows for one in passes], seed)),
    )


def analysis_of(
    system: str,
    *,
    library: str | Path | None = None,
    split: str = "test",
    limit: int | None = None,
    seed: int = 0,
    folder: Path = ASSETS / "analysis",
) -> Bundle:
    """The stored analysis of a system, or with the path of a library one computed now on the clips of a split."""
    if library is None:
        return read_bundle(folder, system)
    return build_bundle(system, Path(library), split, seed=seed, limit=limit)


def analyses_of(
    systems: Sequence[str],
    *,
    recompute: bool = False,
    library: str | Path = "library",
    split: str = "test",
    limit: int | None = None,
    seed: int = 0,
    folder: Path = ASSETS / "analysis",
) -> tuple[dict[str, Bundle], dict[str, str]]:
    """The analyses of those systems that have one, and for the others why there is none: what the notebooks call.

    recompute: computed now for every system that has a tokenizer, on at most `limit` clips of the split.
    PlaygroundError if there is none at all.
    """

    def can(name: str) -> bool:
        return row_of(name).tokenizer is not None and bool(files_of(name)["checkpoint"])

    there = {name: can(name) if recompute else name in stored_systems(folder) for name in systems}
    found = {
        name: analysis_of(
            name, library=library if recompute else None, split=split, limit=limit, seed=seed, folder=folder
        )
        for name, wanted in there.items()
        if wanted
    }
    if not found:
        raise PlaygroundError(f"none of {', '.join(systems)} is trained and analysed here")
    return found, {name: why_absent(name, draws=False) for name, wanted in there.items() if not wanted}


def _clip(library: Library, one: ClipPass) -> BundleClip:
    clip = library.clips[one.index]
    action = group_of(clip.action, clip.captions)
    return BundleClip(clip.id, one.index, clip.source, action, sentence(action, clip.captions), one.rows)


def _spread(indices: list[int], limit: int | None) -> list[int]:
    """At most `limit` entries, evenly spread over the list."""
    if limit is None or limit >= len(indices):
        return indices
    return [indices[int(place)] for place in np.linspace(0, len(indices) - 1, max(limit, 1))]


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its exit status."""
    parser = argparse.ArgumentParser(prog="python -m playground.analysis.store", description=__doc__.splitlines()[0])
    parser.add_argument("--system", required=True, metavar="NAME")
    parser.add_argument("--library", type=Path, required=True, metavar="DIR")
    parser.add_argument("--split", default="test")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--limit", type=int, help="take so many clips at most")
    parser.add_argument("--out", type=Path, default=Path("assets/analysis"), metavar="DIR")
    given = parser.parse_args(arguments)
    try:
        bundle = build_bundle(given.system, given.library, given.split, seed=given.seed, limit=given.limit)
        write_bundle(given.out, bundle)
    except PlaygroundError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    sys.stdout.write(f"{given.out / given.system}.npz: {bundle.provenance}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
