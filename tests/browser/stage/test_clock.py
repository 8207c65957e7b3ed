"""The recovery's twin, the clock and the keyboard of the stage."""

from collections.abc import Callable

import numpy as np
import pytest

from tests.browser.stage.scenes import CODES, FRAMES, IDS, Shown, expected, guided

pytestmark = pytest.mark.browser
Show = Callable[..., Shown]


# ---------------------------------------------------------------- recovery of joints in the browser


@pytest.mark.parametrize("g", [0.0, 2.0, 4.0, -0.5])
def test_the_browser_recovers_the_same_joints_as_python(show: Show, g: float) -> None:
    block, parts = guided()
    made = show(block)
    made.call("stage.setGuidance(argument)", g)
    joints = np.array(made.call("return Array.from(stage.joints('live'))"), np.float64).reshape(FRAMES, 22, 3)
    assert np.abs(joints - expected(parts, g)).max() < 1e-4
    assert np.ptp(joints[:, 0, [0, 2]], axis=0).max() > 0.3  # it really walks
    fixed = np.array(made.call("return Array.from(stage.joints('fixed'))"), np.float64).reshape(FRAMES, 22, 3)
    assert np.abs(fixed - expected(parts, 4.0)).max() < 1e-4


def test_the_live_figure_starts_at_the_payloads_guidance_and_moving_it_redraws(show: Show) -> None:
    block, parts = guided()
    made = show(block)
    joints = np.array(made.call("return Array.from(stage.joints('live'))")).reshape(FRAMES, 22, 3)
    assert made.state("guidance") == 2.0 and np.abs(joints - expected(parts, 2.0)).max() < 1e-4
    before = made.picture()
    made.call("stage.setGuidance('3.5')")
    assert made.picture() != before
    made.call("stage.setGuidance('words')")
    assert made.state("guidance") == 3.5


# ---------------------------------------------------------------- clock


def test_it_plays_by_itself_stops_and_goes_on(show: Show) -> None:
    made = show(playing=True)
    made.until("stage.state.frame > 3")
    made.page.get_by_role("button", name="Pause").click()
    stopped = made.state("frame")
    made.drawn()
    assert made.state("frame") == stopped and not made.state("playing")
    made.page.keyboard.press("Space")  # the button has the focus: it is pressed, once
    made.until(f"stage.state.frame !== {stopped}")
    assert made.complaints == []


def test_with_reduced_motion_it_waits_to_be_asked(show: Show) -> None:
    made = show(playing=True, reduced_motion="reduce")
    assert made.state("playing") is False
    made.page.keyboard.press("Space")
    made.until("stage.state.frame > 1")


def test_the_end_wraps_round_or_stops(shown: Shown) -> None:
    shown.call("stage.seek(46); stage.store.advance(0.2)")
    assert shown.state("frame") == pytest.approx(2.0)
    shown.page.get_by_role("button", name="Loop").click()
    shown.call("stage.seek(46); stage.store.set({ playing: true }); stage.store.advance(0.2)")
    assert shown.state("frame") == FRAMES - 1 and shown.state("playing") is False
    shown.page.get_by_role("button", name="2×").click()
    shown.call("stage.seek(0); stage.store.advance(0.1)")
    assert shown.state("frame") == pytest.approx(4.0)


def test_a_span_plays_round_by_itself(shown: Shown) -> None:
    shown.call("stage.selectSpan([10, 14]); stage.seek(13); stage.store.advance(0.1)")
    assert shown.state("frame") == pytest.approx(11.0)


def test_dragging_the_time_axis_scrubs_and_tells_python_nothing(shown: Shown) -> None:
    box = shown.page.locator(".ms-ruler").bounding_box()
    assert box is not None
    left, right = (shown.call(f"return stage.timeline.xOf({frame})") + box["x"] for frame in (12, 36))
    shown.page.mouse.move(left, box["y"] + 20)
    shown.page.mouse.down()
    assert shown.state("frame") == pytest.approx(12, abs=0.1)
    before = shown.picture()
    shown.page.mouse.move(right, box["y"] + 20, steps=4)
    assert shown.state("frame") == pytest.approx(36, abs=0.1)
    assert shown.picture() != before
    shown.page.mouse.up()
    assert shown.events() == [] and shown.state("span") is None
    slider = shown.page.get_by_role("slider", name="Time")
    assert slider.get_attribute("aria-valuenow") == "1.80" and slider.get_attribute("aria-valuemax") == "2.40"


