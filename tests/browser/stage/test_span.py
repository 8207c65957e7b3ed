"""The span on the time axis: drawn, moved and stretched by mouse, finger and keyboard; told when it is let go."""

from collections.abc import Callable

import pytest

from tests.browser.stage.scenes import FRAMES, Shown

pytestmark = pytest.mark.browser
Show = Callable[..., Shown]


def at(shown: Shown, frame: float) -> tuple[float, float]:
    box = shown.page.locator(".ms-ruler").bounding_box()
    assert box is not None
    return box["x"] + shown.call(f"return stage.timeline.xOf({frame})"), box["y"] + 22


def drag(shown: Shown, start: float, stop: float) -> None:
    shown.page.mouse.move(*at(shown, start))
    shown.page.mouse.down()
    shown.page.mouse.move(*at(shown, stop), steps=4)
    shown.page.mouse.up()


def test_in_span_mode_a_drag_draws_a_span_and_the_dot_still_scrubs(shown: Shown) -> None:
    shown.call("stage.setSpanMode(true)")
    drag(shown, 12.3, 29.6)
    assert shown.events() == [["span", {"start": 12, "stop": 30}]] and shown.state("frame") == 0
    drag(shown, 0, 6)  # the dot stands at 0
    assert shown.state("frame") == pytest.approx(6, abs=0.2) and shown.state("span") == [12, 30]
    shown.page.mouse.click(*at(shown, 40))  # a mere click goes there and leaves the span
    assert shown.state("frame") == pytest.approx(40, abs=0.2) and shown.state("span") == [12, 30]
    assert len(shown.events()) == 1


def test_handles_stretch_it_and_the_band_moves_it(shown: Shown) -> None:
    shown.call("stage.setSpanMode(true); stage.selectSpan([12, 30])")
    shown.drawn()
    drag(shown, 12, 6)
    drag(shown, 30, 41)
    assert shown.state("span") == [6, 41]
    drag(shown, 25, 60)  # as far as there is time
    assert shown.state("span") == [13, FRAMES]
    drag(shown, 13, 70)  # a start never passes its end
    assert shown.state("span") == [FRAMES - 1, FRAMES]
    assert [detail for name, detail in shown.events() if name == "span"] == [
        {"start": 6, "stop": 30},
        {"start": 6, "stop": 41},
        {"start": 13, "stop": FRAMES},
        {"start": FRAMES - 1, "stop": FRAMES},
    ]


def test_without_span_mode_the_axis_scrubs_but_the_handles_hold(shown: Shown) -> None:
    shown.call("stage.selectSpan([12, 30])")
    shown.drawn()
    drag(shown, 20, 24)
    assert shown.state("span") == [12, 30] and shown.state("frame") == pytest.approx(24, abs=0.2)
    drag(shown, 30, 36)
    assert shown.state("span") == [12, 36]


def test_keys_move_a_handle_and_python_hears_once_they_are_let_go(shown: Shown) -> None:
    assert shown.page.get_by_role("slider").count() == 1  # no span, no handles
    shown.page.keyboard.press("]")  # from the start to the playhead
    shown.call("window.heard.length = 0; stage.selectSpan([12, 30])")
    shown.drawn()
    start, end = (shown.page.get_by_role("slider", name=f"{name} of the span") for name in ("Start", "End"))
    end.focus()
    shown.page.keyboard.down("ArrowRight")
    shown.page.keyboard.down("ArrowRight")
    assert shown.state("span") == [12, 32] and shown.events() == []
    shown.page.keyboard.up("ArrowRight")
    assert shown.events() == [["span", {"start": 12, "stop": 32}]]
    shown.page.keyboard.press("PageUp")
    assert shown.state("span") == [12, FRAMES] and shown.state("frame") == 0
    start.focus()
    for key in ("Home", "ArrowLeft", "Shift+ArrowRight"):
        shown.page.keyboard.press(key)
    assert shown.state("span") == [5, FRAMES]
    shown.drawn()
    assert start.get_attribute("aria-valuetext") == "0.25 seconds, frame 5"
    assert start.get_attribute("aria-valuenow") == "0.25" and end.get_attribute("aria-valuemax") == "2.40"
    shown.page.keyboard.press("Escape")
    shown.drawn()
    assert shown.state("span") is None and not start.is_visible()


def test_a_finger_draws_and_moves_a_span(show: Show) -> None:
    made = show(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    made.call("stage.setSpanMode(true)")
    touch = (
        "const [kind, x, y] = argument, ruler = document.querySelector('.ms-ruler');"
        "ruler.setPointerCapture = () => {};"
        "ruler.dispatchEvent(new PointerEvent(kind, { clientX: x, clientY: y, pointerType: 'touch', pointerId: 7,"
        " isPrimary: true, bubbles: true, button: kind === 'pointermove' ? -1 : 0 }))"
    )
    for start, stop in ((10, 20), (20, 34), (15, 18)):
        made.call(touch, ["pointerdown", *at(made, start)])
        made.call(touch, ["pointermove", *at(made, stop)])
        made.call(touch, ["pointerup", *at(made, stop)])
        made.drawn()
    assert [(detail["start"], detail["stop"]) for _, detail in made.events()] == [(10, 20), (10, 34), (13, 37)]
    box = made.page.get_by_role("slider", name="End of the span").bounding_box()
    assert box is not None and box["width"] >= 24 and box["height"] >= 24
    assert made.page.evaluate("() => document.documentElement.scrollWidth") == 390
