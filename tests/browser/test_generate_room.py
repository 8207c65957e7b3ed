"""Generate as a visitor uses it: tokens looked into and forced, seeds side by side, the visit's list, links, stop."""

import re
from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import DESKTOP, PHONE, Visit

pytestmark = pytest.mark.browser
Go = Callable[..., Visit]
DONE = """(n) => {
  const data = window.MotionStage?.get('generate')?.data;
  return data?.figures.length === n && data.tracks[0].levels[9].ids;
}"""
IDS = "() => MotionStage.get('generate').data.tracks[0].levels.map((level) => Array.from(level.ids ?? []))"


@pytest.fixture
def seen(visit: Go, stand_in: str) -> Visit:
    found = visit(f"{stand_in}?room=generate")
    found.page.wait_for_function(DONE, arg=1)
    found.settle()
    return found


def pick_token(page: Page) -> None:
    """The token at scale 3, position 1, by a click where it stands."""
    page.evaluate(
        "() => MotionStage.get('generate').store.commit('select',"
        " { selection: { system: 'lgtok', scale: 3, position: 1 } })"
    )
    expect(page.locator("#generate-token .mtp-drawn")).to_contain_text("scale 3, token 2 of 3")


def test_a_token_is_forced_and_the_visit_leads_back(seen: Visit) -> None:
    page = seen.page
    first = page.evaluate(IDS)
    pick_token(page)
    expect(page.locator("#generate-prompt")).not_to_be_visible()
    page.locator("#generate-token [data-do=code]:enabled").first.click()
    page.wait_for_function(DONE, arg=2)
    expect(page.locator("#generate-stage .ms-labels")).to_contain_text("Before")
    expect(page.locator("#generate-message")).to_contain_text("token 2 set to code")
    expect(page.locator("#generate-score .ms-key")).to_contain_text("another code than before")
    changed = page.evaluate(IDS)
    assert changed[:2] == first[:2] and changed[3:] != first[3:]
    page.wait_for_url(lambda url: "changes=3.1." in url)
    page.get_by_role("button", name="Back to the prompt").click()
    expect(page.locator("#generate-prompt")).to_be_visible()
    page.locator("#generate-earlier button").last.click()
    page.wait_for_function(DONE, arg=1)
    page.wait_for_url(lambda url: "changes" not in url)
    assert page.evaluate(IDS) == first
    assert seen.complaints == []


def test_seeds_stand_side_by_side_and_their_link_shows_the_same(seen: Visit, visit: Go) -> None:
    page = seen.page
    seen.wake("#generate-go")
    page.locator("#generate-takes input").fill("3")
    page.locator("#generate-seed input").fill("5")
    page.locator("#generate-go").click()
    page.wait_for_function(DONE, arg=3)
    expect(page.locator("#generate-stage .ms-labels")).to_contain_text("Seed 6")
    page.get_by_role("radio", name="Seed 7").check()
    expect(page.locator("#generate-score .ms-heads")).to_contain_text("seed 7")
    page.wait_for_url(lambda url: "take=2" in url)
    shown, address = page.evaluate(IDS), page.url
    other = visit(address).page
    other.wait_for_function(DONE, arg=3)
    expect(other.locator("#generate-score .ms-heads")).to_contain_text("seed 7")
    assert other.evaluate(IDS) == shown


def test_a_phone_shows_the_card_of_a_token(visit: Go, stand_in: str) -> None:
    page = visit(f"{stand_in}?room=generate", viewport=PHONE, has_touch=True, is_mobile=True).page
    page.wait_for_function(DONE, arg=1)
    pick_token(page)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= PHONE["width"]


def test_six_seeds_and_a_long_visit_leave_the_score_in_sight(visit: Go, stand_in: str) -> None:
    page = visit(f"{stand_in}?room=generate&takes=6&seconds=2").page
    page.wait_for_function(DONE, arg=6)
    pick_token(page)
    page.locator("#generate-token [data-do=code]:enabled").first.click()
    page.wait_for_function(DONE, arg=2)
    page.get_by_role("button", name="Back to the prompt").click()
    expect(page.locator("#generate-earlier button")).to_have_count(2)
    expect(page.locator("#generate-earlier small").first).to_contain_text("changed at scale 3")
    page.locator("#generate-earlier button").last.click()
    page.wait_for_function(DONE, arg=6)
    page.get_by_role("button", name="Sampling and guidance").click()
    expect(page.locator("#generate-temperature")).to_be_visible()
    score = page.locator("#generate-score .ms-roll").bounding_box()
    assert score is not None and score["y"] + score["height"] <= DESKTOP["height"]


def test_a_prompt_is_rewritten_and_a_version_used(seen: Visit) -> None:
    page = seen.page
    seen.wake("#generate-go")
    prompt = page.locator("#generate-prompt").locator("input, textarea")
    page.get_by_role("tabpanel").get_by_role("button", name="Rewrite the prompt").click()
    prompt.fill("could you show a guy walking slowly and then jumping")
    page.locator("#generate-rewrite-go").click()
    card = page.locator("#generate-rewritten")
    expect(card.locator("ol li")).to_have_count(2)
    expect(card).to_contain_text("Why")
    card.get_by_role("button", name="Use").nth(1).click()
    expect(prompt).to_have_value(re.compile("walks slowly, then jumps"))
