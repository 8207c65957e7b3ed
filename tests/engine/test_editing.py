"""Editing: what stays, what is drawn, and the sentences for spans that make no sense."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.engine.editing import KINDS, benchmark_span, edited_frames
from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.motion import Motion
from tests.analysis.tiny import swaying

TEXT = "someone sits down"


@given(st.integers(16, 196), st.sampled_from(KINDS), st.data())
def test_kinds_say_which_frames_are_drawn(frames, kind, data):
    start = data.draw(st.integers(0, frames - 1))
    stop = data.draw(st.integers(start + 1, frames))
    inside = np.array([start <= f < stop for f in range(frames)])
    expected = {
        "inpaint": inside, "inbetween": inside, "outpaint": ~inside,
        "prefix": np.arange(frames) >= start, "suffix": np.arange(frames) < stop,
    }[kind]  # fmt: skip
    if min(expected.sum(), (~expected).sum()) < LIMITS.min_edit_frames:
        with pytest.raises(PlaygroundError, match="are needed"):
            edited_frames(kind, (start, stop), frames)
    else:
        np.testing.assert_array_equal(edited_frames(kind, (start, stop), frames), expected)


def test_benchmark_masks():
    assert edited_frames("inpaint", benchmark_span("inpaint", 100), 100).nonzero()[0].tolist() == list(range(25, 75))
    outer = edited_frames("outpaint", benchmark_span("outpaint", 100), 100)
    assert outer.tolist() == [not 25 <= f < 75 for f in range(100)]
    assert edited_frames("prefix", benchmark_span("prefix", 100), 100).tolist() == [f >= 50 for f in range(100)]
    assert edited_frames("suffix", benchmark_span("suffix", 100), 100).tolist() == [f < 50 for f in range(100)]


@pytest.mark.parametrize("which", ["tokenized", "generation", "motion"])
@pytest.mark.parametrize("kind", KINDS)
def test_kept_frames_are_bit_for_bit_the_sources(engine, request, which, kind):
    source = Motion(swaying(61, 3), caption="a person") if which == "motion" else request.getfixturevalue(which)
    made = engine.edit(source, None, TEXT, seed=3, kind=kind)
    assert made.kept.sum() + (~made.kept).sum() == made.motion.frames and made.kept.any() and (~made.kept).any()
    np.testing.assert_array_equal(made.motion.joints[made.kept], made.source.joints[made.kept])
    assert np.abs(made.motion.joints[~made.kept] - made.source.joints[~made.kept]).max() > 1e-3
    if which != "motion":
        np.testing.assert_array_equal(made.source.joints, source.motion.joints)
    body = engine.edit(source, None, TEXT, seed=3, kind=kind, anchor="body")
    first = int(np.argmin(body.kept))
    np.testing.assert_array_equal(body.motion.joints[:first], body.source.joints[:first])
    for one in (made, body):
        np.testing.assert_allclose(one.motion.joints[one.kept][..., 1], one.source.joints[one.kept][..., 1], atol=1e-5)
    assert "copied back" in made.promise and str(made.blend) in made.promise


@pytest.mark.parametrize("measured", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_tokens_outside_the_mask_hold_their_codes(engine, tokenized, kind, measured):
    made = engine.edit(tokenized, (20, 40), TEXT, seed=1, kind=kind, measured=measured, top_k=0.9)
    frames, changed, redraws = tokenized.motion.frames, 0, 0
    edited = ~made.kept
    finest = [edited[a:b].mean() > 0.5 for a, b in engine.governed(tokenized, 3)] if measured else [True]
    for scale, (mine, source, redrawn) in enumerate(
        zip(made.levels, tokenized.levels, made.redrawn, strict=True), start=1
    ):
        np.testing.assert_array_equal(mine.ids[~redrawn], source.ids[~redrawn])
        changed += int((mine.ids != source.ids).sum())
        if measured:
            spans = engine.governed(tokenized, scale)
            shares = np.array([edited[a:b].mean() if b > a else 0.0 for a, b in spans])
        else:  # equal shares of the time, frame by frame on a fine grid
            fine = edited[np.minimum((np.arange(6000) + 0.5) * frames / 6000, frames - 1).astype(int)]
            shares = fine.reshape(mine.size, -1).mean(axis=1)
        redraws += int(redrawn.sum())
        if kind == "inbetween" or not any(finest):
            np.testing.assert_array_equal(redrawn, shares > 0)
        elif measured or mine.size == 6:
            np.testing.assert_array_equal(redrawn, shares > 0.5)
    assert redraws > 0 and (changed > 0 or redraws < 4)


def test_a_span_too_short_for_a_latent_still_redraws(engine, tokenized):
    made = engine.edit(tokenized, (8, 12), TEXT, seed=1)  # a latent stands for ten frames
    assert [mask.sum() for mask in made.redrawn] == [1, 1, 2]


def test_the_text_acts_on_edited_frames_only(engine, tokenized):
    """Eq. 7: with the same tokens another prompt leaves the plain decode's far frames nearly alone (no guidance)."""
    from playground.probes import decode_edited

    runtime, frames = engine.runtime(tokenized.system), tokenized.motion.frames
    edited = np.zeros(frames, bool)
    edited[20:40] = True
    none = np.zeros(frames, bool)
    first, second = (decode_edited(runtime, tokenized.levels, frames, text, 1.0, none) for text in (TEXT, "run"))
    np.testing.assert_array_equal(first, second)  # nothing edited: no word acts anywhere
    first, second = (decode_edited(runtime, tokenized.levels, frames, text, 0.0, edited) for text in (TEXT, "run"))
    assert np.abs(first - second)[20:40].max() > 1e-4
    everywhere = decode_edited(runtime, tokenized.levels, frames, TEXT, 1.0, ~none)
    plain = engine.decode(tokenized.token_file(), caption=TEXT, guidance=1.0).features
    np.testing.assert_allclose(everywhere, runtime.normaliser.invert(plain), atol=1e-4)


