import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from playground.nn.sampling import (
    Sampling,
    confidence,
    draw,
    entropy_bits,
    filter_logits,
    guide,
    gumbel_draw,
    top_share,
)


def slow_filter(logits: list[float], top_k: float, top_p: float) -> set[int]:
    """Which codes may be drawn, in plain Python."""
    order = sorted(range(len(logits)), key=lambda i: -logits[i])[: max(1, int(len(logits) * top_k + 1e-9))]
    top = logits[order[0]]
    mass = [math.exp(logits[i] - top) for i in order]
    total, seen, kept = sum(mass), 0.0, set()
    for i, m in zip(order, mass, strict=True):
        if kept and seen / total >= top_p:
            break
        kept.add(i)
        seen += m
    return kept


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.integers(-40, 40), min_size=1, max_size=30, unique=True),
    st.sampled_from([0.01, 0.2, 0.5, 1.0]),
    st.sampled_from([0.1, 0.5, 0.95, 1.0]),
)
def test_filter_keeps_the_codes_that_the_slow_rule_keeps(values, top_k, top_p):
    logits = [v / 8 + 0.001 for v in values]
    kept = filter_logits(torch.tensor(logits, dtype=torch.float64), top_k, top_p)
    finite = {i for i, v in enumerate(kept.tolist()) if v > -math.inf}
    expected = slow_filter(logits, top_k, top_p)
    if top_p == 1.0:  # rounding may drop codes without any mass
        assert finite <= expected and kept.argmax() == torch.tensor(logits).argmax()
    else:
        assert finite == expected
    assert all(kept[i] == logits[i] for i in finite)


def test_same_seed_same_draw_other_seed_other_draw():
    logits = torch.zeros(1, 50, 200)
    sampling = Sampling(top_k=1.0, top_p=1.0)
    first, again, other = (draw(logits, sampling, torch.Generator().manual_seed(s)) for s in (1, 1, 2))
    assert torch.equal(first, again) and not torch.equal(first, other)


def test_temperature_zero_takes_the_most_likely_whatever_the_seed():
    logits = torch.randn(2, 7, 30, generator=torch.Generator().manual_seed(0))
    for seed in (0, 1):
        drawn = draw(logits, Sampling(temperature=0.0), torch.Generator().manual_seed(seed))
        assert torch.equal(drawn, logits.argmax(dim=-1))


def test_draws_follow_the_distribution():
    chance = torch.tensor([0.5, 0.3, 0.2])
    logits = chance.log().expand(1, 20_000, 3)
    drawn = draw(logits, Sampling(top_k=1.0, top_p=1.0), torch.Generator().manual_seed(0))
    share = torch.bincount(drawn.flatten(), minlength=3) / drawn.numel()
    torch.testing.assert_close(share, chance, atol=0.02, rtol=0)


def test_entropy_of_a_uniform_and_of_a_sure_distribution():
    assert entropy_bits(torch.zeros(1, 1, 8)).item() == pytest.approx(3.0)
    assert entropy_bits(torch.tensor([[[100.0, 0.0]]])).item() == pytest.approx(0.0, abs=1e-6)


def test_guide_is_linear():
    assert guide(torch.tensor(2.0), torch.tensor(1.0), 3.0).item() == 5.0


def test_a_row_with_its_own_seed_draws_as_it_does_alone():
    logits = torch.randn(3, 9, 40, generator=torch.Generator().manual_seed(3))
    together = Sampling(seeds=(5, 8, 5), top_k=0.9)
    drawn = draw(logits, together, together.rng())
    for row, seed in enumerate(together.seeds):
        alone = Sampling(seed=seed, top_k=0.9)
        assert torch.equal(drawn[row : row + 1], draw(logits[row : row + 1], alone, alone.rng()))
    assert not torch.equal(drawn[0], drawn[1])


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.integers(-40, 40), min_size=1, max_size=30, unique=True),
    st.sampled_from([0.0, 0.01, 0.1, 0.5, 0.9, 1.0]),
)
def test_top_share_keeps_the_largest(values, share):
    kept = top_share(torch.tensor(values, dtype=torch.float64), share).tolist()
    count = max(1, -(-len(values) * round(share * 100) // 100))  # in whole numbers
    best = set(sorted(values)[-count:])
    assert kept == [float(v) if v in best else -math.inf for v in values]


def test_a_tenth_of_512_codes_is_52():
    assert int(top_share(torch.randn(512), 0.1).isfinite().sum()) == 52
    assert int(top_share(torch.randn(510), 0.1).isfinite().sum()) == 51
    assert int(top_share(torch.zeros(20), 0.1).isfinite().sum()) == 2  # ties do not add to it


@pytest.mark.parametrize("temperature", [0.5, 1.0, 2.0])
def test_gumbel_draws_follow_the_distribution(temperature):
    chance = torch.tensor([0.5, 0.3, 0.2, 0.0])
    drawn = gumbel_draw(chance.log().expand(1, 20_000, 4), temperature, torch.Generator().manual_seed(0))
    expected = chance ** (1 / temperature)
    share = torch.bincount(drawn.flatten(), minlength=4) / drawn.numel()
    torch.testing.assert_close(share, expected / expected.sum(), atol=0.02, rtol=0)


def test_gumbel_draws_at_temperature_zero_need_no_chance():
    logits = torch.randn(2, 7, 30, generator=torch.Generator().manual_seed(0))
    for seed in (0, 1):
        assert torch.equal(gumbel_draw(logits, 0.0, torch.Generator().manual_seed(seed)), logits.argmax(dim=-1))


def test_gumbel_draws_of_a_row_do_not_depend_on_batch_or_padding():
    logits = torch.randn(3, 9, 40, generator=torch.Generator().manual_seed(3))
    real = torch.tensor([[True] * 9, [True, False] * 4 + [True], [True] * 2 + [False] * 7])
    together = Sampling(seeds=(5, 8, 5))
    rngs = together.rng()
    first, second = gumbel_draw(logits, 1.0, rngs, real), gumbel_draw(logits, 1.0, rngs, real)
    for row, seed in enumerate(together.seeds):
        rng = torch.Generator().manual_seed(seed)
        alone = logits[row : row + 1, real[row]]
        assert torch.equal(first[row, real[row]], gumbel_draw(alone, 1.0, rng)[0])
        assert torch.equal(second[row, real[row]], gumbel_draw(alone, 1.0, rng)[0])
    assert not torch.equal(first[0], second[0])


def test_confidence_is_the_softmax_of_the_code():
    logits = torch.tensor([[[1.0, 2.0, 0.5], [0.0, -50.0, 0.0]]])
    mass = [math.exp(1), math.exp(2), math.exp(0.5)]
    found = confidence(logits, torch.tensor([[1, 0]]))[0].tolist()
    assert found == pytest.approx([mass[1] / sum(mass), 0.5], rel=1e-5)
