"""Score and figures of the stage: what lies where, what a pointer does, what is drawn."""

from collections.abc import Callable

import numpy as np
import pytest

from playground.figures import stage as scene
from playground.figures.colors import ORIGINAL, system_color
from tests.browser.stage.scenes import CODES, IDS, Shown, walk

pytestmark = pytest.mark.browser
Show = Callable[..., Shown]
BLUE = system_color("lgtok").light


# ---------------------------------------------------------------- score


def test_hovering_a_token_tells_what_it_is_and_leaving_ends_it(shown: Shown) -> None:
    shown.page.mouse.move(*shown.cell(0, 2, 7))
    tip = shown.page.get_by_role("tooltip")
    assert tip.is_visible()
    text = tip.inner_text()
    assert f"code {IDS[2][7]} of {CODES[2]}" in text and "token 8 of 12" in text and "1.40–1.60 s" in text
    assert shown.state("hover") == {"track": 0, "level": 2, "position": 7}
    shown.page.mouse.move(640, 100)
    assert not tip.is_visible() and shown.state("hover") is None and shown.events() == []


def test_a_click_selects_a_second_click_lets_go(shown: Shown) -> None:
    place = shown.cell(0, 1, 4)
    shown.page.mouse.click(*place)
    shown.page.mouse.click(*shown.cell(1, 0, 2))
    shown.page.mouse.click(*shown.cell(1, 0, 2))
    assert shown.events() == [
        ["select", {"system": "lgtok", "scale": 2, "position": 4}],
        ["select", {"system": "momask-lite", "scale": 1, "position": 2}],
        ["select", None],
    ]


def test_a_row_still_to_come_is_told_and_cannot_be_selected(shown: Shown) -> None:
    heads = shown.page.locator(".ms-head").all_inner_texts()
    assert "44 tokens in 4 scales" in heads[0] and "4 tokens in 1 of 2 scales" in heads[1]
    box = shown.page.locator(".ms-still").bounding_box()
    y = shown.call("return stage.score.laid.rows.at(-1).y + 5")
    assert box is not None
    shown.page.mouse.click(box["x"] + 40, box["y"] + y)
    assert shown.events() == []


def test_cells_have_their_codes_colours_and_lie_where_their_time_is(shown: Shown) -> None:
    shown.drawn()
    palette = scene.code_colors(np.arange(CODES[1], dtype=float)[:, None])
    colours = shown.call(
        "const c = stage.score.still, x = c.getContext('2d'), w = stage.score.width;"
        "const row = stage.score.laid.rows[1];"
        "return [0, 1, 2, 3, 4, 5].map(p => Array.from("
        "x.getImageData(Math.round((p + 0.1) * w / 6), row.y + 4, 1, 1).data.slice(0, 3)))"
    )
    assert np.abs(np.array(colours) - palette[IDS[1]].astype(int)).max() <= 1
    end = shown.call(
        "const x = stage.score.still.getContext('2d'), w = stage.score.width, y = stage.score.laid.rows[4].y + 5;"
        "return [0.65, 0.69].map(s => x.getImageData(Math.round(s * w), y, 1, 1).data[3])"
    )
    assert end[0] == 255 and end[1] == 0  # MoMask's motion ends after two thirds


def test_choosing_a_scale_dims_the_others(shown: Shown) -> None:
    alpha = (
        "const x = stage.score.still.getContext('2d');"
        "return stage.score.laid.rows.slice(0, 4).map(r => x.getImageData(30, r.y + 4, 1, 1).data[3])"
    )
    for code, bright in (
        ("stage.setScale(null)", [0, 1, 2, 3]),
        ("stage.setScale(2)", [1]),
        ("stage.setScale(3, 'upto')", [0, 1, 2]),
        ("stage.setScale(3, 'only')", [2]),
        ("stage.setScale(3, 'without')", [0, 1, 3]),
    ):
        shown.call(code)
        shown.drawn()
        assert [n for n, value in enumerate(shown.call(alpha)) if value == 255] == bright


# ---------------------------------------------------------------- figures


def test_figures_stand_in_their_systems_colours(shown: Shown) -> None:
    assert shown.near(BLUE).count > 600 and shown.near(ORIGINAL.light).count > 600
    assert shown.page.locator(".ms-label").all_inner_texts() == ["Original", "LG-Tok\nMPJPE 31 mm"]
    canvas = shown.page.get_by_role("img", name="2 figures in sync: Original, LG-Tok (MPJPE 31 mm). 2.4 seconds.")
    assert canvas.is_visible()


def test_ghost_trail_overlay_and_orbit_change_the_picture(shown: Shown) -> None:
    shown.call("stage.seek(20)")
    seen = [shown.picture()]
    for name in ("Ghost", "Trail", "Overlay"):
        button = shown.page.get_by_role("button", name=name)
        button.click()
        assert button.get_attribute("aria-pressed") == "true"
        seen.append(shown.picture())
    shown.page.mouse.move(600, 150)
    shown.page.mouse.down()
    shown.page.mouse.move(700, 160, steps=3)
    shown.page.mouse.up()
    seen.append(shown.picture())
    assert all(before != after for before, after in zip(seen, seen[1:], strict=False))
    shown.page.get_by_role("button", name="Reset view").click()
    assert shown.picture() == seen[-2]


def test_every_figure_is_inside_the_picture(show: Show) -> None:
    crowd = [scene.figure(str(n), f"Figure {n}", walk(shake=0.1 * n), "mogo-lite") for n in range(6)]
    for size in ({"width": 1280, "height": 720}, {"width": 390, "height": 844}):
        made = show(scene.payload(crowd), viewport=size)
        found = made.near("#009e73", within=60)
        assert found.count > 1000 and found.left > 1 and found.top > 1
        assert found.right < found.width - 2 and found.bottom < found.height - 2