def test_seams_are_measured_at_every_border(engine, tokenized):
    frames = tokenized.motion.frames
    for kind, borders in (("inpaint", [20, 40]), ("outpaint", [20, 40]), ("prefix", [20]), ("suffix", [40])):
        made = engine.edit(tokenized, (20, 40), TEXT, kind=kind)
        assert [seam.frame for seam in made.seams] == borders
        np.testing.assert_array_equal(made.seam_mm, np.array([seam.jolt_mm for seam in made.seams], np.float32))
        for seam in made.seams:
            x = made.source.joints.astype(np.float64)
            second = np.linalg.norm(x[2:] - 2 * x[1:-1] + x[:-2], axis=-1).mean(axis=1) * 1000
            assert seam.source_mm == pytest.approx(second[seam.frame - 2 : seam.frame].max(), rel=1e-4)
        if kind in ("prefix", "suffix", "outpaint"):
            assert made.gap_m == 0
    assert frames > 40


def test_seeds_and_callers_at_once(engine, generation):
    first = engine.edit(generation, (16, 44), TEXT, seed=5, top_k=0.9)
    others = [engine.edit(generation, (16, 44), TEXT, seed=seed, top_k=0.9) for seed in (6, 7)]
    assert any(not np.array_equal(first.levels[2].ids, one.levels[2].ids) for one in others)
    free = engine.edit(generation, (16, 44), None, seed=5)
    assert free.prompt == ""
    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(lambda _: engine.edit(generation, (16, 44), TEXT, seed=5, top_k=0.9), range(8)))
    for one in made:
        np.testing.assert_array_equal(one.motion.joints, first.motion.joints)


SPANS = [
    (30, 20), (-1, 20), (0, 61), (20, 20), (20,), "20-30", (None, None), (1.5, 20), (0, 60), (10, 12), ("a", "b"), 5,
    (float("nan"), 20), (0, 20, 40),
]  # fmt: skip


@pytest.mark.parametrize("span", SPANS, ids=str)
def test_bad_spans_are_one_sentence(engine, tokenized, span):
    with pytest.raises(PlaygroundError) as error:
        engine.edit(tokenized, span, TEXT)
    assert len(str(error.value)) < 200 and "\n" not in str(error.value)


def test_other_bad_edits_are_one_sentence(engine, tokenized):
    for wrong in ({"kind": "erase"}, {"kind": None}, {"anchor": "floor"}, {"seed": -1}, {"cfg": 99.0}, {"pace": 2},
                  {"deadline": 0.0}, {"prompt": ""}, {"prompt": "x" * 1000}):  # fmt: skip
        with pytest.raises(PlaygroundError):
            engine.edit(**({"source": tokenized, "span": (20, 40), "prompt": TEXT} | wrong))
    with pytest.raises(PlaygroundError, match="not at hand"):
        engine.edit(replace(tokenized, features=np.zeros((0, 67), np.float32)), (20, 40), TEXT)
    with pytest.raises(PlaygroundError, match="unknown system"):
        engine.edit(Motion(swaying(61, 3)), (20, 40), TEXT, system="nothing")
