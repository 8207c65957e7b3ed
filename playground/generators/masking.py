"""What masked generators share: the post-norm trunk, what training hides, and drawing hidden tokens in several passes.

MoMask (arXiv 2312.00063; systems.md B2, B3) and MoMask++ (arXiv 2507.09122; E4). A sequence of token ids holds V codes,
then the mask token V, then the pad token V + 1.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from playground.generators.base import Edit, StepGenerator, redraw_masks
from playground.nn.attention import Memory
from playground.nn.blocks import Block
from playground.nn.linear import Linear
from playground.nn.modules import module_list
from playground.nn.positions import sinusoid
from playground.nn.sampling import Sampling, confidence, guide, gumbel_draw, top_share
from playground.nn.sequences import join_masks
from playground.nn.transfer import on_device
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Tokenizer, Tokens, level_masks
from playground.tokenizers.quantizers import MultiScaleQuantizer

RANDOM_SHARE = 0.1  # of the hidden tokens: a random code stands there
MASK_SHARE = 0.88  # of the other hidden tokens: the mask token; the rest stays as it is
IGNORED = -100  # target of positions that no loss is taken at


@dataclass(frozen=True)
class TrunkConfig:
    """The numbers of a trunk and of the tokens it reads; the defaults are the published ones (B2, E4)."""

    width: int = 384
    depth: int = 8
    heads: int = 6
    hidden: int = 1024  # feed-forward width
    dropout: float = 0.2
    text_width: int = 512  # width of what is read of a text
    scales: tuple[int, ...] = (49,) * 6  # tokens a level of the longest motion
    codes: tuple[int, ...] = (512,) * 6  # the same for every level
    code_width: int = 512  # of the token embeddings, learned anew
    iterations: int = 10  # passes of iterative decoding, K
    small_init: bool = True  # weights and tables from a normal of std 0.02; False: torch's own, learns in fewer steps

    def __post_init__(self) -> None:
        if len(self.scales) != len(self.codes) or len(set(self.codes)) != 1:
            raise ValueError("masked generators need a codebook size a level, the same for every level")


class Trunk(nn.Module):
    """Text and token vectors in, one vector a token out: post-norm GELU encoder layers, or decoder layers with a text
    memory, between a projection and a head (linear, GELU, LayerNorm, linear)."""

    def __init__(self, config: TrunkConfig, outputs: int, *, memories: int = 0) -> None:
        super().__init__()
        c = config
        self.dropout = c.dropout
        self.text_proj = Linear(c.text_width, c.width)
        self.token_proj = Linear(c.code_width, c.width)
        self.blocks = module_list(
            Block(
                c.width, c.heads, c.hidden, memories=memories, dropout=c.dropout, norm="layer", pre=False, feed="gelu"
            )
            for _ in range(c.depth)
        )
        self.head = nn.Sequential(Linear(c.width, c.width), nn.GELU(), nn.LayerNorm(c.width), Linear(c.width, outputs))

    def place(self, x: Tensor, positions: Tensor) -> Tensor:
        """x [B, S, D] with the sinusoids of positions [S] added."""
        table = on_device(sinusoid(positions, x.shape[-1]), x.device).to(x.dtype)
        return F.dropout(x + table, self.dropout, self.training)

    def forward(
        self,
        vectors: Tensor,
        positions: Tensor,
        real: Tensor,
        prefix: Tensor | None = None,
        prefix_mask: Tensor | None = None,
        memories: Sequence[Memory] = (),
    ) -> Tensor:
        """Token vectors [B, S, code width] at positions [S], real where bool [B, S] -> [B, S, outputs].

        prefix: [B, P, D], put before the tokens, real where prefix_mask (bool [B, P]; None: everywhere).
        """
        x = self.place(self.token_proj(vectors), positions)
        parts, masks = [x], [all_or(real)]
        if prefix is not None:
            parts, masks = [prefix.to(x.dtype), x], [prefix_mask, *masks]
        mask = join_masks(masks, parts)
        x = torch.cat(parts, dim=1)
        for block in self.blocks:
            x = block(x, None, mask, memories)
        return self.head(x[:, -vectors.shape[1] :])


def all_or(real: Tensor) -> Tensor | None:
    """The mask, or None where it hides nothing (on a GPU, asking would wait for it)."""
    return None if real.device.type == "cpu" and bool(real.all()) else real


def small_init(module: nn.Module) -> None:
    """Weights and tables from a normal of std 0.02, biases 0."""
    if isinstance(module, nn.Linear | nn.Embedding):
        nn.init.normal_(module.weight, std=0.02)
    if isinstance(module, nn.Linear) and module.bias is not None:
        nn.init.zeros_(module.bias)


# ---- training --------------------------------------------------------------------------------------------------


def mask_ratio(progress: float) -> float:
    """Share of the tokens that are hidden: cos(pi / 2 * progress), from 1 at 0 to 0 at 1."""
    return math.cos(math.pi / 2 * progress)


def corrupt(
    ids: Tensor, real: Tensor, codes: int, rng: torch.Generator, replaced: float = 0.0
) -> tuple[Tensor, Tensor]:
    """Hide tokens for training: ids int64 [B, S], real bool [B, S] -> input ids [B, S] and hidden, bool [B, S].

    A row hides round(cos(pi u / 2) * S) random positions, at least one, as far as they are real; u is uniform. Of the
    hidden ones 10 % hold a random code, 88 % of the rest the mask token, the others their own code (B2). A share
    `replaced` of the real tokens that are not hidden holds a random code too (E4). Padding holds the pad token.
    """
    count = torch.tensor([round(mask_ratio(u) * ids.shape[1]) for u in torch.rand(len(ids), generator=rng).tolist()])
    rank = torch.rand(ids.shape, generator=rng).argsort(dim=1)
    coin = on_device(torch.rand(ids.shape, generator=rng), ids.device)
    other = on_device(torch.randint(codes, ids.shape, generator=rng), ids.device)
    hidden = on_device(rank < count.clamp(min=1)[:, None], ids.device) & real
    masked = hidden & (coin >= RANDOM_SHARE) & (coin < RANDOM_SHARE + (1 - RANDOM_SHARE) * MASK_SHARE)
    noisy = torch.where(hidden, coin < RANDOM_SHARE, coin < replaced)
    return marked(torch.where(noisy, other, ids), masked, real, codes), hidden


def marked(ids: Tensor, masked: Tensor, real: Tensor, codes: int) -> Tensor:
    """Ids [B, S] with the mask token where masked and the pad token where not real (bool [B, S])."""
    return ids.masked_fill(masked, codes).masked_fill(~real, codes + 1)


def prediction_loss(logits: Tensor, ids: Tensor, wanted: Tensor) -> tuple[Tensor, Tensor]:
    """Mean cross-entropy of logits [B, S, V] where wanted (bool [B, S]), and how many arg-maxes are right there."""
    target = ids.masked_fill(~wanted, IGNORED)
    total = F.cross_entropy(logits.flatten(0, 1).float(), target.flatten(), ignore_index=IGNORED, reduction="sum")
    return total / wanted.sum().clamp(min=1), (logits.argmax(dim=-1) == target).sum()


# ---- drawing ---------------------------------------------------------------------------------------------------


def text_branches(text: TextFeatures | None, cfg: float) -> tuple[bool, ...]:
    """Which texts a guided pass needs, True standing for the null text: u + s (c - u) is c at s = 1 and u at s = 0."""
    if text is None or cfg == 0:
        return (True,)
    return (False,) if cfg == 1 else (False, True)


def branch_logits(logits: Tensor, branches: tuple[bool, ...], cfg: float) -> Tensor:
    """Logits [B * branches, S, V] of all branches -> guided ones [B, S, V], u + cfg (c - u)."""
    if len(branches) == 1:
        return logits
    with_text, without = logits.chunk(2)
    return guide(with_text, without, cfg - 1)


def choose(
    logits: Tensor, sampling: Sampling, rng: torch.Generator | Sequence[torch.Generator], real: Tensor
) -> Tensor:
    """Codes [B, S] drawn from guided logits [B, S, V]: the top share alone, Gumbel noise, arg max (B2)."""
    return gumbel_draw(top_share(logits, sampling.top_k), sampling.temperature, rng, real)


def draw_hidden(
    predict: Callable[[Tensor], Tensor],
    ids: Tensor,
    redraw: Tensor,
    real: Tensor,
    config: TrunkConfig,
    sampling: Sampling,
    rng: torch.Generator | Sequence[torch.Generator],
) -> tuple[Tensor, Tensor]:
    """Iterative decoding: draw the codes where redraw (bool [B, S]) in K = config.iterations passes, change no other.

    Pass k = 0..K-1 hides the round(cos(pi/2 * k/(K-1)) * n) least confident of a row's n tokens to draw, at least one,
    and draws all hidden ones; a token that was not hidden again stays (B2). predict: ids [B, S] with mask and pad
    tokens -> guided logits [B, S, V]. Returns ids [B, S], 0 where not real, and the logits [B, S, V] that each was
    drawn from.
    """
    count = redraw.sum(dim=1)
    least = torch.full(ids.shape, float("inf"), device=ids.device)
    scores = least.masked_fill(redraw, 0.0)
    logits: Tensor | None = None
    for step in range(config.iterations if bool(redraw.any()) else 1):
        if sampling.check is not None:
            sampling.check()
        ratio = mask_ratio(step / max(config.iterations - 1, 1))
        size = (ratio * count.double()).round().clamp(min=1).minimum(count)
        hidden = scores.argsort(dim=1, stable=True).argsort(dim=1) < size[:, None]
        guided = predict(marked(ids, hidden, real, config.codes[0]))
        drawn = choose(guided, sampling, rng, real)
        ids = torch.where(hidden, drawn, ids)
        scores = torch.where(hidden, confidence(guided, drawn), least)
        logits = guided if logits is None else torch.where(hidden[..., None], guided, logits)
    assert logits is not None
    return ids.masked_fill(~real, 0), logits


def redraw_rows(tokenizer: Tokenizer, keep: Tensor, lengths: Tensor) -> tuple[Tensor, ...]:
    """Latents to keep (bool [T of the longest]) -> tokens to draw anew, bool [B, s_n] a level: the mask of each row's
    own latents, resized to its own levels (A10)."""
    masks = tuple(torch.zeros_like(mask) for mask in level_masks(tokenizer, lengths))
    for row, frames in enumerate(lengths.tolist()):
        sizes = tokenizer.sizes(frames)
        for mask, own in zip(masks, redraw_masks(keep[: sizes[-1]], sizes), strict=True):
            mask[row, : len(own)] = own
    return masks


@dataclass(frozen=True, eq=False)
class MaskingGenerator(StepGenerator):
    """A masked network with the tokenizer whose tokens it draws; holds no state of a call."""

    network: nn.Module
    tokenizer: Tokenizer

    @property
    def quantizer(self) -> MultiScaleQuantizer:
        """Of the tokenizer."""
        return self.tokenizer.quantizer

    def edit(
        self, tokens: Tokens, keep: Tensor, text: TextFeatures | None, lengths: Tensor, sampling: Sampling
    ) -> Tokens:
        """Redraw the tokens of all levels where keep (bool [T], resized to each) is False; kept ones stay (B3)."""
        *_, last = self.steps(text, lengths, sampling, Edit(tokens, redraw_rows(self.tokenizer, keep, lengths)))
        return last.tokens
