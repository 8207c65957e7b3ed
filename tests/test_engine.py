"""The engine on tiny checkpoints written on the spot."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.checkpoints import Card, save_checkpoint
from playground.engine import Engine, check_generation, prepare
from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.measures import mpjpe
from playground.motion.motion import Motion
from playground.motion.representation import Normaliser, from_features67, to_features67
from playground.systems import checkpoint_path, header, row_of
from playground.text.encoders import identify, load_encoder
from playground.tokenizers.token_file import LevelTokens, TokenFile
from tests.conftest import drifting
from tests.tiny import TINY, tiny_generator, tiny_tokenizer

PROMPT = "a person strolls along"


@pytest.fixture(scope="session")
def assets(tmp_path_factory):
    """A folder with a tiny lgtok; its numbers mean nothing, its shapes are real."""
    folder = tmp_path_factory.mktemp("assets")
    encoder = identify(load_encoder("minilm"))
    normaliser = Normaliser(np.zeros(67, np.float32), np.full(67, 0.05, np.float32))
    facts = {"step": 3, "seconds": 1.0, "seed": 0}
    tokenizer = tiny_tokenizer(max_frames=196, text_width=384)
    path = checkpoint_path(folder, "lgtok", "tokenizer")
    save_checkpoint(path, tokenizer, Card("tokenizer", tokenizer.config, encoder, "nothing", facts, normaliser))
    network = tiny_generator(text_width=384, lengths=49).transformer
    path = checkpoint_path(folder, "lgtok", "generator")
    save_checkpoint(path, network, Card("generator", network.config, encoder, "nothing", facts))
    return folder


@pytest.fixture(scope="session")
def engine(assets):
    return Engine(assets)


def test_systems_say_what_their_files_hold(engine, tmp_path):
    info = next(info for info in engine.systems() if info.name == "lgtok")
    head = header(checkpoint_path(engine.assets, "lgtok", "tokenizer"))
    assert (info.checkpoint, info.data, info.facts["step"]) == ("shipped", "nothing", 3)
    assert info.parameters > sum(np.prod(v["shape"]) for k, v in head.items() if k.startswith("model.quantizer"))
    assert engine.scales("lgtok") == list(zip(TINY.scales, TINY.codes, strict=True))
    assert all(info.checkpoint == "absent" and info.parameters == 0 for info in Engine(tmp_path).systems())
    with pytest.raises(PlaygroundError, match="no checkpoint here"):
        Engine(tmp_path).tokenize(Motion(drifting()))


def test_tokenize_then_reconstruct(engine):
    motion = Motion(drifting(60), caption="ignored")
    tokenized = engine.tokenize(motion, PROMPT)
    assert tokenized.motion.frames == 56 and tokenized.caption == PROMPT  # 59 rows, floored to a multiple of 4
    np.testing.assert_allclose(tokenized.embedding, tokenized.per_level.sum(axis=0), atol=1e-4)
    assert tokenized.residual_energy[0] == 1 and len(tokenized.residual_energy) == len(tokenized.levels) + 1
    decoded = engine.reconstruct(tokenized, guidance=1.5)
    assert decoded.motion.joints.shape == (56, 22, 3)
    assert decoded.mpjpe_mm == pytest.approx(mpjpe(motion.joints[:56], decoded.motion.joints), rel=1e-3)
    fewer = engine.reconstruct(tokenized, scales=1)
    assert fewer.scales == 1 and not np.array_equal(fewer.features, decoded.features)


def test_a_token_file_decodes_to_the_same_motion(engine):
    tokenized = engine.tokenize(Motion(drifting(60)), PROMPT)
    file = TokenFile.from_json(tokenized.token_file().to_json())
    np.testing.assert_array_equal(engine.decode(file).features, engine.reconstruct(tokenized).features)
    other = engine.decode(file, caption="somebody sits down").features
    assert not np.array_equal(other, engine.decode(file).features)
    assert not np.array_equal(engine.decode(file, caption="").features, engine.decode(file).features)


def test_guidance_pair_gives_the_decode_at_any_g(engine):
    tokenized = engine.tokenize(Motion(drifting(60)), PROMPT)
    pair = engine.guidance_pair(tokenized)
    for g in (0.0, 2.0, 4.0):
        blend = (1 + g) * pair.conditional - g * pair.unconditional
        decoded = engine.reconstruct(tokenized, guidance=g)
        np.testing.assert_allclose(blend, decoded.features, atol=1e-3)
        np.testing.assert_allclose(from_features67(blend * pair.std + pair.mean), decoded.motion.joints, atol=1e-3)


def test_generation_yields_every_scale_and_is_the_same_for_a_seed(engine):
    steps = list(engine.generate_steps(PROMPT, 3.0, seed=4))
    assert [step.level for step in steps] == [1, 2, 3]
    assert [len(step.levels) for step in steps] == [1, 2, 3] and len(steps[-1].entropy) == 3
    assert steps[-1].motion.frames == 60
    whole = engine.generate(PROMPT, 3.0, seed=4)
    for ours, last in zip(whole.levels, steps[-1].levels, strict=True):
        np.testing.assert_array_equal(ours.ids, last.ids)
    np.testing.assert_array_equal(whole.motion.joints, steps[-1].motion.joints)
    other = engine.generate(PROMPT, 3.0, seed=5)
    assert any(not np.array_equal(a.ids, b.ids) for a, b in zip(whole.levels, other.levels, strict=True))
    again = engine.decode(whole.token_file(), guidance=row_of("lgtok").sampling.guidance)
    np.testing.assert_allclose(again.motion.joints, whole.motion.joints, atol=1e-5)


def test_eight_visitors_at_once_get_what_one_gets(engine):
    alone = engine.generate(PROMPT, 3.0, seed=1)
    tokens = engine.tokenize(Motion(drifting(60)), PROMPT)
    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(lambda seed: engine.generate(PROMPT, 3.0, seed=seed), [1, 2, 1, 3, 1, 4, 1, 5]))
        read = list(pool.map(lambda _: engine.tokenize(Motion(drifting(60)), PROMPT), range(8)))
    for result in made[::2]:
        assert all(np.array_equal(a.ids, b.ids) for a, b in zip(alone.levels, result.levels, strict=True))
    for result in read:
        assert all(np.array_equal(a.ids, b.ids) for a, b in zip(tokens.levels, result.levels, strict=True))
        np.testing.assert_array_equal(result.embedding, tokens.embedding)


def test_free_form_needs_no_prompt_and_an_empty_prompt_is_an_error(engine):
    assert engine.generate(None, 2.0).prompt == ""
    for prompt in ("", "   ", "\x00\n", "x" * 10_000):
        with pytest.raises(PlaygroundError):
            engine.generate(prompt, 2.0)


def test_the_deadline_stops_a_generation(engine):
    with pytest.raises(PlaygroundError, match="took longer than 0 s"):
        engine.generate(PROMPT, 3.0, deadline=0.0)


BAD = [
    {"seconds": 0.0}, {"seconds": 1e9}, {"seconds": float("nan")}, {"seed": -1}, {"seed": 2**40}, {"guidance": -1},
    {"guidance": 99}, {"cfg": float("inf")}, {"temperature": -1}, {"top_k": 0}, {"top_p": 1.5}, {"top_p": float("nan")},
]  # fmt: skip


@pytest.mark.parametrize("wrong", BAD, ids=str)
def test_numbers_out_of_range_are_one_sentence(engine, wrong):
    with pytest.raises(PlaygroundError, match=r"accepted|must be"):
        engine.generate(**({"prompt": PROMPT, "seconds": 2.0} | wrong))


@given(st.floats(LIMITS.min_seconds, LIMITS.max_seconds))
def test_frames_are_the_seconds_floored_to_the_unit(seconds):
    frames = check_generation(seconds, 0, 2.0, 4.0, 1.0, 0.2, 0.95)
    assert frames % 4 == 0 and 0 <= 20 * seconds - frames < 4 + 1e-5


def test_motions_that_do_not_fit_are_one_sentence(engine):
    with pytest.raises(PlaygroundError, match="needs at least"):
        engine.tokenize(Motion(drifting(8)))
    with pytest.raises(PlaygroundError, match="20 frames a second"):
        engine.tokenize(replace(Motion(drifting(60)), fps=30.0))
    assert engine.tokenize(Motion(drifting(400))).motion.frames == LIMITS.max_frames


def test_prepare_gives_rows_of_the_canonical_poses():
    turned = drifting(50)[:, :, [2, 1, 0]] * np.array([1, 1, -1]) + np.array([3, 0.5, -2])
    features, motion = prepare(Motion(turned.astype(np.float32)))
    assert features.shape == (48, 67) and motion.frames == 48
    np.testing.assert_allclose(motion.joints[0, 0, [0, 2]], 0, atol=1e-6)
    np.testing.assert_allclose(from_features67(features), motion.joints, atol=1e-4)
    np.testing.assert_allclose(to_features67(drifting(49)), features, atol=1e-4)


def test_tokens_of_another_shape_are_refused(engine):
    levels = (LevelTokens(2, 8, np.zeros(2, np.int64)),)
    with pytest.raises(PlaygroundError, match="do not fit lgtok"):
        engine.decode(TokenFile("lgtok", "x", "", 40, levels))
    with pytest.raises(PlaygroundError, match="unknown system"):
        engine.decode(TokenFile("nothing", "x", "", 40, levels))


def test_a_broken_checkpoint_is_one_sentence(tmp_path):
    path = checkpoint_path(tmp_path, "lgtok", "tokenizer")
    path.parent.mkdir(parents=True)
    for data in (b"", b"\xff" * 100, b"\x10" + b"\0" * 7 + b"not json at all!"):
        path.write_bytes(data)
        with pytest.raises(PlaygroundError, match="not a checkpoint"):
            Engine(tmp_path).systems()


def test_a_checkpoint_of_another_text_encoder_is_refused(assets, tmp_path):
    tokenizer = tiny_tokenizer(text_width=384)
    other = replace(identify(load_encoder("minilm")), hash="0" * 64)
    normaliser = Normaliser(np.zeros(67, np.float32), np.ones(67, np.float32))
    path = checkpoint_path(tmp_path, "lgtok", "tokenizer")
    save_checkpoint(path, tokenizer, Card("tokenizer", tokenizer.config, other, "x", {}, normaliser))
    with pytest.raises(PlaygroundError, match="text encoder"):
        Engine(tmp_path).tokenize(Motion(drifting(60)))
