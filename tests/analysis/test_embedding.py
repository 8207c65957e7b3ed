"""Maps: PCA against an eigen-decomposition, t-SNE for its seed and for inputs it cannot place."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from playground.analysis.embedding import EmbeddingMap, agreement_by_label, motion_means, neighbour_agreement
from playground.errors import PlaygroundError


def groups(count: int, each: int = 15, width: int = 6, seed: int = 0) -> tuple[np.ndarray, list[str]]:
    rng = np.random.default_rng(seed)
    centres = rng.normal(size=(count, width)) * 10
    rows = np.concatenate([centre + rng.normal(size=(each, width)) * 0.1 for centre in centres])
    return rows, [f"group {n}" for n in range(count) for _ in range(each)]


@given(st.integers(3, 20), st.integers(2, 6), st.integers(0, 2**16))
def test_pca_against_the_covariance(n: int, width: int, seed: int) -> None:
    rows = np.random.default_rng(seed).normal(size=(n, width))
    result = EmbeddingMap().fit(rows, "pca")
    values, vectors = np.linalg.eigh(np.cov(rows.T))
    expected = (rows - rows.mean(axis=0)) @ vectors[:, ::-1][:, :2]
    np.testing.assert_allclose(np.abs(result.points_), np.abs(expected), atol=1e-8)
    np.testing.assert_allclose(result.explained_, values[::-1][:2] / values.sum(), atol=1e-9)


def test_tsne_keeps_groups_together_and_repeats() -> None:
    rows, names = groups(4)
    first = EmbeddingMap().fit(rows, "tsne", seed=3)
    np.testing.assert_array_equal(first.points_, EmbeddingMap().fit(rows, "tsne", seed=3).points_)
    agreement, chance = neighbour_agreement(first.points_, names, k=5)
    assert agreement == 1.0 and chance < 0.3
    assert first.perplexity_ == pytest.approx((len(rows) - 1) / 3)
    assert EmbeddingMap(perplexity=5).fit(rows).perplexity_ == 5


@settings(max_examples=12, deadline=None)
@given(
    st.integers(1, 6), st.integers(1, 4), st.sampled_from(["tsne", "pca"]), st.sampled_from([0.0, 1e-12, 1.0, 1e200])
)
def test_few_vectors_of_any_size_get_finite_points(n: int, width: int, method: str, size: float) -> None:
    rows = np.random.default_rng(n).normal(size=(n, width)) * size
    result = EmbeddingMap().fit(rows, method)
    assert result.points_.shape == (n, 2) and np.isfinite(result.points_).all()


@pytest.mark.parametrize("method", ["tsne", "pca"])
def test_equal_vectors_go_to_the_origin(method: str) -> None:
    assert not EmbeddingMap().fit(np.full((7, 3), 0.1), method).points_.any()


@pytest.mark.parametrize("rows", [np.zeros((0, 4)), np.zeros(4), [[1.0, np.nan]], [[np.inf, 0.0]]])
def test_what_has_no_place_is_refused(rows: np.ndarray) -> None:
    with pytest.raises(PlaygroundError):
        EmbeddingMap().fit(rows)


def test_unknown_method_is_refused() -> None:
    with pytest.raises(PlaygroundError, match="tsne, pca"):
        EmbeddingMap().fit(np.ones((3, 2)), "umap")


def test_means_are_over_latents() -> None:
    embeddings = [np.arange(6).reshape(3, 2), np.ones((5, 2))]
    np.testing.assert_array_equal(motion_means(embeddings), [[2.0, 3.0], [1.0, 1.0]])
    assert motion_means([]).size == 0


@given(st.integers(2, 14), st.integers(1, 16), st.integers(0, 2**16))
def test_agreement_against_sorting_all_distances(n: int, k: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, names = rng.normal(size=(n, 3)), [str(value) for value in rng.integers(0, 3, n)]
    shares, pairs = [], []
    for i in range(n):
        others = sorted((j for j in range(n) if j != i), key=lambda j: float(np.linalg.norm(rows[i] - rows[j])))
        near = others[:k]
        shares.append(sum(names[j] == names[i] for j in near) / len(near))
        pairs.append(sum(names[j] == names[i] for j in others) / len(others))
    agreement, chance = neighbour_agreement(rows, names, k)
    assert agreement == pytest.approx(np.mean(shares))
    assert chance == pytest.approx(np.mean(pairs))
    groups = agreement_by_label(rows, names, k)
    assert [group.count for group in groups] == sorted((group.count for group in groups), reverse=True)
    for group in groups:
        own = [i for i, name in enumerate(names) if name == group.label]
        assert group.count == len(own)
        assert group.agreement == pytest.approx(np.mean([shares[i] for i in own]))
        assert group.chance == pytest.approx(np.mean([pairs[i] for i in own]))


def test_agreement_of_a_single_vector_is_unknown() -> None:
    assert np.isnan(neighbour_agreement(np.ones((1, 3)), ["walk"])).all()


def test_a_missing_label_is_refused() -> None:
    with pytest.raises(PlaygroundError):
        neighbour_agreement(np.ones((2, 3)), ["walk"])
