"""Endless as a visitor uses it: it goes on and on, hears the next instruction, stops, and a link brings it back."""

import re
from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from playground.ui.walking import WINDOW
from tests.browser.conftest import PHONE, Visit

pytestmark = pytest.mark.browser
Go = Callable[..., Visit]
STAGE = "window.MotionStage?.get('endless')"
OPENED = f"() => {STAGE}?.data?.frames === 200"
MADE = f"(n) => {{ const data = {STAGE}?.data; return data?.growing && data.origin + data.growing.made >= n; }}"
HELD = f"""() => {{
  const {{ figures: [figure], tracks: [track] }} = {STAGE}.data;
  return [figure.joints.length / 66, ...track.levels.map((level) => level.ids.length * 4)];
}}"""
RIBBON = f"() => {STAGE}.data.ribbon.map(([, words]) => words)"
SPEED = f"() => {STAGE}.store.set({{ speed: 4 }})"  # so that the test is short


@pytest.fixture
def seen(visit: Go, stand_in: str) -> Visit:
    found = visit(f"{stand_in}?room=endless")
    found.page.wait_for_function(OPENED)
    found.settle()
    return found


def start(page: Page, seen: Visit) -> None:
    """Press Start and wait until the first second is there."""
    page.locator("#endless-go").click()
    page.wait_for_function(MADE, arg=20)
    expect(page.locator("#endless-say")).to_be_enabled()
    page.evaluate(SPEED)


def test_it_goes_on_listens_and_stops(seen: Visit, visit: Go) -> None:
    page = seen.page
    expect(page.locator("#endless-score .ms-ribbon li")).to_have_count(2)
    start(page, seen)
    assert page.evaluate(f"() => {STAGE}.state.playing")
    page.wait_for_function(MADE, arg=60)
    page.locator("#endless-prompt").locator("input, textarea").fill("a person bows")
    page.locator("#endless-say").click()
    expect(page.locator("#endless-heard")).to_contain_text(re.compile(r"From second [\d.]+ on: a person bows"))
    page.wait_for_function(f"() => ({RIBBON})().at(-1) === 'a person bows'")
    expect(page.locator("#endless-score .ms-ribbon li.is-now")).to_have_text("a person bows")
    expect(page.locator("#endless-facts")).to_contain_text("jerk at switches")
    expect(page.locator("#endless-facts tbody tr")).to_have_count(1)
    page.wait_for_url(lambda url: "then=" in url and "a+person+bows" in url)
    page.locator("#endless-stop").click()
    expect(page.locator("#endless-say")).to_be_disabled()
    page.wait_for_function(f"() => {STAGE}.data.growing === null && !{STAGE}.state.playing")
    shown = page.evaluate(f"() => {STAGE}.data.ribbon")
    other = visit(page.url).page
    other.wait_for_function(MADE, arg=20)
    expect(other.locator("#endless-then").locator("input, textarea")).to_have_value(re.compile("a person bows"))
    assert not other.evaluate(f"() => {STAGE}.state.playing")  # this visitor asks for calm
    other.evaluate(f"() => {{ {STAGE}.store.set({{ speed: 4, playing: true }}); }}")
    other.wait_for_function(f"() => {STAGE}.data.ribbon.length === 2")
    assert other.evaluate(f"() => {STAGE}.data.ribbon") == shown
    assert seen.complaints == []


def test_the_browser_holds_no_more_after_long_than_after_short(seen: Visit) -> None:
    page = seen.page
    start(page, seen)
    held = []
    for made in range(40, WINDOW + 80, 20):
        page.evaluate(f"() => {STAGE}.seek(1e6)")  # to the end of what is there, so that more is asked for
        page.wait_for_function(MADE, arg=made)
        held.append(page.evaluate(HELD))
    assert max(map(max, held)) == WINDOW and held[-1] == [WINDOW] * 4


def test_a_bad_plan_gives_one_sentence_and_nothing_starts(seen: Visit) -> None:
    page = seen.page
    page.locator("#endless-then").locator("input, textarea").fill("soon a person jumps")
    page.locator("#endless-go").click()
    expect(page.locator("#endless-heard [role=alert]")).to_contain_text("begins with no second")
    expect(page.locator("#endless-say")).to_be_disabled()


def test_a_prompt_is_rewritten_and_its_steps_are_played(seen: Visit) -> None:
    page = seen.page
    prompt = page.locator("#endless-prompt").locator("input, textarea")
    page.get_by_role("tabpanel").get_by_role("button", name="Rewrite the prompt").click()
    prompt.fill("please show someone who walks forward and then jumps")
    page.locator("#endless-rewrite-go").click()
    card = page.locator("#endless-rewritten")
    expect(card).to_contain_text("Step by step")
    expect(card).to_contain_text("left out")
    card.get_by_role("button", name="Play the steps one after the other").click()
    expect(page.locator("#endless-then").locator("input, textarea")).to_have_value(re.compile(r"^[\d.]+ .*jump"))
    expect(prompt).to_have_value(re.compile("walks forward$"))
    start(page, seen)
    page.wait_for_function(f"() => ({RIBBON})().some((words) => words.includes('jump'))")


def test_a_phone_never_scrolls_sideways_while_it_grows(visit: Go, stand_in: str) -> None:
    seen = visit(f"{stand_in}?room=endless", viewport=PHONE, has_touch=True, is_mobile=True)
    seen.page.wait_for_function(OPENED)
    start(seen.page, seen)
    seen.page.wait_for_function(MADE, arg=60)
    assert seen.page.evaluate("() => document.documentElement.scrollWidth") <= PHONE["width"]
