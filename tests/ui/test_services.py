"""What all rooms share: which system they show, and what makes stored results stale."""

from dataclasses import replace

import pytest

from playground.errors import PlaygroundError
from playground.systems import SamplingDefaults, SystemInfo
from playground.ui.services import Services
from tests.ui.double import FakeEngine

LITE = FakeEngine().systems()[0]


def with_systems(*systems: SystemInfo) -> Services:
    engine = FakeEngine()
    engine.systems = lambda: list(systems)  # type: ignore[method-assign]
    return Services(lambda: engine)  # type: ignore[arg-type, return-value]


def test_rooms_show_the_usual_system_or_the_first_shipped_one_that_generates():
    absent = replace(LITE, name="lgtok-lite", checkpoint="absent")
    silent = replace(LITE, name="lgtok-rvq", generator=None, sampling=SamplingDefaults(guidance=1.0))
    assert with_systems(absent, silent, LITE).default_system().name == "lgtok"
    assert with_systems(replace(LITE, name="mosa"), silent, LITE).default_system().name == "lgtok"
    assert with_systems(silent, replace(LITE, name="mosa")).default_system().name == "mosa"
    assert with_systems(absent, silent).default_system().name == "lgtok-rvq"
    assert with_systems(absent, silent).sampling().guidance == 1.0
    with pytest.raises(PlaygroundError, match="no trained system"):
        with_systems(absent).default_system()
    assert with_systems(absent).sampling() == SamplingDefaults()


def test_rows_without_files_make_no_stored_result_stale():
    absent = replace(LITE, name="lgtok-lite", checkpoint="absent")
    assert with_systems(absent, LITE).fingerprint() == with_systems(LITE).fingerprint()
