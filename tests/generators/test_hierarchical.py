import math
from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.nn import functional as F

from playground.errors import PlaygroundError
from playground.generators.base import TokenBatch
from playground.generators.hierarchical import (
    HIERARCHICAL_PRESETS,
    HierarchicalConfig,
    HierarchicalGenerator,
    RQHCTransformer,
    Sweep,
)
from playground.nn.attention import KeyValueCache, RelativeAttention
from playground.nn.sampling import Sampling
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Tokens
from tests.generators.lookup import Lookup, louder, row_of
from tests.tiny import text_features

LEVELS = 3
TINY = HierarchicalConfig(
    width=14, depths=(2, 1, 1), heads=(3, 2, 1), hidden=20, dropout=0.0, text_width=20, scales=(12,) * LEVELS,
    codes=(10,) * LEVELS, code_width=6,
)  # fmt: skip
LENGTHS = torch.tensor([40, 21])  # 10 and 6 steps


def tiny(**changes) -> HierarchicalGenerator:
    with torch.random.fork_rng():
        torch.manual_seed(1)
        network = RQHCTransformer(replace(TINY, **changes))
        for name, parameter in network.named_parameters():
            if name.endswith(("key_bias", "distance_bias", "distances")):
                torch.nn.init.normal_(parameter, std=0.3)
        return HierarchicalGenerator(louder(network, 5.0), Lookup(LEVELS))


def some_tokens(seed: int = 0, size: int = 10, rows: int = 2) -> Tokens:
    rng = torch.Generator().manual_seed(seed)
    return Tokens(tuple(torch.randint(10, (rows, size), generator=rng) for _ in range(LEVELS)), (10,) * LEVELS)


def slow_relative(layer: RelativeAttention, x: torch.Tensor) -> torch.Tensor:
    """x [T, D] -> [T, D]: Transformer-XL's four terms, one query, key and head at a time, float64."""
    heads, reach, size = layer.heads, layer.distances.shape[1] - 1, layer.distances.shape[2]
    qkv = x @ layer.qkv.weight.double().T + layer.qkv.bias.double()
    inner, table = heads * size, layer.distances.double()
    out = torch.zeros(len(x), inner, dtype=torch.float64)
    for h in range(heads):
        part = slice(h * size, (h + 1) * size)
        query, key, value = (qkv[:, n * inner : (n + 1) * inner][:, part] for n in range(3))
        u, v = layer.key_bias[h, 0].double(), layer.distance_bias[h, 0].double()
        for i in range(len(x)):
            scores = []
            for j in range(i + 1):
                far = table[h, min(i - j, reach)]
                terms = query[i] @ key[j] + query[i] @ far + u @ key[j] + v @ far
                scores.append(float(terms) / math.sqrt(size))
            weights = [math.exp(s - max(scores)) for s in scores]
            out[i, part] = sum(w / sum(weights) * value[j] for j, w in enumerate(weights))
    return out @ layer.out.weight.double().T + layer.out.bias.double()


def slow_logits(net: RQHCTransformer, pooled: torch.Tensor, ids: list[list[int]]) -> list[torch.Tensor]:
    """Pooled text [D] and ids, a list a level -> logits [T, V] a level, one row, float64."""
    width, result = net.config.width, []
    text = net.text_proj.weight.double() @ pooled.double() + net.text_proj.bias.double()
    for level, decoder in enumerate(net.decoders):
        rows = [text + decoder.level.double()]
        for t in range(len(ids[0])):
            own = ids[level][t - 1] if t else net.config.codes[level]
            lower = [net.decoders[n].embedding.weight[ids[n][t]].double() for n in range(level)]
            rows.append(decoder.embedding.weight[own].double() + sum(lower))
        x = torch.stack(rows)
        for layer in decoder.layers:
            x = x + slow_relative(layer.attention, F.layer_norm(x, (width,), eps=1e-5))
            feed, inner = layer.feed_forward, F.layer_norm(x, (width,), eps=1e-5)
            up = F.gelu(inner @ feed.up.weight.double().T + feed.up.bias.double())
            x = x + up @ feed.down.weight.double().T + feed.down.bias.double()
        last = F.layer_norm(x[1:], (width,), eps=1e-5)
        result.append(last @ decoder.head.weight.double().T + decoder.head.bias.double())
    return result


@pytest.mark.parametrize(("width", "heads", "reach"), [(8, 2, 9), (7, 2, 3), (10, 3, 1)])
def test_relative_attention_equals_its_formula_with_and_without_a_cache(width, heads, reach):
    torch.manual_seed(0)
    layer = RelativeAttention(width, heads, reach).eval().requires_grad_(False)
    for parameter in layer.parameters():
        parameter.normal_(std=0.7)
    x = torch.randn(2, 7, width)
    out = layer(x)
    for row in range(2):
        torch.testing.assert_close(out[row].double(), slow_relative(layer, x[row].double()), atol=1e-4, rtol=1e-4)
    cache = KeyValueCache()
    parts = [layer(x[:, part], cache=cache) for part in (slice(0, 3), slice(3, 4), slice(4, 7))]
    torch.testing.assert_close(torch.cat(parts, dim=1), out, atol=1e-5, rtol=1e-5)


