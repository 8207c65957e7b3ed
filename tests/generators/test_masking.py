"""What masked training hides, and iterative decoding, against plain Python."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from playground.generators.masked import MaskedConfig
from playground.generators.masking import corrupt, draw_hidden, mask_ratio
from playground.nn.sampling import Sampling


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 60), st.integers(0, 2**31), st.integers(1, 60))
def test_hidden_counts_follow_the_formula(size, seed, real_count):
    ids = torch.arange(size).expand(4, -1) % 7
    real = (torch.arange(size) < real_count).expand(4, -1)
    seen, hidden = corrupt(ids, real, 7, torch.Generator().manual_seed(seed))
    everywhere = corrupt(ids, torch.ones_like(real), 7, torch.Generator().manual_seed(seed))[1]
    chance = torch.rand(4, generator=torch.Generator().manual_seed(seed))
    for row in range(4):
        assert int(everywhere[row].sum()) == max(1, round(math.cos(math.pi * float(chance[row]) / 2) * size))
    assert torch.equal(hidden, everywhere & real)
    assert bool((seen[~real] == 8).all()) and bool((seen[real & ~hidden] == ids[real & ~hidden]).all())
    assert bool((seen[real] <= 7).all())


@pytest.mark.parametrize("replaced", [0.0, 0.1])
def test_shares_of_mask_tokens_and_random_codes(replaced):
    ids = torch.full((400, 100), 3)
    real = torch.ones_like(ids, dtype=torch.bool)
    seen, hidden = corrupt(ids, real, 1000, torch.Generator().manual_seed(0), replaced)
    assert float((seen[hidden] == 1000).float().mean()) == pytest.approx(0.9 * 0.88, abs=0.01)
    assert float((seen[hidden] == 3).float().mean()) == pytest.approx(0.9 * 0.12, abs=0.01)
    assert float((seen[~hidden] != 3).float().mean()) == pytest.approx(replaced, abs=0.01)
    assert float(hidden.float().mean()) == pytest.approx(2 / math.pi, abs=0.03)  # the mean of the cosine


def slow_decoding(predict, redraw, iterations, codes):
    """One row at temperature 0 in plain Python: which tokens are hidden in every pass, and what is drawn."""
    ids, scores = [0] * len(redraw), {i: 0.0 for i, again in enumerate(redraw) if again}
    total, passes = len(scores), []
    for step in range(iterations):
        size = min(total, max(1, round(math.cos(math.pi / 2 * step / max(iterations - 1, 1)) * total)))
        hidden = sorted(scores, key=lambda i: (scores[i], i))[:size]
        passes.append(set(hidden))
        logits = predict([codes if i in hidden else v for i, v in enumerate(ids)])
        scores = {}
        for i in hidden:
            mass = [math.exp(v - max(logits[i])) for v in logits[i]]
            ids[i] = max(range(codes), key=lambda v: mass[v])
            scores[i] = mass[ids[i]] / sum(mass)
    return ids, passes


@settings(max_examples=25, deadline=None)
@given(st.lists(st.booleans(), min_size=1, max_size=14).filter(any), st.integers(1, 7), st.integers(0, 2**31))
def test_iterative_decoding_equals_the_slow_rule(redraw, iterations, seed):
    codes, size = 5, len(redraw)
    table = torch.randn(size, codes + 1, codes, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)

    def predict(ids):  # what is seen elsewhere changes every logit
        return torch.stack([sum(table[(i + j) % size, v] for j, v in enumerate(ids)) for i in range(size)])

    seen = []

    def batched(ids):
        seen.append({i for i, v in enumerate(ids[0].tolist()) if v == codes})
        return predict(ids[0].tolist())[None]

    again = torch.tensor([redraw])
    config = MaskedConfig(scales=(size,) * 2, codes=(codes,) * 2, iterations=iterations)
    real = torch.ones_like(again)
    zeros = torch.zeros_like(again, dtype=torch.long)
    sampling = Sampling(temperature=0.0)
    ids, logits = draw_hidden(batched, zeros, again, real, config, sampling, sampling.rng())
    expected, passes = slow_decoding(lambda ids: predict(ids).tolist(), redraw, iterations, codes)
    assert ids[0].tolist() == expected and seen == passes
    assert all(later <= earlier for earlier, later in zip(passes, passes[1:], strict=False))
    assert logits[0][again[0]].argmax(dim=-1).tolist() == ids[0][again[0]].tolist()


def test_the_schedule_runs_from_all_to_none():
    assert [mask_ratio(x) for x in (0.0, 1 / 3, 0.5, 1.0)] == pytest.approx([1, math.cos(math.pi / 6), 0.5**0.5, 0])
