"""The closer looks of the room Tokenize as a visitor uses them: a token's card, a swap, scales alone, other words."""

import re
from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import PHONE, Visit
from tests.ui.double import FakeEngine, stored_analysis

pytestmark = pytest.mark.browser
Go = Callable[..., Visit]
FIGURES = "() => MotionStage.get('tokenize').data.figures.map((figure) => figure.id)"
STATE = "() => MotionStage.get('tokenize').getState()"


@pytest.fixture
def seen(visit: Go, stand_in: str) -> Visit:
    return visit(stand_in)


def click_token(page: Page, row: int, share: float) -> None:
    """Click the score: row `row` from 1, at this share of its width."""
    expect(page.locator("#tokenize-score .ms-roll")).to_be_visible()
    page.wait_for_function("() => window.MotionStage?.get('tokenize')?.data")
    place = page.locator("#tokenize-score .ms-roll").bounding_box()
    assert place is not None
    page.mouse.click(place["x"] + share * place["width"], place["y"] + 26 + 16 * (row - 0.5))


def test_a_token_opens_its_card_and_goes_back(seen: Visit) -> None:
    page = seen.page
    click_token(page, 5, 0.4)
    expect(page.locator("#tokenize-card")).to_contain_text("scale 5, token 3 of 6")
    expect(page.locator("#tokenize-card")).to_contain_text(re.compile(r"Governs \d.\d\d to \d.\d\d s, measured"))
    expect(page.locator("#tokenize-example")).to_be_hidden()
    page.get_by_role("button", name="Back to the motion").first.click()
    expect(page.locator("#tokenize-example")).to_be_visible()
    assert page.evaluate(STATE)["selection"] is None


def test_a_swap_moves_the_motion_and_can_be_undone(seen: Visit) -> None:
    page = seen.page
    click_token(page, 5, 0.4)
    page.locator("#tokenize-card").get_by_role("button", name=re.compile("^opposite")).click()
    expect(page.locator("#tokenize-card [role=status]")).to_contain_text("at most 100 mm")
    expect(page.locator("#tokenize-stage .ms-labels")).to_contain_text("With the other code")
    expect(page.locator("#tokenize-score .ms-heads")).to_contain_text("What moves when code")
    assert page.evaluate(STATE)["selection"] == {"system": "lgtok", "scale": 5, "position": 2}
    expect(page).to_have_url(re.compile(r"selection=lgtok\.5\.2.*code=\d+|code=\d+.*selection=lgtok\.5\.2"))
    page.get_by_role("button", name="Undo").click()
    expect(page.locator("#tokenize-stage .ms-labels")).not_to_contain_text("With the other code")
    expect(page).not_to_have_url(re.compile("code="))


def test_a_link_to_a_swap_shows_it_in_a_fresh_profile(visit: Go, stand_in: str) -> None:
    page = visit(stand_in + "?room=tokenize&motion=m1&selection=lgtok.4.1&code=9").page
    expect(page.locator("#tokenize-card [role=status]")).to_contain_text("became 9")
    assert page.evaluate(FIGURES) == ["original", "rebuilt", "swapped"]


def test_a_code_is_put_in_by_keyboard_and_a_bad_one_is_refused(seen: Visit) -> None:
    page = seen.page
    click_token(page, 5, 0.4)
    field = page.get_by_role("spinbutton", name="Code to put in")
    field.fill("7")
    field.press("Enter")
    expect(page.locator("#tokenize-card [role=status]")).to_contain_text("became 7")
    field.fill("999")
    field.press("Enter")
    expect(page.locator("#tokenize-message [role=alert]")).to_contain_text("0 to 255 are accepted")
    expect(page.locator("#tokenize-card [role=status]")).to_contain_text("became 7")


def test_the_card_leads_to_a_clip_that_has_the_code(visit: Go, stand_in: str) -> None:
    engine, bundle = FakeEngine(), stored_analysis()
    example = engine.examples()[0]
    ids = engine.tokenize(example.motion(), example.caption).levels[9].ids
    position = next(n for n, code in enumerate(ids) if bundle.where_used(9, int(code)))
    page = visit(stand_in + f"?room=tokenize&motion={example.id}&selection=lgtok.10.{position}").page
    link = page.locator("#tokenize-card a").first
    expect(link).to_be_visible()
    motion = re.search(r"motion=([^&]+)", link.get_attribute("href") or "")
    assert motion
    link.click()
    page.wait_for_function("() => window.MotionStage?.get('embedding')?.state.selection?.scale === 10")
    there = "() => { const { state, data } = MotionStage.get('embedding'); const { scale, position } = state.selection;"
    assert page.evaluate(there + " return data.tracks[0].levels[scale - 1].ids[position]; }") == int(ids[position])
    expect(page).to_have_url(re.compile(f"motion={motion[1]}"))


@pytest.mark.parametrize(
    ("words", "tokens", "text"), [("only n", "36 tokens", "only-10"), ("without n", "80 tokens", "without-10")]
)
def test_one_scale_alone_or_left_out(seen: Visit, words: str, tokens: str, text: str) -> None:
    page = seen.page
    page.get_by_role("radio", name=words, exact=True).check()
    expect(page.locator("#tokenize-facts")).to_contain_text(tokens)
    expect(page).to_have_url(re.compile(f"scales={text}"))
    page.wait_for_function(f"(word) => ({STATE})().mode === word", arg=words.split()[0])


def test_what_the_words_do(seen: Visit) -> None:
    page = seen.page
    page.get_by_role("button", name="What do the words do?").click()
    expect(page.locator("#tokenize-words tbody tr")).to_have_count(3)
    expect(page.locator("#tokenize-score .ms-heads")).to_contain_text("Which words the detokenizer looks at")
    expect(page.locator("#tokenize-score .ms-key")).to_contain_text("another code without words, 59 of 116 tokens")
    page.locator("#tokenize-marks").get_by_text("with the wrong ones").click()
    expect(page.locator("#tokenize-score .ms-key")).to_contain_text("116 of 116 tokens")
    assert len(page.evaluate(FIGURES)) == 4
    page.locator("#tokenize-wrong textarea, #tokenize-wrong input").first.fill("a person flies")
    page.get_by_role("button", name="Compare").click()
    expect(page).to_have_url(re.compile("wrong=a\\+person\\+flies"))
    page.locator("#tokenize-back").click()
    expect(page.locator("#tokenize-example")).to_be_visible()
    expect(page).not_to_have_url(re.compile("wrong="))


def test_the_card_fits_a_phone(visit: Go, stand_in: str) -> None:
    page = visit(stand_in + "?room=tokenize&motion=m1&selection=lgtok.4.1&code=9", viewport=PHONE).page
    expect(page.locator("#tokenize-card [role=status]")).to_contain_text("became 9")
    assert page.evaluate("() => document.documentElement.scrollWidth") <= PHONE["width"]
