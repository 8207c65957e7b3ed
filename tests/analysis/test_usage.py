"""Code usage against plain counting, and on inputs without tokens, with one code, or outside the codebook."""

import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.analysis.usage import CodeUsage, expected_used, perplexity
from playground.errors import PlaygroundError

SCALES = st.lists(
    st.integers(1, 40).flatmap(lambda size: st.tuples(st.just(size), st.lists(st.integers(0, size - 1), max_size=60))),
    min_size=1,
    max_size=5,
)


def slow_perplexity(ids: list[int]) -> float:
    total = 0.0
    for count in Counter(ids).values():
        p = count / len(ids)
        total -= p * math.log(p + 1e-7)
    return math.exp(total)


@given(SCALES, st.integers(0, 50))
def test_against_plain_counting(scales: list[tuple[int, list[int]]], k: int) -> None:
    usage = CodeUsage().fit([np.array(ids, np.int64) for _, ids in scales], [size for size, _ in scales])
    hit = 0
    for n, (size, ids) in enumerate(scales):
        counter = Counter(ids)
        hit += len(counter)
        assert usage.counts_[n].tolist() == [counter[code] for code in range(size)]
        assert usage.totals_[n] == len(ids)
        assert usage.used_[n] == pytest.approx(len(counter) / size)
        assert usage.dead_[n].tolist() == [code for code in range(size) if code not in counter]
        if ids:
            assert usage.perplexity_[n] == pytest.approx(slow_perplexity(ids), rel=1e-9)
            top = sum(count for _, count in counter.most_common(k)) if k else 0
            assert usage.coverage(k)[n] == pytest.approx(top / len(ids))
        else:
            assert math.isnan(usage.perplexity_[n]) and math.isnan(usage.coverage(k)[n])
    assert usage.used_all_ == pytest.approx(hit / sum(size for size, _ in scales))
    assert usage.codes_ == [size for size, _ in scales]


@given(SCALES)
def test_counts_give_the_same_as_ids(scales: list[tuple[int, list[int]]]) -> None:
    first = CodeUsage().fit([np.array(ids, np.int64) for _, ids in scales], [size for size, _ in scales])
    second = CodeUsage().fit_counts(first.counts_)
    np.testing.assert_array_equal(first.perplexity_, second.perplexity_)
    assert first.used_all_ == second.used_all_


@pytest.mark.parametrize("codes, expected", [(1, 1.0), (2, 2.0), (64, 64.0)])
def test_even_use_has_as_much_perplexity_as_codes(codes: int, expected: float) -> None:
    assert perplexity(np.full(codes, 7)) == pytest.approx(expected, rel=1e-4)


def test_one_code_of_many() -> None:
    usage = CodeUsage().fit([np.full((5, 3), 2)], [10])
    assert usage.perplexity_[0] == pytest.approx(1.0, abs=1e-6)
    assert usage.used_[0] == pytest.approx(0.1) and len(usage.dead_[0]) == 9
    assert usage.coverage(1)[0] == 1.0
    assert usage.relative(0).tolist() == [10.0] + [0.0] * 9
    assert usage.relative(0, "index").tolist() == [0, 0, 10.0, 0, 0, 0, 0, 0, 0, 0]


@given(SCALES)
def test_relative_frequencies_average_to_one(scales: list[tuple[int, list[int]]]) -> None:
    usage = CodeUsage().fit([np.array(ids, np.int64) for _, ids in scales], [size for size, _ in scales])
    for n, (_, ids) in enumerate(scales):
        values = usage.relative(n)
        assert values.mean() == pytest.approx(1.0 if ids else 0.0)
        assert (np.diff(values) <= 0).all()
        assert sorted(values) == sorted(usage.relative(n, "index"))


def test_batched_and_flat_ids_count_alike() -> None:
    ids = np.random.default_rng(0).integers(0, 9, (4, 6))
    assert CodeUsage().fit([ids], [9]).counts_[0].tolist() == CodeUsage().fit([ids.ravel()], [9]).counts_[0].tolist()


@pytest.mark.parametrize(
    "ids, codes",
    [([[0, 1]], [1]), ([[-1]], [4]), ([[0.5]], [4]), ([[float("nan")]], [4]), ([[0]], [4, 4]), ([], [])],
)
def test_ids_that_cannot_be_are_refused(ids: list[list[float]], codes: list[int]) -> None:
    with pytest.raises(PlaygroundError):
        CodeUsage().fit(ids, codes)


@pytest.mark.parametrize("counts", [[], [[]], [[1, -1]], [[[1, 2]]]])
def test_counts_that_cannot_be_are_refused(counts: list) -> None:
    with pytest.raises(PlaygroundError):
        CodeUsage().fit_counts(counts)


@pytest.mark.parametrize("total, codes", [(0, 5), (1, 1), (3, 4), (200, 10)])
def test_what_even_use_would_reach(total: int, codes: int) -> None:
    draws = np.random.default_rng(0).integers(0, codes, (20_000, total))
    reached = np.mean([len(set(row)) / codes for row in draws.tolist()])
    assert expected_used(total, codes) == pytest.approx(reached, abs=0.01)


def test_unknown_order_and_negative_k_are_refused() -> None:
    usage = CodeUsage().fit([[0, 1]], [2])
    with pytest.raises(PlaygroundError):
        usage.relative(0, "size")
    with pytest.raises(PlaygroundError):
        usage.coverage(-1)
