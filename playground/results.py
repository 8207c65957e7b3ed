"""What the engine gives back: plain dataclasses with numpy arrays, for one motion each. No torch."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.motion.motion import Motion
from playground.motion.representation import COLUMNS
from playground.systems import SamplingDefaults, row_of
from playground.tokenizers.token_file import LevelTokens, TokenFile

Floats = NDArray[np.float32]


def _no_rows() -> Floats:
    return np.zeros((0, COLUMNS), np.float32)


@dataclass(frozen=True, eq=False)
class Tokenized:
    """A motion as tokens."""

    system: str
    checkpoint: str  # first 12 digits of the sha256 of the tokenizer's file
    caption: str
    motion: Motion  # what was tokenized: canonical, F poses, F a multiple of 4
    levels: tuple[LevelTokens, ...]
    residual_energy: Floats  # [N + 1], share of the mean square of z left after 0..N scales
    embedding: Floats  # [T, D], sum of all scales
    per_level: Floats  # [N, T, D], each scale's share
    seconds: float = 0.0
    features: Floats = field(default_factory=_no_rows, repr=False)  # [F, 67] un-normalised rows; [0, 67] if not at hand

    def token_file(self) -> TokenFile:
        """The same tokens as a file that can be saved and decoded."""
        return TokenFile(self.system, self.checkpoint, self.caption, self.motion.frames, self.levels)


@dataclass(frozen=True, eq=False)
class Decoded:
    """Tokens as a motion again."""

    motion: Motion  # F poses
    features: Floats  # [F, 67], normalised
    mpjpe_mm: float | None  # pelvis-relative against the tokenized motion, where there is one
    guidance: float
    scales: int  # how many were used
    seconds: float = 0.0
    subset: str = ""  # which ones: upto:7, only:3 or without:3


@dataclass(frozen=True, eq=False)
class GenerationStep:
    """A motion on its way: what is known after some scales, or without tokens after some steps of denoising."""

    level: int  # scales drawn, or steps done, from 1
    levels: tuple[LevelTokens, ...]  # empty for a system without tokens
    entropy: tuple[Floats, ...]  # [s_n] bits a scale, of the distributions drawn from
    motion: Motion  # decoded from the scales so far
    features: Floats = field(repr=False)  # [F, 67] of that motion, normalised
    of: int = 0  # scales, or steps, in all; 0 where nobody counts them

    @property
    def last(self) -> bool:
        """Whether nothing comes after it."""
        return self.level >= self.of


@dataclass(frozen=True, eq=False)
class Generation:
    """A finished generation."""

    system: str
    checkpoint: str
    prompt: str  # "" for free-form
    seed: int
    levels: tuple[LevelTokens, ...]  # empty for a system without tokens
    entropy: tuple[Floats, ...]
    motion: Motion
    features: Floats = field(repr=False)  # [F, 67], normalised
    seconds: float = 0.0
    sampling: SamplingDefaults = field(default_factory=SamplingDefaults)  # what it was drawn and decoded with
    refiner: str = ""  # checkpoint of the root refiner that its way over the ground comes from; "" for none

    @property
    def caption(self) -> str:
        """The text a decoder is guided by: the prompt."""
        return self.prompt

    def token_file(self) -> TokenFile:
        """The tokens as a file that can be saved and decoded. PlaygroundError if the system makes none."""
        if not self.levels:
            raise PlaygroundError(row_of(self.system).no_tokenizer)
        return TokenFile(self.system, self.checkpoint, self.prompt, self.motion.frames, self.levels)


@dataclass(frozen=True, eq=False)
class GuidancePair:
    """Both branches of language-free guidance: m = (1 + g) conditional - g unconditional, normalised (A8)."""

    conditional: Floats  # [F, 67]
    unconditional: Floats  # [F, 67]
    mean: Floats  # [67]
    std: Floats  # [67]


@dataclass(frozen=True, eq=False)
class Example:
    """One entry of the example library."""

    id: str
    title: str
    caption: str
    action: str
    kind: str  # synthetic | generated | decoded clip
    origin: str  # one sentence
    source: Callable[[], Motion] = field(repr=False)

    def motion(self) -> Motion:
        """The motion itself; a decoded clip is decoded on the fly."""
        return self.source()
