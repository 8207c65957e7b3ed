"""MDM, diffusion over feature rows instead of tokens (arXiv 2209.14916), plain and with CASIM (arXiv 2502.02063; D4).

A transformer is shown noisy rows, the step and the text, and predicts the clean rows x0. Sampling walks from noise to a
motion, predicting x0 at every step it visits: all steps with fresh noise (ancestral), or few and without (DDIM).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from playground.generators.base import FeatureBatch
from playground.limits import LIMITS
from playground.nn.attention import Memory
from playground.nn.blocks import Block
from playground.nn.linear import Linear
from playground.nn.modules import module_list
from playground.nn.norm import build_norm
from playground.nn.positions import sinusoid
from playground.nn.sampling import Sampling, guide
from playground.nn.transfer import on_device
from playground.text.encoders import TextFeatures

CASIM = ("none", "encoder", "decoder")


@dataclass(frozen=True)
class DiffusionConfig:
    """Every number of the denoiser and its sampler; the defaults are MDM's published ones on the 67 columns."""

    columns: int = 67
    heading: str = "body"  # rule of the columns' heading (motion/representation.py)
    max_frames: int = LIMITS.max_frames
    casim: str = "none"  # none: pooled text in one token; encoder, decoder: all text tokens (D4)
    patch: int = 1  # frames that one token of the transformer stands for
    width: int = 512
    depth: int = 8
    heads: int = 4
    hidden: int = 1024
    dropout: float = 0.1
    text_width: int = 512
    text_positions: int = LIMITS.max_text_positions  # positions kept for the text in front of the motion
    null_words: int = 12  # positions of the null text where no text is given at all
    steps: int = 50  # of the noise schedule; 1000 is MDM's other one
    visited: int = 50  # steps that sampling visits
    noise: float = 1.0  # fresh noise while sampling: 1 ancestral, 0 deterministic (DDIM)


PRESETS: dict[str, DiffusionConfig] = {
    "full": DiffusionConfig(),
    "lite": DiffusionConfig(
        patch=4, width=160, depth=6, hidden=384, dropout=0.0, text_width=384, visited=10, noise=0.0
    ),
}  # fmt: skip


def cosine_schedule(steps: int) -> Tensor:
    """Share of the clean signal's power after t = 0..steps steps, float64 [steps + 1], from 1 down to almost 0.

    cos² of (t / steps + 0.008) / 1.008 quarter turns, no step taking away more than 0.999 (Nichol and Dhariwal 2021,
    Eq. 17).
    """
    wave = torch.cos((torch.arange(steps + 1, dtype=torch.float64) / steps + 0.008) / 1.008 * torch.pi / 2) ** 2
    taken = (1 - wave[1:] / wave[:-1]).clamp(max=0.999)
    return torch.cat([torch.ones(1, dtype=torch.float64), (1 - taken).cumprod(dim=0)])


def diffuse(clean: Tensor, share: Tensor, noise: Tensor) -> Tensor:
    """x_t of clean rows [B, F, C]: mean sqrt(share) x0, variance 1 - share; share [B]."""
    share = share[:, None, None]
    return share.sqrt() * clean + (1 - share).sqrt() * noise


def step_back(noisy: Tensor, clean: Tensor, share: float, before: float, noise: float) -> tuple[Tensor, float]:
    """From x_t to the step visited next, given the predicted x0: its mean, and the size of the noise to add.

    share, before: signal shares at t and at the next step. noise: 1 the posterior q(x_before | x_t, x0), 0 DDIM.
    """
    size = noise * ((1 - before) / (1 - share) * (1 - share / before)) ** 0.5
    direction = (noisy - share**0.5 * clean) / (1 - share) ** 0.5
    return before**0.5 * clean + max(1 - before - size**2, 0.0) ** 0.5 * direction, size


