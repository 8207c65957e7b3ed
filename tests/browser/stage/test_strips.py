"""Heat maps under the score, marked tokens, hatched frames, and the key that explains them."""

from collections.abc import Callable

import numpy as np
import pytest
from playwright.sync_api import Browser

from playground.figures.colors import TOKENS
from playground.motion.skeleton import HUMAN22
from playground.ui.stage.component import stage_frame
from tests.browser.stage.scenes import ATTENTION, DIFFERENCE, MARKED, WORDS, Shown, payload, rich

pytestmark = pytest.mark.browser
Show = Callable[..., Shown]
HEAT = (  # colours of a heat map's cells, [rows, frames, 3]
    "const { score } = stage, place = score.laid.strips[argument], strip = score.data.strips[argument];"
    "const ctx = score.still.getContext('2d');"
    "return strip.rows.map((_, row) => Array.from({ length: strip.frames }, (_, frame) => Array.from(ctx.getImageData("
    "  Math.round((frame + 0.5) / score.data.frames * score.width),"
    "  Math.floor(place.y + (row + 0.5) * place.step), 1, 1).data.slice(0, 3))))"
)


def lightness(colours: np.ndarray) -> np.ndarray:
    linear = np.where(colours <= 10.31, colours / 255 / 12.92, ((colours / 255 + 0.055) / 1.055) ** 2.4)
    return linear @ np.array([0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_more_is_always_further_along_one_ramp_of_lightness(show: Show, scheme: str) -> None:
    made = show(rich(), color_scheme=scheme)
    made.drawn()
    seen = lightness(np.array(made.call(HEAT, 1), float))
    order = np.argsort(ATTENTION.ravel())
    steps = np.diff(seen.ravel()[order]) * (-1 if scheme == "light" else 1)
    assert steps.min() > -0.01 and abs(seen.max() - seen.min()) > 0.4


def test_a_value_is_told_where_the_pointer_is_and_a_click_goes_there(show: Show) -> None:
    made = show(rich())
    row = [*made.call("return stage.data.strips[0].joints")].index(HUMAN22.index("l_wrist"))
    place = made.value(0, row, 20)
    made.page.mouse.move(*place)
    tip = made.page.get_by_role("tooltip").inner_text()
    assert "left wrist" in tip and "250 mm" in tip and "1.00 s" in tip
    assert made.state("hover") is None and made.events() == []
    made.page.mouse.click(*place)
    assert made.state("frame") == 20 and made.events() == []
    made.page.mouse.move(*made.value(1, 2, 33))
    text = made.page.get_by_role("tooltip").inner_text()
    assert WORDS[2] in text and f"{float(f'{ATTENTION[2, 33]:.3g}'):g}" in text


def test_pointing_at_a_joints_row_marks_that_part_of_every_figure(show: Show) -> None:
    made = show(rich())
    focus = TOKENS["focus"][0]
    before = made.near(focus, within=16).count
    made.page.mouse.move(*made.value(0, 8, 30))
    assert made.near(focus, within=16).count > before + 100
    made.page.mouse.move(*made.value(1, 1, 30))  # a word is no joint
    assert made.near(focus, within=16).count == before


def test_a_strip_has_a_name_a_unit_and_the_ends_of_its_ramp(show: Show) -> None:
    made = show(rich())
    heads = made.page.locator(".ms-head").all_inner_texts()
    assert "Difference" in heads[2] and "250 mm" in heads[2] and "Attention" in heads[3]
    assert made.page.get_by_role("img", name="Colours from 0 to 250 mm").is_visible()
    assert made.call("return stage.data.strips[0].max") == pytest.approx(1000 * DIFFERENCE.max())


def test_names_of_rows_have_room_left_of_the_clock(show: Show) -> None:
    for size in ({"width": 900, "height": 640}, {"width": 390, "height": 844}):
        made = show(rich(), viewport=size)
        gutter, left = made.call("return [stage.score.gutterWidth, stage.timeline.left]")
        assert gutter == left > 60
        assert made.page.evaluate("() => document.documentElement.scrollWidth") <= size["width"]


def test_marks_are_dark_shapes_on_their_cells_only(show: Show) -> None:
    made = show(rich())
    made.drawn()
    corner = made.call(
        "const { score } = stage, row = score.laid.rows[2], ctx = score.still.getContext('2d');"
        "return Array.from({ length: argument }, (_, p) => Array.from(ctx.getImageData("
        " Math.round((p + 1) * score.width / argument) - 4, Math.round(row.y) + 2, 1, 1).data.slice(0, 3)))",
        len(MARKED),
    )
    dark = lightness(np.array(corner, float)) < 0.03
    assert np.array_equal(dark, MARKED)
    made.page.mouse.move(*made.cell(0, 2, 1))
    assert "differs without the caption" in made.page.get_by_role("tooltip").inner_text()


def test_the_key_says_only_what_is_there(show: Show) -> None:
    key = show(rich()).page.locator(".ms-key").inner_text()
    assert "sure" in key and f"differs without the caption, {MARKED.sum()} of {len(MARKED)} tokens" in key
    assert "kept as it was" in key
    assert not show(payload()).page.locator(".ms-key").is_visible()
    partly = show(payload(hatch=[(2, 9)], hatched="stays")).page.locator(".ms-key")
    assert partly.inner_text().strip() == "stays"


def test_kept_frames_are_hatched_on_the_axis_and_on_the_tokens(show: Show) -> None:
    rows = (
        "const y = stage.score.laid.rows[0].y + 4, ctx = stage.score.still.getContext('2d'), w = stage.score.width;"
        "return argument.map(([a, b]) => { const x = Math.round(a / 48 * w), n = Math.round((b - a) / 48 * w);"
        " const data = ctx.getImageData(x, y, n, 1).data, seen = new Set();"
        " for (let i = 0; i < data.length; i += 4) seen.add(data.slice(i, i + 3).join()); return seen.size; })"
    )
    spans = [[1, 8], [14, 20], [34, 44]]
    with_hatch = show(rich())
    kept, free, also = with_hatch.call(rows, spans)
    assert kept > 1 and also > 1 and free == 1
    axis = (
        "const ctx = stage.timeline.canvas.getContext('2d');"
        "return argument.map(f => ctx.getImageData(Math.round(stage.timeline.xOf(f)), 19, 1, 1).data[3])"
    )
    assert [alpha > 0 for alpha in with_hatch.call(axis, [6, 20, 40])] == [True, False, True]


def test_a_notebooks_frame_is_as_tall_as_its_heat_maps_need(browser: Browser) -> None:
    page = browser.new_page()
    page.set_content(stage_frame(rich()))
    page.frame_locator("iframe").get_by_text("kept as it was").wait_for()
    tall = page.eval_on_selector("iframe", "e => [e.clientHeight, e.contentDocument.documentElement.scrollHeight]")
    assert tall[1] <= tall[0] < tall[1] + 60
    page.close()


def test_a_strip_that_does_not_fill_its_rows_is_refused_in_one_sentence(show: Show) -> None:
    made, broken = show(payload()), rich()
    broken["strips"][1]["rows"] = ["a", "b"] * 50 + ["c"]
    made.call("stage.setPayload(argument)", broken)
    assert "Attention" in made.page.get_by_role("alert").inner_text() and made.page.locator(".ms-label").count() == 2
