"""Commands about what goes in: prompts rewritten, takes cut, data prepared, other authors' files converted."""

import json
from pathlib import Path

from playground.commands import say
from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.formats import read_motion
from playground.progress import Progress


def rewrite(prompt: str, rules: bool, as_json: bool) -> None:
    """A prompt as a caption, as timed steps and in many words."""
    from playground.text import endpoint, rewriting

    made = rewriting.rewrite(prompt, None if rules else endpoint.from_environment())
    if as_json:
        say(json.dumps(made.record(), indent=1, ensure_ascii=False))
        return
    say(made.normalised)
    for step in made.steps:
        say(f"  {step.seconds:4.1f} s  {step.text}")
    say(made.expressive)
    for note in made.notes:
        say(f"  - {note}")


def prepare(source: str, root: Path | None, out: Path, cut: bool, name: str) -> None:
    """Published data to library."""
    from playground.data import sources

    with Progress(f"preparing {source}") as progress:
        prepared = sources.prepare(source, root, out, progress, cut, name)
    for note in prepared.notes:
        say(note)
    say(f"{out}: {prepared.clips} clips")


def segment(take: Path, seed: int, html: Path | None) -> None:
    """Show where `prepare bvh --cut` cuts a take, or another seed would."""
    from playground.data import segment as module
    from playground.figures.segments import segments_plot

    if not 0 <= seed <= LIMITS.max_seed:
        raise PlaygroundError(f"--seed is {seed}; 0 to {LIMITS.max_seed} is accepted")
    read = read_motion(take)
    if read.motion.frames < 2:
        raise PlaygroundError(f"{take} holds one pose; a take that can be cut has at least 2")
    found = module.segment(read.motion.joints, read.motion.fps, seed)
    for start, stop in found.spans:
        say(f"{start / found.fps:7.2f} to {stop / found.fps:7.2f} s  {(stop - start) / found.fps:5.2f} s")
    if html:
        html.parent.mkdir(parents=True, exist_ok=True)
        segments_plot(found, caption=f"{take.name}, {read.motion.seconds:g} s, seed {seed}.").write_html(html)
        say(f"{html}: {len(found.spans)} parts, {len(found.minima)} minima")


def snapmogen(motion: Path, out: Path) -> None:
    """SnapMoGen's columns to a BVH file of its 24 joints, or such a BVH file to columns."""
    import numpy as np

    from playground.motion.bvh import read_bvh, write_source
    from playground.motion.formats import read_snapmogen_rows
    from playground.motion.snapmogen import FPS, to_features296

    wanted = ".npz" if motion.suffix.lower() == ".bvh" else ".bvh"
    if out.suffix.lower() != wanted:
        raise PlaygroundError(f"{motion.name} becomes a {wanted} file; {out} should end in {wanted}")
    if wanted == ".npz":
        source = read_bvh(motion.read_bytes())
        rows = to_features296(source)
        out.parent.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(out, features=rows, offsets=source.offsets.astype(np.float32), fps=np.float32(FPS))
        say(f"{out}: {len(rows)} rows of {rows.shape[1]} columns")
    else:
        source = read_snapmogen_rows(motion)
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(write_source(source), encoding="ascii", newline="\n")
        say(f"{out}: {source.frames} poses of {len(source.names)} joints")


def convert(
    family: str, tokenizer: Path, generator: Path, options: Path, out: Path, statistics: Path | None,
    llama: str | None, clip: str | None,
) -> None:  # fmt: skip
    """The released files of other authors to checkpoints; `family` is lgtok, the one there is."""
    from playground.convert import convert_lgtok

    with Progress(f"converting {family}"):
        done = convert_lgtok(tokenizer, generator, options, out, statistics=statistics, llama=llama, clip=clip)
    for note in done.notes:
        say(note)
    for path in done.files:
        say(str(path))
