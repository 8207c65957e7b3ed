"""The networks that measure: motion and text in one latent space (systems.md E5 and the CLIP-style row of F1).

Both read the 67 columns in patches of a few rows, and MiniLM token states; both are transformers with prefix tokens and
sinusoidal positions. Ours alone: patches, pre-norm blocks, smaller widths, and MiniLM in the place of T5 or CLIP.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from playground.motion.representation import COLUMNS
from playground.nn.blocks import UStack
from playground.nn.linear import Linear
from playground.nn.positions import sinusoid
from playground.text.features import TextFeatures
from playground.tokenizers.transformer import length_mask

KINDS = ("tmr", "clip")
LOG_VARIANCE = 10.0  # log-variances are clamped to plus and minus this (E5)
FIRST_SCALE = math.log(1 / 0.07)  # of the CLIP-style logits (F1)
LARGEST_SCALE = math.log(100.0)


@dataclass(frozen=True)
class EvaluatorConfig:
    """Shape of one evaluator network."""

    kind: str = "tmr"  # tmr | clip
    columns: int = COLUMNS
    patch: int = 4  # feature rows that make one motion token
    latent: int = 256
    width: int = 192
    heads: int = 4
    hidden: int = 512
    motion_depth: int = 4
    text_depth: int = 2
    decoder_depth: int = 2  # of the TMR style only
    dropout: float = 0.1
    text_width: int = 384


@dataclass(frozen=True, eq=False)
class Gaussian:
    """Diagonal normal distributions in the latent space: mean and log-variance [B, L]."""

    mean: Tensor
    log_variance: Tensor

    def sample(self, noise: Tensor) -> Tensor:
        """mean + noise * standard deviation, [B, L]; noise [B, L] is standard normal."""
        return self.mean + noise * (self.log_variance / 2).exp()


def _stack(config: EvaluatorConfig, depth: int) -> UStack:
    c = config
    return UStack(
        c.width, c.heads, c.hidden, depth, dropout=c.dropout, norm="layer", pre=True, feed="gelu", skips=False
    )


class PrefixEncoder(nn.Module):
    """Learned prefix tokens in front of a projected sequence, a transformer; the prefixes' states come out."""

    def __init__(self, config: EvaluatorConfig, inputs: int, depth: int, prefixes: int) -> None:
        super().__init__()
        self.project = Linear(inputs, config.width)
        self.prefixes = nn.Parameter(torch.randn(prefixes, config.width))
        self.stack = _stack(config, depth)

    def forward(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """x [B, S, inputs], mask [B, S] or None -> states [B, prefixes, D]."""
        batch, count = len(x), len(self.prefixes)
        states = self.project(x)
        states = torch.cat([self.prefixes.to(states.dtype).expand(batch, -1, -1), states], dim=1)
        positions = torch.arange(states.shape[1], device=x.device)
        states = states + sinusoid(positions, states.shape[-1]).to(states.dtype)
        if mask is not None:
            mask = F.pad(mask, (count, 0), value=True)
        return self.stack(states, None, mask)[:, :count]


def patches(features: Tensor, lengths: Tensor, patch: int) -> tuple[Tensor, Tensor | None]:
    """Rows [B, F, C] -> motion tokens [B, ceil(F / patch), patch * C] and their mask; rows beyond a length count 0."""
    short = -features.shape[1] % patch
    real = length_mask(lengths, features.shape[1])
    if real is not None:
        features = features * real[..., None]
    tokens = F.pad(features, (0, 0, 0, short)).unflatten(1, (-1, patch)).flatten(2)
    return tokens, length_mask((lengths + patch - 1) // patch, tokens.shape[1])


class EvaluatorNetwork(nn.Module):
    """What both kinds share: a motion encoder and a text encoder into vectors [B, L]."""

    def __init__(self, config: EvaluatorConfig, prefixes: int) -> None:
        super().__init__()
        self.config = config
        self.motion = PrefixEncoder(config, config.patch * config.columns, config.motion_depth, prefixes)
        self.text = PrefixEncoder(config, config.text_width, config.text_depth, prefixes)
        self.motion_head = Linear(config.width, config.latent)
        self.text_head = Linear(config.width, config.latent)

    def motion_states(self, features: Tensor, lengths: Tensor) -> Tensor:
        """features [B, F, C] normalised, lengths int64 [B] -> prefix states [B, prefixes, D]."""
        return self.motion(*patches(features, lengths, self.config.patch))

    def embed_motion(self, features: Tensor, lengths: Tensor) -> Tensor:
        """features [B, F, C] normalised, lengths int64 [B] -> [B, L], not of unit length."""
        return self.motion_head(self.motion_states(features, lengths)[:, 0])

    def embed_text(self, text: TextFeatures) -> Tensor:
        """B texts -> [B, L], not of unit length."""
        return self.text_head(self.text(text.tokens, text.mask)[:, 0])


class TMRNetwork(EvaluatorNetwork):
    """Variational encoders of motion and text, and a decoder from either latent back to motion (E5)."""

    def __init__(self, config: EvaluatorConfig) -> None:
        super().__init__(config, prefixes=2)
        self.motion_spread = Linear(config.width, config.latent)
        self.text_spread = Linear(config.width, config.latent)
        self.from_latent = Linear(config.latent, config.width)
        self.decoder = _stack(config, config.decoder_depth)
        self.motion_out = Linear(config.width, config.patch * config.columns)

    def motion_distribution(self, features: Tensor, lengths: Tensor) -> Gaussian:
        """features [B, F, C] normalised, lengths int64 [B] -> distributions of their latents."""
        mean, spread = self.motion_states(features, lengths).unbind(dim=1)
        return Gaussian(self.motion_head(mean), self.motion_spread(spread).clamp(-LOG_VARIANCE, LOG_VARIANCE))

    def text_distribution(self, text: TextFeatures) -> Gaussian:
        """B texts -> distributions of their latents."""
        mean, spread = self.text(text.tokens, text.mask).unbind(dim=1)
        return Gaussian(self.text_head(mean), self.text_spread(spread).clamp(-LOG_VARIANCE, LOG_VARIANCE))

    def decode(self, latent: Tensor, lengths: Tensor) -> Tensor:
        """latent [B, L], lengths int64 [B] -> normalised rows [B, longest, C], 0 beyond each length.

        Every position is its sinusoid plus the projected latent: what attention to that one state would add.
        """
        c, longest = self.config, int(lengths.max())
        tokens = (lengths + c.patch - 1) // c.patch
        count = int(tokens.max())
        start = self.from_latent(latent)[:, None]
        queries = start + sinusoid(torch.arange(count, device=latent.device), c.width).to(start.dtype)
        states = self.decoder(queries, None, length_mask(tokens, count))
        rows = self.motion_out(states).unflatten(-1, (c.patch, c.columns)).flatten(1, 2)[:, :longest]
        real = length_mask(lengths, longest)
        return rows if real is None else rows * real[..., None]


class ContrastiveNetwork(EvaluatorNetwork):
    """Two encoders and a learned scale of their cosines; the text side starts from MiniLM token states (F1)."""

    def __init__(self, config: EvaluatorConfig) -> None:
        super().__init__(config, prefixes=1)
        self.log_scale = nn.Parameter(torch.tensor(FIRST_SCALE))

    def scale(self) -> Tensor:
        """What cosines are multiplied by before the softmax, at most 100; scalar."""
        return self.log_scale.clamp(max=LARGEST_SCALE).exp()


def build_evaluator(config: EvaluatorConfig) -> TMRNetwork | ContrastiveNetwork:
    """The network of a config. ValueError for an unknown kind."""
    if config.kind == "tmr":
        return TMRNetwork(config)
    if config.kind == "clip":
        return ContrastiveNetwork(config)
    raise ValueError(f"unknown kind of evaluator {config.kind!r}; accepted: {', '.join(KINDS)}")
