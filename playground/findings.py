"""What the studies of the engine give back: plain dataclasses with numpy arrays, for one motion each. No torch.

Scales count from 1 (as on the screen), positions of tokens, codes and frames from 0; a span is (start, stop), its
first frame and the frame after its last.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.motion.motion import Motion
from playground.results import Generation, Tokenized
from playground.tokenizers.token_file import LevelTokens

Floats = NDArray[np.float32]
Ids = NDArray[np.int64]
Bools = NDArray[np.bool_]

SCALE_KINDS = ("upto", "only", "without")


@dataclass(frozen=True)
class ScaleSet:
    """Which scales a decode uses: the coarsest up to one, only one, or all without one. Written "only:3"."""

    kind: str  # one of SCALE_KINDS
    scale: int  # from 1

    def __str__(self) -> str:
        return f"{self.kind}:{self.scale}"

    @classmethod
    def of(cls, value: "ScaleSet | int | str | None", count: int) -> "ScaleSet":
        """From 7 or "upto:7" (scales 1 to 7), "only:7", "without:7" or None (all) for a system of `count` scales.

        PlaygroundError for anything else, or a scale that is not there.
        """
        if isinstance(value, str):
            kind, _, number = value.partition(":")
            value = cls(kind, int(number) if number.isascii() and number.isdigit() and len(number) < 4 else 0)
        if value is None:
            value = cls("upto", count)
        chosen = value if isinstance(value, ScaleSet) else cls("upto", value)
        if chosen.kind not in SCALE_KINDS or chosen.scale not in range(1, count + 1):
            raise PlaygroundError(
                f"the scales {str(chosen)[:40]} were asked for; 1 to {count}, only:1 to only:{count} or without:1 to"
                f" without:{count} are accepted"
            )
        return chosen

    def levels(self, count: int) -> tuple[int, ...]:
        """The scales that are used, as indices from 0."""
        if self.kind == "upto":
            return tuple(range(self.scale))
        return tuple(n for n in range(count) if (n == self.scale - 1) == (self.kind == "only"))


@dataclass(frozen=True, eq=False)
class ScaleStudy:
    """One motion decoded from scales 1 to n, for every n; or from other sets of scales."""

    system: str
    checkpoint: str
    guidance: float
    sets: tuple[ScaleSet, ...]  # [N] what was decoded
    mpjpe_mm: Floats  # [N] pelvis-relative error of each decode against the tokenized motion
    energy: Floats  # [N + 1] share of the latent's energy left after 0..N scales
    motions: tuple[Motion, ...] = field(repr=False)  # [N] of F poses
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class Neighbours:
    """The codes of one codebook that are most like a code."""

    system: str
    scale: int
    code: int
    codes: Ids  # [k] most alike first, the code itself left out
    similarity: Floats  # [k] cosine of the angle between the code vectors
    opposite: int  # the code least alike
    opposite_similarity: float


@dataclass(frozen=True)
class Occurrence:
    """A place where a code stands in stored tokens."""

    id: str  # of the clip in the stored analysis, or of the example
    kind: str  # "clip" | "example"
    title: str  # our words
    position: int  # of the token in its scale
    size: int  # tokens of the scale
    frames: tuple[int, int]  # the token's equal share of the motion; what it governs has to be measured
    seconds: tuple[float, float]  # the same in seconds
    motion_frames: int


@dataclass(frozen=True, eq=False)
class Swap:
    """One token replaced by another code, and what that does to the motion."""

    scale: int
    position: int
    before: int  # code
    code: int  # code now
    guidance: float
    levels: tuple[LevelTokens, ...]  # with the new code
    tokenized: Tokenized | Generation = field(repr=False)  # what was given, with the new tokens
    original: Motion = field(repr=False)  # decoded from the old tokens
    motion: Motion = field(repr=False)  # decoded from the new ones
    features: Floats = field(repr=False)  # [F, 67] of `motion`, normalised
    difference: Floats = field(repr=False)  # [F, 22] metres, as motion/differences.py compares
    drift: Floats = field(repr=False)  # [F] metres between the two pelvises on the floor, which adds up over time
    span: tuple[int, int] = (0, 0)  # measured: the frames the change governs
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class Language:
    """One motion tokenized with its caption, with none and with a wrong one."""

    caption: str
    wrong: str
    captioned: tuple[LevelTokens, ...]
    bare: tuple[LevelTokens, ...]
    misled: tuple[LevelTokens, ...]
    bare_flips: tuple[Bools, ...]  # [s_n] a level: another code than with the caption
    misled_flips: tuple[Bools, ...]
    mpjpe_mm: tuple[float, float, float]  # the same text at both ends, g = 0: caption, none, wrong
    motions: tuple[Motion, Motion, Motion] = field(repr=False)
    seconds: float = 0.0

    @property
    def bare_share(self) -> float:
        """Share of all tokens that differ without the caption."""
        return float(np.concatenate(self.bare_flips).mean())

    @property
    def misled_share(self) -> float:
        """Share of all tokens that differ with the wrong caption."""
        return float(np.concatenate(self.misled_flips).mean())


@dataclass(frozen=True, eq=False)
class Attention:
    """Cross-attention of the detokenizer: how much each frame looks at each word piece."""

    words: list[str]  # [W] word pieces, the encoder's marks for begin and end included
    weights: Floats  # [F, W] mean over layers and heads, rows sum to 1
    by_layer: Floats = field(repr=False)  # [layers, heads, F, W]
    patch: int = 1  # frames that share one row, as they share one query
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class Alignment:
    """How much each frame of a generated motion looked at each word piece while the motion was drawn."""

    system: str
    checkpoint: str
    what: str  # which attention it is, in words
    words: list[str]  # [W] word pieces, the encoder's marks for begin and end included
    weights: Floats  # [F, W] mean over steps and heads, rows sum to 1
    by_step: Floats = field(repr=False)  # [S, F, W] one map a step of denoising, noisiest first; S = 1 without steps
    patch: int = 1  # frames that share one row, as they share one token or one query
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class Alternatives:
    """What else a generated token could have been, given all coarser scales."""

    scale: int
    position: int
    chosen: int  # the code that was drawn
    codes: Ids  # [k] most probable first
    probabilities: Floats  # [k] of the guided distribution, whose entropy is shown
    chances: Floats  # [k] after temperature, top-k and top-p: what a draw goes by, 0 for what these leave out
    chosen_probability: float
    entropy: float  # bits
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class Seam:
    """One border between kept and edited frames. A jolt is the mean over joints of |x[f+1] - 2 x[f] + x[f-1]|, the
    larger one of the two frames at the border, in mm."""

    frame: int  # the first frame after the border
    jolt_mm: float
    unblended_mm: float  # if the edited frames were put in without the blend
    source_mm: float  # of the source motion at the same place


@dataclass(frozen=True, eq=False)
class Edited:
    """A motion of which some frames were drawn anew. Kept frames are the source's own, copied back."""

    system: str
    checkpoint: str
    kind: str
    span: tuple[int, int]  # as given
    prompt: str  # "" for free-form
    seed: int
    anchor: str  # "place" | "body", see Engine.edit
    source: Motion
    motion: Motion
    kept: Bools  # [F] True where the frame is the source's
    levels: tuple[LevelTokens, ...]  # drawn tokens mixed with the source's
    redrawn: tuple[Bools, ...]  # [s_n] a level: tokens that were drawn anew
    seams: tuple[Seam, ...]
    blend: int  # edited frames at each border that lean towards the kept side
    gap_m: float  # how far on the floor the edited frames missed the kept ones that follow, before `anchor` closed it
    gap_degrees: float  # and by how much they faced elsewhere
    promise: str  # how it is guaranteed that kept frames stay as they were, in a sentence
    plain: Motion = field(repr=False)  # decoded from `levels` alone, nothing copied back
    plain_error_mm: float = 0.0  # pelvis-relative error of `plain` in the kept frames
    seconds: float = 0.0

    @property
    def seam_mm(self) -> Floats:
        """[borders] jolt of every border."""
        return np.array([seam.jolt_mm for seam in self.seams], np.float32)


@dataclass(frozen=True, eq=False)
class Placed:
    """Where a motion, or each of its tokens, belongs in the stored maps of a system."""

    system: str
    checkpoint: str
    each: str  # "clip" | "token"
    tsne: Floats  # [2], or [tokens, 2] coarse to fine
    pca: Floats  # the same
    nearest: tuple[str, ...]  # ids of the stored clips nearest in all dimensions, nearest first; none for tokens
    seconds: float = 0.0
