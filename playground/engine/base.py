"""What every call of the engine rests on: systems loaded once, a motion to tokens and back, text to motion."""

import json
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from playground.data.examples import ExampleStore, StoredExample
from playground.engine.checks import check_generation, check_guidance, deadline_check, prepare
from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.measures import mpjpe
from playground.motion.motion import Motion
from playground.motion.representation import from_features67
from playground.results import Decoded, Example, Generation, GenerationStep, GuidancePair, Tokenized
from playground.systems import SYSTEMS, SystemInfo, checkpoint_path, describe, header, row_of
from playground.text.prompts import normalise
from playground.tokenizers.token_file import LevelTokens, TokenFile

if TYPE_CHECKING:
    from playground.runtime import Runtime

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
        """(tokens, codes) of every scale, coarse to fine; loads no weight."""
        config = self._config(system)
        return list(zip(config["scales"], config["codes"], strict=True))

    def heading(self, system: str) -> str:
        """The rule by which the features of a system read the heading off the body; loads no weight."""
        return str(self._config(system).get("heading", "body"))

    def codebooks(self, system: str) -> list[NDArray[np.float32]]:
        """Code vectors [V, D] of every scale."""
        return self.runtime(system).codebooks()

    def examples(self) -> list[Example]:
        """The example library; empty where none is shipped."""
        folder = self.assets / "examples"
        if not (folder / "index.json").is_file():
            return []
        stored = _open_examples(folder, (folder / "index.json").stat().st_mtime_ns)
        return [self._example(entry) for entry in stored]

    def runtime(self, system: str) -> "Runtime":
        """The loaded models of a system. PlaygroundError if it is unknown or its checkpoint is absent or broken."""
        row = row_of(system)
        with self._lock:
            if system not in self._runtimes:
                from playground.runtime import load_runtime

                self._runtimes[system] = load_runtime(self.assets, row)
            return self._runtimes[system]

    # ---- motion to tokens and back --------------------------------------------------------------------------------

    def tokenize(self, motion: Motion, caption: str = "", system: str = "lgtok-lite") -> Tokenized:
        """The tokens of a motion, guided by its caption ("" for no text).

        Takes the first 196 rows; the rest is left out, choose another window with `Motion.slice`.
        PlaygroundError for another skeleton or frame rate, or a motion that is too short.
        """
        began = time.perf_counter()
        caption = normalise(caption, what="caption", allow_empty=True)
        features, cut = prepare(motion, self.heading(system))
        levels, quantized = self.runtime(system).encode(features, caption)
        return Tokenized(
            system=system,
            checkpoint=self.runtime(system).checkpoint,
            caption=caption,
            motion=replace(cut, caption=caption),
            levels=levels,
            residual_energy=quantized.energy,
            embedding=quantized.embedding,
            per_level=quantized.per_level,
            seconds=time.perf_counter() - began,
        )

    def reconstruct(
        self, tokenized: Tokenized, guidance: float = 0.0, scales: int | None = None, caption: str | None = None
    ) -> Decoded:
        """The motion that the tokens stand for, and its error against the tokenized one."""
        decoded = self.decode(tokenized.token_file(), caption, guidance, scales)
        return replace(decoded, mpjpe_mm=mpjpe(tokenized.motion.joints, decoded.motion.joints))

    def decode(
        self, tokens: TokenFile, caption: str | None = None, guidance: float = 0.0, scales: int | None = None
    ) -> Decoded:
        """Decode a token file. caption None: the one in the file. scales: keep the coarsest so many, all by default.

        PlaygroundError if the tokens belong to another system's shape or the guidance is out of range.
        """
        began = time.perf_counter()
        check_guidance(guidance)
        runtime = self.runtime(tokens.system)
        count = len(tokens.levels) if scales is None else scales
        if not 1 <= count <= len(tokens.levels):
            raise PlaygroundError(f"{scales} scales were asked for; 1 to {len(tokens.levels)} are accepted")
        text = normalise(tokens.caption if caption is None else caption, what="caption", allow_empty=True)
        features = runtime.decode(tokens.levels, tokens.frames, text, guidance, count)
        motion = Motion(from_features67(runtime.normaliser.invert(features)), caption=text)
        return Decoded(motion, features, None, guidance, count, time.perf_counter() - began)

    def guidance_pair(self, result: Tokenized | Generation, caption: str | None = None) -> GuidancePair:
        """Both branches of the detokenizer's guidance for a tokenized or generated motion."""
        runtime = self.runtime(result.system)
        text = normalise(result.caption if caption is None else caption, what="caption", allow_empty=True)
        conditional, unconditional = runtime.branches(result.levels, result.motion.frames, text)
        return GuidancePair(conditional, unconditional, runtime.normaliser.mean, runtime.normaliser.std)

    # ---- text to motion -------------------------------------------------------------------------------------------

    def generate_steps(
        self,
        prompt: str | None,
        seconds: float,
        system: str = "lgtok-lite",
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
        text = None if prompt is None else normalise(prompt)
        asked = {"guidance": guidance, "cfg": cfg, "temperature": temperature, "top_k": top_k, "top_p": top_p}
        given = {key: value for key, value in asked.items() if value is not None}
        chosen = replace(row_of(system).sampling, **given)
        frames = check_generation(seconds, seed, **asdict(chosen))
        runtime = self.runtime(system)
        check = deadline_check(deadline)
        sampling = {"seed": seed, **asdict(chosen)}
        guidance = sampling.pop("guidance")
        entropy: list[NDArray[np.float32]] = []
        for step in runtime.generate(text, frames, {**sampling, "check": check}):
            entropy.append(step.entropy)
            if not previews and step.level < len(self.scales(system)):
                continue
            features = runtime.decode_embedding(step.embedding, frames, text or "", guidance)
            joints = from_features67(runtime.normaliser.invert(features))
            yield GenerationStep(step.level, step.levels, tuple(entropy), Motion(joints, caption=text or ""), features)

    def generate(
        self, prompt: str | None, seconds: float, system: str = "lgtok-lite", seed: int = 0, **options: Any
    ) -> Generation:
        """The finished motion; arguments as in `generate_steps`. The same seed gives the same tokens."""
        began = time.perf_counter()
        (last,) = self.generate_steps(prompt, seconds, system, seed, previews=False, **options)
        return Generation(
            system=system,
            checkpoint=self.runtime(system).checkpoint,
            prompt=last.motion.caption,
            seed=seed,
            levels=last.levels,
            entropy=last.entropy,
            motion=last.motion,
            features=last.features,
            seconds=time.perf_counter() - began,
        )

    # ---- inside ---------------------------------------------------------------------------------------------------

    def _config(self, system: str) -> dict[str, Any]:
        """The config that a system's tokenizer file states."""
        row = row_of(system)
        head = header(checkpoint_path(self.assets, row.name, "tokenizer"))
        if head is None:
            raise PlaygroundError(row.absent)
        config: dict[str, Any] = json.loads(head["__metadata__"]["config"])
        return config

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
