"""The torch side of the engine's studies: many variants of one motion at once, attention, draws with kept tokens.

Everything takes the loaded system and arrays of one motion, and keeps nothing.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from playground.errors import PlaygroundError
from playground.generators.base import Edit, redraw_masks
from playground.nn.sampling import Sampling, filter_logits
from playground.runtime import Runtime
from playground.systems import SamplingDefaults
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Tokens
from playground.tokenizers.grids import resample_down
from playground.tokenizers.token_file import LevelTokens

CHUNK = 24  # motions that are decoded together; the time left is looked at in between

Floats = NDArray[np.float32]
Ids = NDArray[np.int64]
Bools = NDArray[np.bool_]
Check = Callable[[], None] | None


@torch.no_grad()
def shares(runtime: Runtime, levels: Sequence[LevelTokens], frames: int) -> list[Tensor]:
    """What each level adds to the embedding of a motion of so many frames, [1, T, D] a level.

    PlaygroundError if the tokens do not fit.
    """
    runtime.embedding(levels, frames, 0)
    return [share(runtime, n, level.ids[None], frames) for n, level in enumerate(levels)]


def share(runtime: Runtime, level: int, ids: Ids, frames: int) -> Tensor:
    """What level `level` (from 0) adds to embeddings of motions of one length: ids [B, s] -> [B, T, D]."""
    lengths = torch.full((len(ids),), runtime.latents(frames))
    return runtime.tokenizer.quantizer.share(level, torch.from_numpy(np.array(ids, np.int64)), lengths)


def total(parts: Sequence[Tensor]) -> Tensor:
    """Sum of shares [B, T, D], coarse to fine, in the order in which `embed` adds them."""
    out = parts[0]
    for part in parts[1:]:
        out = out + part
    return out


def subset(runtime: Runtime, levels: Sequence[LevelTokens], frames: int, chosen: Sequence[int]) -> Tensor:
    """Embedding [1, T, D] of some levels (from 0) alone; zeros if there are none."""
    parts = shares(runtime, levels, frames)
    return total([parts[n] for n in chosen]) if chosen else torch.zeros_like(parts[0])


@torch.no_grad()
def replaced(runtime: Runtime, levels: Sequence[LevelTokens], frames: int, level: int, ids: Ids) -> Tensor:
    """Embeddings [B, T, D] of one motion whose level `level` (from 0) holds other ids [B, s] in each row."""
    parts = shares(runtime, levels, frames)
    parts[level] = share(runtime, level, ids, frames)
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
    embedding = runtime.embedding(levels, frames)
    decoded = runtime.tokenizer.decode(embedding, torch.tensor([frames]), text, guidance, mask)
    return runtime.normaliser.invert(decoded[0].numpy())


@torch.no_grad()
def energies(runtime: Runtime, features: Floats, caption: str, levels: Sequence[LevelTokens]) -> Floats:
    """Share of the energy of a motion's latent that is left after 0..N levels of any tokens [N + 1]."""
    x = torch.from_numpy(runtime.normaliser.apply(features))[None]
    rest = runtime.tokenizer.latents(x, torch.tensor([len(features)]), runtime.text(caption)).float()
    left = [rest.square().mean()]
    for part in shares(runtime, levels, len(features)):
        rest = rest - part
        left.append(rest.square().mean())
    norm = torch.stack(left)
    return (norm / norm[0].clamp(min=1e-12)).numpy()


@torch.no_grad()
def token_vectors(runtime: Runtime, ids: Sequence[Ids], frames: int) -> list[Floats]:
    """What each token adds to the embedding where it stands: ids [B, s_n] a level -> [B, s_n, D] a level.

    The share of its level, pooled back from the latents to the level's own length. All motions have so many frames.
    """
    found = [share(runtime, level, level_ids, frames) for level, level_ids in enumerate(ids)]
    return [resample_down(one, level_ids.shape[1]).numpy() for one, level_ids in zip(found, ids, strict=True)]


def text_attention(
    runtime: Runtime, levels: Sequence[LevelTokens], frames: int, caption: str
) -> tuple[list[str], Floats]:
    """Word pieces [W] and the detokenizer's attention to them [layers, heads, F, W]."""
    text = runtime.text(caption)
    reads = getattr(runtime.tokenizer, "text_attention", None)
    if text is None or reads is None:
        raise PlaygroundError("there is no attention to words without a caption, or in a system that reads none")
    try:
        weights = reads(runtime.embedding(levels, frames), torch.tensor([frames]), text)[:, 0]
    except ValueError:
        raise PlaygroundError(f"the detokenizer of {runtime.name} has no cross-attention to text to look at") from None
    words = text.words[0]
    repeated = weights.repeat_interleave(runtime.tokenizer.config.patch, dim=2)[:, :, :frames, : len(words)]
    return list(words), repeated.numpy()


