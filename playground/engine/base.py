"""What every call of the engine rests on: systems loaded once, a motion to tokens and back, text to motion."""

import json
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from playground.data.examples import ExampleStore, StoredExample
from playground.engine.checks import check_generation, check_guidance, check_seeds, deadline_check, prepare, settings
from playground.engine.generation import draw_steps, finish
from playground.errors import PlaygroundError
from playground.findings import ScaleSet
from playground.limits import LIMITS
from playground.motion.measures import mpjpe
from playground.motion.motion import Motion
from playground.motion.representation import from_features67
from playground.results import Decoded, Example, Generation, GenerationStep, GuidancePair, Tokenized
from playground.systems import (
    DEFAULT_SYSTEM,
    SYSTEMS,
    SystemInfo,
    check_here,
    checkpoint_path,
    describe,
    header,
    row_of,
)
from playground.text.prompts import normalise
from playground.tokenizers.token_file import LevelTokens, TokenFile

if TYPE_CHECKING:
    from playground.runtime import Runtime

Scales = ScaleSet | int | str | None
ASSETS = Path(__file__).resolve().parent.parent.parent / "assets"


class BaseEngine:
    """Loads each system once and answers from any thread; holds no state of a call."""

    def __init__(self, assets: Path = ASSETS) -> None:
        self.assets = assets
        self._runtimes: dict[str, Runtime] = {}
        self._lock = threading.Lock()

    # ---- what there is -------------------------------------------------------------------------------------------

    def systems(self) -> list[SystemInfo]:
        """Every system of the table with what its checkpoint says; loads no weight."""
        return [describe(self.assets, row) for row in SYSTEMS.values()]

    def scales(self, system: str) -> list[tuple[int, int]]:
        """(tokens, codes) of every scale at full length, coarse to fine; [] without a tokenizer.

        Loads no weight, but for a file from before its scales were written into the header.
        """
        if row_of(system).tokenizer is None:
            return []
        config = self._config(system)
        scales = config.get("scales") or self.runtime(system).tokenizer.config.scales
        return list(zip(scales, config["codes"], strict=True))

    def sizes(self, system: str, frames: int) -> tuple[int, ...]:
        """Tokens of every scale of a motion of so many frames, coarse to fine; () without a tokenizer."""
        if row_of(system).tokenizer is None:
            return ()
        if not 1 <= frames <= LIMITS.max_frames:
            raise PlaygroundError(f"a motion has 1 to {LIMITS.max_frames} frames, got {frames}")
        return tuple(self.runtime(system).tokenizer.sizes(frames))

    def heading(self, system: str) -> str:
        """The rule by which the features of a system read the heading off the body; loads no weight."""
        return str(self._config(system).get("heading", "body"))

    def codebooks(self, system: str) -> list[NDArray[np.float32]]:
        """Code vectors [V, D] of every scale; [] without a tokenizer."""
        runtime = self.runtime(system)
        return [] if runtime.codec is None else runtime.codebooks()

    def examples(self) -> list[Example]:
        """The example library; empty where none is shipped."""
        return [self._example(entry) for entry in self._stored_examples()]

    def runtime(self, system: str) -> "Runtime":
        """The loaded models of a system. PlaygroundError if it is unknown or its checkpoint is absent or broken."""
        row = row_of(system)
        with self._lock:
            if system not in self._runtimes:
                check_here(self.assets, row)  # before torch is loaded
                from playground.runtime import load_runtime

                self._runtimes[system] = load_runtime(self.assets, row)
            return self._runtimes[system]

    # ---- motion to tokens and back --------------------------------------------------------------------------------

    def tokenize(self, motion: Motion, caption: str = "", system: str = DEFAULT_SYSTEM) -> Tokenized:
        """The tokens of a motion, guided by its caption ("" for no text).

        Takes the first 196 rows; the rest is left out, choose another window with `Motion.slice`.
        PlaygroundError for another skeleton or frame rate, or a motion that is too short.
        """
        began = time.perf_counter()
        caption = normalise(caption, what="caption", allow_empty=True)
        features, cut = prepare(motion, self.heading(system))
        runtime = self.runtime(system)
        levels, quantized = runtime.encode(features, caption)
        return Tokenized(
            system=system,
            checkpoint=runtime.checkpoint,
            caption=caption,
            motion=replace(cut, caption=caption),
            levels=levels,
            residual_energy=quantized.energy,
            embedding=quantized.embedding,
            per_level=quantized.per_level,
            seconds=time.perf_counter() - began,
            features=features,
        )

    def reconstruct(
        self, tokenized: Tokenized, guidance: float = 0.0, scales: Scales = None, caption: str | None = None
    ) -> Decoded:
        """The motion that the tokens stand for, and its error against the tokenized one. Arguments as in `decode`."""
        decoded = self.decode(tokenized.token_file(), caption, guidance, scales)
        return replace(decoded, mpjpe_mm=mpjpe(tokenized.motion.joints, decoded.motion.joints))

    def decode(
        self, tokens: TokenFile, caption: str | None = None, guidance: float = 0.0, scales: Scales = None
    ) -> Decoded:
        """Decode a token file. caption None: the one in the file. scales: 3 keeps the three coarsest, "only:3" and
        "without:3" (or a ScaleSet) one or all but one, None all.

        PlaygroundError if the tokens belong to another system's shape, the guidance is out of range or a scale is not
        there.
        """
        began = time.perf_counter()
        check_guidance(guidance)
        runtime = self.runtime(tokens.system)
        count = len(tokens.levels)
        chosen = ScaleSet.of(scales, count)
        text = normalise(tokens.caption if caption is None else caption, what="caption", allow_empty=True)
        if chosen.kind == "upto":
            features = runtime.decode(tokens.levels, tokens.frames, text, guidance, chosen.scale)
        else:
            from playground.probes import subset

            embedding = subset(runtime, tokens.levels, tokens.frames, chosen.levels(count))
            features = runtime.decode_embedding(embedding, tokens.frames, text, guidance)
        motion = Motion(from_features67(runtime.normaliser.invert(features)), caption=text)
        used = len(chosen.levels(count))
        return Decoded(motion, features, None, guidance, used, time.perf_counter() - began, str(chosen))

    def guidance_pair(self, result: Tokenized | Generation, caption: str | None = None) -> GuidancePair:
        """Both branches of the detokenizer's guidance for a tokenized or generated motion."""
        runtime = self.runtime(result.system)
        if runtime.codec is None:
            raise PlaygroundError(row_of(result.system).no_tokenizer)
        text = normalise(result.caption if caption is None else caption, what="caption", allow_empty=True)
        conditional, unconditional = runtime.branches(result.levels, result.motion.frames, text)
        return GuidancePair(conditional, unconditional, runtime.normaliser.mean, runtime.normaliser.std)

    # ---- text to motion -------------------------------------------------------------------------------------------

    def generate_steps(
        self,
        prompt: str | None,
        seconds: float,
        system: str = DEFAULT_SYSTEM,
        seed: int = 0,
        guidance: float | None = None,
        cfg: float | None = None,
        temperature: float | None = None,
        top_k: float | None = None,
        top_p: float | None = None,
        deadline: float | None = LIMITS.deadline_seconds,
        previews: bool = True,
    ) -> Iterator[GenerationStep]:
        """Yield the motion after every scale; without previews after the last one alone.

        prompt None is free-form. cfg guides the generator, guidance the decoder; what is None is the system's own
        default (systems.SamplingDefaults).

        PlaygroundError for an empty prompt, a number out of range, or a run past the deadline (checked at every scale).
        """
        asked = {"guidance": guidance, "cfg": cfg, "temperature": temperature, "top_k": top_k, "top_p": top_p}
        steps = self.generate_many_steps(prompt, seconds, system, (seed,), deadline, previews, **asked)
        yield from (step for (step,) in steps)

    def generate(
        self, prompt: str | None, seconds: float, system: str = DEFAULT_SYSTEM, seed: int = 0, **options: Any
    ) -> Generation:
        """The finished motion; arguments as in `generate_steps`. The same seed gives the same tokens."""
        return self.generate_many(prompt, seconds, system, (seed,), **options)[0]

    def generate_many_steps(
        self,
        prompt: str | None,
        seconds: float,
        system: str = DEFAULT_SYSTEM,
        seeds: Sequence[int] = (0, 1, 2, 3),
        deadline: float | None = LIMITS.deadline_seconds,
        previews: bool = True,
        **options: Any,
    ) -> Iterator[tuple[GenerationStep, ...]]:
        """As `generate_steps` for several seeds at once: a tuple, one step a seed, after every scale."""
        text = None if prompt is None else normalise(prompt)
        how = settings(row_of(system), options)
        check_seeds(seeds)
        frames = {check_generation(seconds, seed, **asdict(how)) for seed in seeds}.pop()
        runtime = self.runtime(system)
        yield from draw_steps(runtime, text, frames, seeds, how, deadline_check(deadline), previews=previews)

    def generate_many(
        self,
        prompt: str | None,
        seconds: float,
        system: str = DEFAULT_SYSTEM,
        seeds: Sequence[int] = (0, 1, 2, 3),
        **options: Any,
    ) -> list[Generation]:
        """The finished motions of several seeds, drawn together; each is what its seed gives alone, up to rounding."""
        began = time.perf_counter()
        (last,) = self.generate_many_steps(prompt, seconds, system, seeds, previews=False, **options)
        options.pop("deadline", None)
        how, runtime = settings(row_of(system), options), self.runtime(system)
        return [finish(runtime, step, seed, how, began) for step, seed in zip(last, seeds, strict=True)]

    # ---- inside ---------------------------------------------------------------------------------------------------

    def _config(self, system: str) -> dict[str, Any]:
        """The config that a system's tokenizer file states. PlaygroundError if there is none."""
        row = row_of(system)
        head = header(checkpoint_path(self.assets, row.name, row.parts[0]))
        if head is None:
            raise PlaygroundError(row.absent)
        if row.tokenizer is None:
            raise PlaygroundError(row.no_tokenizer)
        metadata = head["__metadata__"]
        config: dict[str, Any] = json.loads(metadata["config"])
        return config | ({"scales": json.loads(metadata["scales"])} if "scales" in metadata else {})

    def _stored_examples(self) -> tuple[StoredExample, ...]:
        folder = self.assets / "examples"
        if not (folder / "index.json").is_file():
            return ()
        return _open_examples(folder, (folder / "index.json").stat().st_mtime_ns).examples

    def _example(self, entry: StoredExample) -> Example:
        source: Callable[[], Motion] = entry.motion if entry.joints is not None else partial(self._decoded, entry)
        return Example(entry.id, entry.title, entry.caption, entry.action, entry.kind, entry.origin, source)

    def _decoded(self, entry: StoredExample) -> Motion:
        tokens = entry.tokens
        if tokens is None:
            raise PlaygroundError(f"the example {entry.id!r} holds neither joints nor tokens")
        levels = tuple(LevelTokens(len(i), c, i) for i, c in zip(tokens.ids, tokens.codes, strict=True))
        file = TokenFile(tokens.system, tokens.checkpoint, entry.caption, entry.frames, levels)
        return replace(self.decode(file).motion, name=entry.title)


@lru_cache(maxsize=4)
def _open_examples(folder: Path, changed: int) -> ExampleStore:
    return ExampleStore.open(folder)
