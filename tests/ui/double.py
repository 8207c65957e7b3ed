"""A stand-in for the engine with the same methods and no model: the same input always gives the same random tokens.

It lets the rooms be tested without torch. What it "decodes" is the motion it was given, shaken less and less the more
scales are used, so that the error falls with every scale as the real one does.
"""

import tempfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from playground.analysis.bundle import Bundle, BundleClip, counts_of, write_bundle
from playground.engine import check_generation, prepare
from playground.motion.measures import mpjpe
from playground.motion.motion import Motion
from playground.motion.representation import to_features67
from playground.motion.synthetic import corpus
from playground.results import Decoded, Example, GenerationStep, GuidancePair, Tokenized
from playground.systems import SYSTEMS, SystemInfo
from playground.text.prompts import normalise
from playground.tokenizers.token_file import LevelTokens, TokenFile
from tests.ui.double_drawing import Drawing
from tests.ui.double_endless import Endless
from tests.ui.double_studies import Studies, shaken

SIZES = (1, 2, 3, 4, 6, 8, 12, 18, 26, 36)
CODES = (128, 128, 192, 192, 256, 256, 320, 320, 384, 384)
DENOISER, DENOISED = "mdm-casim-decoder", 4  # a system without tokens, and its steps
KINDS = ("synthetic", "generated", "decoded clip")


@lru_cache(maxsize=1)
def motions() -> list[Motion]:
    """A handful of synthetic motions with their first captions."""
    made = corpus(6, seed=4)
    return [replace(one.motion, caption=one.captions[0], name=one.captions[0]) for one in made]


def tokens(seed: int) -> tuple[LevelTokens, ...]:
    """Random tokens of all scales."""
    rng = np.random.default_rng(seed)
    return tuple(LevelTokens(s, c, rng.integers(0, c, s)) for s, c in zip(SIZES, CODES, strict=True))


@lru_cache(maxsize=4)
def stored_analysis(
    system: str = "lgtok", sizes: tuple[int, ...] = SIZES, codes: tuple[int, ...] = CODES, frames: int = 80
) -> Bundle:
    """A map of 90 clips in three groups with random tokens."""
    rng = np.random.default_rng(5)
    groups = ["walk", "wave", "sit"] * 30
    centres = {"walk": (0.0, 0.0), "wave": (6.0, 1.0), "sit": (2.0, 6.0)}
    points = np.array([centres[group] for group in groups]) + rng.normal(size=(90, 2))
    clips = tuple(
        BundleClip(f"c{n}", n, "take", group, f"a person does {group}", frames) for n, group in enumerate(groups)
    )
    ids = [np.minimum(rng.geometric(0.02, (90, size)), most) - 1 for size, most in zip(sizes, codes, strict=True)]
    means = np.concatenate([points, rng.normal(size=(90, 6))], axis=1).astype(np.float32)
    energy = np.tile(0.7 ** np.arange(len(sizes) + 1), (90, 1)).astype(np.float32)
    return Bundle(
        system, "fake00000000", "made up", "test", 0, 30.0, (0.4, 0.2), 0.7, 0.33, sizes, codes, {}, "", clips,
        means, points.astype(np.float32), points[:, ::-1].astype(np.float32).copy(),
        np.concatenate(ids, axis=1).astype(np.int16), counts_of(ids, codes), energy, np.full(90, 40.0, np.float32),
        np.zeros(8, np.float32), np.eye(2, 8, dtype=np.float32), *_token_map(rng, sizes),
    )  # fmt: skip


def _token_map(rng: np.random.Generator, sizes: tuple[int, ...]) -> tuple[NDArray[Any], ...]:
    """Index, centre, axes, scores and places of 20 tokens of every scale."""
    scale = np.repeat(np.arange(1, len(sizes) + 1), 20)
    index = np.stack([rng.integers(0, 90, len(scale)), scale, rng.integers(0, np.array(sizes)[scale - 1])], axis=1)
    scores = (rng.normal(size=(len(scale), 3)) + scale[:, None] * [1.0, 0.5, 0.0]).astype(np.float16)
    places = (scores[:, :2] * 4).astype(np.float32)
    return index.astype(np.int32), np.zeros(8, np.float32), np.eye(3, 8, dtype=np.float32), scores, places


