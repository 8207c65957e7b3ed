"""The room Codebooks on the engine's stand-in: charts of chosen systems, the card and the motion of a code."""

import json
import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from playground.analysis.usage import CodeUsage
from playground.errors import PlaygroundError
from playground.figures.coverage import usage_lines
from playground.ui.rooms import codebooks
from playground.ui.services import Services
from tests.ui.double import CODES, SIZES, FakeEngine, stored_analysis


@pytest.fixture
def services() -> Services:
    engine = FakeEngine()
    return Services(lambda: engine)  # type: ignore[arg-type, return-value]


@pytest.fixture
def do(services: Services) -> codebooks.Handlers:
    return codebooks.Handlers(services, codebooks.opening_view(services))


def event(**values: Any) -> Any:
    return SimpleNamespace(**values)


def test_the_room_opens_with_the_code_that_the_first_scale_uses_most(services: Services) -> None:
    view = codebooks.opening_view(services)
    counts = np.bincount(stored_analysis().tokens[:, 0], minlength=CODES[0])
    assert view.controls["code"] == f"lgtok.1.{counts.argmax()}"
    assert "rank 1</strong>" in view.controls["card"] and view.kind == "stored"
    assert [len(view.stage[part]) for part in ("figures", "tracks")] == [1, 0]


@pytest.mark.parametrize(("scale", "code"), [(1, 0), (4, 3), (10, 383)])
def test_a_card_counts_what_the_clips_hold(do: codebooks.Handlers, scale: int, code: int) -> None:
    _, card, kept = do.pick(event(id=f"lgtok.{scale}.{code}"))
    start = sum(SIZES[: scale - 1])
    ids = stored_analysis().tokens[:, start : start + SIZES[scale - 1]]
    count = int((ids == code).sum())
    assert kept == f"lgtok.{scale}.{code}"
    assert (f"Used by {count} of {ids.size:,} tokens" in card) if count else ("Dead:" in card)


def test_a_like_code_is_of_the_same_scale(do: codebooks.Handlers) -> None:
    _, card, kept = do.pick(event(id="lgtok.4.3"))
    other = re.search(r'data-do="code" data-code="(\d+)"', card)
    assert other
    assert do.act(kept, event(do="code", code=other[1], number=""))[2] == f"lgtok.4.{other[1]}"


def test_other_systems_keep_a_code_of_theirs_and_leave_one_that_is_none(do: codebooks.Handlers) -> None:
    opened = do.opening.controls["code"]
    for current, kept in (("lgtok.4.3", "lgtok.4.3"), ("momask.1.2", opened), ("", opened)):
        *drawn, stage, card, code = do.choose(["lgtok"], "sorted", 10, current)
        assert drawn == list(do.draw(["lgtok"], "sorted", 10)) and code == kept
        assert f"Code {kept.rsplit('.', 1)[1]} of scale {kept.split('.')[1]}, LG-Tok" in stage and "Used by" in card
    with pytest.raises(PlaygroundError, match="at least one"):
        do.choose([], "sorted", 10, opened)


NO_CODES = ["", "lgtok", "lgtok.0.1", "lgtok.11.1", "lgtok.1.128", "x.1.1", None]


@pytest.mark.parametrize("text", NO_CODES)
def test_what_is_no_code_is_refused(do: codebooks.Handlers, text: object) -> None:
    with pytest.raises(PlaygroundError):
        do.show(text)


def test_curves_tell_which_code_was_clicked(services: Services) -> None:
    figure = json.loads(codebooks.panels(services, codebooks.Wish(("lgtok",), "sorted", 5)))
    for level, trace in enumerate(figure["data"], start=1):
        ids = [place for place, _ in trace["customdata"]]
        assert sorted(ids) == sorted(f"lgtok.{level}.{code}" for code in range(CODES[level - 1]))


def test_the_table_says_what_the_top_codes_cover(services: Services) -> None:
    text = codebooks.scale_table(services, codebooks.Wish(("lgtok",), "sorted", 7))
    assert "top 7 cover" in text and "90 test clips of made up" in text and text.count("<tr>") == 11


@pytest.mark.parametrize(
    ("systems", "order", "k"),
    [([], "sorted", 5), (["lgtok-lite"], "sorted", 5), (["lgtok"], "up", 5), (["lgtok"], "sorted", 0)],
)
def test_controls_out_of_bounds_are_refused(services: Services, systems: list[str], order: str, k: int) -> None:
    with pytest.raises(PlaygroundError):
        codebooks.Wish.checked(services, systems, order, k)


def test_a_link_with_an_unknown_code_falls_back(do: codebooks.Handlers) -> None:
    query = "?room=codebooks&order=index&k=3&code=lgtok.1.9999"
    systems, order, k, *_, code = do.arrive(event(query=query))
    assert (systems, order, k) == (["lgtok"], "index", 3) and code == do.opening.controls["code"]


def usage(counts: list[list[int]]) -> CodeUsage:
    return CodeUsage().fit_counts(counts)


def test_systems_of_different_depth_share_one_axis() -> None:
    deep, flat = usage([[4, 0], [1, 3], [2, 2]]), usage([[5, 1, 0, 0], [3, 3, 3, 3]])
    figure = usage_lines({"lgtok": deep, "momask": flat}, 1)
    traces = [trace for trace in figure.data if trace.mode == "lines+markers"]
    assert [list(trace.x) for trace in traces[:1]] == [[0.0, 0.5, 1.0]] and list(traces[3].x) == [0.0, 1.0]
    assert list(traces[2].y) == pytest.approx([100, 75, 50]) and list(traces[5].y) == pytest.approx([83.3333, 25])
    names = [trace.text[0] for trace in figure.data if trace.mode == "text"]
    assert names == ["lgtok", "momask"]


def test_systems_of_one_depth_keep_the_numbers_of_the_scales() -> None:
    figure = usage_lines({"lgtok": usage([[4, 0], [1, 3]]), "momask": usage([[1, 1], [0, 0]])}, 2)
    assert list(figure.data[0].x) == [1, 2] and figure.data[6].y[1] is None  # nothing counted, nothing drawn
    with pytest.raises(PlaygroundError):
        usage_lines({}, 2)
