"""MOGO's RQHC-Transformer: one causal sub-decoder a level, all of them one after the other at every time step (C2).

Sub-decoder l reads one vector a time step: the embeddings of the step's tokens of all lower levels plus that of its own
token one step before (the reading of C2). The text stands before the first step. Positions are relative, so a long
history may be cut to the training length; one sweep over time draws everything.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from playground.generators.base import Edit, Step, TokenBatch
from playground.generators.causal import CausalGenerator, kept, without_text
from playground.nn.attention import KeyValueCache, RelativeAttention
from playground.nn.blocks import build_feed_forward
from playground.nn.linear import Linear
from playground.nn.modules import module_list
from playground.nn.norm import build_norm
from playground.nn.sampling import Sampling, draw, entropy_bits, guide
from playground.nn.transfer import on_device
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Tokens
from playground.tokenizers.quantizers import MultiScaleQuantizer


@dataclass(frozen=True)
class HierarchicalConfig:
    """Every number of the RQHC-Transformer; the defaults are MOGO's (its head widths are rounded down)."""

    width: int = 1024
    depths: tuple[int, ...] = (18, 16, 8, 4, 2, 2)  # layers, a level
    heads: tuple[int, ...] = (16, 12, 6, 2, 2, 2)  # a level
    hidden: int = 4096
    dropout: float = 0.1
    corrupt: float = 0.0  # share of the tokens that are replaced in training where they stand for the step before
    text_width: int = 512
    scales: tuple[int, ...] = (49,) * 6
    codes: tuple[int, ...] = (8192,) * 6
    code_width: int = 128


HIERARCHICAL_PRESETS: dict[str, HierarchicalConfig] = {
    "full": HierarchicalConfig(),
    "lite": HierarchicalConfig(
        width=96, depths=(4, 2, 1, 1, 1, 1), heads=(4, 4, 2, 2, 2, 2), hidden=288, dropout=0.0, corrupt=0.2,
        text_width=384, codes=(512,) * 6,
    ),
}  # fmt: skip


class RelativeLayer(nn.Module):
    """Pre-norm block of causal self-attention with relative positions and a feed-forward with GELU."""

    def __init__(self, width: int, heads: int, hidden: int, reach: int, dropout: float) -> None:
        super().__init__()
        self.dropout = dropout
        self.attention = RelativeAttention(width, heads, reach, dropout=dropout)
        self.feed_forward = build_feed_forward("gelu", width, hidden, dropout)
        self.norms = module_list(build_norm("layer", width) for _ in range(2))

    def forward(self, x: Tensor, cache: KeyValueCache | None, layer: int) -> Tensor:
        """x [B, T, D] -> [B, T, D]."""
        out = self.attention(self.norms[0](x), cache=cache, layer=layer)
        x = x + F.dropout(out, self.dropout, self.training)
        return x + F.dropout(self.feed_forward(self.norms[1](x)), self.dropout, self.training)


class SubDecoder(nn.Module):
    """The decoder of one level: its own depth and heads, the width of all."""

    def __init__(self, config: HierarchicalConfig, level: int) -> None:
        super().__init__()
        c = config
        self.embedding = nn.Embedding(c.codes[level] + 1, c.width)  # the last one: there was no step before
        self.level = nn.Parameter(torch.zeros(c.width))
        self.layers = module_list(
            RelativeLayer(c.width, c.heads[level], c.hidden, c.scales[level], c.dropout) for _ in range(c.depths[level])
        )
        self.norm = build_norm("layer", c.width)
        self.head = Linear(c.width, c.codes[level])

    def forward(self, x: Tensor, cache: KeyValueCache | None = None) -> Tensor:
        """Inputs [B, T, D] -> logits [B, T, V] at every one of them; with a cache x continues what it has seen."""
        for index, layer in enumerate(self.layers):
            x = layer(x, cache, index)
        return self.head(self.norm(x))


