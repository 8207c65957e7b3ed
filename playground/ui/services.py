"""What every room is handed: the engine, opened once and late, and what is known without it."""

import hashlib
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from playground.analysis.bundle import Bundle, read_bundle
from playground.errors import PlaygroundError
from playground.figures.stage import code_colors, message
from playground.motion.motion import Motion
from playground.systems import DEFAULT_SYSTEM, SamplingDefaults, checkpoint_path, header, row_of
from playground.ui.facts import as_sentence
from playground.ui.view import View, read_view

if TYPE_CHECKING:
    from playground.engine import Engine, Example, SystemInfo

EngineSource = Callable[[], "Engine"]
SIDE_BY_SIDE = (DEFAULT_SYSTEM, "momask", "mogo")  # systems that rooms show first: three, so that a screen stays calm
KIND_WORDS = {"synthetic": "synthetic", "generated": "generated here", "decoded clip": "recorded, kept as tokens"}


class Services:
    """The rooms' door to the engine. Making one opens nothing."""

    def __init__(self, engine: EngineSource) -> None:
        self._source = engine
        self._bundles: dict[str, Bundle] = {}
        self._palettes: dict[str, list[NDArray[np.uint8]]] = {}

    def engine(self) -> "Engine":
        """The engine; opening it the first time may take a second."""
        return self._source()

    def examples(self) -> list["Example"]:
        """The example library in the order to show it; empty if there is none."""
        return list(self.engine().examples())

    def example(self, wanted: str) -> "Example":
        """The example of that id; PlaygroundError if there is none."""
        for example in self.examples():
            if example.id == wanted:
                return example
        raise PlaygroundError("that example is not in the library any more; choose another one")

    def example_motion(self, wanted: str) -> Motion:
        """The motion of an example."""
        return self.example(wanted).motion()

    def example_choices(self) -> list[tuple[str, str]]:
        """(what the menu says, id) of every example."""
        return [(f"{e.title} · {KIND_WORDS.get(e.kind, e.kind)}", e.id) for e in self.examples()]

    def opening_example(self) -> "Example":
        """The example that the page opens with: the first of the library; PlaygroundError if it is empty."""
        found = self.examples()
        if not found:
            raise PlaygroundError("the example library is not here; upload a motion to begin")
        return found[0]

    def palettes(self, system: str) -> list[NDArray[np.uint8]]:
        """Colours uint8 [codes, 3] of every scale's codebook, so that near codes look near."""
        if system not in self._palettes:
            self._palettes[system] = [code_colors(codes) for codes in self.engine().codebooks(system)]
        return self._palettes[system]

    def scales(self, system: str) -> list[tuple[int, int]]:
        """(tokens, codes) of every scale of a system at full length; [] without a tokenizer."""
        return [(int(size), int(codes)) for size, codes in self.engine().scales(system)]

    def sizes(self, system: str, frames: int) -> list[tuple[int, int]]:
        """(tokens, codes) of every scale of a motion of so many frames; [] without a tokenizer."""
        counts = self.engine().sizes(system, frames)
        return [(int(size), codes) for size, (_, codes) in zip(counts, self.scales(system), strict=True)]

    def checkpoint(self, system: str) -> str:
        """What a token file says of a system: 12 digits of its first file's sha256, "" where there is no file."""
        path = checkpoint_path(self.engine().assets, system, row_of(system).parts[0])
        if not path.is_file():
            return ""
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()[:12]

    def opening_path(self, name: str) -> Path:
        """Where the stored first result of a room lies."""
        return self.engine().assets / "opening" / f"{name}.json"

    def fingerprint(self) -> str:
        """Which checkpoints and which analysis stored results must come from to be shown; read from headers alone."""
        assets, mark = self.engine().assets, hashlib.sha256()
        for system in self.engine().systems():
            heads = [header(checkpoint_path(assets, system.name, part)) for part in ("tokenizer", "generator")]
            if any(heads):
                mark.update(json.dumps([system.name, heads], sort_keys=True).encode())
        return mark.hexdigest()[:16]

    def shipped(self, part: str = "") -> list["SystemInfo"]:
        """The systems whose checkpoint is here; with a part ("tokenizer" or "generator") those that have it."""
        there = [system for system in self.engine().systems() if system.checkpoint == "shipped"]
        return [system for system in there if not part or getattr(system, part)]

    def editors(self) -> list["SystemInfo"]:
        """The shipped systems that can draw a part of a motion anew: those with tokens and a generator of them."""
        return [system for system in self.shipped("tokenizer") if system.generator]

    def readers(self) -> list["SystemInfo"]:
        """The shipped systems whose decoder reads words, which is where the guidance g acts; the usual one first."""
        found = [system for system in self.shipped("tokenizer") if self.engine().reads_words(system.name)]
        usual = self.default_system().name if found else ""
        return sorted(found, key=lambda system: system.name != usual)

    def first_few(self, known: Sequence[str]) -> list[str]:
        """Of the systems named those that a room shows side by side at first; the usual one where none of them is."""
        return [name for name in SIDE_BY_SIDE if name in known] or [self.default_system().name]

    def preset(self, room: str, example: str) -> View | None:
        """The stored result of a room for an example, or None."""
        return read_view(self.opening_path(f"{room}-{example}"), self.fingerprint())

    def first_view(self, name: str, compute: Callable[["Services"], View]) -> View:
        """The stored first result of a room, or one computed now; an empty stage with one sentence without either."""
        found = read_view(self.opening_path(name), self.fingerprint())
        if found is not None:
            return found
        try:
            return compute(self)
        except PlaygroundError as error:
            return View(stage=message("empty", as_sentence(str(error))))

    def bundle(self, system: str) -> Bundle:
        """The stored analysis of a system, read once; PlaygroundError if it is not there."""
        if system not in self._bundles:
            self._bundles[system] = read_bundle(self.engine().assets / "analysis", system)
        return self._bundles[system]

    def refines(self) -> bool:
        """Whether a root refiner is shipped."""
        return self.engine().refines

    def sampling(self, name: str = "") -> SamplingDefaults:
        """How a system ("" for the one the page prefers) generates where nothing else is asked for."""
        try:
            return self.system(name).sampling
        except PlaygroundError:
            return SamplingDefaults()

    def system(self, name: str = "") -> "SystemInfo":
        """A shipped system by its name, "" for the one the page prefers. PlaygroundError if it is not shipped."""
        if not name:
            return self.default_system()
        for system in self.shipped():
            if system.name == name:
                return system
        raise PlaygroundError(f"the system {name} is not shipped with this copy; choose another one")

    def default_system(self) -> "SystemInfo":
        """The usual system where it is here, else the first that tokenizes and generates, or else the first one.

        PlaygroundError if none is shipped.
        """
        shipped = self.shipped()
        if not shipped:
            raise PlaygroundError("no trained system is shipped with this copy; train one with: make train")
        able = [system for system in shipped if system.generator and system.tokenizer]
        return next((system for system in able if system.name == DEFAULT_SYSTEM), (able or shipped)[0])
