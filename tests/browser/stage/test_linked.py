"""One selection for every view: what lights up in the other tracks, on the time axis and on the figures; the cursor."""

from collections.abc import Callable
from typing import Any

import pytest

from playground.figures.colors import TOKENS
from tests.browser.stage.scenes import CODES, FRAMES, IDS, SPANS, Shown, rich

pytestmark = pytest.mark.browser
Show = Callable[..., Shown]
FOCUS = TOKENS["focus"][0]
CHOSEN = {"system": "lgtok", "scale": 2, "position": 4}
LIT = (  # whether the moving canvas holds the focus colour near a place (track, level, frame)
    "const [track, level, frame, edge] = argument, { score } = stage;"
    "const row = score.laid.rows.find(r => r.track === track && r.level === level);"
    "const x = Math.round(frame / score.data.frames * score.width), ctx = score.moving.getContext('2d');"
    "const data = ctx.getImageData(Math.max(0, x - 3), Math.round(row.y) - 2, 7, row.height + 4).data;"
    "for (let i = 0; i < data.length; i += 4)"
    "  if (data[i + 3] > 200 && Math.hypot(data[i] - 11, data[i + 1] - 107, data[i + 2] - 203) < 30) return true;"
    "return false;"
)


@pytest.fixture
def linked(show: Show) -> Shown:
    return show(rich())


def test_a_chosen_token_lights_its_measured_frames_in_the_other_track(linked: Shown) -> None:
    linked.call("stage.select(argument)", CHOSEN)  # governs 30..46 as measured, 32..40 by its share
    linked.drawn()
    assert linked.call(LIT, [1, 1, 28])  # token 7 of MoMask's 8 holds frames 28 to 32
    assert not linked.call(LIT, [1, 1, 12])
    assert linked.call(LIT, [0, 0, int(SPANS[4][0])]) and linked.call(LIT, [0, 3, int(SPANS[4][1])])
    bar = linked.call(
        "const c = stage.timeline.canvas.getContext('2d');"
        "return [20, 31, 45].map(f => Array.from(c.getImageData(Math.round(stage.timeline.xOf(f)), 23, 1, 1).data))"
    )
    assert bar[0][:3] != bar[1][:3] and bar[1] == bar[2] == [11, 107, 203, 255]


def test_figures_wear_a_halo_while_the_clock_is_in_the_span(linked: Shown) -> None:
    linked.call("stage.select(argument); stage.seek(10)", CHOSEN)
    outside = linked.near(FOCUS, within=24).count
    linked.call("stage.seek(38)")
    assert linked.near(FOCUS, within=24).count > outside + 300


def test_hovering_lights_up_and_sends_nothing(linked: Shown) -> None:
    before = linked.picture()
    linked.page.mouse.move(*linked.cell(0, 1, 0))
    linked.drawn()
    assert linked.picture() != before and linked.events() == []
    tip = linked.page.get_by_role("tooltip").inner_text()
    assert "as measured" in tip and "0.00–1.50 s" in tip  # 30 frames; its share would be 8


def test_hovering_the_time_axis_lights_the_tokens_of_that_moment(linked: Shown) -> None:
    under = "return stage.score.moving.toDataURL()"
    linked.drawn()
    before = linked.call(under)
    box = linked.page.locator(".ms-ruler").bounding_box()
    assert box is not None
    linked.page.mouse.move(box["x"] + linked.call("return stage.timeline.xOf(36)"), box["y"] + 20)
    linked.drawn()
    assert linked.state("peek") == pytest.approx(36, abs=0.2) and linked.state("frame") == 0
    assert linked.call(under) != before and linked.page.locator(".ms-peek").inner_text() == "1.80 s"
    linked.page.mouse.move(400, 100)
    linked.drawn()
    assert linked.state("peek") is None and linked.call(under) == before


# ---------------------------------------------------------------- the cursor


def cursor(shown: Shown) -> dict[str, Any]:
    """What the score's one cell says."""
    return dict(
        shown.call(
            "const cell = document.querySelector('.ms-cell');"
            "return { text: cell.textContent, chosen: cell.getAttribute('aria-selected'),"
            " hover: stage.state.hover, probe: stage.state.probe,"
            " named: document.querySelector('.ms-scroll').getAttribute('aria-activedescendant') === cell.id }"
        )
    )


def into_the_score(shown: Shown) -> None:
    shown.page.get_by_role("slider", name="Time").focus()
    shown.page.keyboard.press("Tab")


def test_arrows_move_between_tokens_and_enter_chooses(linked: Shown) -> None:
    into_the_score(linked)
    assert cursor(linked)["hover"] == {"track": 0, "level": 0, "position": 0}
    places = []
    for key in ("ArrowRight", "ArrowRight", "ArrowDown", "End", "ArrowLeft", "Home", "ArrowUp"):
        linked.page.keyboard.press(key)
        found = cursor(linked)["hover"]
        places.append((found["track"], found["level"], found["position"]))
    # the second of two tokens holds frames 24 to 48, its middle is token 4 of 6
    assert places == [(0, 0, 1), (0, 0, 1), (0, 1, 4), (0, 1, 5), (0, 1, 4), (0, 1, 0), (0, 0, 0)]
    linked.page.keyboard.press("ArrowDown")
    told = cursor(linked)
    assert told["named"] and f"code {IDS[1][1]} of {CODES[1]}" in told["text"]
    linked.page.keyboard.press("Enter")
    chosen = {"system": "lgtok", "scale": 2, "position": told["hover"]["position"]}
    assert linked.events() == [["select", chosen]] and linked.state("frame") == 0
    linked.page.keyboard.press("Enter")
    assert linked.events()[1:] == [["select", None]]


def test_the_cursor_goes_from_track_to_track_and_into_the_heat_maps(linked: Shown) -> None:
    into_the_score(linked)
    linked.page.keyboard.press("PageDown")
    assert cursor(linked)["hover"] == {"track": 1, "level": 0, "position": 1}  # frame 12 of 32, of four tokens
    linked.page.keyboard.press("PageDown")
    assert cursor(linked)["probe"] == {"strip": 0, "row": 0, "frame": 12}
    linked.page.keyboard.press("ArrowRight")
    linked.page.keyboard.press("ArrowDown")
    told = cursor(linked)
    assert told["probe"] == {"strip": 0, "row": 1, "frame": 13} and told["hover"] is None
    assert "neck" in told["text"] and "mm" in told["text"] and "0.65 s" in told["text"]
    linked.page.keyboard.press("Enter")
    assert linked.state("frame") == 13
    linked.page.keyboard.press("PageUp")
    linked.page.keyboard.press("PageUp")
    assert cursor(linked)["hover"]["track"] == 0
    linked.page.keyboard.press("Shift+Tab")
    assert linked.state("hover") is None and linked.events() == []


def test_other_keys_still_belong_to_the_stage(linked: Shown) -> None:
    into_the_score(linked)
    linked.page.keyboard.press("2")
    assert linked.state("scale") == 2
    linked.page.keyboard.press("Space")
    linked.until("stage.state.playing")
    linked.page.keyboard.press("Space")
    linked.page.keyboard.press("Shift+ArrowRight")
    assert 0 < linked.state("frame") < FRAMES


def test_the_score_is_a_grid_with_a_name(linked: Shown) -> None:
    grid = linked.page.get_by_role("grid")
    name = grid.get_attribute("aria-label")
    assert name is not None and "LG-Tok: 2, 6, 12, 24" in name and "largest 250 mm at left wrist, 1.00 s" in name
    assert linked.page.locator(".ms-scroll [role=row] > [role=gridcell]").count() == 1
    assert linked.complaints == []
