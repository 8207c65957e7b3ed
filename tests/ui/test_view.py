"""Stored and live results: one path, honest badges, stale ones ignored."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from playground.errors import PlaygroundError
from playground.ui.opening import OPENINGS, write_openings
from playground.ui.previews import previews_path, read_previews
from playground.ui.rooms import ROOMS
from playground.ui.services import Services
from playground.ui.view import View, read_view
from tests.ui.double import FakeEngine


@pytest.fixture
def services() -> Services:
    engine = FakeEngine()
    return Services(lambda: engine)  # type: ignore[arg-type, return-value]


@pytest.mark.parametrize("name", OPENINGS)
def test_a_stored_view_comes_back_as_it_was(services: Services, tmp_path: Path, name: str) -> None:
    view = OPENINGS[name](services)
    view.stored("abc").write(tmp_path / "deep" / "view.json")
    found = read_view(tmp_path / "deep" / "view.json", "abc")
    assert found is not None and found.kind == "stored"
    assert json.loads(json.dumps(view.stage)) == found.stage
    assert found.facts == view.facts and found.charts == view.charts
    assert found.facts_html() == view.facts_html()


def test_every_room_has_an_opening() -> None:
    assert len(OPENINGS) == len(ROOMS) - 1  # all but Learn, which shows no result


def test_the_badge_says_stored_or_live(services: Services) -> None:
    view = OPENINGS["tokenize"](services)
    assert json.loads(view.stage_json())["badge"]["kind"] == "live"
    assert json.loads(view.stored().stage_json())["badge"]["kind"] == "stored"


@pytest.mark.parametrize(
    "text", ["", "[]", "null", "{}", '{"stage": 3, "facts": []}', '{"stage": {}, "facts": [1]}', "\0"]
)
def test_a_broken_file_is_as_good_as_none(tmp_path: Path, text: str) -> None:
    (tmp_path / "view.json").write_text(text, encoding="utf-8")
    assert read_view(tmp_path / "view.json") is None
    assert read_view(tmp_path / "absent.json") is None


def test_a_view_of_other_checkpoints_is_not_shown(services: Services) -> None:
    assert write_openings(services, ["guidance"]) == ["guidance"]
    shown = services.first_view("guidance", OPENINGS["guidance"])
    assert shown.kind == "stored"
    replace(shown, made_from="other").write(services.opening_path("guidance"))
    assert services.first_view("guidance", OPENINGS["guidance"]).kind == "live"


def test_a_room_without_anything_to_show_says_why(services: Services) -> None:
    def nothing(_: Services) -> View:
        raise PlaygroundError("no trained system is shipped with\nthis copy")

    assert json.loads(services.first_view("none", nothing).stage_json()) == {
        "version": 1, "state": "empty", "message": "No trained system is shipped with this copy.",
    }  # fmt: skip


def test_the_openings_in_assets_belong_to_the_checkpoints_in_assets() -> None:
    from playground.engine import default_engine

    services = Services(default_engine)
    stored = sorted((default_engine().assets / "opening").glob("*.json"))
    if not stored:
        pytest.skip("no stored openings yet; python -m playground.ui.opening makes them")
    for path in stored:
        found = read_previews(services) if path == previews_path(services) else read_view(path, services.fingerprint())
        assert found is not None, f"{path.name} is stale; make the openings again"
