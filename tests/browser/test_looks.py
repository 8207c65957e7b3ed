"""Two closer looks as a visitor uses them: the words that moments look at, and where a long recording is cut."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import PHONE, Visit
from tests.browser.server import serving
from tests.data.test_segment import take
from tests.ui.double import DENOISER

pytestmark = pytest.mark.browser
Go = Callable[..., Visit]
STRIP = "() => { const { strips } = MotionStage.get('generate').data; return strips.map((one) => [one.name, one.rows.join(' '), Array.from(one.values)]); }"  # noqa: E501
DONE = """(frames) => {
  const data = window.MotionStage?.get('generate')?.data;
  return data?.frames === frames && data.tracks[0]?.levels[9].ids;
}"""
HAS = "(n) => window.MotionStage?.get('generate')?.data?.strips.length === n"
SECONDS = "() => MotionStage.get('tokenize').data.frames / 20"


@pytest.fixture(scope="module")
def with_denoiser() -> Iterator[str]:
    """Address of the page on the engine's stand-in with a second system, which has no tokens."""
    with serving("-m", "tests.ui.serve", "{port}", "0.1", "denoises") as address:
        yield address


def upload(page: Page, path: Path) -> None:
    page.locator("#tokenize-upload").locator("xpath=..").locator("input[type=file]").set_input_files(path)


def test_words_by_moments_follow_the_clock_and_the_link(visit: Go, with_denoiser: str) -> None:
    seen = visit(f"{with_denoiser}?room=generate&prompt=a+person+bows&seconds=2&seed=4")
    page = seen.page
    switch = page.get_by_label("Which words did each moment look at?")
    expect(page.locator("#generate-facts")).to_contain_text("tokens")
    page.wait_for_function(DONE, arg=40)
    seen.settle()
    switch.check()
    page.wait_for_function(HAS, arg=1)
    ((name, rows, values),) = page.evaluate(STRIP)
    assert name == "Which words the detokenizer looks at" and rows == "(begin) a person bows . (end)"
    expect(page.locator("#generate-looked")).to_contain_text("map under the score")
    expect(page.locator("#generate-score .ms-heads")).to_contain_text(name)
    expect(page.locator("#generate-score .ms-scroll")).to_be_in_viewport()
    page.wait_for_url(lambda url: "words=1" in url)
    head = "() => document.querySelector('#generate-score .ms-playhead').style.transform"
    before = page.evaluate(head)
    place = page.locator("#generate-score .ms-roll").bounding_box()
    assert place is not None
    page.mouse.click(place["x"] + 0.6 * place["width"], place["y"] + place["height"] - 30)  # inside the map
    page.wait_for_function(f"(old) => ({head})() !== old", arg=before)
    other = visit(page.url).page
    other.wait_for_function(HAS, arg=1)
    assert other.evaluate(STRIP) == [[name, rows, values]]
    switch.uncheck()
    page.wait_for_function(HAS, arg=0)
    page.wait_for_url(lambda url: "words=" not in url)
    assert seen.complaints == []


def test_a_system_without_tokens_shows_the_map_alone(visit: Go, with_denoiser: str) -> None:
    page = visit(f"{with_denoiser}?room=generate&system={DENOISER}&prompt=a+person+bows&seconds=2&words=1").page
    page.wait_for_function(HAS, arg=1)
    assert page.evaluate(STRIP)[0][0] == "Which words the denoiser looks at"
    expect(page.locator("#generate-facts")).to_contain_text("no tokens")
    page.get_by_role("button", name="Sampling and guidance").click()
    expect(page.locator("#generate-s input[type=number]")).to_have_value("2.5")  # its own guidance
    page.locator("#generate-system input").click()
    page.get_by_role("option", name="LG-Tok").click()
    expect(page.locator("#generate-s input[type=number]")).not_to_have_value("2.5")
    page.locator("#generate-go").click()
    page.wait_for_function("() => MotionStage.get('generate').data?.tracks[0]?.levels[9].ids")
    page.wait_for_url(lambda url: "system=" not in url and "words=1" in url)


def test_a_long_recording_shows_its_cuts_and_a_click_chooses_a_part(visit: Go, stand_in: str, tmp_path: Path) -> None:
    path = tmp_path / "long.npz"
    np.savez(path, joints=take(36.0, (6.0, 13.0, 19.5, 29.0)), fps=20.0)
    seen = visit(stand_in)
    page = seen.page
    page.wait_for_function("() => window.MotionStage?.get('tokenize')?.data")
    expect(page.locator("#tokenize-cuts")).to_have_count(0)
    upload(page, path)
    curve = page.locator("#tokenize-curve .mtp-chart[data-drawn]")
    expect(curve).to_be_visible()
    page.wait_for_function(f"() => ({SECONDS})() === 9.8")
    expect(curve.locator("path[fill-rule=evenodd]").first).to_be_attached()  # the shaded window
    box = curve.bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 30 + (8 / 36) * (box["width"] - 32), box["y"] + 30)
    expect(page.locator("#tokenize-part input")).to_have_value("2: 6.0 to 13.0 s")
    page.wait_for_function(f"() => ({SECONDS})() < 7.1")
    page.wait_for_url(lambda url: "part=2" in url)
    page.locator("#tokenize-part input").click()
    page.get_by_role("option", name="1: 0.0 to 6.0 s").click()
    page.wait_for_function(f"() => ({SECONDS})() < 6.1")
    page.wait_for_url(lambda url: "part=1" in url)
    window = page.locator("#tokenize-start input[type=range]")
    window.focus()
    window.press("End")
    page.wait_for_function(f"() => ({SECONDS})() === 9.8")
    expect(page.locator("#tokenize-part input")).to_have_value("by the slider")
    page.wait_for_url(lambda url: "part=" not in url and "start=" in url)
    page.set_viewport_size(PHONE)
    page.wait_for_function("() => document.documentElement.scrollWidth <= innerWidth")
    assert seen.complaints == []
