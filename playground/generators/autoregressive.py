"""T2M-GPT: a GPT over the tokens of one level, plain or with CASIM's text tokens (systems.md D1-D3).

Plain, the first position is the pooled text. With CASIM up to 77 projected text tokens stand before the motion; they
see each other and the motion sees them all, while the motion itself is causal (prefix-LM). The text always takes its
77 places, so padding may be left out, and a learned start token draws the first code (the published block has one
place more than text and codes need). Every position predicts the next code or the end of the motion.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from playground.generators.base import Edit, Step, TokenBatch, null_text
from playground.generators.causal import CausalGenerator, kept, without_text
from playground.limits import LIMITS
from playground.nn.attention import KeyValueCache, prefix_pattern
from playground.nn.blocks import Block
from playground.nn.linear import Linear
from playground.nn.modules import module_list
from playground.nn.norm import build_norm
from playground.nn.positions import sinusoid
from playground.nn.sampling import Sampling, draw, entropy_bits, guide
from playground.nn.transfer import on_device
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Tokens
from playground.tokenizers.quantizers import MultiScaleQuantizer


@dataclass(frozen=True)
class GPTConfig:
    """Every number of the GPT; the defaults are T2M-GPT's published ones (9 + 9 layers in one stack)."""

    width: int = 1024
    depth: int = 18
    heads: int = 16
    hidden: int = 4096
    dropout: float = 0.1
    corrupt: float = 0.5  # share of the input tokens replaced by random codes in training
    casim: bool = False  # text tokens in place of the pooled text
    causal_text: bool = False  # CASIM only: a text token sees those before it alone
    text_width: int = 512
    scales: tuple[int, ...] = (49,)
    codes: tuple[int, ...] = (512,)
    code_width: int = 512


GPT_PRESETS: dict[str, GPTConfig] = {
    "full": GPTConfig(),
    "lite": GPTConfig(width=160, depth=4, heads=4, hidden=640, dropout=0.0, text_width=384, code_width=128),
}


@dataclass(frozen=True, eq=False)
class Prefix:
    """What stands before the motion: states [B, P, D] with their positions added, and which are real, bool [B, P]."""

    states: Tensor
    real: Tensor

    def joined(self, other: "Prefix") -> "Prefix":
        """Both batches, one after the other."""
        return Prefix(torch.cat([self.states, other.states]), torch.cat([self.real, other.real]))


