"""The small moving figures of the maps: what is kept of a clip, and that they follow their checkpoints."""

import base64
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from playground.limits import LIMITS
from playground.ui.previews import (
    MIDDLE,
    RATE,
    SECONDS,
    STEP,
    flat,
    make_previews,
    previews_path,
    read_previews,
    write_previews,
)
from playground.ui.services import Services
from tests.ui.double import FakeEngine, motions


@pytest.fixture
def services() -> Services:
    engine = FakeEngine()
    return Services(lambda: engine)  # type: ignore[arg-type, return-value]


@settings(max_examples=20, deadline=None)
@given(frames=st.integers(1, 196), turn=st.floats(-3, 3), away=st.floats(-50, 50))
def test_where_a_clip_stands_and_faces_does_not_count(frames: int, turn: float, away: float) -> None:
    joints = np.resize(motions()[0].joints, (frames, 22, 3)).astype(np.float64)
    found = flat(joints)
    most = round(RATE * SECONDS) + 1
    assert found.dtype == np.int8 and found.shape == (min(most, -(-frames // (LIMITS.fps // RATE))), 22, 2)
    cos, sin = np.cos(turn), np.sin(turn)
    moved = joints @ np.array([[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]]) + [away, 0, -away]
    assert np.abs(flat(moved).astype(int) - found.astype(int)).max() <= 1


def test_a_standing_figure_keeps_its_height() -> None:
    found = flat(np.repeat(motions()[0].joints[:1], 30, axis=0))
    height = (found[0, :, 1].max() - found[0, :, 1].min()) * STEP
    own = motions()[0].joints[0, :, 1]
    assert height == pytest.approx(float(own.max() - own.min()), abs=2 * STEP)
    assert found[0, :, 1].min() * STEP == pytest.approx(-MIDDLE, abs=STEP) and (found[:, 0, 0] == 0).all()


def test_previews_hold_every_clip_and_go_with_their_checkpoints(
    services: Services, monkeypatch: pytest.MonkeyPatch
) -> None:
    bundle = services.bundle("lgtok")
    made = make_previews(services, "lgtok")
    joints = np.frombuffer(base64.b64decode(made["joints"]), np.int8).reshape(-1, 22, 2)
    assert made["ids"] == list(bundle.ids) and len(joints) == sum(made["poses"])
    second = services.engine().decode(bundle.token_file(1)).motion
    assert np.array_equal(joints[made["poses"][0] :][: made["poses"][1]], flat(second.joints))
    assert read_previews(services) is None
    write_previews(services)
    assert read_previews(services) == json.loads(json.dumps(made))
    monkeypatch.setattr(Services, "fingerprint", lambda self: "another one")
    assert read_previews(services) is None
    previews_path(services).write_text("{", encoding="utf-8")
    assert read_previews(services) is None
