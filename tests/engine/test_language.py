"""What language does: flips against separate tokenizations, attention against a slow softmax."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from playground.engine import Engine
from playground.engine.language import compare_captions
from playground.errors import PlaygroundError
from playground.motion.measures import mpjpe
from playground.motion.motion import Motion
from tests.analysis.tiny import swaying
from tests.tiny import tiny_tokenizer

WRONG = "someone sits down"


def test_flips_are_those_of_separate_tokenizations(engine, tokenized):
    motion = Motion(swaying(61, 3))
    found = engine.language(tokenized, WRONG)
    for text, levels, flips, error, decoded in (
        ("", found.bare, found.bare_flips, found.mpjpe_mm[1], found.motions[1]),
        (WRONG, found.misled, found.misled_flips, found.mpjpe_mm[2], found.motions[2]),
    ):
        separate = engine.tokenize(motion, text)
        again = engine.reconstruct(separate)
        for own, other, ours, flip in zip(tokenized.levels, separate.levels, levels, flips, strict=True):
            np.testing.assert_array_equal(ours.ids, other.ids)
            np.testing.assert_array_equal(flip, own.ids != other.ids)
        np.testing.assert_array_equal(decoded.joints, again.motion.joints)
        assert error == pytest.approx(again.mpjpe_mm)
    assert found.mpjpe_mm[0] == pytest.approx(mpjpe(tokenized.motion.joints, found.motions[0].joints))
    flat = [bool(x) for level in found.misled_flips for x in level]
    assert found.misled_share == pytest.approx(sum(flat) / len(flat))


def test_tokens_flip_where_the_words_move_the_latent(engine, tokenized):
    """With a codebook that holds the latent of either caption, the caption decides the token."""
    runtime = engine.runtime(tokenized.system)
    model = tiny_tokenizer(max_frames=196, text_width=384)
    x = torch.from_numpy(runtime.normaliser.apply(tokenized.features))[None]
    lengths = torch.tensor([len(tokenized.features)])
    for row, text in enumerate((tokenized.caption, "", WRONG)):
        latent = model.latents(x, lengths, runtime.text(text))
        model.quantizer.codebooks[0].vectors[row] = latent.mean(dim=1)[0]
    other = replace(runtime, codec=model)
    levels, _ = other.encode(tokenized.features, tokenized.caption)
    found = compare_captions(other, replace(tokenized, levels=levels), WRONG, None)
    assert [int(one[0].ids[0]) for one in (found.captioned, found.bare, found.misled)] == [0, 1, 2]
    assert found.bare_flips[0].tolist() == found.misled_flips[0].tolist() == [True]
    assert 0 < found.bare_share <= 1 and 0 < found.misled_share <= 1


def test_language_needs_a_caption_another_one_and_the_motion(engine, tokenized):
    with pytest.raises(PlaygroundError, match="without a caption"):
        engine.language(engine.tokenize(Motion(swaying(61, 3))), WRONG)
    with pytest.raises(PlaygroundError, match="is the right one"):
        engine.language(tokenized, f"  {tokenized.caption} ")
    with pytest.raises(PlaygroundError, match="empty"):
        engine.language(tokenized, " ")
    with pytest.raises(PlaygroundError, match="not at hand"):
        engine.language(replace(tokenized, features=np.zeros((0, 67), np.float32)), WRONG)
    with pytest.raises(PlaygroundError, match="took longer"):
        engine.language(tokenized, WRONG, deadline=0.0)


@pytest.mark.parametrize("which", ["tokenized", "generation"])
def test_attention_rows_sum_to_one(engine, request, which):
    result = request.getfixturevalue(which)
    found = engine.attention(result)
    assert found.weights.shape == (result.motion.frames, len(found.words))
    assert found.by_layer.shape == (3, 2, *found.weights.shape) and found.patch == 1
    np.testing.assert_allclose(found.by_layer.sum(axis=-1), 1.0, atol=1e-5)
    np.testing.assert_allclose(found.weights, found.by_layer.mean(axis=(0, 1)), atol=1e-7)
    assert found.by_layer.min() >= 0 and np.ptp(found.by_layer, axis=-1).max() > 0.01
    assert {"person", "along"} <= set(found.words)
    other = engine.attention(result, "a dog runs")
    assert "dog" in other.words and len(other.words) == other.weights.shape[1]
    with pytest.raises(PlaygroundError, match="no words"):
        engine.attention(result, "")


def test_attention_of_the_first_layer_is_the_slow_softmax(engine, tokenized):
    """Recomputed from the weights of the first block, one frame and one head at a time."""
    runtime = engine.runtime(tokenized.system)
    model, text = runtime.tokenizer, runtime.text(tokenized.caption)
    seen = []
    block = model.decoder.blocks[0]
    cross = block.cross_attentions[1]
    handle = cross.register_forward_pre_hook(lambda module, inputs: seen.append(inputs[0]))
    try:
        engine.reconstruct(tokenized)
    finally:
        handle.remove()
    query = cross.query(seen[0])[0].double()
    key = cross.key_value(model.text_proj(text.tokens))[0, :, :16].double()
    found = engine.attention(tokenized).by_layer[0]
    for head in range(2):
        part = slice(8 * head, 8 * head + 8)
        for frame in (0, 7, 55):
            score = torch.stack([(query[frame, part] * word[part]).sum() / 8**0.5 for word in key])
            np.testing.assert_allclose(found[head, frame], score.exp() / score.exp().sum(), atol=1e-5)


def test_a_detokenizer_that_reads_text_in_context_has_no_heat_map(tmp_path):
    from playground.checkpoints import Card, save_checkpoint
    from playground.motion.representation import Normaliser
    from playground.systems import checkpoint_path
    from playground.text.encoders import identify, load_encoder

    model = tiny_tokenizer(max_frames=196, text_width=384, text_mixing_out="in-context")
    normaliser = Normaliser(np.zeros(67, np.float32), np.ones(67, np.float32))
    card = Card("tokenizer", model.config, identify(load_encoder("minilm")), "nothing", {}, normaliser)
    save_checkpoint(checkpoint_path(tmp_path, "lgtok", "tokenizer"), model, card)
    other = Engine(tmp_path)
    with pytest.raises(PlaygroundError, match="no cross-attention"):
        other.attention(other.tokenize(Motion(swaying(61, 3)), "a person walks"))
