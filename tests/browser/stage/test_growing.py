"""A motion that grows: pieces join one window of bounded length on a running clock, and the stage asks for more."""

from collections.abc import Callable

import numpy as np
import pytest

from playground.figures import stage as scene
from tests.browser.stage.scenes import Shown, walk

pytestmark = pytest.mark.browser
Show = Callable[..., Shown]
FRAMES, UNIT, WINDOW, AHEAD = 20, 4, 80, 30
WAY = walk(400)
IDS = np.random.default_rng(4).integers(0, 64, (2, 100))
SAID = [(0, "a person walks"), (48, "a person jumps"), (130, "a person sits down")]
HEARD = "window.asked = []; stage.options.onEvent = (event, detail) => window.asked.push([event, detail]);"


def piece(number: int, name: str = "one", frames: int = FRAMES) -> scene.Json:
    """The piece of that number, a second each."""
    first = number * FRAMES
    cells = slice(first // UNIT, (first + frames) // UNIT)
    track = scene.track("mogo", "MOGO", frames, [scene.level(row[cells], 64) for row in IDS])
    figure = scene.figure("walker", "MOGO", WAY[first : first + frames], "mogo")
    said = [entry for entry in SAID if entry[0] < first + frames]
    grows = scene.growing(first, WINDOW, AHEAD)
    return scene.payload([figure], [track], scene=name, growing=grows, ribbon=said)


def growing(show: Show, pieces: int) -> Shown:
    made = show(piece(0))
    made.call(HEARD)
    for number in range(1, pieces):
        made.call("stage.setPayload(argument)", piece(number))
    made.drawn()
    return made


def kept(made: Shown) -> list[int]:
    """Frames, tokens and colours that the browser holds."""
    return list(
        made.call(
            "const { figures: [figure], tracks: [track] } = stage.data;"
            " return [figure.frames, figure.joints.length / 66, ...track.levels.flatMap("
            "(level) => [level.size, level.ids.length, level.rgb.length / 3])]"
        )
    )


def test_pieces_join_and_the_oldest_are_dropped(show: Show) -> None:
    made = growing(show, 3)
    assert kept(made) == [60, 60] + [15] * 6 and made.state("until") == 60 and made.state("frames") == WINDOW
    made.call("stage.seek(30)")
    for number in range(3, 12):
        made.call("stage.setPayload(argument)", piece(number))
        assert kept(made)[0] <= WINDOW
    assert kept(made) == [80, 80] + [20] * 6 and made.state("origin") == 160
    joints = np.array(made.call("return Array.from(stage.joints('walker'))")).reshape(-1, 22, 3)
    assert np.abs(joints - WAY[160:240]).max() < 1e-6
    ids = made.call("return stage.data.tracks[0].levels.map((level) => Array.from(level.ids))")
    assert np.array_equal(ids, IDS[:, 40:60])
    assert made.state("frame") == 0  # what it showed is gone: the oldest frame that is left
    assert made.complaints == []


def test_the_clock_runs_on_and_choices_move_along(show: Show) -> None:
    made = growing(show, 4)
    made.call("stage.select({ system: 'mogo', scale: 2, position: 12 }); stage.seek(70)")
    made.call("stage.setPayload(argument)", piece(4))
    made.drawn()
    assert made.state("frame") == 50 and made.state("selection") == {"system": "mogo", "scale": 2, "position": 7}
    slider = made.page.get_by_role("slider", name="Time")
    assert slider.get_attribute("aria-valuetext") == "3.50 of 5.00 seconds"
    assert "3.50" in (made.page.locator(".ms-time").text_content() or "")
    made.call("stage.setPayload(argument)", piece(7))  # does not follow: begins anew
    assert made.state("origin") == 140 and made.state("frame") == 0
    made.call("stage.setPayload(argument)", piece(0, "two"))
    assert made.state("origin") == 0 and made.state("frame") == 0 and made.state("selection") is None


def test_the_ribbon_shows_which_words_hold_when(show: Show) -> None:
    made = growing(show, 4)
    words = made.page.locator(".ms-ribbon li")
    assert words.all_text_contents() == ["a person walks", "a person jumps"]
    assert words.nth(1).get_attribute("title") == "2.40 to 4.00 s: a person jumps"
    made.call("stage.seek(50)")
    made.until("document.querySelector('.ms-ribbon .is-now').textContent === 'a person jumps'")
    for number in range(4, 8):
        made.call("stage.setPayload(argument)", piece(number))
    assert words.all_text_contents() == ["a person jumps", "a person sits down"]


def test_it_asks_for_more_and_waits_at_the_end(show: Show) -> None:
    made = growing(show, 2)
    made.call("stage.seek(34); stage.play()")
    made.until("window.asked.length && stage.state.frame === 39")
    assert made.call("return window.asked[0]") == ["hungry", {"have": 40}] and made.state("playing")
    made.call("stage.setPayload(argument); stage.seek(55)", piece(2))
    made.until("window.asked.at(-1)[1].have === 60")
    assert {event for event, _ in made.call("return window.asked")} == {"hungry"}


def test_once_ended_the_window_is_a_motion_like_any_other(show: Show) -> None:
    made = growing(show, 6)
    made.call("stage.finish()")
    assert made.state("until") is None and made.state("frames") == 80 and made.state("playing") is False
    made.call("stage.setPayload(argument)", piece(6))  # too late
    made.call("stage.seek(500)")
    assert made.state("frame") == 79 and kept(made)[0] == 80
    made.call("stage.play()")
    made.until("stage.state.frame < 79")
    assert made.call("return window.asked") == [] and made.complaints == []