class FakeEngine(Drawing, Studies, Endless):
    """What the rooms use of the engine. `pause` is called before every scale of a generation.

    denoises: with a second system, DENOISER, that makes motions without tokens; others: with these systems of the
    table, which have the same scales.
    """

    def __init__(
        self, pause: Callable[[], None] = lambda: None, denoises: bool = False, others: Sequence[str] = ()
    ) -> None:
        self.pause = pause
        self.denoises = denoises
        self.others = tuple(others)
        self.calls: list[str] = []
        self.assets = Path(tempfile.mkdtemp(prefix="stand-in-"))
        write_bundle(self.assets / "analysis", stored_analysis())

    def systems(self) -> list[SystemInfo]:
        facts: dict[str, Any] = {}
        name, text = "LG-Tok transformer", "minilm"
        own = SystemInfo("lgtok", "LG-Tok", "lgtok", name, "sar", text, 13_000_000, "none", "shipped", facts)
        other = replace(own, name=DENOISER, title="MDM with CASIM, decoder", family="mdm", tokenizer=None)
        rows = [SYSTEMS[one] for one in self.others]
        more = [
            replace(own, name=row.name, title=row.title, family=row.family, generator=row.generator,
                    sampling=row.sampling) for row in rows
        ]  # fmt: skip
        return [own, *more, *([replace(other, sampling=SYSTEMS[DENOISER].sampling)] if self.denoises else [])]

    def reads_words(self, system: str) -> bool:
        return system.startswith("lgtok") and system != "lgtok-notext"

    def scales(self, system: str) -> list[tuple[int, int]]:
        return [] if system == DENOISER else list(zip(SIZES, CODES, strict=True))

    def sizes(self, system: str, frames: int) -> tuple[int, ...]:
        return () if system == DENOISER else SIZES

    def codebooks(self, system: str) -> list[NDArray[np.float64]]:
        if system == DENOISER:
            return []
        rng = np.random.default_rng(3)
        return [rng.normal(size=(codes, 8)) for codes in CODES]

    def examples(self) -> list[Example]:
        return [
            Example(
                f"m{n}",
                motion.name.capitalize(),
                motion.caption,
                "walk",
                KINDS[n % 3],
                "made up",
                partial(_same, motion),
            )
            for n, motion in enumerate(motions())
        ]

    def tokenize(self, motion: Motion, caption: str = "", system: str = "lgtok") -> Tokenized:
        self.calls.append("tokenize")
        caption = normalise(caption, what="caption", allow_empty=True)
        _, cut = prepare(motion)
        own = "" if system == "lgtok" else system
        levels = tokens(zlib.crc32(cut.joints.tobytes() + f"{caption}{own}".encode()))
        scale = np.linspace(1, 0.2, len(SIZES))[:, None, None]
        per_level = (np.random.default_rng(0).normal(size=(len(SIZES), 36, 16)) * scale).astype(np.float32)
        energy = np.concatenate([[1.0], 0.7 * 0.7 ** np.arange(len(SIZES))]).astype(np.float32)
        return Tokenized(system, "fake", caption, cut, levels, energy, per_level.sum(axis=0), per_level, 0.05)

    def reconstruct(
        self, tokenized: Tokenized, guidance: float = 0.0, scales: int | None = None, caption: str | None = None
    ) -> Decoded:
        self.calls.append(f"reconstruct {scales}")
        used = scales or len(SIZES)
        size = 0.2 + 0.2 * (zlib.crc32(tokenized.motion.joints.tobytes()) % 100) / 100
        motion = shaken(tokenized.motion, size * 0.75**used)
        error = mpjpe(tokenized.motion.joints, motion.joints)
        return Decoded(motion, _features(motion), error, guidance, used, 0.04)

    def decode(self, file: TokenFile, caption: str | None = None, guidance: float = 0.0, scales: Any = None) -> Decoded:
        self.calls.append("decode")
        source = motions()[zlib.crc32(file.levels[0].ids.tobytes()) % len(motions())]
        motion = replace(source, joints=np.resize(source.joints, (file.frames, 22, 3)))
        return Decoded(motion, _features(motion), None, guidance, len(file.levels), 0.04)

    def generate_steps(
        self, prompt: str | None, seconds: float, system: str = "lgtok", seed: int = 0, guidance: float = 2.0,
        cfg: float = 4.0, temperature: float = 1.0, top_k: float = 0.2, top_p: float = 0.95, **rest: Any,
    ) -> Iterator[GenerationStep]:  # fmt: skip
        self.calls.append("generate")
        text = None if prompt is None else normalise(prompt)
        frames = check_generation(seconds, seed, guidance, cfg, temperature, top_k, top_p)
        levels = tokens(zlib.crc32(f"{text}{seed}".encode()))
        source = motions()[zlib.crc32(f"{text}".encode()) % len(motions())]
        clean = replace(source, joints=np.resize(source.joints, (frames, 22, 3)))
        rng = np.random.default_rng(1)
        entropy: list[NDArray[np.float32]] = []
        for n in range(1, (DENOISED if system == DENOISER else 0) + 1):
            self.pause()
            motion = shaken(clean, 0.4 * 0.7**n)
            yield GenerationStep(n, (), (), motion, _features(motion), DENOISED)
        for n in range(1, (0 if system == DENOISER else len(levels)) + 1):
            self.pause()
            entropy.append(rng.uniform(0, 5, SIZES[n - 1]).astype(np.float32))
            motion = shaken(clean, 0.4 * 0.7**n)
            yield GenerationStep(n, levels[:n], tuple(entropy), motion, _features(motion), len(levels))

    def guidance_pair(self, result: Tokenized, caption: str | None = None) -> GuidancePair:
        self.calls.append("guidance_pair")
        worded, wordless = _features(result.motion), _features(shaken(result.motion, 0.02))
        mean, std = worded.mean(axis=0), worded.std(axis=0) + np.float32(1e-2)
        return GuidancePair((worded - mean) / std, (wordless - mean) / std, mean, std)


def _same(motion: Motion) -> Motion:
    return motion


def _features(motion: Motion) -> NDArray[np.float32]:
    """[F, 67] of F poses, the last one standing for its own step."""
    return to_features67(np.concatenate([motion.joints, motion.joints[-1:]]))
