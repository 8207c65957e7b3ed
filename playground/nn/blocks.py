"""Transformer blocks and the U-shaped stack of LG-Tok's tokenizer and detokenizer (systems.md A3, A4)."""

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from playground.nn.attention import CrossAttention, KeyValueCache, Memory, SelfAttention
from playground.nn.linear import Linear
from playground.nn.modules import module_list
from playground.nn.norm import build_norm
from playground.nn.rope import Rotation

FEED_FORWARDS = ("swiglu", "gelu")


class SwiGLU(nn.Module):
    """W2(dropout(silu(Wg x) * (W1 x))), the two input maps fused."""

    def __init__(self, width: int, hidden: int, *, dropout: float = 0.0, bias: bool = True) -> None:
        super().__init__()
        self.gate_up = Linear(width, 2 * hidden, bias=bias)
        self.down = Linear(hidden, width, bias=bias)
        self.dropout = dropout

    def forward(self, x: Tensor) -> Tensor:
        gate, up = self.gate_up(x).chunk(2, dim=-1)
        return self.down(F.dropout(F.silu(gate) * up, self.dropout, self.training))


class GELU(nn.Module):
    """Plain two-layer feed-forward with GELU, the ablation of Table 4a-c."""

    def __init__(self, width: int, hidden: int, *, dropout: float = 0.0) -> None:
        super().__init__()
        self.up = Linear(width, hidden)
        self.down = Linear(hidden, width)
        self.dropout = dropout

    def forward(self, x: Tensor) -> Tensor:
        return self.down(F.dropout(F.gelu(self.up(x)), self.dropout, self.training))


def build_feed_forward(kind: str, width: int, hidden: int, dropout: float) -> nn.Module:
    """`swiglu` or `gelu`; ValueError for another name."""
    if kind == "swiglu":
        return SwiGLU(width, hidden, dropout=dropout)
    if kind == "gelu":
        return GELU(width, hidden, dropout=dropout)
    raise ValueError(f"unknown feed-forward {kind!r}; accepted: {', '.join(FEED_FORWARDS)}")


class Block(nn.Module):
    """Self-attention, then one cross-attention a memory, then the feed-forward; post-norm as published, or pre-norm."""

    def __init__(
        self, width: int, heads: int, hidden: int, *, memories: int, dropout: float, norm: str, pre: bool, feed: str
    ) -> None:
        super().__init__()
        self.pre = pre
        self.dropout = dropout
        self.self_attention = SelfAttention(width, heads, dropout=dropout)
        self.cross_attentions = module_list(CrossAttention(width, heads, dropout=dropout) for _ in range(memories))
        self.feed_forward = build_feed_forward(feed, width, hidden, dropout)
        self.norms = module_list(build_norm(norm, width) for _ in range(memories + 2))

    def _drop(self, x: Tensor) -> Tensor:
        return F.dropout(x, self.dropout, self.training)

    def attend_self(
        self,
        x: Tensor,
        rotation: Rotation | None,
        mask: Tensor | None,
        cache: KeyValueCache | None = None,
        layer: int = 0,
        record: list[Tensor] | None = None,
    ) -> Tensor:
        """The self-attention sub-layer with its residual and norm, x [B, T, D]; arguments as in SelfAttention."""
        inner = self.norms[0](x) if self.pre else x
        out = self.self_attention(inner, rotation=rotation, mask=mask, cache=cache, layer=layer, record=record)
        return x + self._drop(out) if self.pre else self.norms[0](x + self._drop(out))

    def attend_memory(self, x: Tensor, index: int, memory: Memory) -> Tensor:
        """Cross-attention number `index` with its residual and norm, x [B, T, D]."""
        attention, norm = self.cross_attentions[index], self.norms[index + 1]
        if self.pre:
            return x + self._drop(attention(norm(x), memory))
        return norm(x + self._drop(attention(x, memory)))

    def feed(self, x: Tensor) -> Tensor:
        """The feed-forward sub-layer with its residual and norm, x [B, T, D]."""
        if self.pre:
            return x + self._drop(self.feed_forward(self.norms[-1](x)))
        return self.norms[-1](x + self._drop(self.feed_forward(x)))

    def forward(
        self, x: Tensor, rotation: Rotation | None, mask: Tensor | None, memories: Sequence[Memory] = ()
    ) -> Tensor:
        x = self.attend_self(x, rotation, mask)
        for index, memory in enumerate(memories):
            if memory.null_rows == x.shape[0]:  # first text memory of a guided decode: the two branches part here
                x = torch.cat([x, x])
                mask = mask if mask is None else torch.cat([mask, mask])
            x = self.attend_memory(x, index, memory)
        return self.feed(x)


class UStack(nn.Module):
    """Entry norm, an odd number of blocks with U-shaped skips, exit norm.

    The outputs of the first half wait on a stack; before each block of the second half the stream is joined with the
    popped one and mapped back to the width by that block's own linear layer. ValueError for an even depth with skips.
    """

    def __init__(
        self,
        width: int,
        heads: int,
        hidden: int,
        depth: int,
        *,
        memories: int = 0,
        dropout: float = 0.0,
        norm: str = "rms",
        pre: bool = False,
        feed: str = "swiglu",
        skips: bool = True,
    ) -> None:
        super().__init__()
        if skips and depth % 2 == 0:
            raise ValueError(f"a stack with U-shaped skips needs an odd depth, got {depth}")
        self.paired = depth // 2 if skips else 0
        self.blocks = module_list(
            Block(width, heads, hidden, memories=memories, dropout=dropout, norm=norm, pre=pre, feed=feed)
            for _ in range(depth)
        )
        self.merges = module_list(Linear(2 * width, width) for _ in range(self.paired))
        self.entry = build_norm(norm, width)
        self.exit = build_norm(norm, width)

    def forward(
        self,
        x: Tensor,
        rotation: Rotation | None,
        mask: Tensor | None,
        memories: Sequence[Memory] = (),
    ) -> Tensor:
        """x [B, T, D] -> [B, T, D], or [2B, T, D] when a memory asks for a null branch of every row."""
        x = self.entry(x)
        waiting: list[Tensor] = []
        first_merge = len(self.blocks) - self.paired
        for depth, block in enumerate(self.blocks):
            if depth >= first_merge:
                x = self.merges[depth - first_merge](torch.cat([x, waiting.pop()], dim=-1))
            if mask is not None and mask.shape[0] < x.shape[0]:
                mask = torch.cat([mask, mask])
            x = block(x, rotation, mask, memories)
            if depth < self.paired:
                waiting.append(x)
        return self.exit(x)