def test_logits_equal_slow_loops():
    generator, tokens, text = tiny(), some_tokens(), text_features((4, 2))
    logits = generator.logits(tokens, text, LENGTHS)
    for row in range(2):
        expected = slow_logits(generator.network, text.pooled[row], [ids[row].tolist() for ids in tokens.ids])
        for ours, slow in zip(logits, expected, strict=True):
            torch.testing.assert_close(ours[row].double(), slow, atol=1e-3, rtol=1e-3)


@settings(max_examples=20, deadline=None)
@given(level=st.integers(0, LEVELS - 1), place=st.integers(0, 9), by=st.integers(1, 9))
def test_a_token_changes_only_what_is_drawn_after_it(level, place, by):
    generator, tokens, text = tiny(), some_tokens(), text_features((4, 2))
    changed = [ids.clone() for ids in tokens.ids]
    changed[level][:, place] = (changed[level][:, place] + by) % 10
    before = generator.logits(tokens, text, LENGTHS)
    after = generator.logits(Tokens(tuple(changed), tokens.codes), text, LENGTHS)
    for number in range(LEVELS):
        first = 10 if number < level else place + (number == level)  # levels below never see it
        assert torch.equal(before[number][:, :first], after[number][:, :first])
        if first < 10:
            assert not torch.equal(before[number][:, first], after[number][:, first])


@pytest.mark.parametrize("cfg", [0.0, 3.0])
@pytest.mark.parametrize("with_text", [True, False])
def test_cached_sampling_equals_teacher_forcing(cfg, with_text):
    generator, lengths = tiny(), torch.tensor([48, 48])  # as many steps as the window holds
    text = text_features((4, 2)) if with_text else None
    step = generator.generate(text, lengths, Sampling(seed=2, cfg=cfg))
    plain = torch.cat(generator.logits(step.tokens, text, lengths), dim=1)
    if with_text:
        empty = TextFeatures(text.tokens * 0, text.mask, text.pooled * 0, text.words)
        plain = (1 + cfg) * plain - cfg * torch.cat(generator.logits(step.tokens, empty, lengths), dim=1)
    assert step.level == LEVELS and step.tokens.sizes == (12,) * LEVELS
    torch.testing.assert_close(step.logits, plain, atol=1e-4, rtol=1e-3)
    chance = plain.double().softmax(-1)
    torch.testing.assert_close(step.entropy.double(), -(chance * chance.log2()).sum(-1), atol=1e-3, rtol=1e-3)
    torch.testing.assert_close(step.embedding, generator.tokenizer.embed(step.tokens, lengths=lengths))


def test_a_long_sweep_continues_from_the_newest_three_quarters():
    generator, text = tiny(), text_features((4,))
    tokens = generator.generate(text, torch.tensor([80]), Sampling(seed=4, cfg=0.0)).tokens
    assert tokens.sizes == (20,) * LEVELS
    sweep = Sweep(generator.network, text, 1, 0.0, [ids[:, :12] for ids in tokens.ids])
    assert sweep.history[0].tolist() == tokens.ids[0][:, 3:12].tolist()
    cut = Tokens(tuple(ids[:, 3:13] for ids in tokens.ids), tokens.codes)
    expected = [part[:, -1] for part in generator.logits(cut, text, torch.tensor([40]))]
    step = generator.generate(text, torch.tensor([80]), Sampling(seed=4, cfg=0.0))
    for level in range(LEVELS):
        torch.testing.assert_close(step.logits[:, 20 * level + 12], expected[level], atol=1e-4, rtol=1e-3)


def test_rows_with_their_own_seeds_do_not_depend_on_the_batch():
    generator, text = tiny(), text_features((4, 2), padded=2)
    batch = generator.generate(text, LENGTHS, Sampling(seeds=(3, 9)))
    assert all(not ids[1, 6:].any() for ids in batch.tokens.ids) and not batch.embedding[1, 6:].any()
    for row, (seed, words, size) in enumerate(((3, 4, 10), (9, 2, 6))):
        alone = generator.generate(row_of(text, row, words), LENGTHS[row : row + 1], Sampling(seed=seed)).tokens
        for one, both in zip(alone.ids, batch.tokens.ids, strict=True):
            assert torch.equal(one[0], both[row, :size])


def test_same_seed_same_tokens():
    generator, text = tiny(), text_features((4, 2))
    drawn = [generator.generate(text, LENGTHS, Sampling(seed=s, top_k=1.0)).tokens for s in (1, 1, 2)]
    assert drawn[0] == drawn[1] != drawn[2]
    cold = [generator.generate(text, LENGTHS, Sampling(seed=s, temperature=0.0)).tokens for s in (1, 2)]
    assert cold[0] == cold[1]


