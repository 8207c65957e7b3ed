"""What the commands do: check everything that can be checked at once, then call the engine."""

import json
import os
import socket
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from playground.data.library import Library
from playground.engine import Engine, default_engine
from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.formats import read_motion, write_motion
from playground.motion.motion import Motion
from playground.progress import Progress
from playground.systems import row_of
from playground.text.prompts import normalise
from playground.tokenizers.token_file import TokenFile

CLIP_FILES = (".bvh", ".npy", ".npz")
FACTS = ("name", "tokenizer", "generator", "text", "parameters", "data", "checkpoint")


def say(text: str) -> None:
    """One line on stdout."""
    sys.stdout.write(text.encode("utf-8", "replace").decode("utf-8") + "\n")


def app(host: str, port: int) -> None:
    """Serve the web app until it is stopped."""
    try:
        socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET).close()
    except OSError as error:
        raise PlaygroundError(
            f"{host} port {port} cannot be used: {error.strerror}; --host and --port choose"
        ) from error
    os.environ.setdefault("GRADIO_ANALYTICS_ENABLED", "False")  # read when gradio is imported
    from playground.ui.app import launch

    say(f"starting the app on http://{host}:{port} (Ctrl+C stops it)")
    sys.stdout.flush()
    launch(host, port)


def systems(as_json: bool) -> None:
    """Print the table of systems."""
    rows = [{key: getattr(system, key) for key in FACTS} for system in default_engine().systems()]
    if as_json:
        say(_json(rows))
        return
    for row in rows:
        parts = [str(row[key]) for key in ("tokenizer", "generator") if row[key]]
        here = f"{row['parameters']:,} parameters, data {row['data']}, checkpoint {row['checkpoint']}"
        if row["checkpoint"] == "absent":
            here = "checkpoint absent" + (": not trained yet" if row_of(row["name"]).command == "train" else "")
        say(f"{row['name']:<22} {' + '.join(parts)}, text {row['text']}, {here}")


def tokenize(clip: str, caption: str | None, system: str, start: float, library: Path | None, to: Path | None) -> None:
    """Motion to token file."""
    engine = default_engine()
    _check_system(engine, system)
    if caption is not None:
        caption = normalise(caption, what="caption", allow_empty=True)
    motion, notes = find_clip(clip, start, library, engine)
    with Progress(f"tokenizing with {system}"):
        tokenized = engine.tokenize(motion, motion.caption if caption is None else caption, system)
    _write_text(tokenized.token_file().to_json(), to)
    if to:
        for note in notes:
            say(note)
        count = sum(level.size for level in tokenized.levels)
        say(f"{to}: {count} tokens in {len(tokenized.levels)} levels, {tokenized.motion.frames} frames")


def decode(tokens: Path, caption: str | None, guidance: float, out: Path) -> None:
    """Token file to motion file."""
    engine = default_engine()
    file = TokenFile.read(tokens)
    _check_system(engine, file.system)
    if caption is not None:
        caption = normalise(caption, what="caption", allow_empty=True)
    codes = [count for _, count in engine.scales(file.system)]
    expected = list(zip(engine.sizes(file.system, file.frames), codes, strict=True))
    if [(level.size, level.codes) for level in file.levels] != expected:
        raise PlaygroundError(
            f"{tokens} does not fit {file.system}, which has {len(expected)} levels of "
            f"{', '.join(str(size) for size, _ in expected)} tokens"
        )
    with Progress(f"decoding with {file.system}"):
        decoded = engine.decode(file, caption=caption, guidance=guidance)
    _write_motion(decoded.motion, out)


def generate(
    prompt: str | None,
    no_text: bool,
    seconds: float,
    seed: int,
    system: str,
    guidance: float | None,
    out: Path,
    to: Path | None,
) -> None:
    """Text to motion file."""
    if no_text and prompt is not None:
        raise PlaygroundError("a prompt and --no-text were both given; choose one")
    if not no_text and prompt is None:
        raise PlaygroundError("a prompt is needed; --no-text generates without one")
    engine = default_engine()
    _check_system(engine, system, generator=True)
    with Progress(f"generating with {system}"):
        made = engine.generate(prompt, seconds, system, seed=seed, guidance=guidance)
    _write_motion(made.motion, out)
    if to:
        _write_text(made.token_file().to_json(), to)


def train(
    config: str,
    library: Path,
    out: Path,
    resume: bool,
    size: str,
    steps: int | None,
    minutes: float | None,
    accelerator: str,
    devices: int | None,
    precision: str,
) -> None:
    """Train a tokenizer, a generator or an evaluator."""
    if devices is not None and devices < 1:
        raise PlaygroundError(f"--devices is {devices}; at least 1 is needed")
    if minutes is not None and minutes <= 0:
        raise PlaygroundError(f"--minutes is {minutes:g}; more than 0 is accepted")
    Library.open(library)
    from playground.training.loop import Launch
    from playground.training.run import train

    launch = Launch(accelerator, devices or "auto", precision=precision)
    facts = train(config, library, out, size=size, resume=resume, steps=steps, minutes=minutes, launch=launch)
    if facts["step"] < facts["steps"]:
        say(f"stopped at step {facts['step']} of {facts['steps']}; --resume goes on")


