import math
from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.nn import functional as F

from playground.errors import PlaygroundError
from playground.generators.autoregressive import GPT, GPT_PRESETS, GPTConfig, GPTGenerator
from playground.generators.base import TokenBatch
from playground.nn.sampling import Sampling
from playground.text.encoders import TextFeatures
from playground.tokenizers.base import Tokens
from tests.generators.lookup import Lookup, louder, row_of
from tests.tiny import text_features

TINY = GPTConfig(
    width=16, depth=2, heads=2, hidden=24, dropout=0.0, text_width=20, scales=(12,), codes=(10,), code_width=6
)
LENGTHS = torch.tensor([40, 21])  # 10 and 6 tokens
KINDS = {"plain": {}, "casim": {"casim": True}, "causal text": {"casim": True, "causal_text": True}}
every_kind = pytest.mark.parametrize("kind", KINDS)


def tiny(kind: str = "plain", **changes) -> GPTGenerator:
    with torch.random.fork_rng():
        torch.manual_seed(1)
        return GPTGenerator(louder(GPT(replace(TINY, **KINDS[kind], **changes))), Lookup())


def some_tokens(seed: int = 0, size: int = 10, rows: int = 2) -> Tokens:
    rng = torch.Generator().manual_seed(seed)
    return Tokens((torch.randint(10, (rows, size), generator=rng),), (10,))


