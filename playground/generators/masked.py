"""MoMask: a masked transformer for the first level, a residual transformer for the others (arXiv 2312.00063; B2, B3).

Also MoMask on LG-Tok's tokenizer (A11), whose latents are all real and which needs no padding masks. One module holds
both transformers and the estimator of a motion's length, so that they are trained and stored together.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from playground.errors import PlaygroundError
from playground.generators.base import Edit, Step, TokenBatch, null_text
from playground.generators.masking import (
    MaskingGenerator,
    Trunk,
    TrunkConfig,
    branch_logits,
    choose,
    corrupt,
    draw_hidden,
    prediction_loss,
    small_init,
    text_branches,
)
from playground.limits import LIMITS
from playground.nn.linear import Linear
from playground.nn.sampling import Sampling, entropy_bits
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Tokens, level_masks
from playground.tokenizers.quantizers import MultiScaleQuantizer


@dataclass(frozen=True)
class MaskedConfig(TrunkConfig):
    """Every number of MoMask's generator; the defaults are the published one. text_width: of the pooled text."""

    residual_drop: float = 1 / 9  # share of the rows with text that the residual half loses besides: 0.1 becomes 0.2
    residual_guidance: float = 1.25  # times Sampling.cfg: 5 where the masked half has 4 (B3)
    edit_guidance: float = 0.5  # the same while editing: 2
    length_classes: int = LIMITS.max_frames // 4 + 1  # of the length estimator; 0: it is left out
    length_unit: int = 4  # frames a class

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(set(self.scales)) != 1 or len(self.scales) < 2:
            raise ValueError("MoMask needs two levels or more, of as many tokens each")


MASKED_PRESETS: dict[str, MaskedConfig] = {
    "full": MaskedConfig(),
    "lite": MaskedConfig(
        width=128, depth=4, heads=2, hidden=256, dropout=0.1, text_width=384, code_width=96, small_init=False
    ),
}


class MaskedTransformer(nn.Module):
    """Tokens of the first level, some hidden, and the pooled text -> logits (B2)."""

    def __init__(self, config: MaskedConfig) -> None:
        super().__init__()
        self.tokens = nn.Embedding(config.codes[0] + 2, config.code_width)  # codes, mask, pad
        self.trunk = Trunk(config, config.codes[0])

    def forward(self, ids: Tensor, real: Tensor, pooled: Tensor) -> Tensor:
        """ids int64 [B, T] with mask and pad tokens, real bool [B, T], pooled [B, text width] -> logits [B, T, V]."""
        positions = torch.arange(ids.shape[1])
        return self.trunk(self.tokens(ids), positions, real, self.trunk.text_proj(pooled)[:, None])


class ResidualTransformer(nn.Module):
    """Tokens of all lower levels and the pooled text -> logits of a level (B3).

    One table a level: as input a level's tokens are looked up in it, as output the dot products with it are the logits,
    so the output table of a level is the input table of the next level's pass.
    """

    def __init__(self, config: MaskedConfig) -> None:
        super().__init__()
        self.tables = nn.Parameter(torch.empty(len(config.codes), config.codes[0], config.code_width))
        self.level = nn.Embedding(len(config.codes), config.width)
        self.trunk = Trunk(config, config.code_width)
        nn.init.normal_(self.tables, std=0.02 if config.small_init else config.code_width**-0.5)
        if not config.small_init:  # what is read of the tables weighs as much as the positions
            self.trunk.token_proj.weight.data.mul_(config.code_width**0.5)

    def forward(self, ids: tuple[Tensor, ...], level: Tensor, real: Tensor, pooled: Tensor) -> Tensor:
        """ids int64 [B, T] a level, of which those below `level` (int64 [B], from 1) are read -> logits [B, T, V]."""
        positions = torch.arange(real.shape[1])
        total = torch.zeros((), device=real.device)
        for below, known in enumerate(ids):
            total = total + F.embedding(known, self.tables[below]) * (level > below)[:, None, None]
        prefix = torch.stack([self.trunk.text_proj(pooled), self.level(level)], dim=1)
        return self.trunk(total, positions, real, prefix) @ self.tables[level].transpose(1, 2)


class LengthEstimator(nn.Module):
    """Pooled text -> logits of the motion's length in classes of so many frames (B3)."""

    def __init__(self, text_width: int, classes: int, widths: tuple[int, ...] = (512, 256, 128)) -> None:
        super().__init__()
        self.hidden = nn.ModuleList(
            nn.Sequential(Linear(inputs, outputs), nn.LayerNorm(outputs), nn.LeakyReLU(0.2), nn.Dropout(0.2))
            for inputs, outputs in zip((text_width, *widths), widths, strict=False)
        )
        self.out = Linear(widths[-1], classes)

    def forward(self, pooled: Tensor) -> Tensor:
        """pooled [B, text width] -> logits [B, classes]."""
        for layer in self.hidden:
            pooled = layer(pooled)
        return self.out(pooled)


