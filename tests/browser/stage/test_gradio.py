"""The stage as a Gradio component: payloads go in, commits come out, calls stay in the browser."""

import os
from collections.abc import Iterator

os.environ.setdefault("GRADIO_ANALYTICS_ENABLED", "False")

import gradio as gr
import pytest
from playwright.sync_api import Browser, Page, expect

from playground.figures import stage as scene
from playground.ui.stage.component import score_slot, stage_call, stage_component
from tests.browser.server import free_port
from tests.browser.stage.scenes import IDS, payload, walk

pytestmark = pytest.mark.browser


def heard(event: gr.EventData) -> str:
    """What Python got, as text."""
    return str(event._data)


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """A page with two stages in tabs, the first with its score in a place of its own."""
    with gr.Blocks() as page:
        with gr.Tab("One"):
            one = stage_component("one", payload())
            score_slot("one")
        with gr.Tab("Two"):
            stage_component("two", payload(), height=200)
        said = gr.Textbox(label="said")
        number = gr.Number(2, label="g")
        replace, refuse = gr.Button("replace"), gr.Button("refuse")
        for event in (one.select, one.span, one.pick_scale):
            event(heard, None, said)
        replace.click(lambda: scene.payload([scene.figure("new", "New", walk(20))]), None, one, show_progress="hidden")
        refuse.click(lambda: scene.message("error", "Not today."), None, one, show_progress="hidden")
        number.change(None, number, None, js=stage_call("one", "seek"))
    port = free_port()
    page.launch(server_port=port, prevent_thread_lock=True, quiet=True, ssr_mode=False)
    yield f"http://127.0.0.1:{port}/"
    page.close()


@pytest.fixture
def page(browser: Browser, address: str) -> Iterator[Page]:
    made = browser.new_page(viewport={"width": 1000, "height": 900}, reduced_motion="reduce")
    made.goto(address)
    made.wait_for_function("() => window.MotionStage?.get('one')?.data")
    yield made
    made.close()


def test_commits_reach_python(page: Page) -> None:
    box = page.locator(".ms-still").first.bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 20, box["y"] + 34)
    said = page.get_by_label("said")
    expect(said).to_have_value("{'selection': {'system': 'lgtok', 'scale': 1, 'position': 0}}")
    assert str(IDS[0][0]) in page.locator(".ms-spoken").first.inner_text()
    page.keyboard.press("3")
    expect(said).to_have_value("{'scale': 3}")
    page.keyboard.press("End")
    page.keyboard.press("[")
    expect(said).to_have_value("{'span': {'start': 47, 'stop': 48}}")


def test_payloads_replace_the_scene_and_errors_keep_it(page: Page) -> None:
    page.get_by_role("button", name="refuse").click()
    expect(page.get_by_role("alert").first).to_have_text("Not today.")
    expect(page.locator(".ms-label")).to_have_count(2)
    page.get_by_role("button", name="replace").click()
    expect(page.locator(".ms-label")).to_have_text(["New"])
    expect(page.locator(".ms-error").first).to_be_hidden()


def test_a_call_stays_in_the_browser(page: Page) -> None:
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.get_by_label("g", exact=True).fill("17")
    page.get_by_label("g", exact=True).press("Tab")
    page.wait_for_function("() => MotionStage.get('one').state.frame === 17")
    assert [url for url in asked if "queue" in url or "/api" in url] == []


def test_a_stage_in_the_second_tab_has_its_size_when_it_is_shown(page: Page) -> None:
    page.get_by_role("tab", name="Two").click()
    page.wait_for_function("() => MotionStage.get('two')?.figures.camera.width > 300")
    page.wait_for_function(
        "() => { const c = MotionStage.get('two').figures.canvas; const d = c.getContext('2d')"
        ".getImageData(0, 0, c.width, c.height).data; let n = 0;"
        " for (let i = 0; i < d.length; i += 4) n += d[i + 2] - d[i] > 100; return n > 500; }"
    )
    page.evaluate("() => document.activeElement.blur()")
    page.keyboard.press("End")  # keys that nobody else wants go to the stage in sight
    assert page.evaluate("() => ['one', 'two'].map(name => MotionStage.get(name).state.frame)") == [0, 47]
