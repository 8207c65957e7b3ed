"""CLIP, LLaMA and T5 from a folder: tiny random models, saved on the spot, against transformers' own forward pass."""

import hashlib
import json
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import torch
from safetensors.torch import load_file, save_file
from tokenizers import Tokenizer, models, pre_tokenizers, processors

from playground.errors import PlaygroundError
from playground.text.encoders import CachedEncoder, TextEncoder, load_encoder
from playground.text.pretrained import load_pretrained

transformers = pytest.importorskip("transformers")

TEXTS = ["a man walks", "jump", "a man walks to the left and sits down and jumps", "zebra"]
WORDS = ["a", "man", "walks", "jump", "to", "the", "left", "and", "sits", "down", "jumps"]


def word_tokenizer(template: str, specials: list[str], eos: str, bos: str | None) -> Any:
    """A tokenizer of whole words; specials take the first ids."""
    vocabulary = {word: index for index, word in enumerate([*specials, "<unk>", *WORDS])}
    tokenizer = Tokenizer(models.WordLevel(vocabulary, unk_token="<unk>"))
    tokenizer.pre_tokenizer = pre_tokenizers.Whitespace()
    tokenizer.post_processor = processors.TemplateProcessing(
        single=template, special_tokens=[(special, vocabulary[special]) for special in specials]
    )
    return transformers.PreTrainedTokenizerFast(
        tokenizer_object=tokenizer, eos_token=eos, bos_token=bos, unk_token="<unk>", model_max_length=1000
    )


def clip_tokenizer() -> Any:
    """CLIP's own tokenizer class on single bytes."""
    letters = sorted(pre_tokenizers.ByteLevel.alphabet())
    pieces = [*letters, *(letter + "</w>" for letter in letters), "<|startoftext|>", "<|endoftext|>"]
    return transformers.CLIPTokenizer(vocab={piece: index for index, piece in enumerate(pieces)}, merges=[])


