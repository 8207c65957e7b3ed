"""The page as a whole: what stands on the screen at once, phone, dark, words, and that it keeps to itself."""

from collections.abc import Callable
from urllib.parse import urlparse

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.conftest import DESKTOP, PHONE, Visit

pytestmark = pytest.mark.browser
Go = Callable[..., Visit]
ROOMS = ("Tokenize", "Embedding map", "Codebooks", "Generate", "Guidance", "Edit", "Endless", "Compare")
STAGES = {room: room.lower() for room in ("Tokenize", "Generate", "Guidance", "Edit", "Endless", "Compare")}
STAGES["Embedding map"] = "embedding"
CONTROLS = {
    "Tokenize": "#tokenize-scales input[type=range]",
    "Embedding map": "#embedding-map .plotly",
    "Generate": "#generate-go",
    "Guidance": "#guidance-g input[type=range]",
    "Edit": "#edit-go",
    "Endless": "#endless-go",
    "Compare": "#compare-go",
}


def box(place: Locator) -> dict[str, float]:
    expect(place).to_be_visible()
    found = place.bounding_box()
    assert found is not None
    return {**found, "right": found["x"] + found["width"], "bottom": found["y"] + found["height"]}


def test_the_tabs_have_their_names(visit: Go, stand_in: str) -> None:
    page = visit(stand_in).page
    assert [tab.strip() for tab in page.get_by_role("tab").all_inner_texts()] == [*ROOMS, "Learn"]


@pytest.mark.parametrize("room", STAGES)
def test_player_score_and_main_control_are_seen_without_scrolling(visit: Go, stand_in: str, room: str) -> None:
    page = visit(stand_in).enter(room)
    name = STAGES[room]
    picture = box(page.locator(f"#{name}-stage .ms-picture"))
    assert picture["height"] >= 320
    parts = [f"#{name}-stage .ms-toolbar", f"#{name}-score .ms-roll", CONTROLS[room]]
    for part in parts:
        place = box(page.locator(part).first)
        assert place["y"] >= 0 and place["bottom"] <= DESKTOP["height"] and place["right"] <= DESKTOP["width"]


@pytest.mark.parametrize("room", ROOMS)
def test_a_phone_never_scrolls_sideways(visit: Go, stand_in: str, room: str) -> None:
    page = visit(stand_in, viewport=PHONE, has_touch=True, is_mobile=True).enter(room)
    top = 0.0
    if room in STAGES:
        expect(page.locator(f"#{STAGES[room]}-score .ms-roll")).to_be_visible()
        top = box(page.locator(f"#{STAGES[room]}-stage .ms-picture"))["bottom"]
    panel = box(page.locator(f"#room-{room.lower().replace(' ', '-')} .mtp-panel"))
    assert page.evaluate("() => document.documentElement.scrollWidth") <= PHONE["width"]
    assert panel["x"] >= 0 and panel["right"] <= PHONE["width"] and panel["y"] > top


def ground(page: Page) -> float:
    """Mean brightness of the page's ground, 0 to 255."""
    color = page.evaluate("() => getComputedStyle(document.body).backgroundColor")
    numbers = [float(part) for part in color.strip("rgba()").split(",")[:3]]
    return sum(numbers) / 3


def test_light_and_dark_follow_the_system_and_the_switch(visit: Go, stand_in: str) -> None:
    light = visit(stand_in, color_scheme="light").page
    assert ground(light) > 200
    light.get_by_role("button", name="Switch between light and dark").click()
    expect(light.locator("body")).to_have_class("dark")
    assert ground(light) < 60
    light.reload()
    expect(light.get_by_role("tab", name="Tokenize", exact=True)).to_be_visible()
    expect(light.locator("body")).to_have_class("dark")
    assert ground(visit(stand_in, color_scheme="dark").page) < 60


@pytest.mark.parametrize("room", ROOMS)
def test_every_room_explains_itself(visit: Go, stand_in: str, room: str) -> None:
    page = visit(stand_in).enter(room)
    here = page.locator(f"#room-{room.lower().replace(' ', '-')}")
    expect(here.get_by_role("heading").first).to_be_visible()
    here.get_by_role("button", name="What am I looking at?").click()
    expect(here.get_by_text("In one sentence.")).to_be_visible()


def test_figures_play_by_themselves_unless_the_visitor_wants_calm(visit: Go, stand_in: str) -> None:
    moving = visit(stand_in, reduced_motion="no-preference").page
    moving.wait_for_function("() => window.MotionStage?.get('tokenize')?.state.frame > 1")
    calm = visit(stand_in).page
    calm.wait_for_function("() => window.MotionStage?.get('tokenize')?.data")
    assert not calm.evaluate("() => MotionStage.get('tokenize').state.playing")


def test_nothing_leaves_the_machine_and_nothing_complains(visit: Go, stand_in: str) -> None:
    seen = visit(stand_in)
    for room in ROOMS:
        seen.enter(room)
        seen.settle()
    page = seen.enter("Generate")
    page.locator("#generate-go").click()
    expect(page.locator("#generate-stage .ms-labels")).to_contain_text("of 10")
    seen.settle()
    hosts = {urlparse(url).hostname for url in seen.requests if not url.startswith(("data:", "blob:"))}
    assert hosts == {"127.0.0.1"}
    assert seen.complaints == []
