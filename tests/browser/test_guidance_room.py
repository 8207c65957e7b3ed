"""The sweep in Guidance as a visitor uses it: the slider's g marked on the curves, a click takes g there."""

from collections.abc import Callable

import pytest
from playwright.sync_api import expect

from tests.browser.conftest import Visit

pytestmark = pytest.mark.browser
Go = Callable[..., Visit]
MARKED = "() => [...document.querySelectorAll('#guidance-sweep .mtp-now')].map((line) => Number(line.dataset.g))"


def test_a_click_on_the_curve_takes_the_figure_there(visit: Go, stand_in: str) -> None:
    seen = visit(f"{stand_in}?room=guidance&g=1")
    page = seen.page
    expect(page.locator("#guidance-sweep .mtp-chart")).to_have_attribute("data-drawn", "1")
    expect(page.locator("#guidance-measured")).to_contain_text("40 test clips of made up")
    page.wait_for_function(f"() => ({MARKED})().join() === '1,1'")
    panel = page.locator("#guidance-sweep .nsewdrag").first.bounding_box()
    assert panel is not None
    page.mouse.click(panel["x"] + 0.75 * panel["width"], panel["y"] + 0.5 * panel["height"])
    page.wait_for_function(f"() => ({MARKED})()[0] > 1.5")
    g, other = page.evaluate(MARKED)
    assert g == other == float(page.locator("#guidance-g input[type=range]").input_value())
    assert page.evaluate("() => MotionStage.get('guidance').state.guidance") == pytest.approx(g)
    page.wait_for_url(lambda url: f"g={g:g}" in url)
    assert seen.complaints == []
