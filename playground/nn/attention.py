"""Multi-head attention: self-attention with rotary or relative positions and a cache, cross-attention to a memory.

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

    def cut(self, size: int) -> None:
        """Keep the first `size` positions of every layer, in memory of their own."""
        for table in (self.keys, self.values):
            for layer, part in table.items():
                table[layer] = part[:, :, :size].clone()


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
    """Softmax attention on [B, H, T, head width], scale 1/sqrt(head width) -> [B, T, D].

    mask: see above; a pattern of real numbers is added to the scaled scores.
    """
    if query.device.type == "cpu" and query.dtype == torch.bfloat16 and query.requires_grad:
        # torch's fused kernel takes 2 to 8 times as long backwards in bfloat16 on a CPU
        out = F.dropout(attention_weights(query, key, mask), dropout) @ value
    else:
        out = F.scaled_dot_product_attention(query, key, value, attn_mask=_over_scores(mask), dropout_p=dropout)
    return out.transpose(1, 2).flatten(-2)


def attention_weights(query: Tensor, key: Tensor, mask: Tensor | None) -> Tensor:
    """What `attend` multiplies the values with: [B, H, T, head width] twice, its mask -> [B, H, T, S]."""
    score = (query * query.shape[-1] ** -0.5) @ key.transpose(-2, -1)
    over = _over_scores(mask)
    if over is not None and over.dtype == torch.bool:
        score = score.masked_fill(~over, torch.finfo(score.dtype).min)
    elif over is not None:
        score = score + over
    return score.softmax(dim=-1)


def _over_scores(mask: Tensor | None) -> Tensor | None:
    """A mask as it lies over scores [B, H, T, S]: keys [B, S] get the axes that a pattern has."""
    return mask[:, None, None, :] if mask is not None and mask.ndim == 2 else mask


def prefix_pattern(real: Tensor, steps: int, *, causal_prefix: bool = False) -> Tensor:
    """Who sees whom in a prefix followed by a causal part: real bool [B, P], number of steps -> bool [B, 1, S, S].

    The real positions of the prefix see each other, whatever the order (with causal_prefix those before them alone),
    and nothing of the steps; a step sees the real prefix, the steps before it and itself. Everyone sees itself.
    """
    places = torch.arange(real.shape[1] + steps, device=real.device)
    seen = places[None, :] <= places[:, None]
    if not causal_prefix:
        seen = seen | ((places < real.shape[1])[None, :] & (places < real.shape[1])[:, None])
    keys = torch.cat([real, real.new_ones(len(real), steps)], dim=1)
    return (seen & keys[:, None, :] | (places[None, :] == places[:, None]))[:, None]


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
        record: list[Tensor] | None = None,
    ) -> Tensor:
        """x [B, T, D] -> [B, T, D]. mask: [B, S] keys, or [1 or B, 1, T, S] pattern.

        record: where given, the attention weights [B, H, T, S] are appended to it.
        """
        query, key, value = (split_heads(part, self.heads) for part in self.qkv(x).chunk(3, dim=-1))
        if rotation is not None:
            query, key = apply_rope(query, rotation), apply_rope(key, rotation)
        if cache is not None:
            key, value = cache.extend(layer, key, value)
        if record is not None:
            record.append(attention_weights(query, key, mask))
        return self.out(attend(query, key, value, mask, self.dropout if self.training else 0.0))


class RelativeAttention(nn.Module):
    """Causal multi-head self-attention with learned relative positions (Transformer-XL's score; systems.md C2).

    Query i and key j <= i score (q_i k_j + q_i R(i-j) + u k_j + v R(i-j)) / sqrt(head width). R is a table of a vector
    a distance and head; distances beyond `reach` count as `reach`. The head width is width // heads, which need not
    divide: the inner width is their product.
    """

    def __init__(self, width: int, heads: int, reach: int, *, dropout: float = 0.0) -> None:
        super().__init__()
        self.heads = heads
        self.dropout = dropout
        size = width // heads
        self.qkv = Linear(width, 3 * heads * size)
        self.out = Linear(heads * size, width)
        self.distances = nn.Parameter(torch.empty(heads, reach + 1, size))  # R
        self.key_bias = nn.Parameter(torch.zeros(heads, 1, size))  # u
        self.distance_bias = nn.Parameter(torch.zeros(heads, 1, size))  # v
        nn.init.normal_(self.distances, std=0.02)

    def forward(self, x: Tensor, *, cache: KeyValueCache | None = None, layer: int = 0) -> Tensor:
        """x [B, T, D] -> [B, T, D]; with a cache x continues what the cache has seen."""
        query, key, value = (split_heads(part, self.heads) for part in self.qkv(x).chunk(3, dim=-1))
        if cache is not None:
            key, value = cache.extend(layer, key, value)
        steps, seen = query.shape[2], key.shape[2]
        places = torch.arange(seen, device=x.device)
        gap = places[seen - steps :, None] - places[None, :]  # (T, S)
        by_distance = (query + self.distance_bias) @ self.distances.transpose(-2, -1)  # (B, H, T, reach + 1)
        index = gap.clamp(0, self.distances.shape[1] - 1).expand(*query.shape[:2], -1, -1)
        bias = by_distance.gather(-1, index) / query.shape[-1] ** 0.5
        bias = bias.masked_fill(gap < 0, float("-inf")).to(value.dtype)
        query = (query + self.key_bias).to(value.dtype)
        return self.out(attend(query, key, value, bias, self.dropout if self.training else 0.0))


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
