import math

import pytest
import torch

from playground.nn.attention import (
    CrossAttention,
    KeyValueCache,
    Memory,
    SelfAttention,
    attend,
    prefix_pattern,
    split_heads,
)
from playground.nn.rope import rope_angles


def slow_attention(query, key, value, mask, heads):
    """Float64 loops over batch, head and query; query [B, T, D], key and value [B, S, D], mask bool [B, S]."""
    query, key, value = query.double(), key.double(), value.double()
    out = torch.zeros_like(query)
    size = query.shape[-1] // heads
    for b in range(query.shape[0]):
        for h in range(heads):
            part = slice(h * size, (h + 1) * size)
            for t in range(query.shape[1]):
                scores = [float(query[b, t, part] @ key[b, s, part]) / math.sqrt(size) for s in range(key.shape[1])]
                top = max(x for s, x in enumerate(scores) if mask[b, s])
                weights = [math.exp(x - top) if mask[b, s] else 0.0 for s, x in enumerate(scores)]
                for s, weight in enumerate(weights):
                    out[b, t, part] += weight / sum(weights) * value[b, s, part]
    return out.float()


def test_self_attention_equals_loops_and_ignores_masked_keys():
    torch.manual_seed(0)
    layer, x = SelfAttention(8, 2).eval(), torch.randn(2, 5, 8)
    mask = torch.tensor([[True] * 5, [True, True, True, False, False]])
    query, key, value = layer.qkv(x).chunk(3, dim=-1)
    expected = layer.out(slow_attention(query, key, value, mask, 2))
    torch.testing.assert_close(layer(x, mask=mask), expected, atol=1e-5, rtol=1e-5)
    changed = x.clone()
    changed[1, 3:] = 99.0
    torch.testing.assert_close(layer(changed, mask=mask)[1, :3], expected[1, :3], atol=1e-5, rtol=1e-5)


def test_cross_attention_equals_loops():
    torch.manual_seed(1)
    layer, x, states = CrossAttention(8, 2).eval(), torch.randn(2, 4, 8), torch.randn(2, 6, 8)
    mask = torch.tensor([[True] * 6, [True, False, True, False, True, False]])
    key, value = layer.key_value(states).chunk(2, dim=-1)
    expected = layer.out(slow_attention(layer.query(x), key, value, mask, 2))
    torch.testing.assert_close(layer(x, Memory(states, mask)), expected, atol=1e-5, rtol=1e-5)


def test_null_rows_equal_attention_to_copies_of_the_null_vector():
    torch.manual_seed(2)
    layer, x, states, null = CrossAttention(8, 2).eval(), torch.randn(4, 3, 8), torch.randn(2, 5, 8), torch.randn(8)
    out = layer(x, Memory(states, None, None, null, 2))
    torch.testing.assert_close(out[:2], layer(x[:2], Memory(states)))
    for copies in (1, 7):
        full = layer(x[2:], Memory(null.expand(2, copies, 8)))
        torch.testing.assert_close(out[2:], full, atol=1e-6, rtol=1e-5)


def test_gate_switches_the_branch_off_a_row():
    torch.manual_seed(3)
    layer, x, states = CrossAttention(8, 2).eval(), torch.randn(1, 3, 8), torch.randn(1, 5, 8)
    gate = torch.tensor([[[1.0], [0.0], [1.0]]])
    out = layer(x, Memory(states, None, gate))
    assert torch.equal(out[0, 1], torch.zeros(8))
    torch.testing.assert_close(out[0, 0], layer(x, Memory(states))[0, 0])


def test_cache_gives_what_one_pass_gives():
    torch.manual_seed(4)
    layer, x = SelfAttention(8, 2).eval(), torch.randn(1, 6, 8)
    rotation = rope_angles(torch.arange(6), 4, 100.0)
    blocks = torch.tensor([0, 0, 0, 1, 1, 1])
    pattern = (blocks[:, None] >= blocks[None, :])[None, None]
    cache = KeyValueCache()
    parts = [
        layer(x[:, part], rotation=tuple(r[part] for r in rotation), cache=cache) for part in (slice(0, 3), slice(3, 6))
    ]
    full = layer(x, rotation=rotation, mask=pattern)
    torch.testing.assert_close(torch.cat(parts, dim=1), full, atol=1e-6, rtol=1e-5)


