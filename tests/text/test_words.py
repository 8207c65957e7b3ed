"""The two plain encoders of the text ablation."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.text.encoders import TextEncoder, check_same, identify, load_encoder
from playground.text.store import FeatureStore
from playground.text.words import WORDS, PooledEncoder, number_of


def test_words_become_the_same_numbers_wherever_they_stand():
    features = load_encoder("words").encode(["Turn left, then LEFT again!", "left", ""])
    assert features.words == [["turn", "left", "then", "left", "again"], ["left"], [""]]
    left = float(number_of("left"))
    assert features.tokens[0, 1] == features.tokens[0, 3] == features.tokens[1, 0] == left
    assert features.mask.sum(dim=1).tolist() == [5, 1, 1] and features.tokens[2, 0] == 0
    assert number_of("left") != number_of("right")


@given(st.text(max_size=400))
def test_any_text_gives_whole_numbers_inside_the_table(text):
    features = load_encoder("words").encode([text])
    numbers = features.tokens[0, :, 0]
    assert torch.equal(numbers, numbers.half().float()) and torch.equal(numbers, numbers.round())
    assert int(numbers.min()) >= 0 and int(numbers.max()) < WORDS
    assert 1 <= len(numbers) <= LIMITS.max_text_positions


def test_pooled_is_the_pooled_vector_as_the_only_token():
    plain, pooled = load_encoder("minilm"), load_encoder("minilm-pooled")
    texts = ["a person hops on one leg", "somebody bows"]
    given_back, expected = pooled.encode(texts), plain.encode(texts)
    assert given_back.tokens.shape == (2, 1, plain.width) and bool(given_back.mask.all())
    torch.testing.assert_close(given_back.tokens[:, 0], expected.pooled)
    assert isinstance(pooled, TextEncoder) and isinstance(pooled, PooledEncoder)
    with pytest.raises(PlaygroundError, match="trained with the text encoder minilm-pooled"):
        check_same(identify(pooled), plain)


@pytest.mark.parametrize("spec", ["words", "minilm-pooled"])
def test_both_survive_a_store(tmp_path, spec):
    encoder = load_encoder(spec)
    texts = ["a person walks", "a person walks and then turns around", ""]
    store = FeatureStore.cached(tmp_path, texts, encoder)
    assert store.encoder == identify(encoder)
    stored, fresh = store.lookup(texts), encoder.encode(texts)
    assert torch.equal(stored.mask, fresh.mask)
    torch.testing.assert_close(stored.tokens, fresh.tokens, atol=2e-3, rtol=2e-3)
    with pytest.raises(PlaygroundError):
        encoder.encode([3])  # type: ignore[list-item]
