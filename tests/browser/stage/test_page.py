"""The stage in its surroundings: dark, dense, hidden, small, empty, failing, in a notebook, in an app."""

import json
from collections.abc import Callable

import pytest
from playwright.sync_api import Browser

from playground.figures import stage as scene
from playground.figures.colors import TOKENS, contrast, system_color
from playground.ui.stage.component import stage_frame
from tests.browser.stage.scenes import FRAMES, RNG, Shown, payload, walk

pytestmark = pytest.mark.browser
Show = Callable[..., Shown]
BLUE = system_color("lgtok").light


# ---------------------------------------------------------------- surroundings


def test_dark_mode_is_dark_and_its_words_can_be_read(show: Show) -> None:
    made = show(color_scheme="dark")
    assert made.corner() == [int(TOKENS["surface"][1][i : i + 2], 16) for i in (1, 3, 5)]
    for selector in (
        ".ms-label strong",
        ".ms-label span",
        ".ms-head strong",
        ".ms-head span",
        ".ms-total",
        ".ms-button",
    ):
        for color in made.page.eval_on_selector_all(selector, "all => all.map(e => getComputedStyle(e).color)"):
            rgb = [int(value) for value in color[4:-1].split(",")]
            text = "#" + "".join(f"{value:02x}" for value in rgb)
            if text != TOKENS["on-ink"][1]:
                assert contrast(text, TOKENS["surface"][1]) >= 4.5, selector


def test_switching_to_dark_redraws_without_a_reload(shown: Shown) -> None:
    light = shown.corner()
    shown.page.evaluate("() => document.documentElement.classList.add('dark')")
    shown.drawn()
    assert light == [255, 255, 255] and shown.corner() == [28, 29, 32]


def test_a_dense_screen_gets_dense_canvases(show: Show) -> None:
    made = show(device_scale_factor=2)
    sizes = made.call(
        "return [...document.querySelectorAll('canvas')].map(c => [c.width, c.getBoundingClientRect().width])"
    )
    assert len(sizes) >= 4 and all(abs(pixels - 2 * width) <= 2 for pixels, width in sizes if width)


def test_a_stage_in_a_hidden_tab_rests_and_appears_whole(shown: Shown) -> None:
    shown.page.evaluate("() => { document.getElementById('stage').style.display = 'none'; }")
    shown.call("stage.play()")
    shown.drawn()
    frame = shown.state("frame")
    shown.drawn()
    assert shown.state("frame") == frame
    shown.page.evaluate("() => { document.getElementById('stage').style.display = ''; }")
    shown.until(f"stage.state.frame > {frame}")
    assert shown.near(BLUE).count > 600


def test_a_phone_scrolls_the_score_inside_itself_and_never_the_page(show: Show) -> None:
    wide = scene.level(RNG.integers(0, 9, 49), 9)
    block = scene.payload([scene.figure("a", "A", walk())], [scene.track("mosa", "MoSa", FRAMES, [wide])])
    made = show(block, viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    assert made.page.evaluate("() => document.documentElement.scrollWidth") == 390
    inside = made.page.eval_on_selector(".ms-scroll", "e => [e.scrollWidth, e.clientWidth, e.tabIndex]")
    assert inside[0] > inside[1] and inside[2] == 0
    made.call("stage.play(); stage.store.set({ frame: 45 })")
    made.until("document.querySelector('.ms-scroll').scrollLeft > 50")
    box = made.page.locator(".ms-still").bounding_box()
    assert box is not None
    made.call("stage.pause()")
    made.page.touchscreen.tap(200, box["y"] + 34)
    assert [name for name, _ in made.events()] == ["select"]


# ---------------------------------------------------------------- states


def test_loading_and_error_keep_the_last_result_and_a_new_one_ends_both(shown: Shown) -> None:
    before = shown.picture()
    shown.call("stage.setPayload(argument)", json.dumps(scene.message("loading", "Tokenizing")))
    section = shown.page.locator("section.ms")
    assert section.get_attribute("aria-busy") == "true" and shown.page.get_by_text("Tokenizing").is_visible()
    assert shown.picture() == before
    shown.call("stage.setPayload(argument)", scene.message("error", "The prompt is empty."))
    assert shown.page.get_by_role("alert").inner_text() == "The prompt is empty." and shown.picture() == before
    shown.call("stage.setPayload(argument)", payload(badge=scene.badge("live", 0.214)))
    assert not shown.page.get_by_role("alert").is_visible() and section.get_attribute("aria-busy") == "false"
    assert shown.page.locator(".ms-badge").inner_text() == "live, 0.21 s"


@pytest.mark.parametrize("bad", ["{", "[]", "7", '{"version": 9}', '{"version": 1, "figures": [], "skeleton": null}'])
def test_what_is_no_payload_becomes_one_sentence(shown: Shown, bad: str) -> None:
    shown.call("stage.setPayload(argument)", bad)
    assert "cannot be shown" in shown.page.get_by_role("alert").inner_text()
    assert shown.page.locator(".ms-label").count() == 2


def test_the_empty_stage_says_what_to_do(shown: Shown) -> None:
    shown.call("stage.setPayload(null)")
    assert shown.page.get_by_text("Choose a motion").is_visible()
    assert shown.near(BLUE).count == 0
    assert shown.page.get_by_role("button", name="Play").is_disabled()
    shown.page.keyboard.press("Space")
    assert shown.state("playing") is False


def test_one_more_scale_goes_on_where_it_was_another_motion_starts_anew(shown: Shown) -> None:
    shown.call("stage.seek(21); stage.select({ system: 'lgtok', scale: 2, position: 3 })")
    shown.call("stage.setPayload(argument)", payload())
    assert shown.state("frame") == 21 and shown.state("selection") is not None
    other = scene.payload([scene.figure("original", "Original", walk(30))])
    shown.call("stage.setPayload(argument)", other)
    assert shown.state("frame") == 0 and shown.state("selection") is None
    assert not shown.page.locator(".ms-tracks").is_visible()
    assert shown.page.get_by_role("button", name="Overlay").count() == 0


# ---------------------------------------------------------------- places


def test_the_score_can_stand_elsewhere(shown: Shown) -> None:
    shown.page.evaluate(
        "() => { const place = document.createElement('div'); place.id = 'below'; document.body.append(place);"
        " MotionStage.adoptScore('page', place); }"
    )
    shown.drawn()
    assert (
        shown.page.locator("#below .ms-tracks").is_visible() and shown.page.locator("section .ms-tracks").count() == 0
    )
    shown.page.mouse.click(*shown.cell(0, 1, 2))
    assert shown.events() == [["select", {"system": "lgtok", "scale": 2, "position": 2}]]


def test_in_a_notebook_it_lives_in_a_frame(browser: Browser) -> None:
    page = browser.new_page()
    page.set_content(f"<h1>Notebook</h1>{stage_frame(payload(), 'A walk & <its> tokens')}")
    inside = page.frame_locator("iframe")
    inside.get_by_role("button", name="Pause").click()
    inside.get_by_role("button", name="Play").wait_for()
    tall = page.eval_on_selector("iframe", "e => [e.clientHeight, e.contentDocument.documentElement.scrollHeight]")
    assert tall[1] <= tall[0] < tall[1] + 60
    page.close()


def test_a_name_with_markup_stays_text(show: Show) -> None:
    name = "</script><img src=x onerror=alert(1)>"
    made = show(scene.payload([scene.figure("a", name, walk(), caption="<b>x</b>")]))
    assert made.page.locator(".ms-label").inner_text() == f"{name}\n<b>x</b>"
    assert made.page.locator("img[src]").count() == 0 and made.complaints == []
