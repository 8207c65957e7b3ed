"""MoMask++: one masked transformer over the tokens of all scales (arXiv 2507.09122; systems.md E4).

The scales stand one after the other, coarse to fine, on one axis of positions; a shorter motion leaves the places of
the tokens that it lacks empty. The states of all words of the text are read, either in front of the tokens (in-context)
or by cross-attention.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor, nn

from playground.generators.base import Edit, Step, TokenBatch, null_text
from playground.generators.masking import (
    MaskingGenerator,
    Trunk,
    TrunkConfig,
    branch_logits,
    corrupt,
    draw_hidden,
    prediction_loss,
    small_init,
    text_branches,
)
from playground.nn.attention import Memory
from playground.nn.sampling import Sampling, entropy_bits
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Tokens, level_masks
from playground.tokenizers.quantizers import MultiScaleQuantizer


@dataclass(frozen=True)
class MaskedScalesConfig(TrunkConfig):
    """Every number of MoMask++'s generator; the defaults are the published one for HumanML3D."""

    text_width: int = 768
    scales: tuple[int, ...] = (6, 12, 24, 49)
    codes: tuple[int, ...] = (512,) * 4
    iterations: int = 18
    variant: Literal["in-context", "cross"] = "in-context"
    replaced: float = 0.1  # share of the tokens that are not hidden which hold a random code in training
    null_words: int = 16  # words of the null text that free-form generation reads


MASKED_SCALES_PRESETS: dict[str, MaskedScalesConfig] = {
    "full": MaskedScalesConfig(),
    "lite": MaskedScalesConfig(
        width=128, depth=5, heads=2, hidden=384, dropout=0.1, text_width=384, code_width=128, small_init=False
    ),
}


class MaskedScales(nn.Module):
    """Tokens of all scales, some hidden, and the words of the text -> logits."""

    def __init__(self, config: MaskedScalesConfig) -> None:
        super().__init__()
        self.config = config
        self.tokens = nn.Embedding(config.codes[0] + 2, config.code_width)  # codes, mask, pad; shared by all scales
        self.trunk = Trunk(config, config.codes[0], memories=int(config.variant == "cross"))
        if config.small_init:
            self.apply(small_init)

    def positions(self, sizes: tuple[int, ...]) -> Tensor:
        """Places [S] of the tokens of a batch: every scale starts where it does in the longest motion."""
        scales = self.config.scales
        return torch.cat([sum(scales[:level]) + torch.arange(size) for level, size in enumerate(sizes)])

    def forward(self, ids: Tensor, real: Tensor, positions: Tensor, words: Tensor, mask: Tensor) -> Tensor:
        """ids int64 [B, S] with mask and pad tokens, real bool [B, S], positions [S] -> logits [B, S, V].

        words: [B, W, text width], real where mask (bool [B, W]).
        """
        states = self.trunk.place(self.trunk.text_proj(words), torch.arange(words.shape[1]))
        vectors = self.tokens(ids)
        if self.config.variant == "cross":
            return self.trunk(vectors, positions, real, memories=[Memory(states, mask)])
        return self.trunk(vectors, positions, real, states, mask)

    def training_loss(
        self, batch: TokenBatch, quantizer: MultiScaleQuantizer, rng: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        """Cross-entropy of the hidden tokens, and the share of right arg-maxes among them; scalars."""
        ids, real = torch.cat(batch.ids, dim=1), torch.cat(batch.masks, dim=1)
        seen, hidden = corrupt(ids, real, self.config.codes[0], rng, self.config.replaced)
        positions = self.positions(tuple(part.shape[1] for part in batch.ids))
        words = batch.text.tokens * ~batch.dropped[:, None, None]
        loss, right = prediction_loss(self(seen, real, positions, words, batch.text.mask), ids, hidden)
        return loss, right / hidden.sum().clamp(min=1)


@dataclass(frozen=True, eq=False)
class MaskedScalesGenerator(MaskingGenerator):
    """The network with the tokenizer whose tokens it draws; holds no state of a call."""

    network: MaskedScales

    @torch.no_grad()
    def steps(
        self, text: TextFeatures | None, lengths: Tensor, sampling: Sampling, edit: Edit | None = None
    ) -> Iterator[Step]:
        """Draw all scales together by iterative decoding; yield once, when all are there.

        text None draws free-form. Same seed, same tokens. An edit's redraw may differ by row ([B, s_n] a level).
        """
        net, c = self.network, self.network.config
        masks = level_masks(self.tokenizer, lengths)
        real = torch.cat(masks, dim=1)
        sizes = tuple(mask.shape[1] for mask in masks)
        redraw, source = real, torch.zeros_like(real, dtype=torch.long)
        if edit is not None:
            redraw = torch.cat([mask & part for mask, part in zip(masks, edit.redraw, strict=True)], dim=1)
            source = torch.cat([mask * part for mask, part in zip(masks, edit.tokens.ids, strict=True)], dim=1)
        reading = null_text(len(lengths), c.text_width, c.null_words).to(real.device) if text is None else text
        branches = text_branches(text, sampling.cfg)
        words = torch.cat([reading.tokens * (not null) for null in branches])
        mask, here = (torch.cat([part] * len(branches)) for part in (reading.mask, real))
        positions = net.positions(sizes)

        def guided(ids: Tensor) -> Tensor:
            logits = net(torch.cat([ids] * len(branches)), here, positions, words, mask)
            return branch_logits(logits, branches, sampling.cfg)

        ids, logits = draw_hidden(guided, source, redraw, real, c, sampling, sampling.rng())
        tokens = Tokens(tuple(ids.split(sizes, dim=1)), c.codes)
        embedding = self.tokenizer.embed(tokens, None, lengths)
        yield Step(len(sizes), tokens, embedding, entropy_bits(logits), logits)
