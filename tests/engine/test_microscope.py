"""Swapped tokens and governed spans against separate decodes, one by one."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from playground.errors import PlaygroundError
from playground.motion.differences import governed_span, joint_differences
from playground.results import Generation
from playground.tokenizers.token_file import TokenFile


def changed(result, scale, position, code):
    """The tokens of a result with one code replaced, as a file."""
    levels = list(result.levels)
    ids = levels[scale - 1].ids.copy()
    ids[position] = code
    levels[scale - 1] = replace(levels[scale - 1], ids=ids)
    return TokenFile(result.system, "x", result.caption, result.motion.frames, tuple(levels))


def rows(engine, file, guidance):
    return engine.runtime(file.system).normaliser.invert(engine.decode(file, guidance=guidance).features)


@pytest.mark.parametrize("which", ["tokenized", "generation"])
@pytest.mark.parametrize("guidance", [0.0, 1.5])
def test_a_swap_is_two_separate_decodes(engine, request, which, guidance):
    result = request.getfixturevalue(which)
    code = (int(result.levels[1].ids[2]) + 3) % 10
    swap = engine.swap(result, 2, 2, code, guidance)
    before, after = engine.decode(result.token_file(), guidance=guidance), changed(result, 2, 2, code)
    np.testing.assert_array_equal(swap.original.joints, before.motion.joints)
    np.testing.assert_array_equal(swap.motion.joints, engine.decode(after, guidance=guidance).motion.joints)
    expected = joint_differences(rows(engine, result.token_file(), guidance), rows(engine, after, guidance))
    np.testing.assert_array_equal(swap.difference, expected)
    assert swap.difference.shape == (result.motion.frames, 22) and swap.difference.max() > 1e-3
    apart = (swap.motion.joints - swap.original.joints)[:, 0]
    np.testing.assert_allclose(swap.drift, np.hypot(apart[:, 0], apart[:, 2]), atol=1e-6)
    assert swap.span == governed_span(expected)
    assert (swap.before, swap.code) == (result.levels[1].ids[2], code)


def test_a_swap_leaves_what_it_was_given_and_can_be_undone(engine, tokenized):
    ids = [level.ids.copy() for level in tokenized.levels]
    code = (int(ids[2][4]) + 1) % 12
    swap = engine.swap(tokenized, 3, 4, code)
    assert all(np.array_equal(a, level.ids) for a, level in zip(ids, tokenized.levels, strict=True))
    assert [int((a != b.ids).sum()) for a, b in zip(ids, swap.levels, strict=True)] == [0, 0, 1]
    again = swap.tokenized
    np.testing.assert_allclose(again.embedding, again.per_level.sum(axis=0), atol=1e-5)
    np.testing.assert_array_equal(again.residual_energy[:3], tokenized.residual_energy[:3])
    assert again.residual_energy[3] != tokenized.residual_energy[3]
    np.testing.assert_array_equal(engine.reconstruct(again).motion.joints, swap.motion.joints)
    back = engine.swap(again, 3, 4, swap.before)
    np.testing.assert_array_equal(back.motion.joints, swap.original.joints)
    np.testing.assert_allclose(back.tokenized.residual_energy, tokenized.residual_energy, atol=1e-6)
    same = engine.swap(tokenized, 3, 4, swap.before)
    assert same.span == (0, 0) and not same.difference.any()


def test_a_swapped_generation_stays_one(engine, generation):
    swap = engine.swap(generation, 1, 0, "nearest", guidance=1.0)
    assert isinstance(swap.tokenized, Generation) and swap.tokenized.prompt == generation.prompt
    found = engine.neighbours(generation.system, 1, swap.before)
    assert swap.code == found.codes[0] and engine.swap(generation, 1, 0, "opposite").code == found.opposite
    np.testing.assert_array_equal(swap.tokenized.motion.joints, swap.motion.joints)


@pytest.mark.parametrize("which", ["tokenized", "generation"])
@pytest.mark.parametrize("scale", [1, 2, 3])
def test_governed_spans_are_those_found_one_by_one(engine, request, which, scale):
    result = request.getfixturevalue(which)
    base = rows(engine, result.token_file(), 0.0)
    spans = engine.governed(result, scale)
    assert spans.dtype == np.int64 and spans.shape == (result.levels[scale - 1].size, 2)
    for position, found in enumerate(spans.tolist()):
        code = engine.neighbours(result.system, scale, int(result.levels[scale - 1].ids[position])).opposite
        difference = joint_differences(base, rows(engine, changed(result, scale, position, code), 0.0))
        slow = governed_span(difference)
        held = (difference.astype(np.float64) ** 2).sum(axis=1)
        assert tuple(found) == slow or held[found[0] : found[1]].sum() == pytest.approx(0.8 * held.sum(), rel=1e-3)
        assert abs((found[1] - found[0]) - (slow[1] - slow[0])) <= 1


def test_eight_at_once_get_what_one_gets(engine, tokenized):
    swap, spans = engine.swap(tokenized, 2, 1, "opposite", 1.0), engine.governed(tokenized, 3)
    with ThreadPoolExecutor(8) as pool:
        swaps = list(pool.map(lambda _: engine.swap(tokenized, 2, 1, "opposite", 1.0), range(8)))
        measured = list(pool.map(lambda _: engine.governed(tokenized, 3), range(8)))
    for one, two in zip(swaps, measured, strict=True):
        np.testing.assert_array_equal(one.difference, swap.difference)
        np.testing.assert_array_equal(one.motion.joints, swap.motion.joints)
        np.testing.assert_array_equal(two, spans)


WRONG = [
    (0, 0, 1), (4, 0, 1), (2, 3, 1), (2, -1, 1), (2, 0, 10), (2, 0, -1), (2, 0, "first"), ("two", 0, 1), (2, None, 1),
    (2, 0, None), (2, 0.5, 1), (2, 0, 1.5), (2, 0, float("nan")), (10**40, 0, 0),
]  # fmt: skip


@pytest.mark.parametrize("wrong", WRONG, ids=str)
def test_bad_places_and_codes_are_one_sentence(engine, tokenized, wrong):
    with pytest.raises(PlaygroundError, match=r"is accepted|whole number") as error:
        engine.swap(tokenized, *wrong)
    assert "\n" not in str(error.value)


def test_deadline_and_guidance(engine, tokenized):
    with pytest.raises(PlaygroundError, match="took longer"):
        engine.governed(tokenized, 2, deadline=0.0)
    for guidance in (-1.0, 99.0, float("nan")):
        with pytest.raises(PlaygroundError, match="accepted"):
            engine.governed(tokenized, 2, guidance)
        with pytest.raises(PlaygroundError, match="accepted"):
            engine.swap(tokenized, 2, 0, 1, guidance)