class GPT(nn.Module):
    """The network: text and codes so far in, logits of the next code and of the end out."""

    def __init__(self, config: GPTConfig) -> None:
        super().__init__()
        c = self.config = config
        if len(c.scales) != 1 or len(c.codes) != 1:
            raise ValueError(f"a GPT draws tokens of one level, got {len(c.scales)}")
        self.text_proj = Linear(c.text_width, c.width)
        self.start = nn.Parameter(torch.zeros(c.width)) if c.casim else None
        self.codes = nn.Embedding(c.codes[0], c.width)
        self.blocks = module_list(
            Block(c.width, c.heads, c.hidden, memories=0, dropout=c.dropout, norm="layer", pre=True, feed="gelu")
            for _ in range(c.depth)
        )
        self.norm = build_norm("layer", c.width)
        self.head = Linear(c.width, c.codes[0] + 1, bias=False)  # the last one is the end
        for module in self.modules():
            if isinstance(module, nn.Linear | nn.Embedding):
                nn.init.normal_(module.weight, std=0.02)
            if isinstance(module, nn.Linear) and module.bias is not None:
                nn.init.zeros_(module.bias)
        if self.start is not None:
            nn.init.normal_(self.start, std=0.02)

    @property
    def first(self) -> int:
        """Position of the first code."""
        return LIMITS.max_text_positions + 1 if self.config.casim else 1

    def prefix(self, text: TextFeatures | None, rows: int, dropped: Tensor | None = None) -> Prefix:
        """What a motion is drawn after; rows where dropped (bool [B]) and, without text, all rows get the null text."""
        device = self.head.weight.device
        if text is None:
            text = null_text(rows, self.config.text_width, 1).to(device)
        live = torch.ones(rows, device=device) if dropped is None else (~dropped).float()
        if self.start is None:
            states = self.text_proj(text.pooled * live[:, None])[:, None]
            real = torch.ones(rows, 1, dtype=torch.bool, device=device)
            return Prefix(states + self._places(torch.zeros(1), device), real)
        tokens = self.text_proj(text.tokens * live[:, None, None])
        places = torch.cat([torch.arange(tokens.shape[1]), torch.tensor([self.first - 1])])
        states = torch.cat([tokens, self.start.expand(rows, 1, -1)], dim=1)
        real = torch.cat([text.mask, text.mask.new_ones(rows, 1)], dim=1)
        return Prefix(states + self._places(places, device), real)

    def _places(self, places: Tensor, device: torch.device) -> Tensor:
        return on_device(sinusoid(places, self.config.width), device)

    def _pattern(self, prefix: Prefix, steps: int) -> Tensor:
        """bool [B, 1, S, S]. The start token counts as the first step: the text does not see it."""
        own = int(self.start is not None)
        real = prefix.real[:, : prefix.real.shape[1] - own]
        return prefix_pattern(real, steps + own, causal_prefix=self.config.causal_text)

    def _run(
        self, x: Tensor, mask: Tensor | None, cache: KeyValueCache | None, record: list[Tensor] | None = None
    ) -> Tensor:
        x = F.dropout(x, self.config.dropout, self.training)
        for index, block in enumerate(self.blocks):
            last = index == len(self.blocks) - 1
            x = block.feed(block.attend_self(x, None, mask, cache, index, record if last else None))
        return x

    def forward(self, prefix: Prefix, ids: Tensor, record: list[Tensor] | None = None) -> Tensor:
        """Teacher forcing: ids [B, T] -> logits [B, T + 1, V + 1] of what follows 0, 1, ... T codes.

        record: gets the attention weights [B, H, S, S] of the last layer.
        """
        count = ids.shape[1]
        places = self._places(torch.arange(self.first, self.first + count), ids.device)
        x = torch.cat([prefix.states, self.codes(ids) + places], dim=1)
        x = self._run(x, self._pattern(prefix, count), None, record)
        return self.head(self.norm(x[:, -count - 1 :]))

    def begin(self, prefix: Prefix, cache: KeyValueCache) -> Tensor:
        """Fill an empty cache with the prefix -> logits [B, V + 1] of the first code."""
        return self.head(self.norm(self._run(prefix.states, self._pattern(prefix, 0), cache)[:, -1]))

    def proceed(self, ids: Tensor, place: int, prefix: Prefix, cache: KeyValueCache) -> Tensor:
        """Codes [B] number `place` (from 0) -> logits [B, V + 1] of the next one."""
        x = self.codes(ids)[:, None] + self._places(torch.tensor([self.first + place]), ids.device)
        seen = torch.cat([prefix.real, prefix.real.new_ones(len(ids), place + 1)], dim=1)
        return self.head(self.norm(self._run(x, seen, cache)[:, -1]))

    def training_loss(
        self, batch: TokenBatch, quantizer: MultiScaleQuantizer, rng: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        """Mean cross-entropy of codes and end, and the share of right arg-maxes; scalars.

        In training a share `corrupt` of the input codes is replaced by random ones (D3).
        """
        ids, real, end = batch.ids[0], batch.masks[0], self.config.codes[0]
        given = ids
        if self.training and self.config.corrupt:
            swapped = torch.rand(ids.shape, generator=rng) < self.config.corrupt
            other = torch.randint(end, ids.shape, generator=rng)
            given = torch.where(on_device(swapped, ids.device), on_device(other, ids.device), ids)
        logits = self(self.prefix(batch.text, len(ids), batch.dropped), given)
        targets = F.pad(torch.where(real, ids, -1), (0, 1), value=-1)
        targets.scatter_(1, real.sum(dim=1, keepdim=True), end)
        loss = F.cross_entropy(logits.flatten(0, 1).float(), targets.flatten(), ignore_index=-1)
        right = (logits.argmax(dim=-1) == targets).sum() / (targets >= 0).sum()
        return loss, right


@dataclass(frozen=True, eq=False)
class GPTGenerator(CausalGenerator):
    """The GPT with the tokenizer whose tokens it draws; holds no state of a call."""

    network: GPT = field(repr=False)

    @torch.no_grad()
    def steps(
        self, text: TextFeatures | None, lengths: Tensor, sampling: Sampling, edit: Edit | None = None
    ) -> Iterator[Step]:
        """Yield once, when the last code is drawn. text None draws free-form, without guidance.

        The asked length wins: the end is never drawn before it and always after it (see `end_probability`).
        """
        net, rows = self.network, len(lengths)
        guided = text is not None and sampling.cfg != 0
        prefix = net.prefix(text, rows)
        if guided and text is not None:
            prefix = prefix.joined(net.prefix(without_text(text), rows))
        cache, rng = KeyValueCache(), sampling.rng()
        drawn: list[Tensor] = []
        seen: list[Tensor] = []
        for place in range(int(self.counts(lengths).max())):
            if sampling.check is not None:
                sampling.check()
            if place:
                given = torch.cat([drawn[-1]] * 2) if guided else drawn[-1]
                logits = net.proceed(given, place - 1, prefix, cache)
            else:
                logits = net.begin(prefix, cache)
            logits = logits[:, :-1]
            logits = guide(logits[:rows], logits[rows:], sampling.cfg) if guided else logits
            seen.append(logits)
            drawn.append(kept(edit, 0, place, draw(logits[:, None], sampling, rng)[:, 0]))
        tokens, embedding = self.embed((torch.stack(drawn, dim=1),), lengths)
        shown = torch.stack(seen, dim=1)
        yield Step(1, tokens, embedding, entropy_bits(shown), shown)

    @torch.no_grad()
    def logits(self, tokens: Tokens, text: TextFeatures | None, lengths: Tensor) -> list[Tensor]:
        """Logits [B, T, V] of the one level, each given the codes before it, without guidance and without the end."""
        return [self._forced(tokens, text)[:, :-1, :-1]]

    @torch.no_grad()
    def end_probability(self, tokens: Tokens, text: TextFeatures | None) -> Tensor:
        """How likely the motion ends after 0, 1, ... T of the given codes [B, T + 1]."""
        return self._forced(tokens, text).softmax(dim=-1)[..., -1]

    @torch.no_grad()
    def alignment(self, tokens: Tokens, text: TextFeatures, lengths: Tensor) -> Tensor:
        """Words by time [B, T, W]: where the last layer looks in the text when it draws each token (CASIM's view).

        Averaged over the heads, every row rescaled to sum 1 over the words; 0 for padded words and beyond a row's own
        tokens. ValueError for a network that sees the pooled text alone.
        """
        if not self.network.config.casim:
            raise ValueError("the pooled text has no words to look at; CASIM's variant has")
        record: list[Tensor] = []
        self._forced(tokens, text, record)
        words, count = text.mask.shape[1], tokens.sizes[0]
        weights = record[0].mean(dim=1)[:, words : words + count, :words]  # from the start token on
        weights = weights / weights.sum(dim=-1, keepdim=True).clamp(min=1e-12)
        real = torch.arange(count, device=weights.device) < self.counts(lengths)[:, None]
        return weights * real[..., None]

    def _forced(self, tokens: Tokens, text: TextFeatures | None, record: list[Tensor] | None = None) -> Tensor:
        ids = tokens.ids[0]
        return self.network(self.network.prefix(text, len(ids)), ids, record)