def test_alt_dragging_chooses_a_span_once_on_release(shown: Shown) -> None:
    box = shown.page.locator(".ms-ruler").bounding_box()
    assert box is not None
    left, right = (shown.call(f"return stage.timeline.xOf({frame})") + box["x"] for frame in (10.4, 20.6))
    shown.page.keyboard.down("Alt")
    shown.page.mouse.move(right, box["y"] + 20)
    shown.page.mouse.down()
    shown.page.mouse.move(left, box["y"] + 20, steps=4)
    assert shown.state("span") == [10, 21] and shown.events() == []
    shown.page.mouse.up()
    shown.page.keyboard.up("Alt")
    assert shown.events() == [["span", {"start": 10, "stop": 21}]] and shown.state("frame") == 0
    shown.page.keyboard.press("Escape")
    assert shown.events()[1:] == [["span", None]] and shown.state("span") is None


# ---------------------------------------------------------------- keyboard


def test_the_keys_step_frames_and_jump(shown: Shown) -> None:
    shown.call("stage.seek(5.5)")
    frames = []
    for key in ("ArrowRight", "ArrowRight", "ArrowLeft", "End", "ArrowRight", "Home", "ArrowLeft"):
        shown.page.keyboard.press(key)
        frames.append(shown.state("frame"))
    assert frames == [6, 7, 6, FRAMES - 1, FRAMES - 1, 0, 0]


def test_the_keys_walk_from_token_to_token(shown: Shown) -> None:
    shown.page.keyboard.press("Shift+ArrowRight")  # no scale is chosen: the finest, two frames a token
    assert shown.state("frame") == 2
    shown.page.keyboard.press("2")  # eight frames a token
    assert shown.state("scale") == 2 and shown.events() == [["scale", {"scale": 2}]]
    shown.page.keyboard.press("Shift+ArrowRight")
    assert shown.state("frame") == 8 and shown.state("selection") is None
    shown.page.keyboard.press("Enter")
    shown.page.keyboard.press("Shift+ArrowRight")
    shown.page.keyboard.press("Shift+ArrowDown")  # the middle of token 2 of 6 is token 5 of 12
    chosen = [detail for name, detail in shown.events() if name == "select"]
    places = [(detail["scale"], detail["position"]) for detail in chosen]
    assert places == [(2, 1), (2, 2), (3, 5)] and {detail["system"] for detail in chosen} == {"lgtok"}
    told = shown.page.locator(".ms-spoken").inner_text()
    assert f"code {IDS[2][5]} of {CODES[2]}" in told and "scale 3" in told
    shown.page.keyboard.press("2")
    assert shown.state("scale") is None


def test_keys_meant_for_a_text_box_stay_there(shown: Shown) -> None:
    shown.page.evaluate(
        "() => { const box = document.createElement('input'); document.body.append(box); box.focus(); }"
    )
    for key in ("Space", "3", "End"):
        shown.page.keyboard.press(key)
    assert shown.state("playing") is False and shown.state("scale") is None and shown.state("frame") == 0
    assert shown.page.locator("body > input").input_value() == " 3"


def test_everything_can_be_reached_with_tab_and_shows_where_it_is(shown: Shown) -> None:
    reached = set()
    for _ in range(16):
        shown.page.keyboard.press("Tab")
        reached.add(
            shown.page.evaluate(
                "() => { const e = document.activeElement;"
                " return (e.getAttribute('aria-label') || e.textContent) + '|' + getComputedStyle(e).outlineStyle; }"
            )
        )
    names = {entry.rsplit("|", 1)[0] for entry in reached if entry.endswith("|solid")}
    assert {"Play", "Loop", "Follow", "Trail", "Ghost", "Overlay", "1×", "Time"} <= names
