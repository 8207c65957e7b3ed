"""State for links, the snapshot, how six figures stand, and drawing less where time is short."""

import base64
import struct
from collections.abc import Callable
from typing import Any

import pytest

from playground.figures import stage as scene
from tests.browser.stage.scenes import FRAMES, Shown, payload, rich, walk

pytestmark = pytest.mark.browser
Show = Callable[..., Shown]
TOLD = "window.told = []; stage.on('state', state => window.told.push(state));"
WISH: dict[str, Any] = {
    "frame": 21, "scale": 3, "mode": "upto", "selection": {"system": "momask-lite", "scale": 1, "position": 2},
    "span": [8, 20], "speed": 2,
}  # fmt: skip


def crowd(count: int) -> scene.Json:
    return scene.payload(
        [scene.figure(str(n), f"Figure {n}", walk(), "mogo-lite", f"MPJPE {n} mm") for n in range(count)]
    )


# ---------------------------------------------------------------- links


def test_a_state_is_put_back_and_read_again(shown: Shown) -> None:
    shown.call("stage.setState(argument)", WISH)
    assert shown.call("return stage.getState()") == WISH and shown.events() == []
    shown.drawn()
    assert shown.page.get_by_role("button", name="2×").get_attribute("aria-pressed") == "true"
    shown.call("stage.setState({ selection: null, span: null, scale: null })")
    left = {**WISH, "selection": None, "span": None, "scale": None}
    assert shown.call("return stage.getState()") == left


@pytest.mark.parametrize(
    "bad",
    [
        {"frame": "x", "scale": 99, "selection": {"system": "nobody", "scale": 1, "position": 0}, "span": [5, 2]},
        {"frame": None, "scale": -1, "selection": {"system": "lgtok", "scale": 1, "position": 9}, "speed": 1e9},
        {"frame": {}, "scale": "no", "mode": "sideways", "selection": 7, "span": [0, 999], "speed": "fast"},
        {"selection": {"system": "lgtok", "scale": 1, "position": 0.5}, "span": ["a", "b"]},
        {},
    ],
)
def test_what_does_not_fit_falls_away(shown: Shown, bad: dict[str, Any]) -> None:
    before = shown.call("return stage.getState()")
    shown.call("stage.setState(argument)", bad)
    assert shown.call("return stage.getState()") == before


def test_a_frame_past_the_end_is_the_last(shown: Shown) -> None:
    shown.call("stage.setState({ frame: 1000 })")
    assert shown.state("frame") == FRAMES - 1


def test_a_state_asked_for_before_the_result_waits_for_it(shown: Shown) -> None:
    shown.call("stage.setPayload(null); stage.setState(argument)", WISH)
    other = payload()
    other["figures"][0]["id"] = "another"
    other["figures"][1]["ghost_of"] = "another"
    shown.call("stage.setPayload(argument)", other)
    assert shown.call("return stage.getState()") == WISH
    shown.call("stage.setPayload(argument)", crowd(2))
    assert shown.state("frame") == 0 and shown.state("selection") is None


def test_a_links_state_holds_until_the_visitor_does_something(shown: Shown) -> None:
    shown.call("MotionStage.restore('page', argument)", WISH)
    assert shown.call("return stage.getState()") == WISH
    later = scene.payload([scene.figure("later", "Later", walk()), *payload()["figures"]], payload()["tracks"])
    shown.call("stage.setPayload(argument)", later)  # another scene, which the link still speaks of
    assert shown.call("return stage.getState()") == WISH
    shown.page.mouse.click(880, 620)
    shown.call("stage.setPayload(argument)", payload())
    assert shown.state("frame") == 0 and shown.state("selection") is None


def test_a_stage_that_is_mounted_later_starts_where_the_link_says(shown: Shown) -> None:
    state = shown.call(
        "MotionStage.restore('other', argument[0]); const place = document.createElement('div');"
        "document.body.append(place);"
        "return MotionStage.mount(place, argument[1], { name: 'other' }).getState();",
        [WISH, payload()],
    )
    assert state == WISH and not shown.page.evaluate("() => MotionStage.get('other').state.playing")


