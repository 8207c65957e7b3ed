"""Where a long recording would be cut, in Tokenize: parts between still moments, the curve, a link, the script."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from playground.engine import default_engine
from playground.errors import PlaygroundError
from playground.motion.motion import Motion
from playground.ui.cutting import POINTS, cut, cuts_figure, part_choices, part_of
from playground.ui.rooms import tokenize
from playground.ui.services import Services
from playground.ui.state import UPLOADED
from playground.ui.tokenizing import Session, window_of
from playground.ui.uploads import WINDOW, Source, read_upload
from tests.data.test_segment import take
from tests.ui.double import FakeEngine, motions
from tests.ui.test_code import ids, run
from tests.ui.test_code import services as real_services

assert real_services  # a fixture
STOPS = (6.0, 13.0, 19.5, 29.0)  # the last part but one is cut once more: it has more than 9.8 s
BOX, PART, CURVE = -3, -2, -1  # of what a handler shows


@pytest.fixture(scope="module")
def long() -> Motion:
    return replace(motions()[0], joints=take(36.0, STOPS).astype(np.float32), caption="")


@pytest.fixture
def do() -> tokenize.Handlers:
    engine = FakeEngine()
    services = Services(lambda: engine)  # type: ignore[arg-type, return-value]
    return tokenize.Handlers(services, tokenize.opening_view(services))


def test_parts_lie_between_still_moments_and_fit(long: Motion) -> None:
    found = cut(long)
    edges = [stop / 20 for _, stop in found.spans]
    assert all(min(abs(edge - stop) for edge in edges) < 0.15 for stop in STOPS)
    assert all(80 <= stop - start <= WINDOW for start, stop in found.spans)
    assert found.spans[0][0] == 0 and found.spans[-1][1] == long.frames
    assert cut(long).spans == found.spans
    (first, anywhere), *parts = part_choices(found)
    assert (first, anywhere) == ("by the slider", "0") and [value for _, value in parts] == ["1", "2", "3", "4", "5"]
    assert parts[0][0] == f"1: 0.0 to {found.spans[0][1] / 20:.1f} s"
    assert part_of(long, 2) == found.spans[1]
    for wrong in (0, 6, 99):
        with pytest.raises(PlaygroundError, match="the parts 1 to 5"):
            part_of(long, wrong)


def test_the_curve_shows_the_cuts_and_shades_the_window(long: Motion) -> None:
    found = cut(long)
    figure = json.loads(cuts_figure(found, (120, 317)))
    curve, dots, bars = figure["data"]
    lines = [one for one in figure["layout"]["shapes"] if one["type"] == "line"]
    (window,) = [one for one in figure["layout"]["shapes"] if one["type"] == "rect"]
    assert [round(20 * line["x0"]) for line in lines] == found.cuts.tolist()
    assert (window["x0"], window["x1"]) == (6.0, 15.85)
    owner = {frame: n for n, (start, stop) in enumerate(found.spans, 1) for frame in range(start, stop)}
    assert curve["customdata"] == [owner[round(20 * x)] for x in curve["x"]]
    assert dots["customdata"] == [owner[frame] for frame in found.minima.tolist()]
    assert bars["customdata"] == [1, 2, 3, 4, 5] and bars["opacity"] == 0
    low = np.array(bars["x"]) - np.array(bars["width"]) / 2
    assert (20 * low).round().astype(int).tolist() == [start for start, _ in found.spans]
    assert all(trace["meta"]["ring"] is False for trace in figure["data"]) and "dark" in curve["meta"]
    assert not figure["layout"].get("annotations")


def test_a_very_long_recording_sends_a_thinner_curve(long: Motion) -> None:
    joints = np.concatenate([long.joints] * 12)
    curve, *_ = json.loads(cuts_figure(cut(replace(long, joints=joints)), (0, 197)))["data"]
    assert len(curve["x"]) == len(curve["customdata"]) <= POINTS < len(joints)


def test_a_part_is_tokenized_by_itself(do: tokenize.Handlers, long: Motion) -> None:
    source, spans = Source(long, "long.bvh"), cut(long).spans
    first = do._show(Session(UPLOADED, source, upload=source))
    assert first[BOX]["visible"] and first[PART]["value"] == "0" and window_of(first[0]) == (0, WINDOW)
    for shown in (do.cut("3", first[0]), do.point(first[0], SimpleNamespace(id="3"))):  # type: ignore[arg-type]
        held: Session = shown[0]
        assert held.tokenized is not None and window_of(held) == spans[2] and shown[PART]["value"] == "3"
        frames = held.tokenized.motion.frames
        assert frames == (spans[2][1] - spans[2][0] - 1) // 4 * 4
        rect = [one for one in json.loads(shown[CURVE])["layout"]["shapes"] if one["type"] == "rect"]
        assert [rect[0]["x0"], rect[0]["x1"]] == [edge / 20 for edge in spans[2]]
    assert shown[10]["value"] == spans[2][0] / 20 <= shown[10]["maximum"]  # the slider
    again = do.again("a person glides", held)  # another caption: the same part
    assert window_of(again[0]) == spans[2]
    moved = do.move(4.0, held)
    assert window_of(moved[0]) == (80, 80 + WINDOW) and moved[PART]["value"] == "0"
    last = do.cut("5", held)
    assert window_of(last[0]) == spans[4]
    assert window_of(do.cut("0", last[0])[0]) == (long.frames - WINDOW, long.frames)
    with pytest.raises(PlaygroundError, match="part 9 was asked for"):
        do.cut("9", held)


def test_a_short_recording_has_nothing_to_cut(do: tokenize.Handlers) -> None:
    for shown in (do.choose("m1", None), do._show(Session(UPLOADED, Source(motions()[0], "x"), part=7))):
        assert shown[BOX] == {"visible": False, "__type__": "update"}


def test_a_link_names_a_part(do: tokenize.Handlers, long: Motion) -> None:
    source = Source(long, "long.bvh")
    held = Session(UPLOADED, source, upload=source)

    def event(part: int) -> Any:
        return SimpleNamespace(query=f"?room=tokenize&motion=file:long.bvh&start=3&part={part}")

    session = do.arrive(held, event(2))[0]
    assert session.part == 2 and window_of(session) == cut(long).spans[1]
    assert window_of(do.arrive(held, event(0))[0]) == (60, 60 + WINDOW)
    with pytest.raises(PlaygroundError, match="the parts 1 to 5"):
        do.arrive(held, event(77))


def test_the_script_cuts_at_the_same_place(
    real_services: Services, long: Motion, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    np.savez(tmp_path / "long.npz", joints=long.joints, fps=20.0)
    _, left = run(real_services, "?room=tokenize&motion=file%3Along.npz&part=4&caption=x", tmp_path, monkeypatch)
    motion = read_upload(str(tmp_path / "long.npz")).motion
    expected = default_engine().tokenize(motion.slice(*part_of(motion, 4)), "x")
    assert ids(left["tokens"].levels) == ids(expected.levels)
    assert left["motion"].frames == part_of(motion, 4)[1] - part_of(motion, 4)[0]
