"""Which words each moment looked at: the map of the very draw, recomputed by hand; a sentence where there is none."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.motion.representation import Normaliser
from playground.nn.positions import sinusoid
from playground.systems import SYSTEMS
from tests.tiny_systems import tiny_system

PROMPT = "a person steps over a log"
FRAMES = 24
LOOKING = ("mdm-casim-decoder", "t2mgpt-casim", "lgtok")
BLIND = ("mdm", "mdm-casim", "momask", "lgtok-notext")
HEADS = 2  # of the tiny systems


@pytest.fixture(scope="module")
def tiny(tmp_path_factory) -> Engine:
    folder = tmp_path_factory.mktemp("alignment")
    normaliser = Normaliser(np.zeros(67, np.float32), np.full(67, 0.05, np.float32))
    for name in (*LOOKING, *BLIND):
        tiny_system(folder, name, normaliser)
    return Engine(folder)


def drawn(engine: Engine, name: str, seed: int = 5):
    return engine.generate(PROMPT, FRAMES / 20, name, seed=seed, top_k=1.0, temperature=2.0)


@pytest.mark.parametrize("name", LOOKING)
def test_rows_are_shares_and_a_seed_gives_one_map(tiny, name):
    made, other = drawn(tiny, name), drawn(tiny, name, 6)
    found, again = tiny.alignment(made), tiny.alignment(drawn(tiny, name))
    assert found.weights.shape == (FRAMES, len(found.words)) and found.weights.dtype == np.float32
    assert {"person", "log", "[CLS]"} <= set(found.words) and found.system == name
    np.testing.assert_allclose(found.by_step.sum(axis=-1), 1.0, atol=1e-5)
    np.testing.assert_allclose(found.weights, found.by_step.mean(axis=0), atol=1e-6)
    np.testing.assert_array_equal(found.weights, again.weights)
    assert not np.array_equal(found.weights, tiny.alignment(other).weights)
    for start in range(0, FRAMES, found.patch):
        rows = found.weights[start : start + found.patch]
        assert (rows == rows[0]).all()


def test_the_denoisers_map_is_the_one_that_the_motion_was_drawn_with(tiny):
    """What the last cross-attention got while the motion was drawn, turned into weights head by head."""
    name = "mdm-casim-decoder"
    runtime = tiny.runtime(name)
    network = runtime.diffusion.network
    cross = network.blocks[-1].cross_attentions[0]
    seen = []
    handle = cross.register_forward_pre_hook(lambda module, inputs: seen.append(inputs))
    try:
        made = drawn(tiny, name)
    finally:
        handle.remove()
    found, visits, patch = tiny.alignment(made), runtime.diffusion.visits(), network.config.patch
    assert found.by_step.shape == (len(visits), FRAMES, len(found.words)) and found.patch == patch
    assert len(seen) == len(visits) > 1 and "denoiser" in found.what
    text, width = runtime.prompt(PROMPT), network.config.width
    for step, visit in enumerate(visits):
        states = network.text_proj(text.tokens[0]) + network.time(sinusoid(torch.tensor([visit - 1]), width))
        query = cross.query(seen[step][0][0]).double()  # of the text's branch, not of the null text's
        key = cross.key_value(states)[: len(found.words), :width].double()
        for frame in (0, 9, FRAMES - 1):
            rows = []
            for head in range(HEADS):
                part = slice(head * width // HEADS, (head + 1) * width // HEADS)
                mass = [float(query[frame // patch, part] @ word[part]) / (width / HEADS) ** 0.5 for word in key]
                rows.append(np.exp(mass) / np.exp(mass).sum())
            np.testing.assert_allclose(found.by_step[step, frame], np.mean(rows, axis=0), atol=1e-5)


def test_tokens_of_gpt_look_at_words_from_where_they_are_drawn(tiny):
    made = drawn(tiny, "t2mgpt-casim")
    found, runtime = tiny.alignment(made), tiny.runtime("t2mgpt-casim")
    net, text = runtime.generator.network, runtime.prompt(PROMPT)
    record: list[torch.Tensor] = []
    net(net.prefix(text, 1), torch.from_numpy(made.levels[0].ids)[None], record)
    positions, count = text.mask.shape[1], len(found.words)
    for token in range(made.levels[0].size):
        row = record[0][0, :, positions + token, :count].double().mean(dim=0)
        for frame in range(4 * token, 4 * token + 4):
            np.testing.assert_allclose(found.weights[frame], row / row.sum(), atol=1e-5)
    assert found.patch == 4 and "generator" in found.what


def test_where_the_generator_sees_no_words_the_detokenizer_tells(tiny):
    made = drawn(tiny, "lgtok")
    found, seen = tiny.alignment(made), tiny.attention(made)
    np.testing.assert_allclose(found.weights, seen.weights, atol=1e-6)
    assert found.words == seen.words and "detokenizer" in found.what


@pytest.mark.parametrize("name", LOOKING + BLIND)
def test_the_headers_know_who_can_tell(tiny, name):
    assert tiny.looks_at_words(name) == (name in LOOKING)
    assert not Engine(tiny.assets / "nowhere").looks_at_words(name)
    if name in BLIND:
        with pytest.raises(PlaygroundError, match=r"no attention to single words|no cross-attention to text"):
            tiny.alignment(drawn(tiny, name))


def test_what_cannot_be_told_is_said_in_a_sentence(tiny):
    name = "mdm-casim-decoder"
    with pytest.raises(PlaygroundError, match="drawn without words"):
        tiny.alignment(tiny.generate(None, 1.2, name))
    with pytest.raises(PlaygroundError, match="took longer"):
        tiny.alignment(drawn(tiny, name), deadline=0.0)
    absent = replace(drawn(tiny, name), system="momaskpp")
    assert "momaskpp" in SYSTEMS
    with pytest.raises(PlaygroundError, match="no checkpoint"):
        tiny.alignment(absent)