class RQHCTransformer(nn.Module):
    """The network: text and tokens in, logits of every level out."""

    def __init__(self, config: HierarchicalConfig) -> None:
        super().__init__()
        c = self.config = config
        if not len(c.depths) == len(c.heads) == len(c.scales) == len(c.codes) or len(set(c.scales)) != 1:
            raise ValueError("an RQHC-Transformer needs a depth, heads, codes and the same number of tokens a level")
        self.text_proj = Linear(c.text_width, c.width)
        self.decoders = module_list(SubDecoder(c, level) for level in range(len(c.codes)))
        for module in self.modules():
            if isinstance(module, nn.Linear | nn.Embedding):
                nn.init.normal_(module.weight, std=0.02)
            if isinstance(module, nn.Linear) and module.bias is not None:
                nn.init.zeros_(module.bias)
            if isinstance(module, SubDecoder):
                nn.init.normal_(module.level, std=0.02)

    def text_slot(self, text: TextFeatures | None, rows: int, dropped: Tensor | None = None) -> Tensor:
        """Projected text [B, D]; rows where dropped (bool [B]) and, without text, all rows get the null text."""
        if text is None:
            return self.text_proj.bias.expand(rows, -1)
        pooled = text.pooled if dropped is None else text.pooled * ~dropped[:, None]
        return self.text_proj(pooled)

    def inputs(self, level: int, lower: Sequence[Tensor], before: Tensor) -> Tensor:
        """What sub-decoder `level` reads: tokens of the lower levels and its own one step before, ids [B, T] each."""
        x: Tensor = self.decoders[level].embedding(before)
        for number, ids in enumerate(lower[:level]):
            x = x + self.decoders[number].embedding(ids)
        return x

    def prefill(
        self,
        slot: Tensor,
        ids: Sequence[Tensor],
        caches: Sequence[KeyValueCache] | None = None,
        before: Sequence[Tensor] | None = None,
    ) -> list[Tensor]:
        """Text slot [B, D] and tokens [B, T] a level -> logits [B, T, V] a level, each given all that comes before it.

        caches: filled on the way, one a level. before: ids [B, T] a level to stand for the step before (default: the
        true ones).
        """
        logits = []
        for level, decoder in enumerate(self.decoders):
            earlier = self.step_before(level, ids[level]) if before is None else before[level]
            x = torch.cat([(slot + decoder.level)[:, None], self.inputs(level, ids, earlier)], dim=1)
            logits.append(decoder(x, None if caches is None else caches[level])[:, 1:])
        return logits

    def step_before(self, level: int, ids: Tensor) -> Tensor:
        """Ids [B, T] shifted by one step; the first is the one that says that there was none."""
        return F.pad(ids[:, :-1], (1, 0), value=self.config.codes[level])[:, : ids.shape[1]]

    def training_loss(
        self, batch: TokenBatch, quantizer: MultiScaleQuantizer, rng: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        """Sum over the levels of the mean cross-entropy (C2), and the share of right arg-maxes; scalars.

        In training a share `corrupt` of the tokens is replaced by random ones where they stand for the step before.
        """
        before = []
        for level, ids in enumerate(batch.ids):
            given = ids
            if self.training and self.config.corrupt:
                swapped = torch.rand(ids.shape, generator=rng) < self.config.corrupt
                other = torch.randint(self.config.codes[level], ids.shape, generator=rng)
                given = torch.where(on_device(swapped, ids.device), on_device(other, ids.device), ids)
            before.append(self.step_before(level, given))
        slot = self.text_slot(batch.text, len(batch.lengths), batch.dropped)
        logits = self.prefill(slot, batch.ids, before=before)
        losses, rights = [], []
        for part, ids, real in zip(logits, batch.ids, batch.masks, strict=True):
            targets = torch.where(real, ids, -1).flatten()
            losses.append(F.cross_entropy(part.flatten(0, 1).float(), targets, ignore_index=-1))
            rights.append((part.argmax(dim=-1).flatten() == targets).sum() / real.sum())
        return torch.stack(losses).sum(), torch.stack(rights).mean()


class Sweep:
    """One sweep over time, the state of one call: caches, and the newest tokens of all levels.

    When the history reaches the training length, its older quarter is left out and the caches are built anew from the
    rest, so that memory and the time of a step stay bounded however long the sweep. What a sweep draws depends on the
    text, the history it holds and the random draws alone.
    """

    def __init__(
        self,
        network: RQHCTransformer,
        text: TextFeatures | None,
        rows: int,
        cfg: float,
        history: Sequence[Tensor] | None = None,
    ) -> None:
        """text None: free-form, without guidance. history: ids [B, t] a level that stand before the first step."""
        self.network = network
        self.rows = rows
        self.cfg = cfg if text is not None else 0.0
        self.slot = network.text_slot(text, rows)
        if self.cfg and text is not None:
            self.slot = torch.cat([self.slot, network.text_slot(without_text(text), rows)])
        empty = torch.zeros(rows, 0, dtype=torch.long, device=self.slot.device)
        self.history = [empty for _ in network.decoders] if history is None else list(history)
        self._rebuild()

    @property
    def window(self) -> int:
        """Steps that the network was trained to see."""
        return self.network.config.scales[0]

    def _both(self, ids: Tensor) -> Tensor:
        return torch.cat([ids, ids]) if self.cfg else ids

    def _rebuild(self) -> None:
        if self.history[0].shape[1] >= self.window:
            self.history = [ids[:, -max(1, self.window - -(-self.window // 4)) :].clone() for ids in self.history]
        self.caches = [KeyValueCache() for _ in self.network.decoders]
        size = self.history[0].shape[1]
        room = self.window - size if size else 0  # always the same shape: kernels for each would be kept for good
        self.network.prefill(self.slot, [self._both(F.pad(ids, (0, room))) for ids in self.history], self.caches)
        for cache in self.caches:
            cache.cut(size + 1)

    def step(
        self,
        sampling: Sampling,
        rng: torch.Generator | Sequence[torch.Generator],
        edit: Edit | None = None,
        place: int = 0,
    ) -> tuple[list[Tensor], list[Tensor]]:
        """Draw one time step -> ids [B] and guided logits [B, V], a level each.

        edit: tokens that stay; place: the number of this step there.
        """
        if self.history[0].shape[1] >= self.window:
            self._rebuild()
        drawn: list[Tensor] = []
        seen: list[Tensor] = []
        for level, decoder in enumerate(self.network.decoders):
            own = self.history[level]
            before = own[:, -1:] if own.shape[1] else own.new_full((self.rows, 1), self.network.config.codes[level])
            x = self.network.inputs(level, [ids[:, None] for ids in drawn], before)
            logits = decoder(self._both(x), self.caches[level])[:, -1]
            if self.cfg:
                logits = guide(logits[: self.rows], logits[self.rows :], self.cfg)
            seen.append(logits)
            drawn.append(kept(edit, level, place, draw(logits[:, None], sampling, rng)[:, 0]))
        self.history = [torch.cat([old, new[:, None]], dim=1) for old, new in zip(self.history, drawn, strict=True)]
        return drawn, seen


@dataclass(frozen=True, eq=False)
class HierarchicalGenerator(CausalGenerator):
    """The RQHC-Transformer with the tokenizer whose tokens it draws; holds no state of a call."""

    network: RQHCTransformer = field(repr=False)

    @torch.no_grad()
    def steps(
        self, text: TextFeatures | None, lengths: Tensor, sampling: Sampling, edit: Edit | None = None
    ) -> Iterator[Step]:
        """Yield once, when all levels of the last time step are drawn. text None draws free-form, without guidance."""
        sweep, rng = Sweep(self.network, text, len(lengths), sampling.cfg), sampling.rng()
        drawn: list[list[Tensor]] = []
        seen: list[list[Tensor]] = []
        for place in range(int(self.counts(lengths).max())):
            if sampling.check is not None:
                sampling.check()
            ids, logits = sweep.step(sampling, rng, edit, place)
            drawn.append(ids)
            seen.append(logits)
        levels = len(self.network.decoders)
        tokens, embedding = self.embed(tuple(torch.stack(ids, dim=1) for ids in zip(*drawn, strict=True)), lengths)
        most = max(self.network.config.codes)
        parts = [torch.stack(part, dim=1) for part in zip(*seen, strict=True)]
        shown = torch.cat([F.pad(part, (0, most - part.shape[-1]), value=float("-inf")) for part in parts], dim=1)
        entropy = torch.cat([entropy_bits(part) for part in parts], dim=1)
        yield Step(levels, tokens, embedding, entropy, shown)

    @torch.no_grad()
    def logits(self, tokens: Tokens, text: TextFeatures | None, lengths: Tensor) -> list[Tensor]:
        """Logits [B, T, V_n] of every level, given lower levels and earlier steps, without guidance."""
        return self.network.prefill(self.network.text_slot(text, len(lengths)), tokens.ids)
