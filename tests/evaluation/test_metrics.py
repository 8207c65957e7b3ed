"""Every metric against another way of computing it: scipy, sklearn, or loops over single numbers."""

import math
from collections import Counter
from itertools import permutations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import sqrtm
from sklearn.metrics.pairwise import cosine_similarity, euclidean_distances

from playground.errors import PlaygroundError
from playground.evaluation import metrics
from playground.evaluation.metrics import Missing


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def cloud(n: int, width: int, seed: int = 0, scale: float = 1.0) -> np.ndarray:
    """Correlated normal rows [n, width]."""
    source = rng(seed)
    return source.normal(size=(n, width)) @ source.normal(size=(width, width)) * scale + source.normal(size=width)


def why(value: float | Missing) -> str:
    assert isinstance(value, Missing)
    return value.why


# ---- FID -------------------------------------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore")
def published_fid(a: np.ndarray, b: np.ndarray) -> float:
    """Matrix square root of the product by scipy; 1e-6 on the diagonals only where it is not finite."""
    one, other = np.atleast_2d(np.cov(a, rowvar=False)), np.atleast_2d(np.cov(b, rowvar=False))
    root = sqrtm(one @ other)
    if not np.isfinite(root).all():
        ridge = 1e-6 * np.eye(len(one))
        root = sqrtm((one + ridge) @ (other + ridge))
    return float(((a.mean(0) - b.mean(0)) ** 2).sum() + np.trace(one) + np.trace(other) - 2 * np.trace(root).real)


def svd_fid(a: np.ndarray, b: np.ndarray) -> float:
    """The same without a covariance: the trace of the root is the nuclear norm of the product of the centred rows."""
    x, y = ((rows - rows.mean(0)) / math.sqrt(len(rows) - 1) for rows in (a, b))
    overlap = np.linalg.svd(x @ y.T, compute_uv=False).sum()
    return float(((a.mean(0) - b.mean(0)) ** 2).sum() + (x**2).sum() + (y**2).sum() - 2 * overlap)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("n, m, width", [(200, 150, 24), (40, 33, 1), (12, 30, 40), (3, 3, 20), (2, 2, 5)])
@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e4])
def test_fid_equals_the_published_formula_and_the_svd(n: int, m: int, width: int, scale: float) -> None:
    a, b = cloud(n, width, 1, scale), cloud(m, width, 2, 1.3 * scale)
    assert metrics.fid(a, b) == pytest.approx(svd_fid(a, b), rel=1e-4)
    assert metrics.fid(a, b) == pytest.approx(published_fid(a, b), rel=1e-4)
    assert metrics.fid(b, a) == pytest.approx(metrics.fid(a, b), rel=1e-6)


def test_fid_of_degenerate_sets() -> None:
    flat, line = np.ones((10, 6)), np.outer(rng(3).normal(size=30), rng(4).normal(size=6))
    assert metrics.fid(flat, flat + 2.0) == pytest.approx(24.0)  # points: the squared distance of the means
    assert metrics.fid(line, 3 * line) == pytest.approx(svd_fid(line, 3 * line), rel=1e-4)
    assert metrics.fid(flat, line) == pytest.approx(svd_fid(flat, line), rel=1e-4)
    same = cloud(50, 8)
    assert metrics.fid(same, same[::-1]) == pytest.approx(0.0, abs=1e-6 * np.cov(same.T).trace())
    assert isinstance(metrics.fid(same, same), float) and metrics.fid(same, same) >= 0
    assert "at least 2" in why(metrics.fid(same, same[:1]))


# ---- R-Precision -----------------------------------------------------------------------------------------------------