def clip_config() -> Any:
    """A small text tower whose end token is the tokenizer's."""
    return transformers.CLIPTextConfig(
        vocab_size=514, hidden_size=32, intermediate_size=48, projection_dim=24, num_hidden_layers=2,
        num_attention_heads=4, max_position_embeddings=77, bos_token_id=512, eos_token_id=513, pad_token_id=1,
    )  # fmt: skip


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One saved model a family, and a CLIP tower without its projection."""
    root = tmp_path_factory.mktemp("models")
    llama = transformers.LlamaModel(
        transformers.LlamaConfig(
            vocab_size=20, hidden_size=40, intermediate_size=48, num_hidden_layers=2, num_attention_heads=4,
            num_key_value_heads=2, max_position_embeddings=200, bos_token_id=0, eos_token_id=1,
        )
    )  # fmt: skip
    t5 = transformers.T5EncoderModel(
        transformers.T5Config(
            vocab_size=20, d_model=48, d_kv=12, d_ff=64, num_layers=2, num_heads=4, feed_forward_proj="gated-gelu",
            pad_token_id=0, eos_token_id=1,
        )
    )  # fmt: skip
    saved = {
        "llama": (llama, word_tokenizer("<bos> $A", ["<bos>", "<eos>"], "<eos>", "<bos>")),
        "t5": (t5, word_tokenizer("$A </s>", ["<pad>", "</s>"], "</s>", None)),
        "clip": (transformers.CLIPTextModelWithProjection(clip_config()), clip_tokenizer()),
        "clip-bare": (transformers.CLIPTextModel(clip_config()), clip_tokenizer()),
    }
    for name, (model, tokenizer) in saved.items():
        model.save_pretrained(root / name)
        tokenizer.save_pretrained(root / name)
    return {name: root / name for name in saved}


def encoder_of(folders: dict[str, Path], family: str) -> TextEncoder:
    """The encoder of a family through the public door."""
    return load_encoder(f"{family}:{folders[family]}")


@pytest.mark.parametrize("family", ["llama", "t5"])
def test_states_equal_transformers_alone_and_in_a_batch(folders: dict[str, Path], family: str) -> None:
    encoder = encoder_of(folders, family)
    kind = {"llama": transformers.LlamaModel, "t5": transformers.T5EncoderModel}[family]
    model = kind.from_pretrained(folders[family]).eval()
    tokenizer = transformers.AutoTokenizer.from_pretrained(folders[family])
    features = encoder.encode(TEXTS)
    assert features.width == encoder.width == {"llama": 40, "t5": 48}[family]
    for row, text in enumerate(TEXTS):
        ids = tokenizer(text, return_tensors="pt").input_ids
        with torch.no_grad():
            states = model(input_ids=ids).last_hidden_state[0]
        count = ids.shape[1]
        assert features.mask[row].tolist() == [column < count for column in range(features.mask.shape[1])]
        assert (features.tokens[row, :count] - states).abs().max() < 1e-5
        assert not features.tokens[row, count:].any()
        assert (features.pooled[row] - states.mean(dim=0)).abs().max() < 1e-5
        assert features.words[row] == tokenizer.convert_ids_to_tokens(ids[0])


def test_llama_keeps_bos_and_t5_keeps_its_end_token(folders: dict[str, Path]) -> None:
    assert encoder_of(folders, "llama").encode(["a man"]).words == [["<bos>", "a", "man"]]
    assert encoder_of(folders, "t5").encode(["a man"]).words == [["a", "man", "</s>"]]


@pytest.mark.parametrize("family", ["clip", "clip-bare"])
def test_clip_gives_all_77_states_before_the_projection(folders: dict[str, Path], family: str) -> None:
    encoder = load_pretrained("clip", str(folders[family]))
    model = transformers.CLIPTextModel.from_pretrained(folders[family]).eval()
    features = encoder.encode(TEXTS)
    assert features.tokens.shape == (4, 77, 32)
    for row, text in enumerate(TEXTS):
        letters = [letter for word in text.split() for letter in (*word[:-1], word[-1] + "</w>")]
        assert features.words[row] == ["<|startoftext|>", *letters, "<|endoftext|>"]
        vocabulary = clip_tokenizer().get_vocab()
        ids = [vocabulary[word] for word in features.words[row]]
        valid = len(ids)
        assert features.mask[row].tolist() == [True] * valid + [False] * (77 - valid)
        with torch.no_grad():
            states = model(input_ids=torch.tensor([ids + [0] * (77 - valid)])).last_hidden_state[0]
        assert (features.tokens[row] - states).abs().max() < 1e-5
        expected = states[valid - 1]
        if family == "clip":
            whole = transformers.CLIPTextModelWithProjection.from_pretrained(folders[family])
            expected = whole.text_projection.weight.detach() @ expected
        assert (features.pooled[row] - expected).abs().max() < 1e-5


def test_a_whole_clip_model_works_as_well_as_its_text_tower(folders: dict[str, Path], tmp_path: Path) -> None:
    tower = transformers.CLIPTextModelWithProjection.from_pretrained(folders["clip"])
    vision = transformers.CLIPVisionConfig(
        hidden_size=32, intermediate_size=32, num_hidden_layers=1, num_attention_heads=4, image_size=32, patch_size=16
    )
    parts = {"text_config": clip_config().to_dict(), "vision_config": vision.to_dict()}
    whole = transformers.CLIPModel(transformers.CLIPConfig(**parts, projection_dim=24))
    whole.text_model.load_state_dict(tower.text_model.state_dict())
    whole.text_projection.load_state_dict(tower.text_projection.state_dict())
    whole.save_pretrained(tmp_path)
    clip_tokenizer().save_pretrained(tmp_path)
    one, other = load_pretrained("clip", str(tmp_path)), encoder_of(folders, "clip")
    assert torch.equal(one.encode(TEXTS).tokens, other.encode(TEXTS).tokens)
    assert torch.equal(one.encode(TEXTS).pooled, other.encode(TEXTS).pooled)
    assert one.hash != other.hash


@pytest.mark.parametrize("family", ["clip", "llama", "t5"])
def test_long_empty_and_nasty_texts(folders: dict[str, Path], family: str) -> None:
    encoder = encoder_of(folders, family)
    features = encoder.encode(["walks " * 500, "", "🕺\x00", "\ud800"])
    assert features.tokens.shape[1] == 77 and len(features.words[0]) == 77
    assert torch.isfinite(features.tokens).all() and torch.isfinite(features.pooled).all()
    assert encoder.encode([]).tokens.shape[0] == 0 and len(encoder.encode([]).words) == 0
    if family == "clip":
        assert features.words[0][-1] == "<|endoftext|>" and bool(features.mask[0].all())
        assert features.words[1] == ["<|startoftext|>", "<|endoftext|>"]


@pytest.mark.parametrize("family", ["clip", "llama", "t5"])
def test_eight_threads_get_the_same_bits(folders: dict[str, Path], family: str) -> None:
    encoder = encoder_of(folders, family)
    expected = encoder.encode(TEXTS)
    with ThreadPoolExecutor(8) as pool:
        for features in pool.map(lambda _: encoder.encode(TEXTS), range(16)):
            assert torch.equal(features.tokens, expected.tokens) and features.words == expected.words


def test_cache_and_hash(folders: dict[str, Path]) -> None:
    encoder = encoder_of(folders, "t5")
    weights = (folders["t5"] / "model.safetensors").read_bytes()
    assert encoder.hash == hashlib.sha256(weights).hexdigest()
    cached = CachedEncoder(encoder)
    assert torch.equal(cached.encode(["a man"]).tokens, cached.encode(["a man"]).tokens)


def test_weights_in_parts_have_one_hash_that_sees_every_part(folders: dict[str, Path], tmp_path: Path) -> None:
    model = transformers.LlamaModel.from_pretrained(folders["llama"])
    model.save_pretrained(tmp_path, max_shard_size="20KB")
    transformers.AutoTokenizer.from_pretrained(folders["llama"]).save_pretrained(tmp_path)
    parts = sorted(tmp_path.glob("model-*.safetensors"))
    assert len(parts) > 1
    encoder = load_pretrained("llama", str(tmp_path))
    assert torch.equal(encoder.encode(TEXTS).tokens, encoder_of(folders, "llama").encode(TEXTS).tokens)
    before = encoder.hash
    model.norm.weight.data += 1
    model.save_pretrained(tmp_path, max_shard_size="20KB")
    assert load_pretrained("llama", str(tmp_path)).hash != before


def damage(folder: Path, kind: str) -> None:
    """Make one thing wrong with a saved model."""
    if kind == "weights":
        (folder / "model.safetensors").unlink()
    elif kind == "pickle":
        (folder / "model.safetensors").rename(folder / "pytorch_model.bin")
    elif kind == "binary":
        (folder / "model.safetensors").write_bytes(b"\x00" * 100)
    elif kind == "config":
        (folder / "config.json").write_text("[1, 2")
    elif kind == "list":
        (folder / "config.json").write_text("[]")
    elif kind == "family":
        config = json.loads((folder / "config.json").read_text())
        (folder / "config.json").write_text(json.dumps({**config, "model_type": "bert"}))
    elif kind == "arrays":
        arrays = load_file(folder / "model.safetensors")
        kept = {name: array for name, array in arrays.items() if "layers.1" not in name}
        save_file(kept, folder / "model.safetensors")
    elif kind == "tokenizer":
        (folder / "tokenizer.json").write_text("{}")


@pytest.mark.parametrize(
    ("kind", "sentence"),
    [
        ("weights", "no .*safetensors weights"),
        ("pickle", "no .*safetensors weights"),
        ("binary", "could not be read"),
        ("config", "no readable config.json"),
        ("list", "no readable config.json"),
        ("family", 'type "bert"'),
        ("arrays", "lack .* arrays"),
        ("tokenizer", "could not be read"),
    ],
)
def test_broken_folders_are_one_sentence(folders: dict[str, Path], tmp_path: Path, kind: str, sentence: str) -> None:
    shutil.copytree(folders["llama"], tmp_path / "model")
    damage(tmp_path / "model", kind)
    with pytest.raises(PlaygroundError, match=sentence) as caught:
        load_encoder(f"llama:{tmp_path / 'model'}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("family", ["clip", "llama", "t5"])
def test_a_missing_folder_says_what_is_expected(family: str) -> None:
    with pytest.raises(PlaygroundError, match=f"no folder .*{family} text encoder; expected are config.json"):
        load_encoder(f"{family}:/no/such/folder")
    with pytest.raises(PlaygroundError):
        load_encoder(f"{family}:")
