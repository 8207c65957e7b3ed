"""The torch side of the engine's studies: many variants of one motion at once, attention, draws with kept tokens.

Everything takes the loaded system and arrays of one motion, and keeps nothing.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from playground.errors import PlaygroundError
from playground.generators.base import Edit, redraw_masks
from playground.nn.sampling import Sampling, filter_logits
from playground.runtime import Runtime
from playground.systems import SamplingDefaults
from playground.tokenizers.base import Tokens
from playground.tokenizers.quantizers import resample_down
from playground.tokenizers.token_file import LevelTokens

CHUNK = 24  # motions that are decoded together; the time left is looked at in between

Floats = NDArray[np.float32]
Ids = NDArray[np.int64]
Bools = NDArray[np.bool_]
Check = Callable[[], None] | None


@torch.no_grad()
def shares(runtime: Runtime, levels: Sequence[LevelTokens]) -> list[Tensor]:
    """What each level adds to the embedding, [1, T, D] a level. PlaygroundError if the tokens do not fit."""
    runtime.embedding(levels, 0)
    quantizer = runtime.tokenizer.quantizer
    return [quantizer.share(n, torch.from_numpy(level.ids.copy())[None]) for n, level in enumerate(levels)]


def total(parts: Sequence[Tensor]) -> Tensor:
    """Sum of shares [B, T, D], coarse to fine, in the order in which `embed` adds them."""
    out = parts[0]
    for part in parts[1:]:
        out = out + part
    return out


def subset(runtime: Runtime, levels: Sequence[LevelTokens], chosen: Sequence[int]) -> Tensor:
    """Embedding [1, T, D] of some levels (from 0) alone; zeros if there are none."""
    parts = shares(runtime, levels)
    return total([parts[n] for n in chosen]) if chosen else torch.zeros_like(parts[0])


@torch.no_grad()
def replaced(runtime: Runtime, levels: Sequence[LevelTokens], level: int, ids: Ids) -> Tensor:
    """Embeddings [B, T, D] of one motion whose level `level` (from 0) holds other ids [B, s] in each row."""
    parts = shares(runtime, levels)
    parts[level] = runtime.tokenizer.quantizer.share(level, torch.from_numpy(np.array(ids, np.int64)))
    return total(parts)


def decode_many(
    runtime: Runtime, embeddings: Tensor, frames: int, caption: str, guidance: float = 0.0, check: Check = None
) -> Floats:
    """Embeddings [B, T, D] of motions of one length -> normalised rows [B, F, 67]."""
    features = []
    for part in embeddings.split(CHUNK):
        if check:
            check()
        text = runtime.texts([caption] * len(part)) if caption else None
        decoded = runtime.tokenizer.decode(part, torch.full((len(part),), frames), text, guidance)
        features.append(decoded.numpy())
    return np.concatenate(features)


def decode_edited(
    runtime: Runtime, levels: Sequence[LevelTokens], frames: int, caption: str, guidance: float, edited: Bools
) -> Floats:
    """Un-normalised rows [F, 67]; text acts only on the frames where `edited` (bool [F]) is True (Eq. 7)."""
    mask = torch.from_numpy(edited)[None]
    text = runtime.text(caption)
    decoded = runtime.tokenizer.decode(runtime.embedding(levels), torch.tensor([frames]), text, guidance, mask)
    return runtime.normaliser.invert(decoded[0].numpy())


@torch.no_grad()
def energies(runtime: Runtime, features: Floats, caption: str, levels: Sequence[LevelTokens]) -> Floats:
    """Share of the energy of a motion's latent that is left after 0..N levels of any tokens [N + 1]."""
    x = torch.from_numpy(runtime.normaliser.apply(features))[None]
    rest = runtime.tokenizer.latents(x, torch.tensor([len(features)]), runtime.text(caption)).float()
    left = [rest.square().mean()]
    for share in shares(runtime, levels):
        rest = rest - share
        left.append(rest.square().mean())
    norm = torch.stack(left)
    return (norm / norm[0].clamp(min=1e-12)).numpy()