@settings(max_examples=10, deadline=None)
@given(keep=st.lists(st.booleans(), min_size=10, max_size=10), seed=st.integers(0, 99), forced=st.integers(0, LEVELS))
def test_an_edit_keeps_the_kept_tokens(keep, seed, forced):
    generator, text, source = tiny(), text_features((4, 2)), some_tokens(seed)
    lengths, mask = torch.tensor([40, 40]), torch.tensor(keep)
    edited = generator.edit(source, mask, text, lengths, Sampling(seed=seed, top_k=1.0), forced)
    for level in range(LEVELS):
        stays = mask | (level < forced)
        assert torch.equal(edited.ids[level][:, stays], source.ids[level][:, stays])


def test_score_is_the_log_softmax_of_the_given_token():
    generator, tokens, text = tiny(), some_tokens(), text_features((4, 2))
    logits = generator.logits(tokens, text, LENGTHS)
    for level, scores in enumerate(generator.score(tokens, text, LENGTHS)):
        for row in range(2):
            for place, code in enumerate(tokens.ids[level][row].tolist()):
                line = logits[level][row, place].double()
                assert float(scores[row, place]) == pytest.approx(float(line[code] - line.logsumexp(0)), abs=1e-4)


def batch_of(tokens: Tokens, counts: torch.Tensor, text: TextFeatures, dropped=None) -> TokenBatch:
    masks = torch.arange(tokens.sizes[0]) < counts[:, None]
    ids = tuple(torch.where(masks, level, 0) for level in tokens.ids)
    none = torch.zeros(len(counts), dtype=torch.bool) if dropped is None else dropped
    return TokenBatch(ids, (masks,) * len(ids), counts * 4, text, none)


def test_loss_is_the_sum_over_levels_and_sees_no_padding_and_no_dropped_text():
    generator, tokens, text = tiny(), some_tokens(), text_features((4, 2))
    counts, net = torch.tensor([10, 6]), generator.network
    batch = batch_of(tokens, counts, text, torch.tensor([False, True]))
    loss, right = net.training_loss(batch, generator.quantizer, torch.Generator().manual_seed(0))
    total, hits = 0.0, []
    texts = [text.pooled[0], torch.zeros(20)]
    slow = [slow_logits(net, texts[b], [ids[b].tolist() for ids in tokens.ids]) for b in range(2)]
    for level in range(LEVELS):
        terms, own = [], []
        for b, count in enumerate(counts.tolist()):
            for t in range(count):
                line, target = slow[b][level][t], int(tokens.ids[level][b, t])
                terms.append(float(line.logsumexp(0) - line[target]))
                own.append(int(line.argmax()) == target)
        total += sum(terms) / len(terms)
        hits.append(sum(own) / len(own))
    assert float(loss) == pytest.approx(total, rel=1e-3)
    assert float(right) == pytest.approx(sum(hits) / LEVELS, abs=1e-6)


def test_training_learns_a_toy_and_follows_its_own_random_source():
    with torch.random.fork_rng():
        torch.manual_seed(0)
        net = RQHCTransformer(replace(TINY, corrupt=0.2)).train()
    ids = (torch.arange(12)[None] + torch.arange(8)[:, None]) % 10
    tokens = Tokens((ids, (ids * 3 + 1) % 10, (ids + 5) % 10), (10,) * LEVELS)
    batch, quantizer = batch_of(tokens, torch.full((8,), 12), text_features((4, 2) * 4, seed=3)), Lookup(3).quantizer
    losses = [net.training_loss(batch, quantizer, torch.Generator().manual_seed(s))[0].item() for s in (1, 1, 2)]
    assert losses[0] == losses[1] != losses[2]
    optimiser, rng = torch.optim.AdamW(net.parameters(), lr=1e-2), torch.Generator().manual_seed(0)
    for _ in range(40):
        loss, right = net.training_loss(batch, quantizer, rng)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    assert loss.item() < 0.6 * losses[0] and right.item() > 0.5
    assert all(p.grad is not None for p in net.parameters())


def test_check_may_stop_between_steps():
    calls = []

    def check():
        calls.append(1)
        if len(calls) == 3:
            raise PlaygroundError("stop")

    with pytest.raises(PlaygroundError, match="stop"):
        tiny().generate(None, LENGTHS, Sampling(check=check))
    assert len(calls) == 3


def test_levels_of_several_lengths_are_refused_and_presets_have_their_size():
    with pytest.raises(ValueError, match="same number of tokens"):
        RQHCTransformer(replace(TINY, scales=(3, 6, 12)))
    assert 1e6 < sum(p.numel() for p in RQHCTransformer(HIERARCHICAL_PRESETS["lite"]).parameters()) < 2e6
    with torch.device("meta"):
        full = RQHCTransformer(HIERARCHICAL_PRESETS["full"])
    assert [decoder.layers[0].attention.distances.shape[2] for decoder in full.decoders] == [64, 85, 170, 512, 512, 512]
