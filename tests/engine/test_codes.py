"""Neighbours, occurrences and prototypes against plain loops."""

import numpy as np
import pytest

from playground.engine.codes import opposites
from playground.errors import PlaygroundError
from playground.limits import LIMITS
from tests.analysis.tiny import CODES, SCALES, SYSTEM


@pytest.mark.parametrize("scale", [1, 2, 3])
def test_neighbours_are_those_of_a_loop(engine, scale):
    book = engine.codebooks(SYSTEM)[scale - 1].astype(np.float64)
    for code in range(CODES[scale - 1]):
        angle = {
            other: float(book[code] @ book[other] / np.linalg.norm(book[code]) / np.linalg.norm(book[other]))
            for other in range(len(book)) if other != code
        }  # fmt: skip
        found = engine.neighbours(SYSTEM, scale, code, count=3)
        assert found.codes.tolist() == sorted(angle, key=lambda other: -angle[other])[:3]
        np.testing.assert_allclose(found.similarity, [angle[other] for other in found.codes], atol=1e-6)
        assert found.opposite == min(angle, key=lambda other: angle[other])
        assert found.opposite == opposites(engine.codebooks(SYSTEM)[scale - 1], np.array([code]))[0]
    assert len(engine.neighbours(SYSTEM, scale, 0, count=LIMITS.max_listed).codes) == CODES[scale - 1] - 1


def test_a_codebook_of_one_code_has_no_opposite_but_itself():
    assert opposites(np.ones((1, 4), np.float32), np.zeros(3, np.int64)).tolist() == [0, 0, 0]


@pytest.mark.parametrize("scale", [1, 2, 3])
def test_occurrences_are_those_of_a_loop(engine, scale):
    analysis = engine.analysis(SYSTEM)
    size, everywhere = SCALES[scale - 1], 0
    for code in range(CODES[scale - 1]):
        expected = {("example", "sway", p) for p in range(size) if p % CODES[scale - 1] == code}
        for row, clip in enumerate(analysis.clips):
            ids = analysis.levels(row)[scale - 1].ids
            expected |= {("clip", clip.id, p) for p in range(size) if ids[p] == code}
        found = engine.occurrences(SYSTEM, scale, code, count=LIMITS.max_listed)
        assert {(one.kind, one.id, one.position) for one in found} == expected
        assert len(found) == len(expected)
        everywhere += len(found)
        firsts = [one.id for one in found[: len({one.id for one in found})]]
        assert len(firsts) == len(set(firsts))  # every motion once before any twice
        for one in found:
            start, stop = one.frames
            assert 0 <= start < stop <= one.motion_frames
            assert one.seconds[0] == pytest.approx(one.position * one.motion_frames / size / 20, abs=1e-3)
    assert everywhere == (len(analysis) + 1) * size
    assert len(engine.occurrences(SYSTEM, scale, 0, count=1)) <= 1


def test_titles_are_our_own_words(engine):
    captions = {clip.caption for clip in engine.analysis(SYSTEM).clips}
    for code in range(CODES[2]):
        for one in engine.occurrences(SYSTEM, 3, code):
            assert one.title == "A sway" if one.kind == "example" else one.title.rsplit(" (", 1)[0] in captions


def test_a_prototype_is_the_code_alone(engine):
    import torch

    runtime = engine.runtime(SYSTEM)
    quantizer = runtime.tokenizer.quantizer
    embedding = quantizer.share(1, torch.full((1, 3), 7))
    expected = runtime.tokenizer.decode(embedding, torch.tensor([40]), None)[0].numpy()
    made = engine.prototype(SYSTEM, 2, 7, seconds=2.0)
    np.testing.assert_allclose(made.features, expected, atol=1e-5)
    assert made.motion.frames == 40 and made.subset == "only:2"


NOT_THERE = [
    (0, 0), (4, 0), (1, 8), (1, -1), (1.5, 0), ("1", 0), (1, None), (1, 10**30), (float("nan"), 0), ([1], 0),
]  # fmt: skip


@pytest.mark.parametrize("call", ["neighbours", "occurrences", "prototype"])
@pytest.mark.parametrize(("scale", "code"), NOT_THERE, ids=str)
def test_codes_that_are_not_there_are_one_sentence(engine, call, scale, code):
    with pytest.raises(PlaygroundError, match=r"is accepted|whole number"):
        getattr(engine, call)(SYSTEM, scale, code)


def test_other_bad_questions(engine):
    with pytest.raises(PlaygroundError, match="unknown system"):
        engine.neighbours("nothing", 1, 0)
    for count in (0, LIMITS.max_listed + 1, "many"):
        with pytest.raises(PlaygroundError, match="number of neighbours"):
            engine.neighbours(SYSTEM, 1, 0, count=count)
    for seconds in (0.0, 99.0, float("nan")):
        with pytest.raises(PlaygroundError, match="are accepted"):
            engine.prototype(SYSTEM, 1, 0, seconds=seconds)