@dataclass(frozen=True, eq=False)
class WordMaps:
    """A generator's attention to the words of a prompt. weights: [S, F, W], a map a step of denoising, else one."""

    words: list[str]
    weights: Floats
    patch: int  # frames that share a row


def generator_attention(
    runtime: Runtime,
    prompt: str,
    frames: int,
    levels: Sequence[LevelTokens],
    seed: int,
    how: SamplingDefaults,
    check: Check = None,
) -> WordMaps | None:
    """Where the last layer of the generator looks in a prompt while it draws one motion; None where it cannot say.

    A diffusion is run once more with its seed; tokens are given to the network as they were drawn.
    """
    source: Any = runtime.generator if runtime.diffusion is None else runtime.diffusion
    reads = getattr(source, "alignment", None)
    if reads is None:
        return None
    text, lengths, sampling = _asked(runtime, prompt, frames, (seed,), how, check)
    assert text is not None
    try:
        if runtime.diffusion is not None:
            weights, patch = reads(text, lengths, sampling), int(source.network.config.patch)
        else:
            tokens = Tokens(tuple(torch.from_numpy(o.ids.copy())[None] for o in levels), tuple(o.codes for o in levels))
            drawn = reads(tokens, text, lengths)  # (1, T, W)
            weights = drawn[:, torch.arange(frames) * drawn.shape[1] // frames]
            patch = -(-frames // drawn.shape[1])
    except PlaygroundError:  # the time is up
        raise
    except ValueError:  # a variant that sees the pooled text alone, or words in front of the motion
        return None
    words = list(text.words[0])
    return WordMaps(words, weights[:, :, : len(words)].float().numpy(), patch)


# ---- draws ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class DrawnBatch:
    """One step of a generation with several seeds. entropy, logits: of the levels that this step has finished."""

    level: int  # levels drawn, from 1
    levels: list[tuple[LevelTokens, ...]]  # one entry a seed
    entropy: tuple[Floats, ...]  # [B, s_n] bits a level
    embedding: Tensor  # [B, T, D]
    logits: tuple[Tensor, ...]  # [B, s_n, V] a level, guided

    def logits_of(self, level: int) -> Tensor | None:
        """Those of level number `level` (from 1); None if another step has finished it."""
        place = level - 1 - (self.level - len(self.logits))
        return self.logits[place] if 0 <= place < len(self.logits) else None


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

    PlaygroundError if the system has no generator of tokens.
    """
    generator, done = runtime.drawing, 0
    for step in generator.steps(*_asked(runtime, prompt, frames, seeds, how, check), edit):
        ids, codes = [level.numpy().astype(np.int64) for level in step.tokens.ids], step.tokens.codes
        levels = [
            tuple(LevelTokens(o.shape[1], c, o[row]) for o, c in zip(ids, codes, strict=False))
            for row in range(len(seeds))
        ]
        sizes, done = [o.shape[1] for o in ids[done:]], step.level  # a step may finish several levels
        entropy = tuple(part.numpy() for part in step.entropy.split(sizes, dim=1))
        yield DrawnBatch(step.level, levels, entropy, step.embedding, step.logits.split(sizes, dim=1))


def draw_features(
    runtime: Runtime, prompt: str | None, frames: int, seeds: Sequence[int], how: SamplingDefaults, check: Check = None
) -> Iterator[tuple[int, int, Floats]]:
    """Motions of a system without tokens, one a seed: steps done, steps in all, normalised rows [B, F, C] so far."""
    assert runtime.diffusion is not None
    for done, count, guess in runtime.diffusion.steps_of(*_asked(runtime, prompt, frames, seeds, how, check)):
        yield done, count, guess.numpy()


def _asked(
    runtime: Runtime, prompt: str | None, frames: int, seeds: Sequence[int], how: SamplingDefaults, check: Check
) -> tuple[TextFeatures | None, Tensor, Sampling]:
    """Text, lengths and sampling of a draw of one motion a seed."""
    options = {key: value for key, value in asdict(how).items() if key != "guidance"}
    text = runtime.texts([prompt] * len(seeds), prompts=True) if prompt else None
    return text, torch.full((len(seeds),), frames), Sampling(**options, check=check, seeds=tuple(seeds))


def chances(logits: Tensor, how: SamplingDefaults) -> tuple[Floats, Floats]:
    """Logits [V] -> probabilities [V] of the guided distribution, and those a draw goes by (temperature, filters)."""
    guided = logits.float().softmax(dim=-1).numpy()
    if how.temperature <= 0:
        drawn = torch.nn.functional.one_hot(logits.argmax(), len(logits)).float()
    else:
        drawn = filter_logits(logits.float() / how.temperature, how.top_k, how.top_p).softmax(dim=-1)
    return guided, drawn.numpy()
