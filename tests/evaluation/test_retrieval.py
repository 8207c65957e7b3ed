"""Retrieval figures of evaluators against slow counting, and what bounds them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.data.batches import Sample
from playground.errors import PlaygroundError
from playground.evaluation.retrieval import TOPS, ceiling, retrieval, retrieval_lines


@given(st.integers(1, 12), st.integers(1, 5), st.integers(0, 10_000))
def test_the_ceiling_is_what_guessing_among_equals_gives(size, pool, seed):
    groups = np.random.default_rng(seed).integers(0, 3, size)
    if size < pool:
        return
    order = np.random.default_rng(seed + 1).permutation(size)
    shares = ceiling(groups[:, None] == groups, pool, np.random.default_rng(seed + 1))
    for top, share in zip(TOPS, shares, strict=True):
        chances = []
        for start in range(0, size - pool + 1, pool):
            inside = [groups[row] for row in order[start : start + pool]]
            chances += [min(1.0, top / inside.count(group)) for group in inside]
        assert share == pytest.approx(np.mean(chances))


class Oracle:
    """Knows the caption numbers; motions and texts are points of a line. Everything within a caption coincides."""

    def __init__(self, noise: float = 0.0) -> None:
        self.noise = noise

    def embed_rows(self, rows):
        shift = self.noise * np.random.default_rng(0).standard_normal(len(rows))
        return np.stack([np.array([row[0, 0] + s, 0.0], np.float32) for row, s in zip(rows, shift, strict=True)])

    def embed_texts(self, texts):
        return np.array([[float(text.split()[1]), 0.0] for text in texts], np.float32)


def clips(count: int, captions: int = 1, same: int = 1) -> list[Sample]:
    """`same` neighbouring clips share all their captions."""
    return [
        Sample(
            np.full((8, 67), float(n // same), np.float32),
            tuple(f"clip {n // same} said {c}" for c in range(captions)),
            "A",
            "even" if n % 2 else "odd",
        )
        for n in range(count)
    ]


def test_a_perfect_evaluator_finds_everything():
    facts = retrieval(Oracle(), clips(70, captions=3), repeats=3)
    for pool in ("pool32",):
        for top in ("top1", "top2", "top3"):
            assert facts[pool]["own"][top] == {"mean": 1.0, "ci95": 0.0} == facts[pool]["same_caption"][top]
            assert facts[pool]["ceiling_caption"][top]["mean"] == 1.0
        assert facts[pool]["ceiling_action"]["top3"]["mean"] == pytest.approx(3 / 16, abs=0.02)
    assert "pool100" not in facts and facts["n"] == 70


def test_repeated_captions_bound_the_first_reading_and_not_the_second():
    facts = retrieval(Oracle(noise=1e-3), clips(32, same=4), repeats=40)["pool32"]
    for top in TOPS:
        name = f"top{top}"
        assert facts["ceiling_caption"][name]["mean"] == pytest.approx(top / 4)
        assert facts["own"][name]["mean"] == pytest.approx(top / 4, abs=0.02)
        assert facts["same_caption"][name]["mean"] == 1.0


def test_a_constant_evaluator_finds_what_guessing_does():
    class Constant(Oracle):
        def embed_texts(self, texts):
            return np.zeros((len(texts), 2), np.float32)

        def embed_rows(self, rows):
            return np.zeros((len(rows), 2), np.float32)

    facts = retrieval(Constant(), clips(40), repeats=2)
    assert facts["pool32"]["own"]["top3"]["mean"] == pytest.approx(3 / 32)


def test_figures_depend_on_the_seed_alone():
    first, again = (retrieval(Oracle(noise=3.0), clips(64, captions=2), repeats=4, seed=5) for _ in range(2))
    other = retrieval(Oracle(noise=3.0), clips(64, captions=2), repeats=4, seed=6)
    assert first == again and first != other
    assert 0 < first["pool32"]["own"]["top1"]["mean"] < 1 and first["pool32"]["own"]["top1"]["ci95"] > 0


def test_clips_without_captions_do_not_count():
    silent = Sample(np.zeros((8, 67), np.float32), (), "A", "odd")
    assert retrieval(Oracle(), [*clips(33), silent], repeats=1)["n"] == 33
    with pytest.raises(PlaygroundError, match="captions"):
        retrieval(Oracle(), [silent], repeats=1)


def test_the_card_has_a_row_for_every_pool_and_reading():
    lines = retrieval_lines(retrieval(Oracle(), clips(128), repeats=2))
    assert len(lines) == 2 + 2 * 4 and all(line.count("|") == 6 for line in lines)
    assert lines[2] == "| 32 | own motion only | 1.000 ± 0.000 | 1.000 ± 0.000 | 1.000 ± 0.000 |"
