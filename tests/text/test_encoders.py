"""The cache around an encoder, the identity of encoders, and the names that load_encoder knows."""

import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import torch

from playground.errors import PlaygroundError
from playground.text.encoders import (
    CachedEncoder,
    EncoderId,
    TextEncoder,
    TextFeatures,
    check_same,
    identify,
    load_encoder,
)


class LetterEncoder:
    """A fake: one state a letter, its code point and its place; counts its calls."""

    name, width, hash = "letters", 2, "ab" * 32

    def __init__(self) -> None:
        self.calls: list[list[str]] = []
        self.lock = threading.Lock()

    def encode(self, texts: Sequence[str]) -> TextFeatures:
        """[B, W, 2]."""
        with self.lock:
            self.calls.append(list(texts))
        longest = max(map(len, texts), default=0)
        tokens, mask = torch.zeros(len(texts), longest, 2), torch.zeros(len(texts), longest, dtype=torch.bool)
        for row, text in enumerate(texts):
            for column, letter in enumerate(text):
                tokens[row, column] = torch.tensor([float(ord(letter)), float(column)])
                mask[row, column] = True
        return TextFeatures(tokens, mask, tokens.sum(dim=1), [list(text) for text in texts])


def same(left: TextFeatures, right: TextFeatures) -> bool:
    """Bit-identical features."""
    return (
        torch.equal(left.tokens, right.tokens)
        and torch.equal(left.mask, right.mask)
        and torch.equal(left.pooled, right.pooled)
        and left.words == right.words
    )


def test_a_cache_is_an_encoder() -> None:
    cached = CachedEncoder(LetterEncoder())
    assert isinstance(cached, TextEncoder)
    assert identify(cached) == EncoderId("letters", 2, "ab" * 32)


def test_hit_equals_miss_and_runs_nothing() -> None:
    inner = LetterEncoder()
    cached = CachedEncoder(inner)
    miss = cached.encode(["walk", "sit", "walk"])
    runs = len(inner.calls)
    assert same(cached.encode(["walk", "sit", "walk"]), miss)
    assert len(inner.calls) == runs == 2
    assert same(miss, LetterEncoder().encode(["walk", "sit", "walk"]))


def test_hit_equals_miss_with_the_default_encoder_in_any_company() -> None:
    cached = CachedEncoder(load_encoder("minilm"))
    alone = cached.encode(["a person kicks"])
    mixed = CachedEncoder(load_encoder("minilm")).encode(["a person bows very slowly to the left", "a person kicks"])
    width = alone.tokens.shape[1]
    assert torch.equal(mixed.tokens[1, :width], alone.tokens[0])
    assert not mixed.mask[1, width:].any()


def test_the_least_recently_used_text_is_forgotten() -> None:
    cached = CachedEncoder(LetterEncoder(), capacity=2)
    cached.encode(["a"])
    cached.encode(["b"])
    cached.encode(["a"])
    cached.encode(["c"])
    assert len(cached) == 2 and "a" in cached and "c" in cached and "b" not in cached


def test_writing_to_an_answer_leaves_the_cache_alone() -> None:
    cached = CachedEncoder(LetterEncoder())
    first = cached.encode(["walk"])
    first.tokens.zero_()
    first.pooled.zero_()
    first.words[0].clear()
    assert same(cached.encode(["walk"]), LetterEncoder().encode(["walk"]))


def test_eight_threads_share_a_small_cache() -> None:
    cached = CachedEncoder(LetterEncoder(), capacity=3)
    texts = ["walk", "sit", "run", "jump", "bow", "kick"]

    def ask(turn: int) -> bool:
        chosen = [texts[(turn * step) % len(texts)] for step in (1, 2, 5)]
        return same(cached.encode(chosen), LetterEncoder().encode(chosen))

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(ask, range(200)))
    assert len(cached) == 3


def test_two_caches_do_not_share_texts() -> None:
    one, other = CachedEncoder(LetterEncoder()), CachedEncoder(LetterEncoder())
    one.encode(["walk"])
    assert "walk" in one and "walk" not in other


def test_nothing_and_nonsense() -> None:
    cached = CachedEncoder(LetterEncoder())
    assert cached.encode([]).tokens.shape == (0, 0, 2)
    with pytest.raises(PlaygroundError, match="strings"):
        cached.encode([3])  # type: ignore[list-item]
    with pytest.raises(ValueError, match="capacity"):
        CachedEncoder(LetterEncoder(), capacity=0)


@pytest.mark.parametrize(
    "recorded",
    [EncoderId("clip", 2, "ab" * 32), EncoderId("letters", 3, "ab" * 32), EncoderId("letters", 2, "cd" * 32)],
    ids=["name", "width", "hash"],
)
def test_a_checkpoint_refuses_another_encoder(recorded: EncoderId) -> None:
    check_same(identify(LetterEncoder()), LetterEncoder())
    with pytest.raises(PlaygroundError, match=f"{recorded.name} .*letters"):
        check_same(recorded, LetterEncoder())


@pytest.mark.parametrize("spec", ["", "MiniLM", "bert", "gpt:/somewhere", "minilm:/x", "CLIP", "y" * 5000])
def test_unknown_encoders_are_one_sentence(spec: str) -> None:
    with pytest.raises(PlaygroundError, match="unknown text encoder") as caught:
        load_encoder(spec)
    assert len(str(caught.value)) < 300 and "\n" not in str(caught.value)


@pytest.mark.parametrize("family", ["clip", "llama", "t5"])
def test_a_family_alone_stands_for_the_folder_that_the_environment_names(
    family: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    variable = f"PLAYGROUND_{family.upper()}"
    monkeypatch.delenv(variable, raising=False)
    with pytest.raises(PlaygroundError, match=variable):
        load_encoder(family)
    monkeypatch.setenv(variable, str(tmp_path / "nowhere"))
    with pytest.raises(PlaygroundError, match=f"no folder .*nowhere for the {family}"):
        load_encoder(family)


def test_a_checkpoint_whose_weights_are_not_known_takes_any_of_its_width() -> None:
    check_same(EncoderId("letters", 2, ""), LetterEncoder())
    with pytest.raises(PlaygroundError, match="weights unknown"):
        check_same(EncoderId("letters", 3, ""), LetterEncoder())
