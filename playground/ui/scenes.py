"""What stands on the stage in each room: payloads of figures/stage.py made from what the engine returns."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from playground.figures import stage as scene
from playground.figures.stage import NOT_FRAMES, ORIGINAL_ID, Json
from playground.motion.motion import Motion
from playground.systems import row_of
from playground.ui.cards import term
from playground.ui.facts import Fact, bits, bits_text, millimetres

if TYPE_CHECKING:
    from playground.engine import Decoded, GuidancePair, SystemInfo, Tokenized

MPJPE_CARD = term("mpjpe")
FIXED_GUIDANCE = (0, 1, 2, 3, 4)
MARKS = {"[CLS]": "(begin)", "[SEP]": "(end)"}  # of the encoder, in plain words


def score(
    system: "SystemInfo",
    frames: int,
    levels: Sequence[Any],
    palettes: Sequence[Any] | None = None,
    entropy: Sequence[Any] | None = None,
    sizes: Sequence[tuple[int, int]] = (),
    spans: Sequence[Any] | None = None,
    marks: Sequence[Any] | None = None,
    marked: str = "",
) -> Json:
    """The score of one motion: LevelTokens `levels` as rows. The scales of `sizes`, (tokens, codes) each, that have no
    tokens yet are drawn empty. palettes: colours uint8 [codes, 3] a scale; entropy: bits [s] a scale; spans: measured
    frames [s, 2] a scale, None where it was not measured; marks: bool [s] a scale, and `marked` what they mean."""
    rows = []
    for n, level in enumerate(levels):
        colors = palettes[n] if palettes else None
        nats = np.asarray(entropy[n], np.float64) * math.log(2) if entropy else None  # the engine counts in bits
        span, mark = spans[n] if spans else None, marks[n] if marks else None
        rows.append(scene.level(level.ids, level.codes, colors, nats, spans=span, marks=mark))
    rows += [scene.level(None, codes, size=size) for size, codes in sizes[len(levels) :]]
    note = "" if row_of(system.name).latents_are_frames else NOT_FRAMES
    return scene.track(system.name, system.title, frames, rows, note, marked or "changed")


def tokenized_scene(
    system: "SystemInfo", tokenized: "Tokenized", decoded: "Decoded", palettes: Sequence[Any] | None
) -> Json:
    """The original and what its tokens give back, with the score."""
    original = scene.figure(ORIGINAL_ID, "Original", tokenized.motion.joints)
    error = f"MPJPE {millimetres(decoded.mpjpe_mm)}"
    rebuilt = scene.figure(
        "rebuilt", f"From tokens ({system.title})", decoded.motion.joints, system.name, error, ghost_of=ORIGINAL_ID
    )
    track = score(system, tokenized.motion.frames, tokenized.levels, palettes)
    return scene.payload([original, rebuilt], [track])


def clip_scene(
    system: "SystemInfo", motion: Motion, levels: Sequence[Any], palettes: Sequence[Any] | None, name: str, note: str
) -> Json:
    """One motion decoded from stored tokens; `note` says so under its name."""
    shown = scene.figure("clip", name[:1].upper() + name[1:], motion.joints, system.name, note)
    return scene.payload([shown], [score(system, motion.frames, levels, palettes)])


def generated_scene(
    system: "SystemInfo", motion: Motion, levels: Sequence[Any], entropy: Sequence[Any], palettes: Sequence[Any] | None,
    sizes: Sequence[tuple[int, int]],
) -> Json:  # fmt: skip
    """A generated motion after some scales; `sizes` says which scales are still to come."""
    caption = f"scale {len(levels)} of {len(sizes)}" if len(levels) < len(sizes) else ""
    made = scene.figure("made", "Generated", motion.joints, system.name, caption)
    return scene.payload([made], [score(system, motion.frames, levels, palettes, entropy=entropy, sizes=sizes)])


def guidance_scene(
    system: "SystemInfo", motion: Motion, levels: Sequence[Any], pair: "GuidancePair", palettes: Sequence[Any] | None,
    guidance: float,
) -> Json:  # fmt: skip
    """One motion at the slider's guidance and at five fixed ones, all recovered in the browser from both decodes."""
    frames = len(pair.conditional)
    figures = [scene.figure("live", "Your g", None, system.name, "follows the slider", g="live", frames=frames)]
    for g in FIXED_GUIDANCE:
        figures.append(scene.figure(f"g{g}", f"g = {g}", None, system.name, g=g, frames=frames))
    features = scene.features("live", pair.conditional, pair.unconditional, pair.mean, pair.std, guidance)
    return scene.payload(figures, [score(system, motion.frames, levels, palettes)], features)


def words_strip(name: str, pieces: Sequence[str], weights: NDArray[np.float32]) -> Json:
    """Attention [F, W'] to word pieces as a heat map under the score, words by frames.

    The ramp ends at the largest share that a word gets: marks and full stops, which take the most of it whatever the
    motion does, may lie beyond.
    """
    words, columns = readable_words(pieces, weights)
    telling = [n for n, word in enumerate(words) if word not in MARKS.values() and any(map(str.isalnum, word))]
    most = float(columns[:, telling].max()) if telling else 0.0
    return scene.strip("attention", name, "of its attention", words, columns.T, most or None)


def readable_words(pieces: Sequence[str], weights: NDArray[np.float32]) -> tuple[list[str], NDArray[np.float32]]:
    """Word pieces as words [W'], their weights [F, W'] added up, in order; the encoder's marks are put in plain words.

    "##ing" continues the word before it (WordPiece).
    """
    names: list[str] = []
    columns: list[NDArray[np.float32]] = []
    for n, piece in enumerate(pieces):
        if piece.startswith("##") and names:
            names[-1] += piece[2:]
            columns[-1] = columns[-1] + weights[:, n]
            continue
        names.append(MARKS.get(piece, piece))
        columns.append(weights[:, n])
    return names, np.stack(columns, axis=1)


def token_facts(levels: Sequence[Any], used: int | None = None) -> tuple[Fact, ...]:
    """Token count and bits of the first `used` scales."""
    kept = list(levels)[:used]
    sizes, codes = [int(level.size) for level in kept], [int(level.codes) for level in kept]
    return (
        Fact(f"{sum(sizes):,}", "tokens", term("tokens")),
        Fact(bits_text(bits(sizes, codes)), "to store", term("bits")),
    )


def error_fact(decoded: "Decoded") -> Fact:
    """MPJPE of one clip."""
    return Fact(millimetres(decoded.mpjpe_mm), "MPJPE, this clip", MPJPE_CARD)
