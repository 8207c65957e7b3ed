"""Released files -> checkpoints: the same weights under our names, one sentence for every file that is no release."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from playground import cli, runtime
from playground.checkpoints import TRAINING_ONLY, load_generator, load_tokenizer
from playground.convert import convert_lgtok
from playground.engine import Engine, prepare
from playground.errors import PlaygroundError
from playground.generators.scalewise import GeneratorConfig, build_generator, running_sums
from playground.motion.motion import Motion
from playground.text.features import TextFeatures
from playground.tokenizers.transformer import TokenizerConfig, build_tokenizer
from tests.conftest import drifting
from tests.released import (
    GENERATOR,
    GENERATOR_LAYOUT,
    TOKENIZER,
    TOKENIZER_LAYOUT,
    State,
    official_generator,
    official_tokenizer,
    options_text,
    refused,
    release,
    write_release,
)
from tests.tiny import text_features


def layout(state: State) -> tuple[int, str]:
    lines = sorted(f"{name} {list(value.shape)}" for name, value in state.items())
    return len(lines), hashlib.sha256("\n".join(lines).encode()).hexdigest()


def test_the_published_sizes_have_the_names_and_shapes_of_the_public_code() -> None:
    tokenizer, generator = build_tokenizer(TokenizerConfig()), build_generator(GeneratorConfig())
    assert layout(official_tokenizer(tokenizer)) == TOKENIZER_LAYOUT
    assert layout(official_generator(generator)) == GENERATOR_LAYOUT


@pytest.mark.parametrize("masked_motion", [True, False])
def test_weights_come_through_exactly(tmp_path: Path, masked_motion: bool) -> None:
    states = official_tokenizer(TOKENIZER, masked_motion), official_generator(GENERATOR.transformer)
    done = convert_lgtok(*write_release(tmp_path, *states), tmp_path / "out")
    assert [path.name for path in done.files] == ["tokenizer.safetensors", "generator.safetensors"]
    tokenizer, card = load_tokenizer(done.files[0])
    network, generator_card = load_generator(done.files[1])
    assert tokenizer.config == replace(TOKENIZER.config, heading="humanml3d", dropout=0.1)
    assert network.config == replace(GENERATOR.transformer.config, dropout=network.config.dropout)
    for ours, original in ((tokenizer, TOKENIZER), (network, GENERATOR.transformer)):
        for name, value in original.state_dict().items():
            if name.rsplit(".", 1)[-1] not in TRAINING_ONLY:
                assert torch.equal(value, ours.state_dict()[name]), name
    assert card.data == "HumanML3D" and (card.encoder.name, card.encoder.width, card.encoder.hash) == ("llama", 20, "")
    assert generator_card.encoder.name == "clip" and generator_card.facts["tokenizer"] == card.hash[:12]


def test_tokens_motions_and_logits_are_the_same(tmp_path: Path) -> None:
    done = convert_lgtok(*release(tmp_path), tmp_path / "out")
    tokenizer, network = load_tokenizer(done.files[0])[0], load_generator(done.files[1])[0]
    features, lengths, text = torch.randn(2, 40, 67), torch.tensor([40, 28]), text_features()
    theirs, ours = TOKENIZER.encode(features, lengths, text), tokenizer.encode(features, lengths, text)
    assert theirs.tokens == ours.tokens
    decoded = [model.decode(theirs.embedding, lengths, text, 2.0) for model in (TOKENIZER, tokenizer)]
    torch.testing.assert_close(*decoded, atol=1e-4, rtol=0)
    for words in (text, None):
        rows = [
            net(running_sums(TOKENIZER.quantizer, theirs.tokens), net.remember(words, lengths))
            for net in (GENERATOR.transformer, network)
        ]
        for a, b in zip(*rows, strict=True):
            torch.testing.assert_close(a, b, atol=1e-5, rtol=1e-5)


def test_options_choose_the_look_up_and_the_place_of_the_norms(tmp_path: Path) -> None:
    paths = release(tmp_path)
    paths[2].write_text(options_text(using_znorm="False", norm_first="True", dataset_name="motionx", scales="1_3_6"))
    done = convert_lgtok(*paths, tmp_path / "out")
    config = load_tokenizer(done.files[0])[0].config
    assert (config.metric, config.pre_norm, config.scales) == ("euclidean", True, (1, 3, 6))
    assert any("30 frames" in note for note in done.notes) and any("Mean.npy" in note for note in done.notes)


def test_statistics_come_from_the_folder_of_the_data(tmp_path: Path) -> None:
    paths, data = release(tmp_path / "in"), tmp_path / "data"
    data.mkdir()
    mean, std = np.linspace(-1, 1, 263), np.linspace(0.1, 2, 263)
    np.save(data / "Mean.npy", mean)
    assert "Std.npy" in refused(paths, tmp_path / "out", statistics=data)
    np.save(data / "Std.npy", std)
    done = convert_lgtok(*paths, tmp_path / "out", statistics=data)
    normaliser = load_tokenizer(done.files[0])[1].normaliser
    assert normaliser is not None and not done.notes
    np.testing.assert_allclose(normaliser.mean, mean[:67], rtol=1e-6)
    np.testing.assert_allclose(normaliser.std, std[:67], rtol=1e-6)
    np.save(paths[0].parent / "Mean.npy", mean[:67].astype(np.float32) + 1)
    np.save(paths[0].parent / "Std.npy", std[:67].astype(np.float32))
    beside = load_tokenizer(convert_lgtok(*paths, tmp_path / "beside").files[0])[1].normaliser
    assert beside is not None and beside.mean[0] == pytest.approx(0.0)


@pytest.mark.parametrize(
    "std", [np.zeros(67), np.full(67, np.nan), np.ones(66), np.ones((67, 2)), np.array(["a"] * 67)]
)
def test_statistics_that_are_none_are_refused(std: np.ndarray, tmp_path: Path) -> None:
    paths = release(tmp_path / "in")
    np.save(tmp_path / "Mean.npy", np.zeros(67))
    np.save(tmp_path / "Std.npy", std)
    assert "Std.npy" in refused(paths, tmp_path / "out", statistics=tmp_path)


def test_text_encoders_are_folders_of_the_users(tmp_path: Path) -> None:
    paths, folder = release(tmp_path / "in"), tmp_path / "llama"
    assert "no folder" in refused(paths, tmp_path / "out", llama=str(folder))
    folder.mkdir()
    (folder / "config.json").write_text('{"model_type": "llama", "hidden_size": 21}')
    (folder / "model.safetensors").write_bytes(b"weights")
    assert "width 21" in refused(paths, tmp_path / "out", llama=str(folder))
    (folder / "config.json").write_text('{"model_type": "llama", "hidden_size": 20}')
    card = load_tokenizer(convert_lgtok(*paths, tmp_path / "out", llama=str(folder)).files[0])[1]
    assert card.encoder.hash == hashlib.sha256(b"weights").hexdigest()


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tokenizer, generator, options = (str(path) for path in release(tmp_path / "in"))
    words = ["convert", "lgtok", "--tokenizer", tokenizer, "--generator", generator, "--options", options]
    assert cli.main([*words, "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "tokenizer.safetensors" in said and "--statistics" in said
    for wrong in (
        ["convert", "gpt", *words[2:], "--out", str(tmp_path / "x")],
        [*words, "--out", tokenizer],
        [*words, "--out", str(tmp_path / "x"), "--clip", str(tmp_path)],
        [*words[:-2], "--out", str(tmp_path / "x")],
    ):
        assert cli.main(wrong) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
    assert not (tmp_path / "x").exists()


class Letters:
    """A text encoder of width 20 that tells families apart."""

    width, hash = 20, "ab"

    def __init__(self, name: str) -> None:
        self.name = name
        self.seen: list[str] = []

    def encode(self, texts: list[str]) -> TextFeatures:
        self.seen += texts
        return text_features((3,) * len(texts), seed=len(self.name))


def test_the_engine_runs_it_with_two_encoders_and_its_own_heading(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    paths = release(tmp_path / "in")
    np.save(tmp_path / "in" / "Mean.npy", np.zeros(67))
    np.save(tmp_path / "in" / "Std.npy", np.ones(67))
    convert_lgtok(*paths, tmp_path / "assets" / "checkpoints" / "lgtok-humanml3d")
    engine, motion = Engine(tmp_path / "assets"), Motion(drifting(41))
    for variable in ("PLAYGROUND_LLAMA", "PLAYGROUND_CLIP"):
        monkeypatch.delenv(variable, raising=False)
    with pytest.raises(PlaygroundError, match="PLAYGROUND_LLAMA"):
        engine.tokenize(motion, "a person strolls", "lgtok-humanml3d")
    with pytest.raises(PlaygroundError, match="convert command"):
        engine.tokenize(motion, "a person strolls", "lgtok-motionx")
    encoders = {name: Letters(name) for name in ("llama", "clip")}
    monkeypatch.setattr(runtime, "load_encoder", lambda spec: encoders[spec])
    tokenized = engine.tokenize(motion, "a person strolls", "lgtok-humanml3d")
    features, _ = prepare(motion, "humanml3d")
    expected = TOKENIZER.encode(
        torch.from_numpy(features)[None], torch.tensor([len(features)]), encoders["llama"].encode(["a"])
    )
    assert [list(level.ids) for level in tokenized.levels] == [ids[0].tolist() for ids in expected.tokens.ids]
    engine.generate("a person waves", 2.0, "lgtok-humanml3d", seed=3)
    assert encoders["clip"].seen == ["a person waves"] and "a person waves" in encoders["llama"].seen
