"""Learn and the tour, by keyboard alone where it matters."""

from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from playground.ui.cards import cards, term, tour
from tests.browser.conftest import PHONE, Visit

pytestmark = pytest.mark.browser
Go = Callable[..., Visit]


def tab_to(page: Page, words: str, most: int = 60) -> None:
    """Press Tab until the element with the focus says `words`."""
    for _ in range(most):
        page.keyboard.press("Tab")
        if words in (page.evaluate("() => document.activeElement?.textContent ?? ''") or "")[:80]:
            return
    raise AssertionError(f"{words!r} was not reached by Tab")


def test_every_card_is_listed_and_a_question_opens_by_keyboard(visit: Go, stand_in: str) -> None:
    page = visit(stand_in + "?room=learn").page
    here = page.locator("#learn-page")
    expect(here.locator("article")).to_have_count(len(cards()) + 1)
    assert [one.strip() for one in here.locator("nav a").all_inner_texts()] == [one.title for one in cards()] + [
        "Words"
    ]
    here.locator("nav a").last.focus()
    tab_to(page, "What should I try?")
    page.keyboard.press("Enter")
    expect(here.get_by_text("Set Rebuild from scales 1 to to 1")).to_be_visible()


def test_a_jump_inside_learn_leaves_the_address_alone(visit: Go, stand_in: str) -> None:
    page = visit(stand_in + "?room=learn").page
    page.locator("#learn-page nav a", has_text="two guidances").press("Enter")
    expect(page.locator("#learn-two-guidances")).to_be_in_viewport()
    assert page.url.endswith("?room=learn")
    assert page.evaluate("() => document.activeElement.textContent").startswith("Why two guidances")


def test_try_it_sets_the_stage_and_back_returns(visit: Go, stand_in: str) -> None:
    seen = visit(stand_in + "?room=learn")
    page = seen.page
    page.locator("#learn-guidance .mtp-try a").press("Enter")
    expect(page.locator("#room-guidance-button")).to_have_attribute("aria-selected", "true")
    expect(page.locator("#guidance-g input[type=number]")).to_have_value("4")
    page.wait_for_function("() => MotionStage.get('guidance')?.state.guidance === 4")
    page.go_back()
    expect(page.locator("#room-learn-button")).to_have_attribute("aria-selected", "true")
    assert seen.complaints == []


def test_a_term_shows_its_words_on_focus_and_escape_hides_them(visit: Go, stand_in: str) -> None:
    page = visit(stand_in, viewport=PHONE).page
    words = page.locator("#tokenize-facts .mtp-term").first
    words.scroll_into_view_if_needed()
    words.focus()
    card = page.get_by_role("tooltip")
    expect(card).to_have_text(term("mpjpe"))
    box = card.bounding_box()
    assert box is not None and box["x"] >= 0 and box["x"] + box["width"] <= PHONE["width"]
    page.keyboard.press("Escape")
    expect(card).to_be_hidden()


def test_the_tour_by_keyboard(visit: Go, stand_in: str) -> None:
    seen = visit(stand_in)
    page = seen.page
    page.get_by_role("button", name="Tour", exact=True).focus()
    page.keyboard.press("Enter")
    for number, step in enumerate(tour(), 1):
        dialog = page.get_by_role("dialog", name=step.title)
        expect(dialog).to_contain_text(f"{number} of 6")
        ring = page.locator(".mtp-tour-ring")
        expect(ring).to_be_visible()  # what the step is about is there
        box = dialog.bounding_box()
        assert box is not None and box["x"] >= 0 and box["y"] >= 0
        if number == 3:
            page.keyboard.press("ArrowLeft")
            expect(page.get_by_role("dialog", name=tour()[1].title)).to_be_visible()
            page.keyboard.press("ArrowRight")
        page.keyboard.press("Enter")  # the focus is on Next
    expect(page.locator(".mtp-tour")).to_have_count(0)
    assert page.evaluate("() => document.activeElement.textContent") == "Tour"
    assert seen.complaints == []


def test_the_tour_keeps_the_focus_and_can_be_left(visit: Go, stand_in: str) -> None:
    page = visit(stand_in, viewport=PHONE, has_touch=True).page
    page.get_by_role("button", name="Tools").click()
    page.get_by_role("button", name="Tour", exact=True).click()
    for _ in range(5):
        page.keyboard.press("Tab")
        assert page.evaluate("() => document.activeElement.closest('.mtp-tour') !== null")
    assert page.evaluate("() => document.documentElement.scrollWidth") <= PHONE["width"]
    page.keyboard.press("Escape")
    expect(page.locator(".mtp-tour, .mtp-tour-ring")).to_have_count(0)
