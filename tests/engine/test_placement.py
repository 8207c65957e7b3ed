"""Placing into stored maps: affinities, cost and minimum against slow formulas; stored points land where they were."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.manifold import TSNE

from playground.analysis.bundle import write_bundle
from playground.analysis.coordinates import CLIP_COLUMNS, TOKEN_COLUMNS, coordinates_csv
from playground.engine import Engine
from playground.engine.placement import _gradient, affinities, costs, place
from playground.errors import PlaygroundError
from tests.analysis.tiny import SCALES, SYSTEM
from tests.engine.conftest import PROMPT


def groups(n: int = 90, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Three groups of vectors [n, 8] and their t-SNE map."""
    rng = np.random.default_rng(seed)
    vectors = rng.normal(size=(3, 8))[np.arange(n) % 3] * 4 + rng.normal(size=(n, 8)) * 0.6
    return vectors, TSNE(perplexity=12.0, random_state=0, init="pca").fit_transform(vectors).astype(np.float64)


@given(st.integers(0, 1000), st.integers(2, 40), st.floats(1.0, 60.0))
def test_affinities_have_the_perplexity(seed, count, perplexity):
    squared = np.random.default_rng(seed).uniform(0.0, 10.0, (3, count)) * 10.0 ** (seed % 5 - 2)
    chance = affinities(squared, perplexity)
    np.testing.assert_allclose(chance.sum(axis=1), 1.0)
    found = np.exp(-(chance * np.log(np.maximum(chance, 1e-300))).sum(axis=1))
    np.testing.assert_allclose(found, min(perplexity, count), rtol=1e-2)
    assert all((np.diff(row[np.argsort(one)]) <= 1e-12).all() for row, one in zip(chance, squared, strict=True))


def test_equal_vectors_share_alike():
    np.testing.assert_allclose(affinities(np.zeros((1, 5)), 3.0), 0.2)


def slow_cost(points, near, weights, at):
    """KL(P || Q) with its constant: q normalised over all points, p over the near ones."""
    student = np.array([1 / (1 + ((at - point) ** 2).sum()) for point in points])
    total = sum(w * (np.log(w) - np.log(student[k] / student.sum())) for k, w in zip(near, weights, strict=True))
    return float(total)


def test_the_cost_is_the_divergence_and_its_gradient_is_its_slope():
    rng = np.random.default_rng(3)
    points, near = rng.normal(size=(20, 2)) * 5, np.arange(6)
    weights = rng.dirichlet(np.ones(6))[None]
    constant = float((weights * np.log(weights)).sum())
    for at in rng.normal(size=(5, 2)) * 4:
        ours = costs(points, points[near][None], weights, at[None])[0] + constant
        assert ours == pytest.approx(slow_cost(points, near, weights[0], at))
        step = 1e-6 * np.eye(2)
        slope = [(slow_cost(points, near, weights[0], at + d) - slow_cost(points, near, weights[0], at - d)) / 2e-6
                 for d in step]  # fmt: skip
        np.testing.assert_allclose(_gradient(points, points[near][None], weights, at[None])[0], slope, atol=1e-5)


def test_places_are_no_worse_than_a_grid_search():
    vectors, points = groups()
    new = vectors[:6] + 0.3
    placed = place(vectors, points, new, 12.0)
    squared = ((new[:, None] - vectors) ** 2).sum(axis=-1)
    near = np.argsort(squared, axis=1)[:, :36]
    weights = affinities(np.take_along_axis(squared, near, axis=1), 12.0)
    low, high = points.min(axis=0) - 2, points.max(axis=0) + 2
    grid = np.stack(np.meshgrid(*(np.linspace(a, b, 60) for a, b in zip(low, high, strict=True))), -1).reshape(-1, 2)
    for row in range(6):
        many = np.full(len(grid), row)
        best = costs(points, points[near[many]], weights[many], grid).min()
        assert (
            costs(points, points[near[row : row + 1]], weights[row : row + 1], placed[row : row + 1])[0] <= best + 1e-3
        )


def test_stored_points_land_near_their_own_place_and_in_their_group():
    vectors, points = groups()
    placed = place(vectors, points, vectors, 12.0)
    apart = np.linalg.norm(placed - points, axis=1)
    assert np.median(apart) < 0.1 * points.std() and apart.max() < points.std()
    left_out = place(vectors[3:], points[3:], vectors[:3], 12.0)  # never seen: the group is found all the same
    for row in range(3):
        centres = np.stack([points[3:][(np.arange(3, 90) % 3) == group].mean(axis=0) for group in range(3)])
        assert np.linalg.norm(centres - left_out[row], axis=1).argmin() == row
    np.testing.assert_allclose(place(vectors, points, vectors[5:6], 12.0)[0], placed[5], atol=1e-4)


