"""Subsets of scales: what they mean, and that a study is nothing but separate decodes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.errors import PlaygroundError
from playground.findings import ScaleSet


@given(st.integers(1, 12), st.data())
def test_sets_name_the_scales_they_keep(count, data):
    scale = data.draw(st.integers(1, count))
    everything = set(range(count))
    assert set(ScaleSet.of(scale, count).levels(count)) == {n for n in everything if n < scale}
    assert set(ScaleSet.of(f"only:{scale}", count).levels(count)) == {scale - 1}
    assert set(ScaleSet.of(f"without:{scale}", count).levels(count)) == everything - {scale - 1}
    assert ScaleSet.of(None, count).levels(count) == tuple(range(count))
    again = ScaleSet.of(str(ScaleSet.of(f"only:{scale}", count)), count)
    assert again == ScaleSet("only", scale) == ScaleSet.of(again, count)


WRONG = [
    0, 4, -1, 1.5, "only", "only:0", "only:4", "only:x", "x:1", "", "upto:²", "only:1:2", "only:" + "9" * 5000,
    ScaleSet("only", 9), ScaleSet("some", 1), [1],
]  # fmt: skip


@pytest.mark.parametrize("wrong", WRONG, ids=lambda value: str(value)[:20])
def test_other_scales_are_one_sentence(engine, tokenized, wrong):
    with pytest.raises(PlaygroundError, match="are accepted") as error:
        engine.reconstruct(tokenized, scales=wrong)
    assert len(str(error.value)) < 300


@pytest.mark.parametrize("kind", ["upto", "only", "without"])
def test_a_study_is_one_decode_a_set(engine, tokenized, kind):
    study = engine.scale_study(tokenized, guidance=1.0, kind=kind)
    assert [str(one) for one in study.sets] == [f"{kind}:{n}" for n in (1, 2, 3)]
    for one, motion, error in zip(study.sets, study.motions, study.mpjpe_mm, strict=True):
        single = engine.reconstruct(tokenized, guidance=1.0, scales=one)
        np.testing.assert_allclose(motion.joints, single.motion.joints, atol=1e-4)
        assert error == pytest.approx(single.mpjpe_mm, rel=1e-3) and single.subset == str(one)
    np.testing.assert_array_equal(study.energy, tokenized.residual_energy)
    with pytest.raises(PlaygroundError, match="took longer"):
        engine.scale_study(tokenized, kind=kind, deadline=0.0)


def test_one_scale_and_the_rest_add_up(engine, tokenized):
    """Decoding is not linear, but the embedding is: only n plus without n is everything."""
    from playground.probes import subset

    runtime = engine.runtime(tokenized.system)
    for n in range(3):
        rest = [m for m in range(3) if m != n]
        both = subset(runtime, tokenized.levels, tokenized.motion.frames, [n]) + subset(
            runtime, tokenized.levels, tokenized.motion.frames, rest
        )
        np.testing.assert_allclose(both[0].numpy(), tokenized.embedding, atol=1e-4)
        np.testing.assert_allclose(
            subset(runtime, tokenized.levels, tokenized.motion.frames, [n])[0].numpy(),
            tokenized.per_level[n],
            atol=1e-5,
        )
    assert not subset(runtime, tokenized.levels, tokenized.motion.frames, []).any()
