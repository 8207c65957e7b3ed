"""Scalable autoregression: MoSa's generator as LG-Tok uses it (arXiv 2602.08337; systems.md A9-A10).

Every scale is drawn at once, given all coarser scales: the running sum of the de-quantized scales so far, pooled to the
next scale's length, is the input of that scale. The loop over scales is written once (`ScalewiseGenerator.steps`).
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from playground.generators.base import Edit, ScoredGenerator, Step, TokenBatch
from playground.limits import LIMITS
from playground.nn.attention import CrossAttention, KeyValueCache, SelfAttention
from playground.nn.blocks import SwiGLU
from playground.nn.linear import Linear
from playground.nn.modules import module_list
from playground.nn.norm import build_norm
from playground.nn.rope import rope_angles
from playground.nn.sampling import Sampling, draw, entropy_bits, guide
from playground.nn.transfer import on_device
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Tokens
from playground.tokenizers.grids import resample_down
from playground.tokenizers.quantizers import MultiScaleQuantizer
from playground.tokenizers.transformer import FULL_SCALES, MID_SCALES, linear_codes


@dataclass(frozen=True)
class GeneratorConfig:
    """Every number of the scale-wise generator; the defaults are LG-Tok's published one."""

    width: int = 384
    depth: int = 8
    heads: int = 6
    hidden: int = 768
    dropout: float = 0.2
    rope_base: float = 100.0
    rope_span: float = 64.0  # every scale's positions run from 0 to this
    text_width: int = 512
    text_mask: bool = False  # False: all positions of the encoder are seen, padding too (as released, with CLIP)
    length_unit: int = 4  # frames a row of the length table
    lengths: int = LIMITS.max_frames // 4  # rows of the length table
    scales: tuple[int, ...] = FULL_SCALES
    codes: tuple[int, ...] = linear_codes(256, 768, 10)
    code_width: int = 512


GENERATOR_PRESETS: dict[str, GeneratorConfig] = {
    "full": GeneratorConfig(),
    "lite": GeneratorConfig(
        width=256, depth=6, heads=4, hidden=512, dropout=0.0, text_width=384, text_mask=True,
        scales=MID_SCALES, codes=linear_codes(128, 384, 10), code_width=192,
    ),
}  # fmt: skip


class Layer(nn.Module):
    """Pre-norm block in the order cross-attention to text, self-attention, SwiGLU (A9)."""

    def __init__(self, width: int, heads: int, hidden: int, dropout: float) -> None:
        super().__init__()
        self.norms = module_list(build_norm("rms", width) for _ in range(3))
        self.text_norm = build_norm("rms", width)
        self.cross = CrossAttention(width, heads, dropout=dropout)
        self.self_attention = SelfAttention(width, heads, dropout=dropout)
        self.feed_forward = SwiGLU(width, hidden, dropout=dropout, bias=False)
        self.dropout = dropout

    def drop(self, x: Tensor) -> Tensor:
        """Dropout at the end of a branch."""
        return F.dropout(x, self.dropout, self.training)


@dataclass(frozen=True, eq=False)
class TextMemory:
    """The text of one call, ready for every layer: keys and values for rows with text, a constant for rows without."""

    keys_values: list[tuple[Tensor, Tensor]]  # a layer: [B, H, W, head width] twice; empty list without any text
    mask: Tensor | None  # [B, W]
    null: list[Tensor]  # a layer: [B, 1, D], what attention to the null text gives; empty list where not needed
    length: Tensor  # [B, D], length embedding

    @property
    def branches(self) -> int:
        """2 where rows with and without text run together, else 1."""
        return bool(self.keys_values) + bool(self.null)