def slow_place(position: int, width: int) -> torch.Tensor:
    angles = [position / 10_000 ** (2 * i / width) for i in range(width // 2)]
    return torch.tensor([f(a) for a in angles for f in (math.sin, math.cos)], dtype=torch.float64)


def slow_logits(net: GPT, text: TextFeatures, row: int, ids: list[int]) -> torch.Tensor:
    """Logits [T + 1, V + 1] of one row by loops over queries and keys, float64."""
    c = net.config
    states, places = [], []
    if c.casim:
        real = [w for w in range(text.mask.shape[1]) if text.mask[row, w]]
        states += [net.text_proj(text.tokens[row, w]).double() for w in real] + [net.start.double()]
        places += [*real, 77]
    else:
        real = [0]
        states, places = [net.text_proj(text.pooled[row]).double()], [0]
    words = len(real) if c.casim else 0
    states += [net.codes.weight[i].double() for i in ids]
    places += [places[-1] + 1 + n for n in range(len(ids))]
    x = torch.stack([s + slow_place(p, c.width) for s, p in zip(states, places, strict=True)])
    for block in net.blocks:
        inner = F.layer_norm(x, (c.width,), eps=1e-5)
        qkv = inner @ block.self_attention.qkv.weight.double().T + block.self_attention.qkv.bias.double()
        out, size = torch.zeros_like(x), c.width // c.heads
        for h in range(c.heads):
            query, key, value = (qkv[:, n * c.width + h * size : n * c.width + (h + 1) * size] for n in range(3))
            for i in range(len(x)):
                whole = i < words and not c.causal_text
                keys = list(range(words)) if whole else list(range(i + 1))
                scores = torch.tensor([float(query[i] @ key[j]) / math.sqrt(size) for j in keys], dtype=torch.float64)
                out[i, h * size : (h + 1) * size] = scores.softmax(0) @ value[keys]
        x = x + out @ block.self_attention.out.weight.double().T + block.self_attention.out.bias.double()
        inner = F.layer_norm(x, (c.width,), eps=1e-5)
        up = F.gelu(inner @ block.feed_forward.up.weight.double().T + block.feed_forward.up.bias.double())
        x = x + up @ block.feed_forward.down.weight.double().T + block.feed_forward.down.bias.double()
    return F.layer_norm(x[-len(ids) - 1 :], (c.width,), eps=1e-5) @ net.head.weight.double().T


@every_kind
def test_logits_equal_slow_loops_and_padded_words_are_not_seen(kind):
    net, tokens = tiny(kind).network, some_tokens()
    text = text_features((4, 2), padded=3)
    logits = net(net.prefix(text, 2), tokens.ids[0])
    for row in range(2):
        expected = slow_logits(net, text, row, tokens.ids[0][row].tolist())
        torch.testing.assert_close(logits[row].double(), expected, atol=1e-3, rtol=1e-3)


@every_kind
def test_what_stands_in_padded_places_never_matters(kind):
    generator, tokens = tiny(kind), some_tokens()
    text = text_features((4, 2), padded=2)
    dirty = TextFeatures(text.tokens + 50.0 * ~text.mask[..., None], text.mask, text.pooled, text.words)
    torch.testing.assert_close(generator.logits(tokens, dirty, LENGTHS), generator.logits(tokens, text, LENGTHS))
    drawn = [generator.generate(t, LENGTHS, Sampling(seed=3)).tokens for t in (text, dirty, text_features((4, 2)))]
    assert drawn[0] == drawn[1] == drawn[2]


@settings(max_examples=15, deadline=None)
@given(kind=st.sampled_from(sorted(KINDS)), place=st.integers(0, 9), code=st.integers(0, 9))
def test_a_token_changes_no_logits_before_or_at_its_place(kind, place, code):
    generator, tokens, text = tiny(kind), some_tokens(), text_features((4, 2))
    changed = tokens.ids[0].clone()
    changed[:, place] = (changed[:, place] + 1 + code % 9) % 10
    net = generator.network
    before = net(net.prefix(text, 2), tokens.ids[0])
    after = net(net.prefix(text, 2), changed)
    assert torch.equal(before[:, : place + 1], after[:, : place + 1])
    assert not torch.equal(before[:, place + 1], after[:, place + 1])


@pytest.mark.parametrize("causal_text", [False, True])
def test_words_see_each_other_and_never_the_motion(causal_text):
    net = tiny("casim", causal_text=causal_text).network
    text, tokens = text_features((4, 3)), some_tokens()
    record: list[torch.Tensor] = []
    net(net.prefix(text, 2), tokens.ids[0], record)
    weights = record[0][1].mean(0)  # 4 word places of which 3 are real, the start, 10 codes
    later = torch.triu(torch.ones(3, 3), 1).bool()
    assert (weights[:3, :3][later] > 0).all() != causal_text
    assert not weights[:3, 3:].any() and not weights[4:, 3].any()
    assert (weights[4:, :3] > 0).all() and not torch.triu(weights[4:, 4:], 1).any()


@every_kind
@pytest.mark.parametrize("cfg", [0.0, 3.0])
@pytest.mark.parametrize("with_text", [True, False])
def test_cached_sampling_equals_teacher_forcing(kind, cfg, with_text):
    generator = tiny(kind)
    text = text_features((4, 2)) if with_text else None
    lengths = torch.tensor([40, 40])
    step = generator.generate(text, lengths, Sampling(seed=2, cfg=cfg))
    (plain,) = generator.logits(step.tokens, text, lengths)
    if with_text:
        empty = TextFeatures(text.tokens * 0, text.mask, text.pooled * 0, text.words)
        (null,) = generator.logits(step.tokens, empty, lengths)
        plain = (1 + cfg) * plain - cfg * null
    torch.testing.assert_close(step.logits, plain, atol=1e-4, rtol=1e-4)
    chance = plain.double().softmax(-1)
    torch.testing.assert_close(step.entropy.double(), -(chance * chance.log2()).sum(-1), atol=1e-3, rtol=1e-3)
    torch.testing.assert_close(step.embedding, generator.tokenizer.embed(step.tokens, lengths=lengths))


@every_kind
def test_rows_with_their_own_seeds_do_not_depend_on_the_batch(kind):
    generator, text = tiny(kind), text_features((4, 2))
    batch = generator.generate(text, LENGTHS, Sampling(seeds=(3, 9)))
    assert batch.tokens.sizes == (10,) and not batch.tokens.ids[0][1, 6:].any()
    assert not batch.embedding[1, 6:].any() and batch.embedding[1, 5].any()
    for row, (seed, words, size) in enumerate(((3, 4, 10), (9, 2, 6))):
        lengths = LENGTHS[row : row + 1]
        alone = generator.generate(row_of(text, row, words), lengths, Sampling(seed=seed)).tokens
        assert torch.equal(alone.ids[0][0], batch.tokens.ids[0][row, :size])


def test_same_seed_same_tokens_and_temperature_zero_draws_nothing():
    generator, text = tiny(), text_features((4, 2))
    draw = [generator.generate(text, LENGTHS, Sampling(seed=s, top_k=1.0)).tokens for s in (1, 1, 2)]
    assert draw[0] == draw[1] != draw[2]
    cold = [generator.generate(text, LENGTHS, Sampling(seed=s, temperature=0.0)).tokens for s in (1, 2)]
    assert cold[0] == cold[1]


@settings(max_examples=15, deadline=None)
@given(keep=st.lists(st.booleans(), min_size=10, max_size=10), seed=st.integers(0, 99))
def test_an_edit_keeps_the_kept_tokens(keep, seed):
    generator, text, source = tiny("casim"), text_features((4, 2)), some_tokens(seed)
    lengths, mask = torch.tensor([40, 40]), torch.tensor(keep)
    edited = generator.edit(source, mask, text, lengths, Sampling(seed=seed, top_k=1.0))
    assert torch.equal(edited.ids[0][:, mask], source.ids[0][:, mask])
    assert generator.edit(source, mask, text, lengths, Sampling(), forced=1) == source
    if not any(keep):
        assert edited == generator.generate(text, lengths, Sampling(seed=seed, top_k=1.0)).tokens


@every_kind
def test_score_and_end_are_shares_of_the_right_distributions(kind):
    generator, tokens, text = tiny(kind), some_tokens(), text_features((4, 2))
    (scores,) = generator.score(tokens, text, LENGTHS)
    ends = generator.end_probability(tokens, text)
    net = generator.network
    logits = net(net.prefix(text, 2), tokens.ids[0]).double()
    for row in range(2):
        for place in range(11):
            mass = logits[row, place].exp()
            assert float(ends[row, place]) == pytest.approx(float(mass[10] / mass.sum()), abs=1e-5)
            if place < 10:
                expected = float((mass[tokens.ids[0][row, place]] / mass[:10].sum()).log())
                assert float(scores[row, place]) == pytest.approx(expected, abs=1e-4)


def test_alignment_is_the_attention_to_the_words_of_what_draws_each_token():
    generator, tokens, text = tiny("casim"), some_tokens(), text_features((4, 2))
    seen = generator.alignment(tokens, text, LENGTHS)
    assert seen.shape == (2, 10, 4)
    torch.testing.assert_close(seen.sum(-1)[0], torch.ones(10))
    assert not seen[1, :, 2:].any() and not seen[1, 6:].any()
    record: list[torch.Tensor] = []
    net = generator.network
    net(net.prefix(text, 2), tokens.ids[0], record)
    row = record[0][0, :, 4 + 3, :4].double().mean(0)  # the start stands at place 4; what draws token 3 is token 2
    torch.testing.assert_close(seen[0, 3].double(), row / row.sum())
    with pytest.raises(ValueError, match="CASIM"):
        tiny().alignment(tokens, text, LENGTHS)


@every_kind
def test_text_matters_and_dropped_rows_see_the_null_text(kind):
    net, ids = tiny(kind).network, some_tokens().ids[0]
    one, other = (net(net.prefix(text_features((4, 4), seed=s), 2), ids) for s in (1, 2))
    assert (one - other).abs().max() > 1e-3
    text = text_features((4, 4))
    dropped = net(net.prefix(text, 2, torch.tensor([True, False])), ids)
    empty = TextFeatures(text.tokens * 0, text.mask, text.pooled * 0, text.words)
    torch.testing.assert_close(dropped[0], net(net.prefix(empty, 2), ids)[0])
    torch.testing.assert_close(dropped[1], net(net.prefix(text, 2), ids)[1])


def batch_of(tokens: Tokens, counts: torch.Tensor, text: TextFeatures) -> TokenBatch:
    masks = torch.arange(tokens.sizes[0]) < counts[:, None]
    ids = torch.where(masks, tokens.ids[0], 0)
    return TokenBatch((ids,), (masks,), counts * 4, text, torch.zeros(len(counts), dtype=torch.bool))


def test_loss_counts_real_tokens_and_the_end_only():
    generator, tokens, text = tiny(), some_tokens(), text_features((4, 2))
    counts = torch.tensor([10, 6])
    loss, right = generator.network.training_loss(
        batch_of(tokens, counts, text), generator.quantizer, torch.Generator().manual_seed(0)
    )
    net, terms, hits = generator.network, [], []
    logits = net(net.prefix(text, 2), tokens.ids[0]).double()
    for row, count in enumerate(counts.tolist()):
        for place in range(count + 1):
            target = int(tokens.ids[0][row, place]) if place < count else 10
            terms.append(float(logits[row, place].logsumexp(0) - logits[row, place, target]))
            hits.append(int(logits[row, place].argmax()) == target)
    assert float(loss) == pytest.approx(sum(terms) / len(terms), rel=1e-4)
    assert float(right) == pytest.approx(sum(hits) / len(hits))


@every_kind
def test_training_learns_a_toy_and_follows_its_own_random_source(kind):
    with torch.random.fork_rng():
        torch.manual_seed(0)
        net = GPT(replace(TINY, **KINDS[kind], corrupt=0.2)).train()
    text = text_features((4, 2) * 4, seed=3)
    ids = (torch.arange(12)[None] + torch.arange(8)[:, None]) % 10
    batch = batch_of(Tokens((ids,), (10,)), torch.full((8,), 12), text)
    quantizer = Lookup().quantizer
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


def test_check_may_stop_between_tokens():
    calls = []

    def check():
        calls.append(1)
        if len(calls) == 3:
            raise PlaygroundError("stop")

    with pytest.raises(PlaygroundError, match="stop"):
        tiny().generate(None, LENGTHS, Sampling(check=check))
    assert len(calls) == 3


def test_several_levels_are_refused_and_presets_have_their_size():
    with pytest.raises(ValueError, match="one level"):
        GPT(replace(TINY, scales=(4, 4), codes=(5, 5)))
    assert 1e6 < sum(p.numel() for p in GPT(GPT_PRESETS["lite"]).parameters()) < 2e6
    with torch.device("meta"):
        assert sum(p.numel() for p in GPT(GPT_PRESETS["full"]).parameters()) > 2.2e8