class MaskedResidual(nn.Module):
    """MoMask's generator: both transformers and the length estimator."""

    def __init__(self, config: MaskedConfig) -> None:
        super().__init__()
        self.config = config
        self.masked = MaskedTransformer(config)
        self.residual = ResidualTransformer(config)
        self.length = LengthEstimator(config.text_width, config.length_classes) if config.length_classes else None
        if config.small_init:
            self.apply(small_init)

    def length_class(self, lengths: Tensor) -> Tensor:
        """Frames int64 [B] -> class int64 [B]."""
        return (lengths // self.config.length_unit).clamp(0, self.config.length_classes - 1)

    def training_loss(
        self, batch: TokenBatch, quantizer: MultiScaleQuantizer, rng: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        """Sum of the three losses, and the share of right arg-maxes of both transformers; scalars.

        The residual half learns one level a row, low ones more often: round((1 - cos(pi u / 2)) (N - 2)) + 1 (B3).
        """
        real, pooled = batch.masks[0], batch.text.pooled
        seen, hidden = corrupt(batch.ids[0], real, self.config.codes[0], rng)
        with_text = pooled * ~batch.dropped[:, None]
        loss, right = prediction_loss(self.masked(seen, real, with_text), batch.ids[0], hidden)

        chance = torch.rand(len(real), 2, generator=rng)
        if self.training:
            with_text = with_text * (chance[:, :1] >= self.config.residual_drop).to(real.device)
        reach = (1 - (chance[:, 1] * math.pi / 2).cos()) * (len(batch.ids) - 2)
        level = (reach.round().long() + 1).to(real.device)
        target = torch.stack(batch.ids)[level, torch.arange(len(level), device=real.device)]
        other, more = prediction_loss(self.residual(batch.ids, level, real, with_text), target, real)

        loss = loss + other
        if self.length is not None:
            loss = loss + F.cross_entropy(self.length(pooled).float(), self.length_class(batch.lengths))
        return loss, (right + more) / (hidden.sum() + real.sum())


@dataclass(frozen=True, eq=False)
class MaskedGenerator(MaskingGenerator):
    """The network with the tokenizer whose tokens it draws; holds no state of a call."""

    network: MaskedResidual

    @torch.no_grad()
    def steps(
        self, text: TextFeatures | None, lengths: Tensor, sampling: Sampling, edit: Edit | None = None
    ) -> Iterator[Step]:
        """Draw the first level by iterative decoding, every other one in one pass; yield after each level (B2, B3).

        text None draws free-form. Same seed, same tokens. An edit's redraw may differ by row ([B, T] a level).
        """
        net, c = self.network, self.network.config
        real = level_masks(self.tokenizer, lengths)[0]
        rng = sampling.rng()
        reading = null_text(len(lengths), c.text_width, 1).to(real.device) if text is None else text
        further = sampling.cfg * (c.residual_guidance if edit is None else c.edit_guidance)

        def guided(level: int, ids: tuple[Tensor, ...], cfg: float) -> Tensor:
            branches = text_branches(text, cfg)
            pooled = torch.cat([reading.pooled * (not null) for null in branches])
            ids, here = tuple(torch.cat([part] * len(branches)) for part in ids), torch.cat([real] * len(branches))
            if level == 0:
                return branch_logits(net.masked(ids[0], here, pooled), branches, cfg)
            which = torch.full((len(here),), level, device=here.device)
            return branch_logits(net.residual(ids, which, here, pooled), branches, cfg)

        drawn: list[Tensor] = []
        for level in range(len(c.codes)):
            redraw = real if edit is None else real & edit.redraw[level]
            source = torch.zeros_like(real, dtype=torch.long) if edit is None else edit.tokens.ids[level] * real
            if level == 0:
                ids, logits = draw_hidden(
                    lambda hidden: guided(0, (hidden,), sampling.cfg), source, redraw, real, c, sampling, rng
                )
            else:
                if sampling.check is not None:
                    sampling.check()
                logits = guided(level, tuple(drawn), further)
                ids = torch.where(redraw, choose(logits, sampling, rng, real), source)
            drawn.append(ids)
            tokens = Tokens(tuple(drawn), c.codes)
            embedding = self.tokenizer.embed(tokens, None, lengths)
            yield Step(level + 1, tokens, embedding, entropy_bits(logits), logits)

    @torch.no_grad()
    def estimate_length(self, text: TextFeatures) -> Tensor:
        """Probabilities [B, classes] of the motion's length; class k stands for k * config.length_unit frames.

        PlaygroundError if the network has no length estimator.
        """
        if self.network.length is None:
            raise PlaygroundError("this generator was trained without an estimator of the length")
        return self.network.length(text.pooled).softmax(dim=-1)
