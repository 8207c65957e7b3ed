"""Compare as a visitor uses it: another thing that differs, more of it, whose tokens, a link, a phone."""

import re
from collections.abc import Callable

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.conftest import DESKTOP, PHONE, Visit

pytestmark = pytest.mark.browser
Go = Callable[..., Visit]
SHOWN = "(n) => window.MotionStage?.get('compare')?.data?.figures.length === n"


@pytest.fixture
def seen(visit: Go, stand_in: str) -> Visit:
    found = visit(f"{stand_in}?room=compare")
    found.page.wait_for_function(SHOWN, arg=4)
    found.settle()
    return found


def chip(page: Page, name: str) -> Locator:
    """One choice of what stands side by side."""
    return page.locator("#compare-values label").filter(has_text=re.compile(f"^\\s*{name}\\s*$"))


def test_settings_stand_side_by_side_and_the_best_is_marked(seen: Visit, visit: Go) -> None:
    page = seen.page
    expect(page.locator("#compare-take tbody tr")).to_have_count(3)
    expect(page.locator("#compare-take tbody tr").last.locator("td").first.locator("strong")).to_have_count(1)
    for name in ("5", "7"):
        chip(page, name).click()
    page.locator("#compare-go").click()
    page.get_by_role("button", name="Scales 1 to 7").click()
    expect(page.locator("#compare-score .ms-heads")).to_contain_text("scales 1 to 7")
    page.wait_for_url(lambda url: "values=2_7_10" in url and "take=1" in url)
    other = visit(page.url).page
    expect(other.locator("#compare-score .ms-heads")).to_contain_text("scales 1 to 7")
    expect(other.locator("#compare-take tbody tr")).to_have_count(3)
    expect(chip(other, "7").locator("input")).to_be_checked()
    assert seen.complaints == []


def test_a_prompt_with_other_seeds(seen: Visit) -> None:
    page = seen.page
    page.locator("#compare-vary input").click()
    page.get_by_role("option", name="Seed, from a prompt").click()
    prompt = page.locator("#compare-prompt").locator("input, textarea")
    expect(prompt).to_be_visible()
    expect(page.locator("#compare-example")).to_have_count(0)
    prompt.fill("a person hops")
    page.locator("#compare-go").click()
    page.wait_for_function(SHOWN, arg=4)
    expect(page.locator("#compare-take")).to_contain_text("“a person hops”")
    expect(page.locator("#compare-take thead")).to_contain_text("from the first")


def test_one_alone_is_refused_in_a_sentence(seen: Visit) -> None:
    page = seen.page
    for name in ("5", "10"):
        chip(page, name).click()
    page.locator("#compare-go").click()
    expect(page.locator("#compare-message [role=alert]")).to_contain_text("Choose 2 to 5 of them")
    expect(page.locator("#compare-take tbody tr")).to_have_count(3)


def test_a_phone_never_scrolls_sideways(visit: Go, stand_in: str) -> None:
    page = visit(f"{stand_in}?room=compare", viewport=PHONE, has_touch=True, is_mobile=True).page
    page.wait_for_function(SHOWN, arg=4)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= PHONE["width"]


def test_a_comparison_can_be_stopped(seen: Visit) -> None:
    page = seen.page
    page.locator("#compare-vary input").click()
    page.get_by_role("option", name="Seed, from a prompt").click()
    expect(page.locator("#compare-prompt")).to_be_visible()
    page.locator("#compare-go").click()
    expect(page.locator("#compare-stop")).to_be_enabled()
    page.wait_for_function(SHOWN, arg=1)
    page.locator("#compare-stop").click()
    expect(page.locator("#compare-message")).to_contain_text(re.compile(r"Stopped after \d of 4"))
    expect(page.locator("#compare-go")).to_be_enabled()
    expect(page.locator("#compare-stop")).to_be_disabled()


ROOMS = ["Tokenize", "Embedding map", "Codebooks", "Generate", "Guidance", "Edit"]


def test_every_room_leads_to_compare_and_back(visit: Go, stand_in: str) -> None:
    seen = visit(stand_in)
    page = seen.page
    for room in ROOMS:
        seen.enter(room)
        own = page.locator(f"#room-{room.lower().replace(' ', '-')}")
        switch = own.get_by_role("button", name="Compare", exact=True).first
        expect(switch).to_be_visible()
        switch.click()
        expect(page.get_by_role("tab", name="Compare", exact=True)).to_have_attribute("aria-selected", "true")
        expect(page).to_have_url(re.compile("room=compare"))
        page.get_by_role("button", name=f"Back to {room}").click()
        expect(page.get_by_role("tab", name=room, exact=True)).to_have_attribute("aria-selected", "true")
        expect(switch).to_be_visible()
    assert seen.complaints == []


def test_compare_begins_where_guidance_stands(visit: Go, stand_in: str) -> None:
    page = visit(f"{stand_in}?room=guidance&motion=m2&g=6").page
    page.wait_for_function("() => window.MotionStage?.get('guidance')?.state.guidance === 6")
    page.locator("#room-guidance").get_by_role("button", name="Compare", exact=True).click()
    page.wait_for_function(SHOWN, arg=5)
    expect(page.locator("#compare-stage .ms-labels")).to_contain_text("g = 6")
    expect(chip(page, "6").locator("input")).to_be_checked()
    expect(page).to_have_url(re.compile("motion=m2"))
    page.go_back()
    expect(page.get_by_role("tab", name="Guidance", exact=True)).to_have_attribute("aria-selected", "true")


def test_five_edits_side_by_side_leave_the_score_in_sight(visit: Go, stand_in: str) -> None:
    page = visit(f"{stand_in}?room=compare&vary=redraw&values=0_1_2_3_4&motion=m2").page
    page.wait_for_function(SHOWN, arg=6)
    expect(page.locator("#compare-take tbody tr")).to_have_count(5)
    score = page.locator("#compare-score .ms-roll").bounding_box()
    assert score is not None and score["y"] + score["height"] <= DESKTOP["height"]