class ScalewiseTransformer(nn.Module):
    """The network: running sums and text in, logits of every scale out."""

    def __init__(self, config: GeneratorConfig) -> None:
        super().__init__()
        c = self.config = config
        self.text_proj = Linear(c.text_width, c.width)
        self.sum_proj = Linear(c.code_width, c.width)
        self.start = nn.Parameter(torch.empty(c.scales[0], c.width))
        self.level = nn.Parameter(torch.empty(len(c.scales), c.width))
        self.length = nn.Parameter(torch.empty(c.lengths, c.width))
        self.layers = module_list(Layer(c.width, c.heads, c.hidden, c.dropout) for _ in range(c.depth))
        self.heads = module_list(Linear(c.width, v) for v in c.codes)
        for table in (self.start, self.level, self.length):
            nn.init.trunc_normal_(table, std=(1 / (3 * c.width)) ** 0.5)
        self.apply(_init)

    def positions(self, level: int) -> Tensor:
        """Continuous positions [s_n] of a scale on the common axis 0..64; a single token stands at 0."""
        return (
            torch.linspace(0.0, self.config.rope_span, self.config.scales[level])
            if self.config.scales[level] > 1
            else torch.zeros(1)
        )

    def pattern(self) -> Tensor:
        """Boolean [1, 1, S, S]: a token sees every token of its own and of coarser scales."""
        level = torch.repeat_interleave(torch.arange(len(self.config.scales)), torch.tensor(self.config.scales))
        return (level[:, None] >= level[None, :])[None, None]

    def remember(
        self, text: TextFeatures | None, lengths: Tensor, *, null: bool = False, dropped: Tensor | None = None
    ) -> TextMemory:
        """Prepare text and lengths (int64 [B], frames) for all layers; null adds the branch without text."""
        c = self.config
        index = (lengths // c.length_unit - 1).clamp(0, c.lengths - 1)
        length = self.length[index]  # (B, D)
        prepared: list[tuple[Tensor, Tensor]] = []
        if text is not None:
            tokens = text.tokens if dropped is None else text.tokens * ~dropped[:, None, None]
            states = self.text_proj(tokens) + length[:, None]
            prepared = [layer.cross.keys_values(layer.text_norm(states)) for layer in self.layers]
        constants: list[Tensor] = []
        if null or text is None:
            empty = (self.text_proj.bias + length)[:, None]
            constants = [layer.cross.constant(layer.text_norm(empty)) for layer in self.layers]
        mask = text.mask if text is not None and c.text_mask else None
        return TextMemory(prepared, mask, constants, length)

    def embed_sums(self, sums: Tensor, level: int) -> Tensor:
        """Input of scale `level` > 0: running sum [B, T, code width], pooled and projected -> [B, s_n, D]."""
        return self.sum_proj(resample_down(sums, self.config.scales[level])) + self.level[level]

    def embed_start(self, length: Tensor) -> Tensor:
        """Input of the first scale from the length embedding [B, D] -> [B, s_1, D]."""
        return self.start[None] + length[:, None] + self.level[0]

    def run(
        self, x: Tensor, text: TextMemory, positions: Tensor, mask: Tensor | None, cache: KeyValueCache | None = None
    ) -> Tensor:
        """All layers on x [B * branches, S, D]; rows with text come first."""
        rotation = rope_angles(
            on_device(positions, x.device), self.config.width // self.config.heads, self.config.rope_base
        )
        for index, layer in enumerate(self.layers):
            x = x + layer.drop(self._cross(layer, index, layer.norms[0](x), text))
            attended = layer.self_attention(layer.norms[1](x), rotation=rotation, mask=mask, cache=cache, layer=index)
            x = x + layer.drop(attended)
            x = x + layer.drop(layer.feed_forward(layer.norms[2](x)))
        return x

    def _cross(self, layer: Layer, index: int, x: Tensor, text: TextMemory) -> Tensor:
        rows = len(x) // text.branches
        parts = []
        if text.keys_values:
            parts.append(layer.cross.attend(x[:rows], text.keys_values[index], text.mask))
        if text.null:
            parts.append(text.null[index].expand(-1, x.shape[1], -1))
        return parts[0] if len(parts) == 1 else torch.cat(parts)

    def forward(self, sums: list[Tensor], text: TextMemory) -> list[Tensor]:
        """Teacher forcing: running sums [B, T, code width] after scales 1..N-1 -> logits [B, s_n, V_n] a scale."""
        inputs = [self.embed_start(text.length)]
        inputs += [self.embed_sums(total, level) for level, total in enumerate(sums, start=1)]
        x = torch.cat(inputs, dim=1)
        positions = torch.cat([self.positions(level) for level in range(len(self.config.scales))])
        x = self.run(x, text, positions, on_device(self.pattern(), x.device))
        return [head(part) for head, part in zip(self.heads, x.split(self.config.scales, dim=1), strict=True)]

    def training_loss(
        self, batch: TokenBatch, quantizer: MultiScaleQuantizer, rng: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        """Loss (A10) and share of right arg-maxes, fed with `batch.noisy`; draws nothing itself."""
        noisy = batch.ids if batch.noisy is None else batch.noisy
        with torch.no_grad(), torch.autocast(batch.lengths.device.type, enabled=False):
            sums = list(quantizer.accumulate(noisy[:-1]))  # not through Tokens: its checks wait for a GPU
        return generator_loss(self(sums, self.remember(batch.text, batch.lengths, dropped=batch.dropped)), batch.ids)


@dataclass(frozen=True, eq=False)
class ScalewiseGenerator(ScoredGenerator):
    """The network with the quantizer whose tokens it draws; holds no state of a call."""

    transformer: ScalewiseTransformer
    quantizer: MultiScaleQuantizer = field(repr=False)

    @torch.no_grad()
    def steps(
        self, text: TextFeatures | None, lengths: Tensor, sampling: Sampling, edit: Edit | None = None
    ) -> Iterator[Step]:
        """The scale loop: yields after every scale. text None draws free-form, without guidance.

        Guidance grows linearly over the scales from 0 to sampling.cfg (A10). Same seed, same tokens.
        """
        net, quantizer = self.transformer, self.quantizer
        guided = text is not None and sampling.cfg != 0
        memory = net.remember(text, lengths, null=guided)
        cache = KeyValueCache()
        rng = sampling.rng()
        total = torch.zeros(len(lengths), quantizer.length, net.config.code_width, device=lengths.device)
        drawn: list[Tensor] = []
        for level in range(len(quantizer.scales)):
            if sampling.check is not None:
                sampling.check()
            x = net.embed_start(memory.length) if level == 0 else net.embed_sums(total, level)
            x = torch.cat([x] * memory.branches)
            logits = net.heads[level](net.run(x, memory, net.positions(level), None, cache))
            if guided:
                ramp = sampling.cfg * level / max(len(quantizer.scales) - 1, 1)
                logits = guide(logits[: len(lengths)], logits[len(lengths) :], ramp)
            ids = draw(logits, sampling, rng)
            ids = ids if edit is None else edit.mix(level, ids)
            drawn.append(ids)
            total = total + quantizer.share(level, ids)
            yield Step(level + 1, Tokens(tuple(drawn), quantizer.codes), total, entropy_bits(logits), logits)

    @torch.no_grad()
    def logits(self, tokens: Tokens, text: TextFeatures | None, lengths: Tensor) -> list[Tensor]:
        """Logits [B, s_n, V_n] of every level, given the true coarser ones, without guidance."""
        return self.transformer(running_sums(self.quantizer, tokens), self.transformer.remember(text, lengths))


def generator_loss(logits: list[Tensor], ids: tuple[Tensor, ...]) -> tuple[Tensor, Tensor]:
    """Mean cross-entropy of scales 1..N-1 plus that of scale N (A10), and the share of right arg-maxes; scalars."""
    losses = [F.cross_entropy(part.flatten(0, 1).float(), i.flatten()) for part, i in zip(logits, ids, strict=True)]
    right = [(part.argmax(dim=-1) == i).float().mean() for part, i in zip(logits, ids, strict=True)]
    return torch.stack(losses[:-1]).mean() + losses[-1], torch.stack(right).mean()


def running_sums(quantizer: MultiScaleQuantizer, tokens: Tokens) -> list[Tensor]:
    """Sums [B, T, code width] after scales 1..N-1: what teacher forcing feeds to scales 2..N."""
    return list(quantizer.accumulate(tokens.ids[:-1]))


def _init(module: nn.Module) -> None:
    if isinstance(module, nn.Linear):
        nn.init.normal_(module.weight, std=0.02)
        if module.bias is not None:
            nn.init.zeros_(module.bias)


def build_generator(config: GeneratorConfig) -> ScalewiseTransformer:
    """The network for a config, randomly initialised, in training mode."""
    return ScalewiseTransformer(config)