class Denoiser(nn.Module):
    """The network: noisy rows, step and text in, clean rows out. No causal mask; padded frames and words are masked."""

    def __init__(self, config: DiffusionConfig) -> None:
        super().__init__()
        if config.casim not in CASIM:
            raise ValueError(f"unknown kind of CASIM {config.casim!r}; accepted: {', '.join(CASIM)}")
        c = self.config = config
        self.enter = Linear(c.patch * c.columns, c.width)
        self.leave = Linear(c.width, c.patch * c.columns)
        self.text_proj = Linear(c.text_width, c.width)
        self.time = nn.Sequential(Linear(c.width, c.width), nn.SiLU(), Linear(c.width, c.width))
        self.blocks = module_list(
            Block(
                c.width, c.heads, c.hidden, memories=int(c.casim == "decoder"), dropout=c.dropout, norm="layer",
                pre=False, feed="gelu",
            )
            for _ in range(c.depth)
        )  # fmt: skip
        self.norm = build_norm("layer", c.width) if c.casim == "decoder" else nn.Identity()
        self.shares = cosine_schedule(c.steps)  # stays on the CPU, in float64

    def forward(
        self,
        noisy: Tensor,
        lengths: Tensor,
        steps: Tensor,
        text: TextFeatures | None,
        dropped: Tensor | None = None,
        record: list[Tensor] | None = None,
    ) -> Tensor:
        """Rows [B, F, C] after steps int64 [B] (from 1) of noise -> predicted clean rows [B, F, C], 0 where padded.

        text None, and rows where dropped (bool [B]) is True, stand for the null text. record takes the last layer's
        cross-attention [B, H, T, W] of the decoder variant.
        """
        x, real = self._tokens(noisy, lengths)
        words, mask = self._words(text, dropped, len(noisy), noisy.device)
        words = words + self.time(sinusoid(steps - 1, self.config.width).to(words.dtype))[:, None]
        if self.config.casim == "decoder":
            x = self._decode(x, real, words, mask, record)
        else:
            x = self._encode(x, real, words, mask)
        out = self.leave(x).unflatten(-1, (self.config.patch, self.config.columns)).flatten(1, 2)
        return out[:, : noisy.shape[1]] * _real(lengths, noisy.shape[1])[..., None]

    def _tokens(self, noisy: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
        """Rows [B, F, C] -> a token a patch [B, T, D], and bool [B, T] where the patch holds a real frame."""
        frames, patch = noisy.shape[1], self.config.patch
        rows = noisy * _real(lengths, frames)[..., None]
        rows = F.pad(rows, (0, 0, 0, -frames % patch))
        tokens = self.enter(rows.unflatten(1, (-1, patch)).flatten(-2))
        return tokens, _real(-(-lengths // patch), tokens.shape[1])

    def _words(
        self, text: TextFeatures | None, dropped: Tensor | None, rows: int, device: torch.device
    ) -> tuple[Tensor, Tensor]:
        """Projected text [B, W, D] and its mask [B, W]; one word, the pooled text, without CASIM."""
        pooled = self.config.casim == "none"
        if text is None:
            states = torch.zeros(rows, 1 if pooled else self.config.null_words, self.config.text_width, device=device)
            mask = torch.ones(states.shape[:2], dtype=torch.bool, device=device)
        elif pooled:
            states, mask = text.pooled[:, None], torch.ones(rows, 1, dtype=torch.bool, device=device)
        else:
            states, mask = text.tokens, text.mask
        if dropped is not None:
            states = states * ~dropped[:, None, None]
        return self.text_proj(states), mask

    def _place(self, x: Tensor, start: int) -> Tensor:
        """x [B, T, D] with the positions start, start + 1, ... added."""
        places = torch.arange(start, start + x.shape[1], device=x.device)
        return F.dropout(x + sinusoid(places, self.config.width).to(x.dtype), self.config.dropout, self.training)

    def _encode(self, x: Tensor, real: Tensor, words: Tensor, mask: Tensor) -> Tensor:
        """[words; motion] through the layers; the motion's positions begin at the same place for every text."""
        first = 1 if self.config.casim == "none" else self.config.text_positions
        count = words.shape[1]
        x = torch.cat([self._place(words, 0), self._place(x, first)], dim=1)
        keys = torch.cat([mask, real], dim=1)
        for block in self.blocks:
            x = block(x, None, keys)
        return self.norm(x[:, count:])

    def _decode(self, x: Tensor, real: Tensor, words: Tensor, mask: Tensor, record: list[Tensor] | None) -> Tensor:
        """The motion through the layers, each looking at the words."""
        x = self._place(x, 0)
        for number, block in enumerate(self.blocks, 1):
            memory = Memory(words, mask, record=record if number == len(self.blocks) else None)
            x = block(x, None, real, [memory])
        return self.norm(x)

    def training_loss(self, batch: FeatureBatch, rng: torch.Generator) -> tuple[Tensor, Tensor]:
        """Mean squared error of the predicted x0 over the real frames, at a random step a motion; the same as figure.

        Steps and noise come from `rng`, a source on the CPU.
        """
        clean = batch.features
        steps = torch.randint(1, self.config.steps + 1, (len(clean),), generator=rng)
        noise = on_device(torch.randn(clean.shape, generator=rng), clean.device)
        noisy = diffuse(clean, on_device(self.shares[steps].float(), clean.device), noise)
        predicted = self(noisy, batch.lengths, on_device(steps, clean.device), batch.text, batch.dropped)
        real = _real(batch.lengths, clean.shape[1])[..., None]
        wrong = (predicted.float() - clean).square() * real
        loss = wrong.sum() / (real.sum() * clean.shape[-1]).clamp(min=1)
        return loss, loss.detach()


@dataclass(frozen=True, eq=False)
class DiffusionGenerator:
    """The network as a generator of feature rows; holds no state of a call."""

    likelihood: ClassVar[bool] = False
    network: Denoiser

    def visits(self) -> list[int]:
        """Steps of the schedule that sampling visits, evenly spread, from the noisiest down to 1."""
        c = self.network.config
        return [round(float(t)) for t in torch.linspace(c.steps, 1, min(c.visited, c.steps), dtype=torch.float64)]

    def sample(self, text: TextFeatures | None, lengths: Tensor, sampling: Sampling) -> Tensor:
        """Normalised rows [B, F, C], 0 beyond each motion's length (int64 [B] frames)."""
        *_, (_, _, rows) = self.steps_of(text, lengths, sampling)
        return rows

    @torch.no_grad()
    def steps_of(
        self,
        text: TextFeatures | None,
        lengths: Tensor,
        sampling: Sampling,
        record: list[Tensor] | None = None,
    ) -> Iterator[tuple[int, int, Tensor]]:
        """Yield (steps done, steps in all, predicted x0 [B, F, C]) after every step; the last x0 is the motion.

        Guidance is u + s (c - u) on x0 with s = sampling.cfg (D4; 2.5 in the paper): 1 is the text alone, 0 none.
        """
        visits, shares = self.visits(), self.network.shares.tolist()
        rngs = sampling.rng()
        noisy = self._noise(lengths, rngs)
        for done, (step, after) in enumerate(zip(visits, [*visits[1:], 0], strict=True), 1):
            if sampling.check is not None:
                sampling.check()
            clean = self._guided(noisy, lengths, step, text, sampling.cfg, record)
            yield done, len(visits), clean
            if after:
                noisy, size = step_back(noisy, clean, shares[step], shares[after], self.network.config.noise)
                noisy = noisy + size * self._noise(lengths, rngs) if size > 0 else noisy

    def alignment(self, text: TextFeatures, lengths: Tensor, sampling: Sampling) -> Tensor:
        """Which words each frame of one motion looks at, by step: weights [steps, F, W], averaged over heads.

        The last layer's cross-attention with the text (not the null text); rows sum to 1. ValueError for another
        variant than the decoder, or for a batch.
        """
        if self.network.config.casim != "decoder" or len(lengths) != 1:
            raise ValueError("the alignment is that of one motion, by the decoder variant")
        record: list[Tensor] = []
        for _ in self.steps_of(text, lengths, sampling, record):
            pass
        weights = torch.stack([layer[0].mean(dim=0) for layer in record])  # (steps, T, W)
        return weights.repeat_interleave(self.network.config.patch, dim=1)[:, : int(lengths[0])]

    def _noise(self, lengths: Tensor, rngs: torch.Generator | list[torch.Generator]) -> Tensor:
        """Standard noise [B, F, C], 0 beyond each row's length; drawn row by row on the CPU, as long as the row."""
        counts, columns = lengths.tolist(), self.network.config.columns
        sources = [rngs] * len(counts) if isinstance(rngs, torch.Generator) else rngs
        out = torch.zeros(len(counts), max(counts), columns)
        for row, (count, rng) in enumerate(zip(counts, sources, strict=True)):
            out[row, :count] = torch.randn(count, columns, generator=rng)
        return out.to(lengths.device)

    def _guided(
        self,
        noisy: Tensor,
        lengths: Tensor,
        step: int,
        text: TextFeatures | None,
        scale: float,
        record: list[Tensor] | None,
    ) -> Tensor:
        """x0 [B, F, C] from both branches, in one pass where both are needed."""
        rows = len(lengths)
        steps = torch.full((rows,), step, device=noisy.device)
        if text is None or scale == 1:
            return self.network(noisy, lengths, steps, text, None, record)
        text = TextFeatures(
            torch.cat([text.tokens] * 2), torch.cat([text.mask] * 2), torch.cat([text.pooled] * 2), text.words * 2
        )
        dropped = torch.arange(2 * rows, device=noisy.device) >= rows
        both = self.network(torch.cat([noisy] * 2), lengths.repeat(2), steps.repeat(2), text, dropped, record)
        return guide(both[:rows], both[rows:], scale - 1)


def _real(lengths: Tensor, frames: int) -> Tensor:
    """bool [B, frames], True up to each length."""
    return torch.arange(frames, device=lengths.device) < lengths[:, None]


def build_denoiser(config: DiffusionConfig) -> Denoiser:
    """The network for a config, randomly initialised, in training mode."""
    return Denoiser(config)
