"""The convolutional tokenizers of the other systems, one module: T2M-GPT, MoMask, MoMask++, MoSa and MOGO.

Convolutions reduce time, a quantizer of one or more levels turns the latents into tokens, convolutions lead back
(systems.md A9, B1, C1, D3, E3). They see no text: arguments for it are there because every tokenizer has them.

The commitment that a training pass returns is made for the outer weight 0.02 that all these papers have (A7, B1, D3,
E3). MOGO's holds C1's three terms, each times its own weight and divided by 0.02, so the same outer weight fits it.
"""

from dataclasses import dataclass, replace
from typing import Literal

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from playground.limits import LIMITS
from playground.nn.convolutions import ConvDecoder, ConvEncoder, Stack, Stage
from playground.text.encoders import TextFeatures
from playground.tokenizers.affine import Penalties
from playground.tokenizers.base import Quantized, Tokens, TrainingOutput
from playground.tokenizers.quantizers import MultiScaleQuantizer
from playground.tokenizers.transformer import FULL_SCALES, length_mask, linear_codes

Attention = Literal["none", "stages", "lowest"]


@dataclass(frozen=True)
class ConvConfig:
    """Every number of a convolutional tokenizer; the defaults are MoMask's published one (B1) on 67 columns."""

    columns: int = 67  # feature columns C
    heading: str = "body"  # rule by which the columns' heading is read off the body (motion/representation.py)
    max_frames: int = LIMITS.max_frames  # longest motion
    reduction: int = 4  # frames a latent, a power of 2; MOGO's literal reading is 1
    width: int = 512
    multipliers: tuple[int, ...] = (1, 1)  # width of each stage in widths; the last ones halve the steps
    block: str = "dilated"  # dilated | normed
    blocks: int = 3  # residual blocks a stage
    attention: Attention = "none"  # stages: after each (E3); lowest: after the last and in the middle (A9)
    middle: bool = False  # two more blocks between encoder stages and latents, and back (A9)
    heads: int = 4
    dropout: float = 0.2  # in residual blocks
    attention_dropout: float = 0.1  # E3
    divisors: tuple[int, ...] = (1,) * 6  # latents a token, a level
    fixed_scales: tuple[int, ...] = ()  # in place of divisors: tokens a level, whatever the length (A9)
    codes: tuple[int, ...] = (512,) * 6
    code_width: int = 512
    shared: bool = False  # one codebook for all levels (E3)
    enough: int = 0  # codes restart only from batches of more than so many vectors a code (E3: 5)
    metric: str = "euclidean"  # cosine | euclidean
    phi: str = "identity"  # conv | residual | identity
    draw: float = 0.5  # Gumbel temperature of the look-ups in training
    level_drop: float = 0.2  # share of training steps that use a prefix of the levels
    affine: bool = False  # learned scale and bias a level (C1)
    loss: Literal["running", "summed"] = "running"  # commitment: mean of levels (A6, B1, E3) | C1's sum with its terms
    beta: float = 0.02  # C1: commitment
    gamma: float = 1e-3  # C1: scales and biases
    decorrelation: float = 1e-2  # C1: lambda

    @property
    def latents(self) -> int:
        """Number of latents T at full length."""
        return -(-self.max_frames // self.reduction)

    @property
    def scales(self) -> tuple[int, ...]:
        """Tokens a level at full length."""
        return self.fixed_scales or tuple(max(1, self.latents // divisor) for divisor in self.divisors)


def _lite(config: ConvConfig, **changes: object) -> ConvConfig:
    """A system at a size that one CPU core trains."""
    return replace(config, **({"width": 128, "code_width": 128, "dropout": 0.0, "attention_dropout": 0.0} | changes))  # type: ignore[arg-type]


_MOMASK = ConvConfig()
_T2MGPT = replace(_MOMASK, divisors=(1,), codes=(512,), draw=0.0, level_drop=0.0, dropout=0.0)
_MOMASKPP = replace(
    _MOMASK, divisors=(8, 4, 2, 1), codes=(512,) * 4, shared=True, enough=5, attention="stages", level_drop=0.0
)
_MOSA = replace(
    _MOMASK, width=256, multipliers=(1, 2, 1), block="normed", blocks=2, attention="lowest", middle=True,
    divisors=(), fixed_scales=FULL_SCALES, codes=linear_codes(256, 768, 10), metric="cosine", phi="conv", draw=0.0,
    level_drop=0.0,
)  # fmt: skip
_MOGO = replace(_MOMASK, codes=(8192,) * 6, code_width=128, affine=True, loss="summed", draw=0.0, level_drop=0.0)
CONV_PRESETS: dict[str, ConvConfig] = {
    "t2mgpt": _T2MGPT,
    "momask": _MOMASK,
    "momaskpp": _MOMASKPP,
    "mosa": _MOSA,
    "mogo": _MOGO,
    "t2mgpt-lite": _lite(_T2MGPT),
    "momask-lite": _lite(_MOMASK),
    "momaskpp-lite": _lite(_MOMASKPP, codes=(256,) * 4),  # batches of 32 motions bring `enough` vectors for 256 codes
    "mosa-lite": _lite(_MOSA, width=80, code_width=112, codes=linear_codes(128, 384, 10), phi="residual"),
    "mogo-lite": _lite(_MOGO, codes=(512,) * 6, code_width=96),
}


class ConvTokenizer(nn.Module):
    """Tokenizer and detokenizer of convolutions. Plain arguments come from a ConvConfig through `build_conv`."""

    def __init__(self, config: ConvConfig) -> None:
        super().__init__()
        c = self.config = config
        if c.fixed_scales and (c.fixed_scales[-1] != c.latents or c.max_frames % c.reduction):
            raise ValueError(f"the last fixed scale must be all {c.latents} latents, got {c.fixed_scales[-1]}")
        if c.block == "normed" and not c.fixed_scales:
            raise ValueError("blocks with GroupNorm need fixed scales")
        self.stages = _stages(c)
        stack = Stack(
            c.block, c.blocks, c.heads, c.dropout, c.attention_dropout, c.middle, c.attention == "lowest"
        )  # fmt: skip
        self.encoder = ConvEncoder(c.columns, c.code_width, self.stages, stack)
        self.decoder = ConvDecoder(c.code_width, c.columns, self.stages, stack)
        self.quantizer = MultiScaleQuantizer(
            c.scales, c.codes, c.code_width, metric=c.metric, phi=c.phi, draw=c.draw, level_drop=c.level_drop,
            divisors=None if c.fixed_scales else c.divisors, shared=c.shared, enough=c.enough, affine=c.affine,
            penalties=Penalties(c.beta, c.gamma, c.decorrelation) if c.loss == "summed" else None,
        )  # fmt: skip

    # ---- lengths --------------------------------------------------------------------------------------------------

    def sizes(self, frames: int) -> tuple[int, ...]:
        """Tokens a level of a motion of so many frames."""
        c = self.config
        return c.fixed_scales or tuple(max(1, -(-frames // c.reduction) // divisor) for divisor in c.divisors)

    def latent_lengths(self, lengths: Tensor) -> Tensor | None:
        """Latents of motions of so many frames, int64 [B]; None where all have the same number."""
        return None if self.config.fixed_scales else (lengths + self.config.reduction - 1) // self.config.reduction

    def _steps(self, frames: int) -> int:
        """Frames that the convolutions run on: whole latents, or always the longest motion."""
        c = self.config
        return c.max_frames if c.fixed_scales else -(-frames // c.reduction) * c.reduction

    def _masks(self, lengths: Tensor, steps: int) -> list[Tensor | None]:
        """Which steps are real, bool [B, 1, steps] before the first stage and after each; None where all are."""
        if self.config.fixed_scales:
            return [None] * (len(self.stages) + 1)
        masks = [length_mask(lengths, steps)]
        for stage in self.stages:
            if stage.halve:
                lengths, steps = (lengths + 1) // 2, steps // 2
            masks.append(length_mask(lengths, steps))
        return [None if mask is None else mask[:, None] for mask in masks]

    # ---- tokenizer ------------------------------------------------------------------------------------------------

    def latents(
        self, features: Tensor, lengths: Tensor, text: TextFeatures | None, dropped: Tensor | None = None
    ) -> Tensor:
        """features [B, F, C] -> latents z [B, T, code width] before quantization, zero beyond each row's own T."""
        steps = self._steps(features.shape[1])
        real = length_mask(lengths, features.shape[1])
        x = features if real is None else features * real[..., None]
        x = F.pad(x.transpose(1, 2), (0, steps - features.shape[1]))
        z: Tensor = self.encoder(x, self._masks(lengths, steps))
        return z.transpose(1, 2)

    @torch.no_grad()
    def encode(self, features: Tensor, lengths: Tensor, text: TextFeatures | None) -> Quantized:
        """features [B, F, C] normalised, lengths int64 [B] -> Quantized; ids are 0 beyond each row's own tokens."""
        counts = self.latent_lengths(lengths)
        z = self.latents(features, lengths, text)
        return self.quantizer.encode(z if counts is None else z[:, : int(counts.max())], counts)

    @torch.no_grad()
    def embed(self, tokens: Tokens, levels: int | None = None, lengths: Tensor | None = None) -> Tensor:
        """Tokens -> embedding [B, T, code width] of the coarsest `levels` scales.

        lengths: frames of each row; None takes all ids as real, and needs a level with a token a latent.
        """
        return self.quantizer.embed(tokens, levels, None if lengths is None else self.latent_lengths(lengths))

    # ---- detokenizer ----------------------------------------------------------------------------------------------

    def detokenize(
        self, embedding: Tensor, lengths: Tensor, text: TextFeatures | None, dropped: Tensor | None, frames: int
    ) -> Tensor:
        """embedding [B, T, code width] -> features [B, frames, C], zero beyond each length."""
        steps = self._steps(frames)
        masks = self._masks(lengths, steps)
        z = F.pad(embedding.transpose(1, 2), (0, steps // self.config.reduction - embedding.shape[1]))
        z = z if masks[-1] is None else z * masks[-1]
        out: Tensor = self.decoder(z, masks).transpose(1, 2)[:, :frames]
        real = length_mask(lengths, frames)
        return out if real is None else out * real[..., None]

    @torch.no_grad()
    def decode(
        self,
        embedding: Tensor,
        lengths: Tensor,
        text: TextFeatures | None,
        guidance: float = 0.0,
        edit_mask: Tensor | None = None,
    ) -> Tensor:
        """embedding [B, T, code width] -> normalised features [B, F, C], F = longest length.

        There is no text in it, so guidance and edit_mask change nothing.
        """
        return self.detokenize(embedding, lengths, text, None, int(lengths.max()))

    @torch.no_grad()
    def branches(self, embedding: Tensor, lengths: Tensor, text: TextFeatures | None) -> tuple[Tensor, Tensor]:
        """The decode twice: with and without text it is the same."""
        plain = self.decode(embedding, lengths, text)
        return plain, plain

    # ---- training -------------------------------------------------------------------------------------------------

    def forward(
        self, features: Tensor, lengths: Tensor, text: TextFeatures | None, dropped: Tensor | None = None
    ) -> TrainingOutput:
        """One training pass: encode, quantize with straight-through gradients, decode."""
        z = self.latents(features, lengths, text, dropped)
        quantized = self.quantizer(z, self.latent_lengths(lengths))
        out = self.detokenize(quantized.embedding.to(z.dtype), lengths, text, dropped, features.shape[1])
        return TrainingOutput(out, quantized.commitment, quantized.ids)


def _stages(c: ConvConfig) -> list[Stage]:
    """Stages of a config. ValueError where the reduction is no power of 2, or more than the stages can do."""
    halvings = c.reduction.bit_length() - 1
    if c.reduction != 2**halvings or halvings > len(c.multipliers):
        raise ValueError(f"{len(c.multipliers)} stages cannot reduce time by {c.reduction}")
    widths = [c.width, *(c.width * multiplier for multiplier in c.multipliers)]
    last = len(c.multipliers) - 1
    return [
        Stage(
            widths[n],
            widths[n + 1],
            n > last - halvings,
            c.attention == "stages" or (c.attention == "lowest" and n == last),
        )
        for n in range(len(c.multipliers))
    ]


def build_conv(config: ConvConfig) -> ConvTokenizer:
    """The module for a config, randomly initialised, in training mode."""
    return ConvTokenizer(config)