def test_recorded_weights_are_what_the_values_are_multiplied_with():
    torch.manual_seed(5)
    layer = CrossAttention(16, 2).eval()
    x, states = torch.randn(2, 5, 16), torch.randn(2, 4, 16)
    mask = torch.tensor([[True] * 4, [True, True, False, False]])
    record: list[torch.Tensor] = []
    with torch.no_grad():
        plain = layer(x, Memory(states, mask))
        seen = layer(x, Memory(states, mask, record=record))
        value = split_heads(layer.key_value(states).chunk(2, dim=-1)[1], 2)
        again = layer.out((record[0] @ value).transpose(1, 2).flatten(-2))
    assert torch.equal(plain, seen) and record[0].shape == (2, 2, 5, 4)
    torch.testing.assert_close(again, plain, atol=1e-6, rtol=1e-5)
    torch.testing.assert_close(record[0].sum(-1), torch.ones(2, 2, 5))
    assert not record[0][1, :, :, 2:].any()


@pytest.mark.parametrize("causal_prefix", [False, True])
def test_prefix_pattern_equals_its_rules(causal_prefix):
    real = torch.tensor([[True, True, True], [True, False, False]])
    pattern = prefix_pattern(real, 4, causal_prefix=causal_prefix)
    for b in range(2):
        for i in range(7):
            for j in range(7):
                both_prefix = i < 3 and j < 3 and not causal_prefix
                seen = (j <= i or both_prefix) and (j >= 3 or bool(real[b, j]))
                assert bool(pattern[b, 0, i, j]) == (seen or i == j)


def test_self_attention_records_the_weights_of_a_pattern():
    torch.manual_seed(6)
    layer, x = SelfAttention(8, 2).eval().requires_grad_(False), torch.randn(2, 5, 8)
    pattern = prefix_pattern(torch.tensor([[True, True], [True, False]]), 3)
    record: list[torch.Tensor] = []
    out = layer(x, mask=pattern, record=record)
    value = split_heads(layer.qkv(x).chunk(3, dim=-1)[2], 2)
    again = layer.out((record[0] @ value).transpose(1, 2).flatten(-2))
    torch.testing.assert_close(again, out, atol=1e-6, rtol=1e-5)
    assert not record[0].masked_select(~pattern.expand(-1, 2, -1, -1)).any()


@pytest.mark.parametrize("kind", ["none", "keys", "pattern", "scores"])
def test_attention_trained_in_half_precision_equals_that_in_full(kind):
    torch.manual_seed(4)
    mask = {
        "none": None,
        "keys": torch.rand(3, 7) > 0.4,
        "pattern": torch.rand(3, 1, 5, 7) > 0.4,
        "scores": torch.randn(3, 2, 5, 7),
    }[kind]
    if mask is not None and mask.dtype == torch.bool:
        mask[..., 0] = True
    full = [torch.randn(3, 2, size, 8).bfloat16().float().requires_grad_() for size in (5, 7, 7)]
    half = [x.detach().bfloat16().requires_grad_() for x in full]
    expected = attend(*full, mask, 0.0)
    out = attend(*half, mask.bfloat16() if kind == "scores" else mask, 0.0)
    assert out.dtype == torch.bfloat16
    torch.testing.assert_close(out.float(), expected, atol=0.02, rtol=0.02)
    direction = torch.randn_like(expected)
    expected.backward(direction)
    out.backward(direction.bfloat16())
    for slow, fast in zip(full, half, strict=True):
        torch.testing.assert_close(fast.grad.float(), slow.grad, atol=0.05, rtol=0.05)


def test_attention_trained_in_half_precision_drops_weights_and_stays_finite_where_nothing_is_seen():
    torch.manual_seed(5)
    query, key, value = (torch.ones(1, 1, 4, 8, dtype=torch.bfloat16, requires_grad=True) for _ in range(3))
    dropped = attend(query, key, value, None, 0.5)
    assert len(dropped.unique()) > 1  # each of the four equal weights is 0 or doubled
    unseen = attend(query, key, value, torch.zeros(1, 4, dtype=torch.bool), 0.0)
    unseen.sum().backward()
    assert unseen.isfinite().all() and query.grad.isfinite().all()
