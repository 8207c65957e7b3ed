"""Edit as a visitor uses it: a span drawn on the timeline, repainted, linked, by keyboard, with another source."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import PHONE, Visit
from tests.conftest import drifting

pytestmark = pytest.mark.browser
Go = Callable[..., Visit]
SHOWN = "(n) => window.MotionStage?.get('edit')?.data?.figures.length === n"
IDS = "() => MotionStage.get('edit').data.tracks[0].levels.map((level) => Array.from(level.ids))"


@pytest.fixture
def seen(visit: Go, stand_in: str) -> Visit:
    found = visit(f"{stand_in}?room=edit")
    found.page.wait_for_function(SHOWN, arg=2)
    found.settle()
    return found


def field(page: Page, key: str) -> float:
    return float(page.locator(f"#edit-{key} input").input_value())


def draw_span(page: Page, start: float, stop: float) -> None:
    """Drag over these shares of the time axis."""
    page.evaluate("() => MotionStage.get('edit').seek(0)")
    box = page.locator("#edit-score .ms-ruler").bounding_box()
    assert box is not None
    x, width, y = box["x"] + 40, box["width"] - 60, box["y"] + 20
    page.mouse.move(x + start * width, y)
    page.mouse.down()
    page.mouse.move(x + stop * width, y, steps=4)
    page.mouse.up()


def test_a_span_is_drawn_and_repainted(seen: Visit, visit: Go) -> None:
    page = seen.page
    expect(page.locator("#edit-stage .ms-labels")).to_contain_text("After")
    expect(page.locator("#edit-score .ms-key")).to_contain_text("kept as it was")
    was = (field(page, "from"), field(page, "to"))
    draw_span(page, 0.5, 0.8)
    page.wait_for_function(f"() => Number(document.querySelector('#edit-from input').value) !== {was[0]}")
    start, stop = field(page, "from"), field(page, "to")
    assert 0 < start < stop and (start, stop) != was
    page.locator("#edit-prompt").locator("input, textarea").fill("a person bows")
    page.locator("#edit-go").click()
    expect(page.locator("#edit-stage .ms-labels")).to_contain_text("a person bows")
    hatch = page.evaluate("() => MotionStage.get('edit').data.hatch")
    assert hatch[0][1] == pytest.approx(20 * start, abs=1) and hatch[1][0] == pytest.approx(20 * stop, abs=1)
    expect(page.locator("#edit-facts")).to_contain_text("frames kept")
    page.get_by_role("button", name="How the rest is kept").click()
    expect(page.locator("#edit-promise")).to_contain_text("copied back")
    expect(page.locator("#edit-seams tbody tr")).to_have_count(2)
    page.wait_for_url(lambda url: "prompt=a+person+bows" in url and f"from={start:g}" in url)
    other = visit(page.url).page
    expect(other.locator("#edit-stage .ms-labels")).to_contain_text("a person bows")
    assert other.evaluate(IDS) == page.evaluate(IDS)
    assert seen.complaints == []


def test_another_kind_and_the_last_generation(seen: Visit) -> None:
    page = seen.page
    page.locator("#edit-kind label", has_text="Prefix").click()
    expect(page.locator("#edit-about")).to_contain_text("continuation")
    page.locator("#edit-last").click()
    page.wait_for_function(SHOWN, arg=1)
    page.wait_for_url(re.compile("motion=made_0_5"))
    page.locator("#edit-go").click()
    page.wait_for_function(SHOWN, arg=2)
    hatch = page.evaluate("() => MotionStage.get('edit').data.hatch")
    assert len(hatch) == 1 and hatch[0][0] == 0


def test_a_bad_span_gives_one_sentence_and_the_last_result_stays(seen: Visit) -> None:
    page = seen.page
    page.locator("#edit-from input").fill("3")
    page.locator("#edit-to input").fill("1")
    page.locator("#edit-go").click()
    expect(page.locator("#edit-message [role=alert]")).to_have_text(re.compile("^The span ends before it begins"))
    expect(page.locator("#edit-stage .ms-labels")).to_contain_text("After")


def test_the_span_is_set_by_keyboard(seen: Visit) -> None:
    page = seen.page
    start = page.locator("#edit-from input")
    start.focus()
    start.press("ArrowUp")
    handle = page.get_by_role("slider", name="Start of the span")
    expect(handle).to_be_visible()
    before = field(page, "from")
    handle.focus()
    handle.press("ArrowRight")
    page.wait_for_function(f"() => Number(document.querySelector('#edit-from input').value) > {before}")


def test_a_phone_never_scrolls_sideways(visit: Go, stand_in: str) -> None:
    page = visit(f"{stand_in}?room=edit", viewport=PHONE, has_touch=True, is_mobile=True).page
    page.wait_for_function(SHOWN, arg=2)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= PHONE["width"]


def test_a_long_upload_shows_its_window(seen: Visit, tmp_path: Path) -> None:
    path = tmp_path / "long.npz"
    np.savez(path, joints=drifting(500), fps=20.0)
    page = seen.page
    window = page.locator("#edit-start input[type=range]")
    expect(window).to_have_count(0)
    page.locator("#edit-upload").locator("xpath=..").locator("input[type=file]").set_input_files(path)
    expect(window).to_be_visible()
    page.wait_for_function(SHOWN, arg=1)
    expect(page.locator("#edit-stage .ms-time")).to_contain_text("9.80 s")
    before = page.evaluate(IDS)
    window.focus()
    window.press("End")
    page.wait_for_function(f"(old) => JSON.stringify(({IDS})()) !== JSON.stringify(old)", arg=before)
    expect(page).to_have_url(re.compile("motion=file.*start=15.2"))
