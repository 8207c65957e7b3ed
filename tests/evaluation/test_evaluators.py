"""Evaluators: order, independence of the batch, files, and one sentence for whatever is wrong."""

from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from playground.checkpoints import Card, load_tokenizer, save_checkpoint
from playground.errors import PlaygroundError
from playground.evaluation import evaluators
from playground.evaluation.evaluators import load_evaluator, open_evaluator
from playground.motion.representation import to_features67
from playground.text.encoders import identify, load_encoder
from playground.text.features import EncoderId
from tests.evaluation.tiny import moving, tiny_evaluator, tiny_network

KINDS = ["tmr", "clip"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_motion_has_one_embedding_wherever_it_stands(kind):
    evaluator = tiny_evaluator(kind)
    clips = [moving(frames, seed) for seed, frames in enumerate([30, 197, 5, 64, 63, 64] + [40] * 70)]
    together = evaluator.embed_motions(clips)
    assert together.shape == (76, 12) and together.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(together, axis=1), 1.0, atol=1e-5)
    for row in (0, 1, 2, 3, 40, 75):
        np.testing.assert_allclose(evaluator.embed_motions([clips[row]])[0], together[row], atol=2e-5)
    np.testing.assert_allclose(evaluator.embed_motions(clips[::-1])[::-1], together, atol=2e-5)
    apart = np.abs(together[:6, None] - together[None, :6]).max(-1) + np.eye(6)
    assert apart.min() > 1e-3


@pytest.mark.parametrize("kind", KINDS)
def test_a_text_has_one_embedding_wherever_it_stands(kind):
    evaluator = tiny_evaluator(kind)
    texts = ["walks", "a person hops on one leg", "", "walks", "turns around " * 8]
    together = evaluator.embed_texts(texts)
    assert together.shape == (5, 12)
    np.testing.assert_array_equal(together[0], together[3])
    for row, text in enumerate(texts):
        np.testing.assert_allclose(evaluator.embed_texts([text])[0], together[row], atol=2e-5)


def test_rows_and_joints_give_the_same_and_the_end_of_a_long_motion_is_left_out():
    evaluator = tiny_evaluator()
    long = moving(260, 1)
    first = evaluator.embed_motions([long])
    np.testing.assert_allclose(evaluator.embed_rows([to_features67(long)]), first, atol=1e-6)
    np.testing.assert_allclose(evaluator.embed_rows([to_features67(long)[:196]]), first, atol=1e-6)


def test_nothing_in_nothing_out():
    assert tiny_evaluator().embed_motions([]).shape == (0, 12)
    assert tiny_evaluator().embed_texts([]).shape == (0, 12)


@pytest.mark.parametrize(
    ("motion", "sentence"),
    [
        (np.zeros((20, 21, 3)), "shape"),
        (np.zeros((20, 66)), "shape"),
        (np.zeros((20, 22, 3), dtype=complex), "shape"),
        (np.array("left"), "shape"),
        (np.zeros((0, 22, 3)), "too short"),
        (np.zeros((3, 22, 3)), "too short"),
        (np.full((20, 22, 3), np.nan), "not finite"),
        (np.full((20, 22, 3), np.inf), "not finite"),
    ],
)
def test_bad_motions_are_one_sentence(motion, sentence):
    with pytest.raises(PlaygroundError, match=sentence) as caught:
        tiny_evaluator().embed_motions([moving(20, 0), motion])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", [None, 3, b"walks", ["walks"]])
def test_bad_texts_are_one_sentence(text):
    with pytest.raises(PlaygroundError, match="list of strings"):
        tiny_evaluator().embed_texts(["walks", text])


# ---- files --------------------------------------------------------------------------------------------------------


def write(path: Path, kind: str, **changes) -> tuple[Path, torch.nn.Module]:
    encoder = load_encoder("minilm")
    network = tiny_network(kind, text_width=encoder.width)
    card = Card("evaluator", network.config, identify(encoder), "tiny", {"step": 3}, tiny_evaluator().normaliser)
    save_checkpoint(path, network, Card(**{**vars(card), **changes}))
    return path, network


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_gives_the_same_embeddings_back(tmp_path, kind):
    path, network = write(tmp_path / f"{kind}.safetensors", kind)
    evaluator, card = open_evaluator(path, kind)
    assert (evaluator.name, evaluator.width, evaluator.hash, evaluator.facts["step"]) == (kind, 12, card.hash, 3)
    clips, texts = [moving(30, 0), moving(45, 1)], ["a person walks", "someone waves"]
    rounded = tiny_network(kind, text_width=384)
    for parameter, saved in zip(rounded.parameters(), network.parameters(), strict=True):
        parameter.copy_(saved.half().float())
    encode = load_encoder("minilm").encode
    same = evaluators.Evaluator(kind, rounded, tiny_evaluator().normaliser, encode)
    np.testing.assert_allclose(evaluator.embed_motions(clips), same.embed_motions(clips), atol=1e-5)
    np.testing.assert_allclose(evaluator.embed_texts(texts), same.embed_texts(texts), atol=1e-5)


def test_absent_and_unknown_evaluators_are_one_sentence(tmp_path):
    with pytest.raises(PlaygroundError, match="one of tmr, clip is accepted"):
        load_evaluator("guo", tmp_path)
    with pytest.raises(PlaygroundError, match="no checkpoint here"):
        load_evaluator("clip", tmp_path)


def test_a_file_of_another_kind_is_refused(tmp_path):
    path, _ = write(tmp_path / "clip.safetensors", "clip")
    with pytest.raises(PlaygroundError, match="holds a clip evaluator, a tmr one is needed"):
        open_evaluator(path, "tmr")
    with pytest.raises(PlaygroundError, match="is no tokenizer checkpoint but one of kind evaluator"):
        load_tokenizer(path)
    without, _ = write(tmp_path / "bare.safetensors", "tmr", normaliser=None)
    with pytest.raises(PlaygroundError, match="mean and std"):
        open_evaluator(without, "tmr")
    other, _ = write(tmp_path / "other.safetensors", "tmr", encoder=EncoderId("minilm", 384, "0" * 64))
    with pytest.raises(PlaygroundError, match="load the encoder it was trained with"):
        open_evaluator(other, "tmr")


def test_damaged_files_are_one_sentence(tmp_path):
    path, network = write(tmp_path / "tmr.safetensors", "tmr")
    (tmp_path / "cut.safetensors").write_bytes(path.read_bytes()[:5000])
    with pytest.raises(PlaygroundError, match="not a checkpoint"):
        open_evaluator(tmp_path / "cut.safetensors", "tmr")
    odd = type(network.config)(**{**vars(network.config), "kind": "guo"})
    with pytest.raises(PlaygroundError, match="cannot build"):
        open_evaluator(write(tmp_path / "odd.safetensors", "tmr", config=odd)[0], "tmr")
    wide = type(network.config)(**{**vars(network.config), "width": 32})
    with pytest.raises(PlaygroundError, match="do not fit"):
        open_evaluator(write(tmp_path / "wide.safetensors", "tmr", config=wide)[0], "tmr")
    assert all(value.dtype == torch.float16 for name, value in load_file(path).items() if name.startswith("model."))
