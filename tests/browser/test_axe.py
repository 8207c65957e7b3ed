"""axe on every room, light and dark, at a desk and on a phone: no serious or critical fault."""

from collections.abc import Callable
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect

from tests.browser.conftest import DESKTOP, PHONE, Visit, visiting

pytestmark = pytest.mark.browser
Go = Callable[..., Visit]
GRAVE = {"serious", "critical"}
CALM = """() => !document.querySelector('.is-loading, [aria-busy=true]')
  && document.getAnimations().every((one) => one.playState !== 'running')"""
ROOMS = {  # room -> what stands there once it is whole
    "Tokenize": "#tokenize-energy .plotly", "Embedding map": "#embedding-map .plotly",
    "Codebooks": "#codebooks-summary .plotly", "Generate": "#generate-score .ms-heads",
    "Guidance": "#guidance-sweep .plotly", "Edit": "#edit-score .ms-heads", "Compare": "#compare-take table",
    "Endless": "#endless-score .ms-ribbon li",
    "Learn": "#learn-page article",
}  # fmt: skip
DEVICES: dict[str, dict[str, Any]] = {
    "desktop": {"viewport": DESKTOP}, "phone": {"viewport": PHONE, "has_touch": True, "is_mobile": True},
}  # fmt: skip


def faults(page: Page) -> list[str]:
    """What axe finds grave, a line each: rule, element, what is wrong."""
    page.wait_for_function(CALM)
    found = Axe().run(page).response["violations"]
    return [
        f"{one['id']}: {node['html'][:160]} | {' '.join((node.get('failureSummary') or '').split())[:260]}"
        for one in found
        if one["impact"] in GRAVE
        for node in one["nodes"]
    ]


@pytest.fixture(scope="module", params=[(device, scheme) for device in DEVICES for scheme in ("light", "dark")],
                ids=lambda pair: "-".join(pair))  # fmt: skip
def page(request: pytest.FixtureRequest, browser: Browser, stand_in: str) -> Any:
    """One page for all rooms of a device and a colour scheme."""
    device, scheme = request.param
    with visiting(browser) as go:
        yield go(stand_in, color_scheme=scheme, **DEVICES[device]).page


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_has_no_grave_fault(page: Page, room: str) -> None:
    page.get_by_role("tab", name=room, exact=True).click()
    expect(page.locator(ROOMS[room]).first).to_be_visible()
    folded = page.locator(f"#room-{room.lower().replace(' ', '-')} button.label-wrap:not(.open):visible")
    while folded.count():
        count = folded.count()
        folded.first.click()
        expect(folded).to_have_count(count - 1)
    assert faults(page) == []


SELECT = """(name) => MotionStage.get(name).store.commit('select',
  { selection: { system: 'lgtok', scale: 3, position: 1 } })"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_cards_and_dialogs_have_no_grave_fault(visit: Go, stand_in: str, scheme: str) -> None:
    page = visit(stand_in, color_scheme=scheme).page
    page.wait_for_function("() => window.MotionStage?.get('tokenize')?.data")
    page.locator("#tokenize-ask").click()
    expect(page.locator(".mtp-language")).to_be_visible()
    assert faults(page) == []
    page.evaluate(SELECT, "tokenize")
    page.locator("#tokenize-card [data-do=replace]").first.click()
    expect(page.locator("#tokenize-card .mtp-outcome")).to_be_visible()
    assert faults(page) == []
    page.get_by_role("tab", name="Generate", exact=True).click()
    page.wait_for_function("() => window.MotionStage?.get('generate')?.data")
    page.evaluate(SELECT, "generate")
    page.locator("#generate-token [data-do=code]:enabled").first.click()
    expect(page.locator("#generate-message")).to_contain_text("set to code")
    assert faults(page) == []
    page.get_by_role("button", name="Back to the prompt").click()
    expect(page.locator("#generate-earlier button").first).to_be_visible()
    page.get_by_role("button", name="Export").click()
    expect(page.locator(".mtp-export-rows")).to_be_visible()
    assert faults(page) == []
    page.keyboard.press("Escape")
    page.get_by_role("button", name="Copy as Python").click()
    expect(page.get_by_role("dialog", name="This room as Python")).to_contain_text("engine.generate")
    assert faults(page) == []
