"""Links as visitors use them: what an address sets, what a visit writes into it, what a teacher hides, the script."""

import ast
import json
import re
from collections.abc import Callable
from urllib.parse import parse_qs, urlparse

import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import Visit

pytestmark = pytest.mark.browser
Go = Callable[..., Visit]
LINK = "?room=generate&prompt=a+person+waves&seed=7&seconds=3&system=lgtok&hide=seed"
PROMPT = 'somebody "jumps" & turns <b>'
CLIPBOARD = "() => navigator.clipboard.readText()"
TOKENS = "(name) => MotionStage.get(name).data.tracks[0].levels.map((level) => Array.from(level.ids ?? []))"
WHOLE_NOW = "MotionStage.get('generate').data.tracks[0].levels.every((level) => level.ids)"
WHOLE = "(name) => window.MotionStage?.get(name)?.data?.tracks[0]?.levels.every((level) => level.ids)"


def selected(page: Page, room: str) -> None:
    expect(page.locator(f"#room-{room}-button")).to_have_attribute("aria-selected", "true")


def finished(page: Page, room: str) -> list[list[int]]:
    """The tokens on the stage of Generate once a generation has ended."""
    expect(page.locator("#generate-stage .ms-badge")).to_contain_text("live")
    expect(page.locator("#generate-go")).to_be_enabled()
    page.wait_for_function(WHOLE, arg=room)
    return page.evaluate(TOKENS, room)


def dumped(tokens: list[list[int]]) -> str:
    """As JSON.stringify writes them."""
    return json.dumps(tokens, separators=(",", ":"))


def asked(page: Page) -> dict[str, str]:
    return {key: values[0] for key, values in parse_qs(urlparse(page.url).query).items()}


def test_a_link_sets_room_controls_result_and_hides(visit: Go, stand_in: str) -> None:
    seen = visit(stand_in + LINK)
    page = seen.page
    selected(page, "generate")
    expect(page.locator("#generate-prompt textarea")).to_have_value("a person waves")
    expect(page.locator("#generate-seconds input[type=number]")).to_have_value("3")
    expect(page.locator("#generate-seed input")).to_have_value("7")
    expect(page.locator("#generate-seed")).to_be_hidden()
    assert finished(page, "generate")
    expect(page.locator("#generate-stage .ms-time")).to_contain_text("3.00 s")
    assert seen.complaints == []


def test_a_copied_link_shows_the_same_in_a_fresh_profile(visit: Go, stand_in: str) -> None:
    seen = visit(stand_in, permissions=["clipboard-read", "clipboard-write"])
    page = seen.enter("Generate")
    finished(page, "generate")
    page.locator("#generate-go").click()  # the first press wakes the whole page, which may put its own words back once
    page.wait_for_function("() => MotionStage.get('generate').element.getAttribute('aria-busy') === 'true'")
    before = finished(page, "generate")
    page.locator("#generate-prompt textarea").fill(PROMPT)
    page.locator("#generate-seed input").fill("11")
    page.locator("#generate-go").click()
    changed = f"(old) => {WHOLE_NOW} && JSON.stringify(({TOKENS})('generate')) !== old"
    page.wait_for_function(changed, arg=dumped(before))
    tokens = finished(page, "generate")
    assert asked(page)["seed"] == "11" and asked(page)["prompt"] == PROMPT
    page.get_by_role("button", name="Copy link").click()
    expect(page.locator(".mtp-toast")).to_contain_text("Link copied")
    link = page.evaluate(CLIPBOARD)
    assert link == page.url
    other = visit(link).page
    expect(other.locator("#generate-prompt textarea")).to_have_value(PROMPT)
    finished(other, "generate")
    other.wait_for_function(f"(wish) => JSON.stringify(({TOKENS})('generate')) === wish", arg=dumped(tokens))


def test_the_address_follows_without_asking_the_server(visit: Go, stand_in: str) -> None:
    seen = visit(stand_in)
    page = seen.enter("Guidance")
    expect(page.locator("#guidance-stage .ms-labels")).to_contain_text("g = 4")
    assert asked(page) == {"room": "guidance"}
    seen.settle()
    mark = len(seen.requests)
    slider = page.locator("#guidance-g input[type=range]")
    slider.focus()
    for _ in range(5):
        slider.press("ArrowRight")
    page.wait_for_function("() => location.search.includes('g=2.25')")
    assert [url for url in seen.sent_since(mark) if "plotly" not in url] == []  # fetched once, whenever there is time


