"""Multi-head attention: self-attention with rotary positions and an optional cache, and cross-attention to a memory.

Masks are boolean, True where a key is real, [B, S], or None when every key is real. The cache belongs to a call, never
to a layer (habit after nanochat's KVCache and torchtune's kv_cache).
"""

from dataclasses import dataclass, field

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from playground.nn.linear import Linear
from playground.nn.rope import Rotation, apply_rope


@dataclass
class KeyValueCache:
    """Keys and values of one generation call, one pair of tensors [B, H, S, head width] a layer."""

    keys: dict[int, Tensor] = field(default_factory=dict)
    values: dict[int, Tensor] = field(default_factory=dict)

    def extend(self, layer: int, key: Tensor, value: Tensor) -> tuple[Tensor, Tensor]:
        """Append along time and return everything seen so far for this layer."""
        if layer in self.keys:
            key = torch.cat([self.keys[layer], key], dim=2)
            value = torch.cat([self.values[layer], value], dim=2)
        self.keys[layer], self.values[layer] = key, value
        return key, value


@dataclass(frozen=True)
class Memory:
    """What a cross-attention looks at.

    states: [B, S, D]; mask: [B, S] or None. Where x has twice as many rows (the two branches of guidance), both halves
    look at the same states, unless null_rows says that the second half looks at nothing but `null` [D]: attention over
    equal keys returns their one value, so those rows receive a constant (systems.md J).
    gate: [B, T, 1] multiplies the branch before its residual sum (the edit mask of Eq. 7), or None.
    """

    states: Tensor
    mask: Tensor | None = None
    gate: Tensor | None = None
    null: Tensor | None = None
    null_rows: int = 0
    rotations: tuple[Rotation, Rotation] | None = None  # rotary positions of the queries and of the states, if any
    record: list[Tensor] | None = None  # where given, every layer appends its attention weights [B, H, T, S]


def split_heads(x: Tensor, heads: int) -> Tensor:
    """[B, T, D] -> [B, H, T, D / H]."""
    return x.unflatten(-1, (heads, -1)).transpose(1, 2)


def attend(query: Tensor, key: Tensor, value: Tensor, mask: Tensor | None, dropout: float) -> Tensor:
    """Softmax attention on [B, H, T, head width], scale 1/sqrt(head width) -> [B, T, D]."""
    if mask is not None and mask.ndim == 2:  # keys [B, S]; a pattern comes as [1, 1, T, S]
        mask = mask[:, None, None, :]
    out = F.scaled_dot_product_attention(query, key, value, attn_mask=mask, dropout_p=dropout)
    return out.transpose(1, 2).flatten(-2)


def attention_weights(query: Tensor, key: Tensor, mask: Tensor | None) -> Tensor:
    """What `attend` multiplies the values with: [B, H, T, head width] twice, key mask [B, S] -> [B, H, T, S]."""
    score = query @ key.transpose(-2, -1) / query.shape[-1] ** 0.5
    if mask is not None:
        score = score.masked_fill(~mask[:, None, None, :], float("-inf"))
    return score.softmax(dim=-1)


class SelfAttention(nn.Module):
    """Multi-head self-attention with one fused projection to queries, keys and values."""

    def __init__(self, width: int, heads: int, *, dropout: float = 0.0, bias: bool = True) -> None:
        super().__init__()
        self.heads = heads
        self.dropout = dropout
        self.qkv = Linear(width, 3 * width, bias=bias)
        self.out = Linear(width, width, bias=bias)

    def forward(
        self,
        x: Tensor,
        *,
        rotation: Rotation | None = None,
        mask: Tensor | None = None,
        cache: KeyValueCache | None = None,
        layer: int = 0,
    ) -> Tensor:
        """x [B, T, D] -> [B, T, D]. mask: [B, S] keys, or [1, 1, T, S] pattern."""
        query, key, value = (split_heads(part, self.heads) for part in self.qkv(x).chunk(3, dim=-1))
        if rotation is not None:
            query, key = apply_rope(query, rotation), apply_rope(key, rotation)
        if cache is not None:
            key, value = cache.extend(layer, key, value)
        return self.out(attend(query, key, value, mask, self.dropout if self.training else 0.0))


class CrossAttention(nn.Module):
    """Multi-head attention from x to a memory, without positions."""

    def __init__(self, width: int, heads: int, *, dropout: float = 0.0, bias: bool = True) -> None:
        super().__init__()
        self.heads = heads
        self.dropout = dropout
        self.query = Linear(width, width, bias=bias)
        self.key_value = Linear(width, 2 * width, bias=bias)
        self.out = Linear(width, width, bias=bias)

    def keys_values(self, states: Tensor) -> tuple[Tensor, Tensor]:
        """states [B, S, D] -> keys and values [B, H, S, head width], to be computed once a call."""
        key, value = self.key_value(states).chunk(2, dim=-1)
        return split_heads(key, self.heads), split_heads(value, self.heads)

    def attend(
        self,
        x: Tensor,
        keys_values: tuple[Tensor, Tensor],
        mask: Tensor | None = None,
        rotation: Rotation | None = None,
    ) -> Tensor:
        """x [B, T, D] to prepared keys and values -> [B, T, D]."""
        query = split_heads(self.query(x), self.heads)
        if rotation is not None:
            query = apply_rope(query, rotation)
        return self.out(attend(query, *keys_values, mask, self.dropout if self.training else 0.0))

    def constant(self, vector: Tensor) -> Tensor:
        """What any query gets from a memory whose states all equal `vector` [D] -> [D]."""
        return self.out(self.key_value(vector).chunk(2, dim=-1)[1])

    def forward(self, x: Tensor, memory: Memory) -> Tensor:
        """x [B, T, D] -> [B, T, D]; the last `memory.null_rows` rows of the batch see the null vector only."""
        live = x.shape[0] - memory.null_rows
        keys_values, mask = self.keys_values(memory.states), memory.mask
        turn_query, turn_key = memory.rotations or (None, None)
        if turn_key is not None:
            keys_values = (apply_rope(keys_values[0], turn_key), keys_values[1])
        if live == 2 * memory.states.shape[0]:
            keys_values = (torch.cat([keys_values[0]] * 2), torch.cat([keys_values[1]] * 2))
            mask = None if mask is None else torch.cat([mask] * 2)
            if turn_query is not None:
                turn_query = (torch.cat([turn_query[0]] * 2), torch.cat([turn_query[1]] * 2))
        if memory.record is not None:
            query = split_heads(self.query(x[:live]), self.heads)
            query = query if turn_query is None else apply_rope(query, turn_query)
            memory.record.append(attention_weights(query, keys_values[0], mask))
        out = self.attend(x[:live], keys_values, mask, turn_query)
        if memory.null_rows and memory.null is not None:
            constant = self.constant(memory.null).expand(memory.null_rows, x.shape[1], -1)
            out = torch.cat([out, constant])
        if memory.gate is None:
            return out
        gate = memory.gate if len(memory.gate) == len(out) else torch.cat([memory.gate] * 2)
        return out * gate