def slow_precision(texts, motions, pool, top, source, groups=None) -> float:
    """Sorting by scikit-learn's distances, item by item; right for distances that are all different."""
    order, hits = source.permutation(len(texts)), []
    for start in range(0, len(texts) // pool * pool, pool):
        rows = list(order[start : start + pool])
        table = euclidean_distances(texts[rows], motions[rows])
        for line, row in enumerate(rows):
            nearest = [rows[column] for column in np.argsort(table[line])[:top]]
            hits.append(row in nearest if groups is None else any(groups[row] == groups[other] for other in nearest))
    return float(np.mean(hits))


@pytest.mark.parametrize("top", [1, 2, 3])
@pytest.mark.parametrize("n, pool", [(100, 32), (100, 100), (65, 32), (7, 3)])
def test_r_precision_equals_sorting(n: int, pool: int, top: int) -> None:
    texts = cloud(n, 5)
    motions = texts + rng(1).normal(size=texts.shape) * 2
    groups = [f"caption {number}" for number in rng(2).integers(0, n // 3, n)]
    for labels in (None, groups):
        ours = metrics.r_precision(texts, motions, pool, top, rng(9), labels)
        assert ours == pytest.approx(slow_precision(texts, motions, pool, top, rng(9), labels), rel=1e-6)
    own = metrics.r_precision(texts, motions, pool, top, rng(9))
    assert own <= metrics.r_precision(texts, motions, pool, top, rng(9), groups)


@settings(max_examples=30)
@given(
    st.lists(st.integers(0, 2), min_size=4, max_size=4),
    st.lists(st.integers(0, 2), min_size=4, max_size=4),
    st.integers(1, 4),
    st.booleans(),
)
def test_equal_distances_count_as_all_their_orders(places: list[int], labels: list[int], top: int, own: bool) -> None:
    texts, motions = np.zeros((4, 1)), np.array(places, float)[:, None]
    hits = []
    for text in range(4):
        for shuffle in permutations(range(4)):  # a stable sort breaks ties by the order of the list
            nearest = sorted(shuffle, key=lambda motion: places[motion])[:top]
            hits.append(text in nearest if own else any(labels[motion] == labels[text] for motion in nearest))
    ours = metrics.r_precision(texts, motions, 4, top, rng(), None if own else labels)
    assert ours == pytest.approx(np.mean(hits), rel=1e-6)


def test_r_precision_of_extremes() -> None:
    texts = cloud(64, 4)
    assert metrics.r_precision(texts, texts, 32, 1, rng()) == 1.0
    assert metrics.r_precision(texts, np.zeros((64, 4)), 32, 3, rng()) == pytest.approx(3 / 32)  # a collapsed evaluator
    assert metrics.r_precision(texts, np.zeros((64, 4)), 32, 1, rng(), ["same"] * 64) == 1.0
    assert "pool of 100" in why(metrics.r_precision(texts, texts, 100, 1, rng()))
    for wrong in ({"top": 0}, {"top": 33}):
        with pytest.raises(PlaygroundError, match="top"):
            metrics.r_precision(texts, texts, 32, rng=rng(), **wrong)
    with pytest.raises(PlaygroundError, match="group"):
        metrics.r_precision(texts, texts, 32, 1, rng(), ["a"])


# ---- distances -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [1.0, 1e-4, 0.0])
def test_mm_dist_and_clip_score_equal_loops(scale: float) -> None:
    texts, motions = cloud(20, 6) * scale, cloud(20, 6, 1)
    apart = [
        math.sqrt(sum((x - y) ** 2 for x, y in zip(a, b, strict=True))) for a, b in zip(texts, motions, strict=True)
    ]
    assert metrics.mm_dist(texts, motions) == pytest.approx(sum(apart) / 20, rel=1e-6)
    expected = cosine_similarity(texts, motions).diagonal().mean()
    assert metrics.clip_score(texts, motions) == pytest.approx(expected, rel=1e-6, abs=1e-12)


def test_distances_of_nothing_are_missing() -> None:
    none = np.zeros((0, 4))
    assert "captioned" in why(metrics.mm_dist(none, none)) and "captioned" in why(metrics.clip_score(none, none))


@pytest.mark.parametrize("n, pairs", [(433, 300), (300, 300), (299, 100), (100, 100)])
def test_diversity_equals_a_loop_over_the_same_pairs(n: int, pairs: int) -> None:
    rows, source = cloud(n, 7), rng(5)
    first, second = source.choice(n, pairs, replace=False), source.choice(n, pairs, replace=False)
    expected = sum(math.dist(rows[i], rows[j]) for i, j in zip(first, second, strict=True)) / pairs
    assert metrics.diversity(rows, rng(5)) == pytest.approx(expected, rel=1e-6)
    assert metrics.diversity(np.ones((n, 3)), rng()) == 0.0


def test_diversity_of_few_motions() -> None:
    assert "100 pairs" in why(metrics.diversity(cloud(99, 3), rng()))
    assert isinstance(metrics.diversity(cloud(5, 3), rng(), pairs=5), float)


def test_multimodality_equals_a_loop_over_the_same_pairs() -> None:
    made, source = rng(1).normal(size=(6, 30, 4)), rng(7)
    first, second = source.choice(30, 10, replace=False), source.choice(30, 10, replace=False)
    gaps = [math.dist(made[t, i], made[t, j]) for t in range(6) for i, j in zip(first, second, strict=True)]
    assert metrics.multimodality(made, rng(7)) == pytest.approx(sum(gaps) / 60, rel=1e-6)
    assert metrics.multimodality(np.ones((3, 10, 4)), rng()) == 0.0
    assert "10 pairs" in why(metrics.multimodality(made[:, :9], rng()))
    assert "0 texts" in why(metrics.multimodality(made[:0], rng()))
    with pytest.raises(PlaygroundError, match="texts, samples"):
        metrics.multimodality(made[0], rng())


# ---- tokens ----------------------------------------------------------------------------------------------------------


def slow_perplexity(ids: np.ndarray) -> float:
    counts = Counter(ids.ravel().tolist())
    shares = [count / ids.size for count in counts.values()]
    return math.exp(-sum(p * math.log(p + 1e-7) for p in shares))


@settings(max_examples=25)
@given(st.integers(0, 2**31), st.integers(1, 9), st.lists(st.integers(1, 12), min_size=1, max_size=4))
def test_usage_and_perplexities_equal_counting(seed: int, n: int, codes: list[int]) -> None:
    ids = [rng([seed, size]).integers(0, size, (n, 3)) for size in codes]
    used = [len(set(level.ravel().tolist())) / size for level, size in zip(ids, codes, strict=True)]
    assert metrics.code_usage(ids, codes) == pytest.approx(sum(used) / len(codes), rel=1e-6)
    expected = sum(slow_perplexity(level) for level in ids) / len(codes)
    assert metrics.code_perplexity(ids, codes) == pytest.approx(expected, rel=1e-6)
    assert metrics.model_perplexity_argmax(ids, codes) == pytest.approx(expected, rel=1e-6)


def test_model_perplexity_equals_cross_entropy() -> None:
    source = torch.Generator().manual_seed(0)
    logits = [torch.randn(5, size, codes, generator=source).double() for size, codes in ((1, 8), (4, 11))]
    true = [torch.randint(0, part.shape[-1], part.shape[:-1], generator=source) for part in logits]
    likelihoods = [
        part.log_softmax(-1).gather(-1, ids[..., None])[..., 0].numpy() for part, ids in zip(logits, true, strict=True)
    ]
    losses = [
        float(torch.nn.functional.cross_entropy(part.flatten(0, 1), ids.flatten()))
        for part, ids in zip(logits, true, strict=True)
    ]
    expected = sum(math.exp(loss) for loss in losses) / 2
    assert metrics.model_perplexity_nll(likelihoods) == pytest.approx(expected, rel=1e-6)
    assert metrics.model_perplexity_nll([np.full(9, -math.log(50.0))]) == pytest.approx(50.0)
    assert metrics.model_perplexity_nll([np.array([0.0, -math.inf])]) == math.inf
    for wrong in (np.array([0.5]), np.array([math.nan])):
        with pytest.raises(PlaygroundError, match="log-likelihoods"):
            metrics.model_perplexity_nll([wrong])


def test_tokens_that_are_not_there_are_missing() -> None:
    empty = np.zeros((0, 2), np.int64)
    ids = [np.zeros((3, 2), np.int64), empty]
    assert "every scale" in why(metrics.code_usage(ids, [4, 4])) and "every scale" in why(
        metrics.code_perplexity(ids, [4, 4])
    )
    assert "every scale" in why(metrics.model_perplexity_argmax(ids, [4, 4]))
    assert "every scale" in why(metrics.model_perplexity_nll([np.zeros(3), np.zeros(0)]))
    assert "every scale" in why(metrics.model_perplexity_nll([]))


# ---- pooling and bad input -------------------------------------------------------------------------------------------


def test_average_pools_frames_and_leaves_out_what_cannot_be_measured() -> None:
    values, weights = [1.0, math.nan, 4.0], [10, 99, 30]
    assert metrics.average(values) == pytest.approx(2.5)
    assert metrics.average(values, weights) == pytest.approx((10 * 1 + 30 * 4) / 40)
    assert "foot sliding" in why(metrics.average([math.nan], what="foot sliding"))
    assert "any of 0" in why(metrics.average([]))
    with pytest.raises(PlaygroundError, match="weight"):
        metrics.average([1.0], [1.0, 2.0])


@pytest.mark.parametrize(
    "wrong", [np.full((40, 3), np.nan), np.full((40, 3), np.inf), np.zeros(40), np.zeros((4, 5, 3))]
)
def test_bad_embeddings_are_refused(wrong: np.ndarray) -> None:
    good = cloud(40, 3)
    for call in (
        lambda: metrics.fid(good, wrong),
        lambda: metrics.mm_dist(wrong, good),
        lambda: metrics.clip_score(good, wrong),
        lambda: metrics.r_precision(good, wrong, 32, 1, rng()),
        lambda: metrics.diversity(wrong, rng()),
    ):
        with pytest.raises(PlaygroundError, match="finite"):
            call()


def test_embeddings_that_do_not_fit_are_refused() -> None:
    with pytest.raises(PlaygroundError, match="one width"):
        metrics.fid(cloud(5, 3), cloud(5, 4))
    with pytest.raises(PlaygroundError, match="its motion"):
        metrics.mm_dist(cloud(5, 3), cloud(6, 3))