def test_a_selected_token_is_in_the_link_and_comes_back(visit: Go, stand_in: str) -> None:
    page = visit(stand_in).page
    page.wait_for_function(WHOLE, arg="tokenize")
    page.locator("#tokenize-score .ms-roll").click(position={"x": 400, "y": 60})
    page.wait_for_function("() => location.search.includes('selection=lgtok.')")
    chosen = page.evaluate("() => MotionStage.get('tokenize').state.selection")
    other = visit(page.url).page
    other.wait_for_function("() => window.MotionStage?.get('tokenize')?.state.selection")
    assert other.evaluate("() => MotionStage.get('tokenize').state.selection") == chosen


@pytest.mark.parametrize(
    "query",
    ["?room=nowhere&seed=x", "?room=generate&prompt=%00&seed=-5&hide=%3Cscript%3E,*,body", "?" + "a=1&" * 2_000,
     "?room=tokenize&motion=gone&scales=99&selection=lgtok.900.900",
     "?room=%22%3E%3Cimg%20src%3Dx%20onerror%3Dalert(1)%3E"],
)  # fmt: skip
def test_a_hostile_link_shows_a_working_page(visit: Go, stand_in: str, query: str) -> None:
    seen = visit(stand_in + query)
    page = seen.page
    alerts: list[str] = []
    page.on("dialog", lambda dialog: alerts.append(dialog.message) or dialog.dismiss())
    room = "generate" if "room=generate" in query else "tokenize"
    selected(page, room)
    page.wait_for_function(WHOLE, arg=room)
    expect(page.get_by_role("button", name="Copy link")).to_be_visible()
    expect(page.locator("#mtp-rooms")).to_be_visible()
    seen.settle()
    assert alerts == [] and seen.complaints == []


@pytest.mark.parametrize("room", ["Tokenize", "Embedding map", "Codebooks", "Generate", "Guidance"])
def test_copy_as_python_in_every_room(visit: Go, stand_in: str, room: str) -> None:
    page = visit(stand_in, permissions=["clipboard-read", "clipboard-write"]).enter(room)
    page.get_by_role("button", name="Copy as Python").click()
    dialog = page.get_by_role("dialog", name="This room as Python")
    expect(dialog).to_contain_text("Copied.")
    code = page.evaluate(CLIPBOARD)
    ast.parse(code)
    assert "default_engine" in code or "read_bundle" in code
    page.keyboard.press("Escape")
    expect(dialog).to_be_hidden()


def test_the_script_says_what_the_address_says(visit: Go, stand_in: str) -> None:
    page = visit(stand_in + "?room=generate&prompt=a+b+c&seed=7&g=1.5").page
    finished(page, "generate")
    page.get_by_role("button", name="Copy as Python").click()
    code = page.get_by_role("dialog", name="This room as Python").locator("code").inner_text()
    assert '"a b c"' in code and re.search(r"seed=7\b", code) and re.search(r"guidance=1\.5\b", code)


def test_in_learn_there_is_nothing_to_copy(visit: Go, stand_in: str) -> None:
    page = visit(stand_in).enter("Learn")
    page.get_by_role("button", name="Copy as Python").click()
    expect(page.locator(".mtp-toast")).to_contain_text("nothing to copy here")


def test_hide_takes_controls_and_parts_away(visit: Go, stand_in: str) -> None:
    page = visit(stand_in + "?room=tokenize&hide=caption,export,learn").page
    selected(page, "tokenize")
    expect(page.locator("#tokenize-caption")).to_be_hidden()
    expect(page.locator("[data-part=export]")).to_be_hidden()
    expect(page.locator("#room-learn-button")).to_be_hidden()
    expect(page.locator("#tokenize-scales")).to_be_visible()
    page.get_by_role("tab", name="Guidance", exact=True).click()
    expect(page.locator("#guidance-caption")).to_be_hidden()
    assert asked(page) == {"room": "guidance", "hide": "caption,export,learn"}
