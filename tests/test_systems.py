"""The table of systems: rows of the family, rows without files, a system without a generator."""

import numpy as np
import pytest

from playground.checkpoints import Card, save_checkpoint
from playground.engine import Engine
from playground.errors import PlaygroundError
from playground.motion.motion import Motion
from playground.motion.representation import Normaliser
from playground.systems import SYSTEMS, checkpoint_path, describe, row_of
from playground.text.encoders import identify, load_encoder
from playground.training.family import FAMILY
from tests.conftest import drifting
from tests.tiny import TINY, tiny_tokenizer

FAMILY_NAMES = ("lgtok", "lgtok-lite", "lgtok-mid", "lgtok-mini", "lgtok-notext", "lgtok-nodrop", "lgtok-rvq")


def test_every_row_of_the_family_can_be_trained_and_every_training_has_a_row():
    assert set(FAMILY_NAMES) <= set(SYSTEMS)
    for rows in FAMILY.values():
        for name in FAMILY_NAMES:
            assert f"{name}-tokenizer" in rows
            for part in ("generator", "refit"):
                assert (f"{name}-{part}" in rows) == (SYSTEMS[name].generator is not None)
        assert {name.rsplit("-", 1)[0] for name in rows} == set(FAMILY_NAMES)


def test_absent_systems_say_so(tmp_path):
    for row in SYSTEMS.values():
        info = describe(tmp_path, row)
        assert (info.checkpoint, info.parameters, info.data, info.facts) == ("absent", 0, "", {})
        with pytest.raises(PlaygroundError, match=f"the system {row.name} .*no checkpoint here"):
            Engine(tmp_path).tokenize(Motion(drifting(60)), system=row.name)
    assert "is not trained yet" in row_of("lgtok-mini").absent


@pytest.fixture(scope="module")
def plain_levels(tmp_path_factory) -> Engine:
    """An engine whose only system is a tiny lgtok-rvq."""
    folder = tmp_path_factory.mktemp("assets")
    model = tiny_tokenizer(
        max_frames=196, text_width=384, scales=(6, 6, 6, 6), codes=(10,) * 4, metric="euclidean", phi="identity",
        draw=0.5, level_drop=0.2,
    )  # fmt: skip
    normaliser = Normaliser(np.zeros(67, np.float32), np.full(67, 0.05, np.float32))
    card = Card("tokenizer", model.config, identify(load_encoder("minilm")), "nothing", {"step": 1}, normaliser)
    save_checkpoint(checkpoint_path(folder, "lgtok-rvq", "tokenizer"), model, card)
    return Engine(folder)


def test_a_system_without_a_generator_tokenizes_and_refuses_to_generate(plain_levels):
    info = next(info for info in plain_levels.systems() if info.checkpoint == "shipped")
    assert (info.name, info.generator) == ("lgtok-rvq", None)
    assert plain_levels.scales("lgtok-rvq") == [(6, 10)] * 4
    tokenized = plain_levels.tokenize(Motion(drifting(60)), "a person strolls", "lgtok-rvq")
    assert [level.size for level in tokenized.levels] == [6] * 4 and tokenized.per_level.shape == (
        4,
        6,
        TINY.code_width,
    )
    again = plain_levels.tokenize(Motion(drifting(60)), "a person strolls", "lgtok-rvq")
    for ours, theirs in zip(tokenized.levels, again.levels, strict=True):  # noise is for training alone
        np.testing.assert_array_equal(ours.ids, theirs.ids)
    decoded = plain_levels.reconstruct(tokenized, scales=2)
    assert decoded.scales == 2 and decoded.mpjpe_mm is not None
    with pytest.raises(PlaygroundError, match="has no generator"):
        plain_levels.generate("a person strolls", 3, system="lgtok-rvq")
