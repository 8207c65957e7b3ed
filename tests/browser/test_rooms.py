"""The rooms as a visitor uses them, on the engine's stand-in: first sight, what controls do, what errors do."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.conftest import Visit
from tests.conftest import drifting

pytestmark = pytest.mark.browser
Go = Callable[..., Visit]
TOKEN_IDS = "() => Array.from(MotionStage.get('tokenize').data.tracks[0].levels[0].ids)"
WATCH_LABELS = """() => {
  window.toldLabels = [];
  const labels = document.querySelector('#generate-stage .ms-labels');
  const watch = new MutationObserver(() => window.toldLabels.push(labels.innerText));
  watch.observe(labels, { childList: true, subtree: true });
}"""


@pytest.fixture
def seen(visit: Go, stand_in: str) -> Visit:
    return visit(stand_in)


def error_in(page: Page, room: str) -> Locator:
    """The error sentence of a room."""
    return page.locator(f"#{room}-message [role=alert]")


def facts(page: Page, room: str) -> Locator:
    return page.locator(f"#{room}-facts")


def choose(page: Page, control: str, place: int) -> str:
    """Pick the entry number `place` of a menu; returns what it says."""
    page.locator(f"#{control} input").click()
    entry = page.get_by_role("option").nth(place)
    words = entry.inner_text().strip()
    entry.click()
    return words


def figure_text(page: Page, room: str) -> str:
    return page.locator(f"#{room}-stage .ms-labels").inner_text()


def test_the_page_opens_with_a_finished_example(seen: Visit) -> None:
    page = seen.page
    expect(page.locator("#tokenize-stage .ms-labels")).to_contain_text("Original")
    expect(page.locator("#tokenize-stage .ms-labels")).to_contain_text("MPJPE")
    expect(page.locator("#tokenize-score .ms-heads")).to_contain_text("116 tokens in 10 scales")
    expect(facts(page, "tokenize")).to_contain_text(re.compile(r"\d mm\s*MPJPE"))
    expect(page.locator("#tokenize-energy .bars path")).to_have_count(11)


def test_another_example_replaces_motion_caption_and_numbers(seen: Visit) -> None:
    page = seen.page
    before, caption = (
        facts(page, "tokenize").inner_text(),
        page.locator("#tokenize-caption textarea, #tokenize-caption input"),
    )
    was = caption.input_value()
    choose(page, "tokenize-example", 2)
    expect(caption).not_to_have_value(was)
    expect(facts(page, "tokenize")).not_to_have_text(before)


def test_fewer_scales_give_a_larger_error(seen: Visit) -> None:
    page = seen.page
    expect(facts(page, "tokenize")).to_contain_text("116 tokens")
    slider = page.locator("#tokenize-scales input[type=range]")
    full = millimetres(page)
    slider.focus()
    for _ in range(7):
        slider.press("ArrowLeft")
    expect(facts(page, "tokenize")).to_contain_text(re.compile(r"\b6 tokens"))
    assert millimetres(page) > full


def test_a_click_on_a_bar_stops_at_its_scale(seen: Visit) -> None:
    page = seen.page
    bars = page.locator("#tokenize-energy .bars path")
    expect(bars).to_have_count(11)
    page.locator("#tokenize-energy .plotly").scroll_into_view_if_needed()
    bars.nth(2).click(force=True)
    expect(facts(page, "tokenize")).to_contain_text(re.compile(r"\b3 tokens"))
    expect(page.locator("#tokenize-scales input[type=number]")).to_have_value("2")


def test_a_bvh_file_can_be_uploaded(seen: Visit, tmp_path: Path) -> None:
    from playground.motion.formats import write_motion
    from playground.motion.synthetic import corpus

    path = tmp_path / "mine.bvh"
    write_motion(corpus(1, seed=9)[0].motion, path)
    page = seen.page
    was, told = figure_text(page, "tokenize"), facts(page, "tokenize").inner_text()
    page.locator("#tokenize-upload").locator("xpath=..").locator("input[type=file]").set_input_files(path)
    expect(page.locator("#tokenize-message")).to_contain_text("mine.bvh")
    expect(page.locator("#tokenize-stage .ms-labels")).not_to_have_text(was)
    expect(facts(page, "tokenize")).not_to_have_text(told, use_inner_text=True)
    own = facts(page, "tokenize").inner_text()
    choose(page, "tokenize-example", 2)
    expect(facts(page, "tokenize")).not_to_have_text(own)
    assert choose(page, "tokenize-example", 0).endswith("mine.bvh · yours")  # it stays in the menu
    expect(facts(page, "tokenize")).to_have_text(own, use_inner_text=True)


@pytest.mark.parametrize("name", ["binary.bvh", "pickled.npy", "bomb.npz", "short.npz", "empty.bvh", "notes.txt"])
def test_a_bad_upload_gives_one_sentence_and_the_last_result_stays(seen: Visit, tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    bad_file(path)
    page = seen.page
    before = facts(page, "tokenize").inner_text()
    page.locator("#tokenize-upload").locator("xpath=..").locator("input[type=file]").set_input_files(path)
    expect(error_in(page, "tokenize").or_(page.locator(".toast-body")).first).to_be_visible()
    assert facts(page, "tokenize").inner_text() == before
    expect(page.locator("#tokenize-stage .ms-labels")).to_contain_text("MPJPE")
    choose(page, "tokenize-example", 1)
    expect(facts(page, "tokenize")).not_to_have_text(before)


def bad_file(path: Path) -> None:
    if path.name == "pickled.npy":
        np.save(path, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    elif path.name == "bomb.npz":
        np.savez_compressed(path, joints=np.zeros((40_000, 22, 3), np.float32))
    elif path.name == "short.npz":
        np.savez(path, joints=np.zeros((2, 22, 3), np.float32))
    elif path.name == "empty.bvh":
        path.write_bytes(b"")
    else:
        path.write_bytes(bytes(range(256)) * 20)


def millimetres(page: Page) -> float:
    found = re.search(r"([\d.]+)\s*mm", facts(page, "tokenize").inner_text())
    assert found is not None
    return float(found.group(1))


@pytest.mark.parametrize("prompt", ["", " \n ", "word " * 2_000])
def test_a_bad_prompt_gives_one_sentence_and_the_last_result_stays(seen: Visit, prompt: str) -> None:
    page = seen.enter("Generate")
    expect(page.locator("#generate-stage .ms-labels")).to_contain_text("Generated")
    before = facts(page, "generate").inner_text()
    seen.settle()
    box = page.locator("#generate-prompt textarea")
    seen.wake("#generate-go")
    before = facts(page, "generate").inner_text()
    box.fill(prompt)
    expect(box).to_have_value(prompt)
    page.locator("#generate-go").click()
    expect(error_in(page, "generate")).to_have_text(re.compile(r"^The prompt [^.]*\.?[^.]*$"))
    assert facts(page, "generate").inner_text() == before
    expect(page.locator("#generate-go")).to_be_enabled()


def test_a_motion_appears_scale_by_scale(seen: Visit) -> None:
    page = seen.enter("Generate")
    expect(page.locator("#generate-score .ms-heads")).to_contain_text("116 tokens in 10 scales")
    seen.wake("#generate-go")
    page.evaluate(WATCH_LABELS)
    page.locator("#generate-prompt textarea").fill("a person sits down")
    page.locator("#generate-go").click()
    label = page.locator("#generate-stage .ms-labels")
    expect(label).to_contain_text("of 10")
    expect(page.locator("#generate-stop")).to_be_enabled()
    expect(label).not_to_contain_text("of 10")
    told = " ".join(page.evaluate("() => window.toldLabels"))
    scales = [int(number) for number in re.findall(r"scale (\d+) of 10", told)]
    assert len(set(scales)) >= 3 and scales == sorted(scales)
    expect(facts(page, "generate")).to_contain_text("116 tokens")
    expect(page.locator("#generate-stop")).to_be_disabled()


def test_a_generation_can_be_stopped_and_keeps_what_it_has(seen: Visit) -> None:
    page = seen.enter("Generate")
    page.locator("#generate-go").click()
    label = page.locator("#generate-stage .ms-labels")
    expect(label).to_contain_text("of 10")
    page.locator("#generate-stop").click()
    expect(page.locator("#generate-message")).to_contain_text(re.compile(r"Stopped.*after scale \d of 10"))
    expect(page.locator("#generate-go")).to_be_enabled()
    expect(label).to_contain_text("of 10")
    page.locator("#generate-go").click()
    expect(facts(page, "generate")).to_contain_text("116 tokens")


def test_the_guidance_slider_moves_the_figure_and_asks_nobody(seen: Visit) -> None:
    page = seen.enter("Guidance")
    for words in ("g = 0", "g = 1", "g = 2", "g = 3", "g = 4"):
        expect(page.locator("#guidance-stage .ms-labels")).to_contain_text(words)
    joints = "() => Array.from(MotionStage.get('guidance').joints('live')).slice(0, 3000)"
    page.wait_for_function("() => window.MotionStage?.get('guidance')?.joints('live') && window.Plotly")
    seen.settle()
    before, mark = np.array(page.evaluate(joints)), len(seen.requests)
    slider = page.locator("#guidance-g input[type=range]")
    slider.focus()
    for _ in range(20):
        slider.press("ArrowRight")
    page.wait_for_function("() => Math.abs(MotionStage.get('guidance').state.guidance - 3) < 1e-6")
    seen.settle()
    moved = np.abs(np.array(page.evaluate(joints)) - before).max()
    assert moved > 1e-3
    assert seen.sent_since(mark) == []


def test_a_click_on_the_map_puts_that_motion_on_the_stage(seen: Visit) -> None:
    page = seen.enter("Embedding map")
    points = page.locator("#embedding-map .scatterlayer .trace .point")
    expect(points.first).to_be_visible()
    label = page.locator("#embedding-stage .ms-labels")
    was = label.inner_text()
    other = "a person does walk" if "walk" not in was else "a person does wave"
    group = page.locator("#embedding-map .scatterlayer .trace").nth(0 if "walk" in other else 1)
    group.locator(".point").first.click(force=True)
    expect(label).to_contain_text(re.compile(other, re.IGNORECASE))
    expect(page.locator("#embedding-facts")).to_contain_text("40 mm")


def test_neighbours_can_be_walked_by_keyboard(seen: Visit) -> None:
    page = seen.enter("Embedding map")
    choices = page.locator("#embedding-near input[type=radio]")
    for _ in range(2):
        expect(choices).to_have_count(4)
        offered = choices.first.get_attribute("value")
        choices.first.focus()
        choices.first.press("Space")
        expect(page.locator("#embedding-near input[type=radio]:checked")).to_have_count(0)
        expect(page.locator(f"#embedding-near input[value='{offered}']")).to_have_count(0)
    expect(page.locator("#embedding-message [role=alert]")).to_have_count(0)
    expect(page.locator(".toast-body")).to_have_count(0)


def test_a_long_upload_shows_its_window(seen: Visit, tmp_path: Path) -> None:
    path = tmp_path / "long.npz"
    np.savez(path, joints=drifting(500), fps=20.0)
    page = seen.page
    window = page.locator("#tokenize-start input[type=range]")
    expect(window).to_have_count(0)
    page.locator("#tokenize-upload").locator("xpath=..").locator("input[type=file]").set_input_files(path)
    expect(window).to_be_visible()
    assert float(window.get_attribute("max") or 0) == pytest.approx((500 - 197) / 20, abs=0.06)
    expect(page.locator("#tokenize-stage .ms-time")).to_contain_text("9.80 s")
    before = page.locator("#tokenize-score").evaluate(TOKEN_IDS)
    window.focus()
    window.press("End")
    page.wait_for_function(f"(old) => JSON.stringify(({TOKEN_IDS})()) !== JSON.stringify(old)", arg=before)