def test_the_page_hears_of_the_state_as_an_event(shown: Shown) -> None:
    shown.call("document.addEventListener('motion-stage-state', event => { window.bubbled = event.detail; })")
    shown.page.get_by_role("button", name="2×").click()
    shown.until("window.bubbled")
    told = shown.page.evaluate("() => window.bubbled")
    assert told["name"] == "page" and told["state"]["speed"] == 2


def test_the_state_is_told_once_it_has_come_to_rest(shown: Shown) -> None:
    shown.call(TOLD)
    for frame in range(12):
        shown.call("stage.seek(argument)", frame)
    shown.call("stage.play()")
    shown.until("stage.state.frame > 12")
    assert shown.page.evaluate("() => window.told.length") == 0
    shown.call("stage.pause(); stage.seek(30); stage.select({ system: 'lgtok', scale: 2, position: 3 })")
    shown.until("window.told.length")
    shown.drawn()
    told = shown.page.evaluate("() => window.told")
    assert [state["frame"] for state in told] == [30] and told[0]["selection"]["position"] == 3


# ---------------------------------------------------------------- picture


def test_a_snapshot_is_a_png_of_the_picture_with_its_names(shown: Shown) -> None:
    url = shown.call("return MotionStage.get('page').snapshot()")
    head, data = url.split(",", 1)
    raw = base64.b64decode(data)
    assert head == "data:image/png;base64" and raw[:8] == b"\x89PNG\r\n\x1a\n"
    size = struct.unpack(">II", raw[16:24])
    assert list(size) == shown.call("return [stage.figures.canvas.width, stage.figures.canvas.height]")
    bare = shown.call("return stage.figures.canvas.toDataURL('image/png')")
    assert url != bare  # the names are on it
    shown.call("stage.setPayload(null)")
    assert shown.call("return stage.snapshot()") is None


def test_six_figures_get_two_rows_where_one_would_be_cramped(show: Show) -> None:
    rows = "return [stage.figures.rows, stage.picture.clientHeight]"
    assert show(crowd(6), viewport={"width": 1280, "height": 720}).call(rows) == [1, 320]
    made = show(crowd(6), viewport={"width": 390, "height": 844})
    count, tall = made.call(rows)
    assert count == 2 and tall > 400
    boxes = made.page.eval_on_selector_all(
        ".ms-label", "all => all.map(e => { const b = e.getBoundingClientRect(); return [b.left, b.right, b.top]; })"
    )
    for left, right in zip(boxes, boxes[1:], strict=False):
        assert left[2] != right[2] or left[1] <= right[0] + 1  # names of one row never overlap
    captions = made.page.locator(".ms-label span").all_inner_texts()
    assert captions == [f"MPJPE {n} mm" for n in range(6)]
    assert show(crowd(3), viewport={"width": 390, "height": 844}).call(rows) == [1, 320]


def test_where_frames_take_long_less_is_drawn_and_a_still_picture_is_whole_again(show: Show) -> None:
    made = show(crowd(6), device_scale_factor=2)
    whole = made.picture()
    slow = "for (let i = 0; i < 30; i++) stage.advance(argument); stage.redraw('layout');"
    made.call("stage.store.set({ playing: true }); stage.seek(0);" + slow, 0.06)
    made.drawn()
    assert made.call("return [stage.figures.ratio, stage.figures.plain]") == [1, False]
    made.call(slow, 0.06)
    made.drawn()
    assert made.call("return [stage.figures.ratio, stage.figures.plain]") == [1, True]
    made.call("stage.pause(); stage.seek(0)")
    assert made.picture() == whole and made.call("return stage.figures.ratio") == 2


def test_quick_frames_cost_nothing(show: Show) -> None:
    made = show(crowd(2), device_scale_factor=2)
    made.call("for (let i = 0; i < 200; i++) stage.pace.watch(0.017);")
    assert made.call("return stage.pace.step") == 0


def test_the_frame_is_told_beside_the_seconds(shown: Shown) -> None:
    shown.call("stage.seek(17)")
    shown.drawn()
    assert shown.page.locator(".ms-time").inner_text().split() == ["0.85", "/", "2.40", "s", "frame", "17"]


def test_everything_at_once_complains_about_nothing(show: Show) -> None:
    made = show(rich(badge=scene.badge("stored")), color_scheme="dark", reduced_motion="reduce")
    made.call("stage.setState(argument)", WISH)
    made.drawn()
    assert made.complaints == [] and made.state("playing") is False
