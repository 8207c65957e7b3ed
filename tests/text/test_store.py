"""Features on disk: what is read back equals what the encoder says, for every batch."""

import json
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from playground.errors import PlaygroundError
from playground.text.encoders import TextFeatures, load_encoder
from playground.text.features import EncoderId
from playground.text.store import FeatureStore

TEXTS = ["a person walks", "somebody bows deeply and stands up again", "run", "", "wave 🕺", "run"]


@pytest.mark.parametrize(("dtype", "tolerance"), [("float32", 1e-5), ("float16", 4e-3)])
def test_lookup_equals_the_encoder(tmp_path: Path, dtype: str, tolerance: float) -> None:
    encoder = load_encoder("minilm")
    store = FeatureStore.build(tmp_path / "store.safetensors", TEXTS, encoder, dtype=dtype)
    assert len(store) == 5 and store.width == 384
    for batch in (["run"], ["run", "a person walks", "run"], TEXTS[::-1]):
        found, direct = store.lookup(batch), encoder.encode(batch)
        assert found.tokens.dtype == torch.float32
        assert torch.equal(found.mask, direct.mask) and found.words == direct.words
        assert not found.tokens[~found.mask].any()
        assert (found.tokens - direct.tokens).abs().max() < tolerance
        assert (found.pooled - direct.pooled).abs().max() < 1e-5
    assert store.lookup([]).tokens.shape == (0, 0, 384)


def test_a_text_that_was_not_stored_is_named(tmp_path: Path) -> None:
    store = FeatureStore.build(tmp_path / "s", ["walk"], load_encoder("minilm"))
    with pytest.raises(PlaygroundError, match='lacks "hop"'):
        store.lookup(["walk", "hop"])


def test_cached_builds_once_and_grows_when_a_text_is_new(tmp_path: Path) -> None:
    encoder = load_encoder("minilm")
    calls: list[tuple[int, int]] = []

    def count(done: int, total: int) -> None:
        calls.append((done, total))

    FeatureStore.cached(tmp_path, TEXTS, encoder, progress=count)
    FeatureStore.cached(tmp_path, TEXTS[:2], encoder, progress=count)
    assert calls == [(5, 5)]
    grown = FeatureStore.cached(tmp_path, ["hop", "run"], encoder, progress=count)
    assert calls == [(5, 5), (6, 6)] and "hop" in grown and "wave 🕺" in grown
    assert [path.name for path in tmp_path.iterdir()] == [f"text-minilm-{encoder.hash[:12]}.safetensors"]


def test_a_store_of_another_encoder_is_refused(tmp_path: Path) -> None:
    class Other:
        name, width, hash = "minilm", 384, "0" * 64

        def encode(self, texts: list[str]) -> TextFeatures:
            """Same features, another identity."""
            return load_encoder("minilm").encode(texts)

    FeatureStore.build(tmp_path / "s", ["walk"], Other())  # type: ignore[arg-type]
    assert FeatureStore.open(tmp_path / "s").encoder == EncoderId("minilm", 384, "0" * 64)
    with pytest.raises(PlaygroundError, match="trained with the text encoder"):
        FeatureStore.open(tmp_path / "s", load_encoder("minilm"))


class Constant:
    """States that hold one value everywhere, padding included, as CLIP's do."""

    name, width, hash = "constant", 3, "1" * 64

    def __init__(self, value: float) -> None:
        self.value = value

    def encode(self, texts: list[str]) -> TextFeatures:
        """[B, 4, 3], of which two positions count."""
        tokens = torch.full((len(texts), 4, 3), self.value)
        mask = torch.tensor([True, True, False, False]).expand(len(texts), 4)
        return TextFeatures(tokens, mask, tokens[:, 0], [["a", "b"]] * len(texts))


def test_states_behind_the_mask_survive_where_the_encoder_has_them(tmp_path: Path) -> None:
    store = FeatureStore.build(tmp_path / "s", ["x", "y"], Constant(0.5))  # type: ignore[arg-type]
    found = store.lookup(["y", "x", "y"])
    assert torch.equal(found.tokens, torch.full((3, 4, 3), 0.5))
    assert found.mask.tolist() == [[True, True, False, False]] * 3


def test_states_too_large_for_float16_are_an_error_not_infinity(tmp_path: Path) -> None:
    with pytest.raises(PlaygroundError, match="float32"):
        FeatureStore.build(tmp_path / "s", ["x"], Constant(1e6))  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())
    store = FeatureStore.build(tmp_path / "s", ["x"], Constant(1e6), dtype="float32")  # type: ignore[arg-type]
    assert float(store.lookup(["x"]).tokens.max()) == 1e6


@pytest.mark.parametrize("kind", ["missing", "binary", "truncated", "strange", "format"])
def test_files_that_are_no_store_are_one_sentence(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "s"
    if kind == "binary":
        path.write_bytes(bytes(range(256)) * 10)
    elif kind == "truncated":
        FeatureStore.build(path, ["walk"], load_encoder("minilm"))
        path.write_bytes(path.read_bytes()[:-50])
    elif kind == "strange":
        save_file({"weights": torch.zeros(3)}, path)
    elif kind == "format":
        arrays = {name: torch.zeros(1) for name in ("states", "offsets", "mask", "pooled")}
        save_file(arrays, path, metadata={"format": "99", "texts": json.dumps([])})
    with pytest.raises(PlaygroundError, match="not a store of text features"):
        FeatureStore.open(path)