def test_a_clip_is_placed_where_its_own_tokens_say(engine, generation):
    analysis = engine.analysis(SYSTEM)
    for row in range(len(analysis)):
        stored = replace(generation, levels=analysis.levels(row), system=SYSTEM)
        placed = engine.place(stored)
        np.testing.assert_allclose(placed.pca, analysis.pca[row], atol=1e-4)
        assert placed.nearest[0] == analysis.clips[row].id and placed.each == "clip"
    found = engine.place(generation)
    vector = (
        engine.runtime(SYSTEM).embedding(generation.levels, generation.motion.frames)[0].double().mean(dim=0).numpy()
    )
    np.testing.assert_allclose(found.pca, (vector - analysis.pca_centre) @ analysis.pca_axes.T, atol=1e-5)
    assert np.isfinite(found.tsne).all() and len(found.nearest) == min(8, len(analysis))


def test_tokens_of_a_stored_clip_are_placed_at_their_stored_axes(engine, generation):
    analysis = engine.analysis(SYSTEM)
    starts = np.concatenate([[0], np.cumsum(analysis.sizes)])
    for row in range(len(analysis)):
        placed = engine.place(replace(generation, levels=analysis.levels(row)), each="token")
        assert placed.tsne.shape == placed.pca.shape == (sum(SCALES), 2) and np.isfinite(placed.tsne).all()
        for n, (clip, scale, position) in enumerate(analysis.token_index.tolist()):
            if clip == row:
                ours = placed.pca[starts[scale - 1] + position]
                np.testing.assert_allclose(ours, analysis.token_pca[n], rtol=2e-3, atol=2e-3)


def test_maps_as_a_table(engine, generation, tokenized):
    analysis = engine.analysis(SYSTEM)
    placed = [("mine", engine.place(generation)), ("a, b", engine.place(tokenized))]
    lines = coordinates_csv(analysis, placed=placed).splitlines()
    assert lines[0] == ",".join(CLIP_COLUMNS) and len(lines) == 1 + len(analysis) + 2
    first = dict(zip(CLIP_COLUMNS, lines[1].split(","), strict=True))
    assert first["id"] == analysis.clips[0].id and float(first["pca_y"]) == pytest.approx(analysis.pca[0, 1], abs=1e-5)
    assert lines[-1].startswith('"a, b",placed,,,,')
    tokens = [("mine", engine.place(generation, each="token"))]
    lines = coordinates_csv(analysis, "token", tokens).splitlines()
    assert lines[0] == ",".join(TOKEN_COLUMNS) and len(lines) == 1 + len(analysis.token_index) + sum(SCALES)
    row, scale, position = analysis.token_index[0]
    stored = dict(zip(TOKEN_COLUMNS, lines[1].split(","), strict=True))
    assert int(stored["code"]) == analysis.levels(int(row))[scale - 1].ids[position]
    with pytest.raises(PlaygroundError, match="another map"):
        coordinates_csv(analysis, "token", placed)
    with pytest.raises(PlaygroundError, match="clip or token"):
        coordinates_csv(analysis, "frame")


def test_maps_that_do_not_fit_are_one_sentence(engine, generation, tmp_path):
    with pytest.raises(PlaygroundError, match="clip or token"):
        engine.place(generation, each="frame")
    with pytest.raises(PlaygroundError, match="unknown system"):
        engine.place(generation, "nothing")
    bare = Engine(tmp_path)
    with pytest.raises(PlaygroundError, match="no stored analysis"):
        bare.analysis(SYSTEM)
    (tmp_path / "checkpoints").symlink_to(engine.assets / "checkpoints")
    write_bundle(tmp_path / "analysis", replace(engine.analysis(SYSTEM), checkpoint="0" * 12))
    for each in ("clip", "token"):
        with pytest.raises(PlaygroundError, match="another checkpoint"):
            bare.place(generation, each=each)
    assert bare.occurrences(SYSTEM, 1, 0) == []  # tokens of another checkpoint mean nothing here
    assert bare.generate(PROMPT, 2.0).system == SYSTEM
