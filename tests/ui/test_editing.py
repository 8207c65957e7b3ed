"""What Edit asks for and shows, on the engine's stand-in: kept frames, spans, sources, links, words of errors."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.systems import SYSTEMS
from playground.ui.bar import script
from playground.ui.drawing import MADE
from playground.ui.editing import (
    KINDS,
    EditSession,
    EditWish,
    file_name,
    open_source,
    opening_view,
    run,
    seam_table,
    source_view,
)
from playground.ui.errors import Noted
from playground.ui.rooms.edit import WISHES, Handlers
from playground.ui.services import Services
from playground.ui.state import State, controls_of, parse, query
from playground.ui.uploads import Source
from tests.ui.double import FakeEngine, motions

ASKED: dict[str, Any] = {"prompt": "a person bows", "kind": "inpaint", "from": 1.0, "to": 2.0, "seed": 3, "g": 0.5,
                         "s": 3.0, "anchor": "place", "measured": False}  # fmt: skip


@pytest.fixture
def engine() -> FakeEngine:
    return FakeEngine()


@pytest.fixture
def services(engine: FakeEngine) -> Services:
    return Services(lambda: engine)  # type: ignore[arg-type, return-value]


@pytest.fixture
def do(services: Services) -> Handlers:
    return Handlers(services, opening_view(services))


def wish(**changed: Any) -> EditWish:
    return EditWish.checked(*({**ASKED, **changed}[key] for key in WISHES))


def event(**values: Any) -> Any:
    return SimpleNamespace(**values)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_shows_both_motions_and_hatches_what_stays(services: Services, kind: str) -> None:
    session = open_source(services, EditSession(), "m0")
    view = run(services, session, wish(kind=kind))
    assert [figure["name"] for figure in view.stage["figures"]] == ["Before", "After"]
    assert view.stage["figures"][1]["ghost_of"] == "before"
    frames, hatched = view.stage["frames"], view.stage["hatch"]
    covered = sum(stop - start for start, stop in hatched)
    assert view.facts[0].value == f"{covered}/{frames}" and 0 < covered < frames
    assert view.stage["tracks"][0]["marked"] == "drawn anew"
    assert all(level["marks"] is not None for level in view.stage["tracks"][0]["levels"])


def test_seconds_become_frames(services: Services, engine: FakeEngine) -> None:
    assert wish().span == (20, 40)
    session = open_source(services, EditSession(), "m0")
    run(services, session, wish())
    assert any(call.startswith("edit inpaint (20, 40)") for call in engine.calls)
    assert wish(**{"from": None}).span is None  # that of the published benchmark


@pytest.mark.parametrize(
    ("key", "value", "sentence"),
    [("kind", "erase", "one of"), ("from", 3.0, "ends before"), ("to", 99, "must be a number"), ("seed", -1, "seed"),
     ("from", "now", "must be a number"), ("g", 7, "guidance"), ("s", None, "guidance")],
)  # fmt: skip
def test_what_does_not_fit_is_refused_in_a_sentence(key: str, value: object, sentence: str) -> None:
    with pytest.raises(PlaygroundError, match=sentence):
        wish(**{key: value})


def test_seams_say_where_how_much_and_of_what(services: Services) -> None:
    session = open_source(services, EditSession(), "m0")
    base = session.base
    assert base is not None
    edited = services.engine().edit(base, (20, 40), "a person bows", seed=4)
    shown = seam_table(edited)
    assert "1.00 s" in shown and "2.00 s" in shown and "seed 4" in shown and "lgtok" in shown


def test_a_generated_motion_comes_by_its_name_and_keeps_its_words(services: Services, do: Handlers) -> None:
    address = "?room=generate&prompt=someone+jogs&seconds=3&seed=9&takes=3&take=1"
    shown = do.last(address, "inpaint", EditSession())
    session, menu, name, caption = shown[0], shown[5], shown[6], shown[7]
    assert name == session.name and name.startswith(f"{MADE}10_3_") and caption == "someone jogs"
    assert menu["value"] == name and menu["choices"][0] == ("someone jogs · generated", name)
    again = do.arrive(EditSession(), event(query=query(State("edit", {"motion": name, "caption": caption, "seed": 2}))))
    assert again[6] == name and again[2] != ""  # a link with a seed asks for the edit itself
    for a, b in zip(session.base.levels, again[0].base.levels, strict=True):
        assert np.array_equal(a.ids, b.ids)


def test_a_link_to_a_motion_alone_shows_it_with_a_span_to_begin_with(do: Handlers) -> None:
    shown = do.arrive(EditSession(), event(query="?room=edit&motion=m2&kind=inpaint"))
    assert shown[0].name == "m2" and shown[10] > shown[9] >= 0
    plain = do.arrive(EditSession(), event(query="?room=edit&motion=m2"))
    assert plain[2] == "" and isinstance(plain[1], Noted)
    gone = do.arrive(EditSession(), event(query="?room=edit&motion=gone"))
    assert gone[0].name == do.services.opening_example().id


def test_somebody_elses_file_is_asked_for(do: Handlers) -> None:
    with pytest.raises(PlaygroundError, match=r"its maker's own, walk.bvh; upload it"):
        do.arrive(EditSession(), event(query="?room=edit&motion=file%3Awalk.bvh"))


def test_an_uploaded_file_has_a_name_that_an_address_takes(services: Services) -> None:
    for title in ("my walk.bvh", "späziergang (2).npz", "..x.bvh", "a" * 90 + ".bvh"):
        source = Source(motions()[0], title)
        name = file_name(source)
        assert parse(f"?room=edit&motion={name.replace(' ', '+')}").values["motion"] == name
        held = open_source(services, EditSession(upload=source), name)
        assert held.title == title and held.base is not None


def test_another_kind_brings_its_own_span(do: Handlers) -> None:
    session, about, start, stop = do.set_kind("suffix", EditSession())
    frames = session.base.motion.frames
    assert (start, stop) == (0.0, (frames // 2) / LIMITS.fps) and "What comes after" in about


def test_a_motion_before_any_edit_is_one_figure(services: Services) -> None:
    view = source_view(services, open_source(services, EditSession(), "m1"))
    assert len(view.stage["figures"]) == 1 and view.stage["hatch"] == []


def test_the_opening_says_what_its_controls_say(services: Services) -> None:
    made = opening_view(services).controls
    assert made["to"] > made["from"] and made["seams"] and made["promise"]
    assert {"prompt", "kind", "from", "to"} <= {row.key for row in controls_of("edit")}


def test_a_long_file_shows_its_window_and_another_one_of_it(do: Handlers) -> None:
    long = replace(motions()[0], joints=np.concatenate([motions()[0].joints] * 9)[:500])
    held = open_source(do.services, EditSession(upload=Source(long, "long.bvh")), "file:long.bvh")
    moved = do.move(5.0, "inpaint", held)
    session, window = moved[0], moved[8]
    assert window["visible"] and window["maximum"] == pytest.approx((500 - 197) / 20, abs=0.06)
    assert session.start == window["value"] == 5.0 and moved[6] == "file:long.bvh"
    assert not np.array_equal(session.base.motion.joints, held.base.motion.joints)
    again = do.arrive(moved[0], event(query="?room=edit&motion=file%3Along.bvh&start=5&from=1&to=2"))
    assert np.array_equal(again[0].base.motion.joints, session.base.motion.joints) and again[2] != ""
    assert not do.choose("m2", "inpaint", session)[8]["visible"]


@pytest.fixture
def several() -> Handlers:
    engine = FakeEngine(others=("momask", "lgtok-rvq"), denoises=True)  # the second one has no generator
    services = Services(lambda: engine)  # type: ignore[arg-type, return-value]
    return Handlers(services, opening_view(services))


def calls(do: Handlers) -> list[str]:
    return do.services.engine().calls  # type: ignore[attr-defined, no-any-return]


def test_another_system_reads_the_same_motion_and_brings_its_own_numbers(several: Handlers) -> None:
    assert [one.name for one in several.services.editors()] == ["lgtok", "momask"]
    held = several.choose("m2", "inpaint", EditSession())[0]
    shown = several.change("momask", "inpaint", held)
    session, own = shown[0], SYSTEMS["momask"].sampling
    assert session.name == "m2" and session.base.system == shown[11] == "momask" and session.caption == held.caption
    assert shown[12:] == (own.guidance, own.cfg)
    several.repaint(session, *ASKED.values())
    assert calls(several)[-1] == "edit inpaint (20, 40) a person bows 3 momask"
    assert several.choose("m1", "inpaint", session)[0].base.system == "momask"  # another motion, the same system


def test_a_link_names_the_system_and_one_that_cannot_gives_way_with_a_sentence(several: Handlers) -> None:
    shown = several.arrive(EditSession(), event(query="?room=edit&system=momask&motion=m1&seed=2"))
    own = SYSTEMS["momask"].sampling
    assert shown[11] == "momask" and calls(several)[-1].endswith("2 momask") and shown[15:17] == (own.guidance, own.cfg)
    for name, title in (("lgtok-rvq", "LG-Tok with MoMask's quantizer"), ("mogo", "MOGO")):
        other = several.arrive(EditSession(), event(query=f"?room=edit&system={name}&motion=m1"))
        assert other[11] == "lgtok" and other[1].text == f"{title} cannot edit here; this is LG-Tok."


def test_the_last_generation_brings_its_system(several: Handlers) -> None:
    shown = several.last("?room=generate&prompt=someone+jogs&system=momask", "inpaint", EditSession())
    name = shown[6]
    assert shown[0].base.system == shown[11] == "momask" and name.endswith("_momask") and shown[1].text == ""
    assert shown[12:] == (SYSTEMS["momask"].sampling.guidance, SYSTEMS["momask"].sampling.cfg)
    back = several.change("lgtok", "inpaint", shown[0])
    assert back[6] == name and back[0].base.system == "lgtok" and calls(several)[-1] == "tokenize"
    for system, source in (("momask", "made"), ("lgtok", "made.motion")):
        address = f"?room=edit&motion={name}&caption=someone+jogs&system={system}"
        again = several.arrive(EditSession(), event(query=address))
        assert again[0].base.system == system
        code = script(several.services, [address])["code"]
        assert 'system="momask",\n    seed=0' in code and f"engine.edit(\n    {source},\n" in code
        assert ('system="lgtok"' in code) == (system == "lgtok")