def evaluate(system: str, library: Path, split: str, to: Path | None, **asked: Any) -> None:
    """Measure a system on a split; `asked` is the rest of evaluation.run.Order."""
    from playground.evaluation import run
    from playground.evaluation.spread import join_spread

    order = run.Order(**asked, out=to)
    order.check()
    _check_system(default_engine(), system)
    if not Library.open(library).split(split):
        raise PlaygroundError(f"the split {split} of {library} is empty")
    spread = join_spread()
    with Progress(f"evaluating {system}") if spread.first else nullcontext() as progress:
        result = run.evaluate(system, library, split, progress, order=order, spread=spread)
    if not spread.first:
        return
    _write_text(_json(result) + "\n", to)
    if to:
        say(f"{to}: " + ", ".join(f"{key} {value:.1f}" for key, value in result.items() if isinstance(value, float)))
        rows = {key: row for key, row in result.get("metrics", {}).items() if row["mean"] is not None}
        for key, row in rows.items():
            say(f"  {key} {row['mean']:.3f} ± {row['ci95']:.3f}")


def bench(to: Path | None) -> None:
    """Measure speed and memory."""
    from playground import bench as module

    module.run(to)


def find_clip(clip: str, start: float, library: Path | None, engine: Engine) -> tuple[Motion, list[str]]:
    """The motion that CLIP names, from `start` seconds on, cut to what a tokenizer sees, and what was done to it.

    A file by its suffix; otherwise an id of the library given, or of the examples, or of the folder `library` that
    `make train` fills. PlaygroundError if it is nowhere, broken, or shorter than `start`.
    """
    if start < 0:
        raise PlaygroundError(f"--start is {start:g}; 0 or more seconds are accepted")
    path = Path(clip)
    if path.suffix.lower() in CLIP_FILES or path.exists():
        read = read_motion(path, start_seconds=start)
        motion, notes = read.motion, [read.mapping, *read.changes]
    else:
        motion, notes = _stored_clip(clip, library, engine), []
        if start >= motion.seconds:
            raise PlaygroundError(f"--start is {start:g} s, but {clip} ends at {motion.seconds:g} s")
        motion = motion.slice(int(start * motion.fps), motion.frames)
    longest = LIMITS.max_frames + 1  # poses of the longest motion: one more than its feature rows
    if motion.frames > longest:
        notes.append(
            f"cut to the first {LIMITS.max_frames / motion.fps:g} s of {motion.seconds:g} s; --start chooses others"
        )
        motion = motion.slice(0, longest)
    return motion, notes


def _stored_clip(clip: str, library: Path | None, engine: Engine) -> Motion:
    example = next((example for example in engine.examples() if example.id == clip), None)
    if example is not None and library is None:
        with Progress(f"decoding {clip}"):
            return example.motion()
    folder = library or Path("library")
    if library is not None or (folder / "library.json").is_file():
        opened = Library.open(folder)
        for number, entry in enumerate(opened.clips):
            if entry.id == clip:
                return Motion(opened.joints(number), caption=entry.captions[0], name=clip)
    where = f"the library {folder}" if library else "the examples"
    raise PlaygroundError(
        f"{clip[:80]!r} is neither a {', '.join(CLIP_FILES)} file nor a clip of {where}; --library names another"
    )


def _check_system(engine: Engine, name: str, generator: bool = False) -> None:
    """The same sentences as the engine's, before anything heavy is loaded."""
    table = {system.name: system for system in engine.systems()}
    if name not in table:
        raise PlaygroundError(f"unknown system {name[:80]!r}; one of {', '.join(table)} is accepted")
    if table[name].checkpoint == "absent":
        raise PlaygroundError(row_of(name).absent)
    if generator and table[name].generator is None:
        raise PlaygroundError(f"the system {name} has no generator; it can tokenize and decode only")


def _write_motion(motion: Motion, out: Path) -> None:
    out.parent.mkdir(parents=True, exist_ok=True)
    for change in write_motion(motion, out):
        say(change)
    say(f"{out}: {motion.frames} poses, {motion.seconds:g} s")


def _write_text(text: str, out: Path | None) -> None:
    if out is None:
        sys.stdout.write(text)
        return
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(text, encoding="utf-8")


def _json(value: Any) -> str:
    return json.dumps(value, indent=1, ensure_ascii=False)