@torch.no_grad()
def token_vectors(runtime: Runtime, ids: Sequence[Ids]) -> list[Floats]:
    """What each token adds to the embedding where it stands: ids [B, s_n] a level -> [B, s_n, D] a level.

    The share of its level, pooled back from the latents to the level's own length.
    """
    quantizer = runtime.tokenizer.quantizer
    vectors = []
    for level, level_ids in enumerate(ids):
        share = quantizer.share(level, torch.from_numpy(np.array(level_ids, np.int64)))
        vectors.append(resample_down(share, level_ids.shape[1]).numpy())
    return vectors


def text_attention(
    runtime: Runtime, levels: Sequence[LevelTokens], frames: int, caption: str
) -> tuple[list[str], Floats]:
    """Word pieces [W] and the detokenizer's attention to them [layers, heads, F, W]."""
    text = runtime.text(caption)
    reads = getattr(runtime.tokenizer, "text_attention", None)
    if text is None or reads is None:
        raise PlaygroundError("there is no attention to words without a caption, or in a system that reads none")
    try:
        weights = reads(runtime.embedding(levels), torch.tensor([frames]), text)[:, 0]
    except ValueError:
        raise PlaygroundError(f"the detokenizer of {runtime.name} has no cross-attention to text to look at") from None
    words = text.words[0]
    repeated = weights.repeat_interleave(runtime.tokenizer.config.patch, dim=2)[:, :, :frames, : len(words)]
    return list(words), repeated.numpy()


# ---- draws ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class DrawnBatch:
    """One step of a generation with several seeds."""

    level: int  # levels drawn, from 1
    levels: list[tuple[LevelTokens, ...]]  # one entry a seed
    entropy: Floats  # [B, s_level] bits
    embedding: Tensor  # [B, T, D]
    logits: Tensor  # [B, s_level, V], guided


def keep(levels: Sequence[LevelTokens], redraw: Sequence[Bools]) -> Edit:
    """Tokens of one motion of which those with redraw (bool [s_n] a level) are to be drawn anew."""
    tokens = Tokens(tuple(torch.from_numpy(o.ids.copy())[None] for o in levels), tuple(o.codes for o in levels))
    return Edit(tokens, tuple(torch.from_numpy(mask.copy()) for mask in redraw))


def resized_masks(redraw: Bools, sizes: Sequence[int]) -> list[Bools]:
    """Latents to draw anew (bool [T]) -> tokens to draw anew, bool [s_n] a level (A10)."""
    return [mask.numpy() for mask in redraw_masks(~torch.from_numpy(redraw), sizes)]


def draw_scales(
    runtime: Runtime,
    prompt: str | None,
    frames: int,
    seeds: Sequence[int],
    how: SamplingDefaults,
    check: Check = None,
    edit: Edit | None = None,
) -> Iterator[DrawnBatch]:
    """Draw one motion a seed, all at once, scale by scale; each row draws as it would alone.

    PlaygroundError if the system has no generator.
    """
    if runtime.generator is None:
        raise PlaygroundError(f"the system {runtime.name} has no generator; it can tokenize and decode only")
    options = {key: value for key, value in asdict(how).items() if key != "guidance"}
    sampling = Sampling(**options, check=check, seeds=tuple(seeds))
    text = runtime.texts([prompt] * len(seeds), prompts=True) if prompt else None
    lengths = torch.full((len(seeds),), frames)
    for step in runtime.generator.steps(text, lengths, sampling, edit):
        ids, codes = [level.numpy().astype(np.int64) for level in step.tokens.ids], step.tokens.codes
        levels = [
            tuple(LevelTokens(o.shape[1], c, o[row]) for o, c in zip(ids, codes, strict=False))
            for row in range(len(seeds))
        ]
        yield DrawnBatch(step.level, levels, step.entropy.numpy(), step.embedding, step.logits)


def chances(logits: Tensor, how: SamplingDefaults) -> tuple[Floats, Floats]:
    """Logits [V] -> probabilities [V] of the guided distribution, and those a draw goes by (temperature, filters)."""
    guided = logits.float().softmax(dim=-1).numpy()
    if how.temperature <= 0:
        drawn = torch.nn.functional.one_hot(logits.argmax(), len(logits)).float()
    else:
        drawn = filter_logits(logits.float() / how.temperature, how.top_k, how.top_p).softmax(dim=-1)
    return guided, drawn.numpy()
