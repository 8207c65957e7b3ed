"""Compare as a switch of every room: what is carried over, and that Compare opens on it."""

from types import SimpleNamespace

import pytest

from playground.errors import PlaygroundError
from playground.ui.bar import comparison
from playground.ui.carry import CARRIES, compared_with
from playground.ui.rooms.compare import Handlers, Held
from playground.ui.services import Services
from playground.ui.state import ROOMS, parse, query
from tests.ui.double import FakeEngine


@pytest.fixture
def services() -> Services:
    engine = FakeEngine()
    return Services(lambda: engine)  # type: ignore[arg-type, return-value]


CARRIED = [
    ("?room=tokenize", {"vary": "scales", "motion": "m0"}),
    ("?room=tokenize&motion=m2&caption=&scales=6", {"vary": "scales", "values": "2_6_10", "motion": "m2"}),
    ("?room=tokenize&motion=m2&caption=some+words", {"motion": "m2", "caption": "some words"}),
    ("?room=embedding-map&motion=c7", {"vary": "scales", "motion": "c7"}),
    ("?room=embedding-map&motion=c7&place=m1", {"motion": "m1"}),
    ("?room=codebooks&code=lgtok.3.4", {"vary": "scales"}),
    ("?room=generate&prompt=a+b&seed=4&seconds=3", {"vary": "s", "prompt": "a b", "seed": 4, "seconds": 3.0}),
    ("?room=generate&prompt=a+b&seed=4&takes=3", {"vary": "seed", "values": "4_5_6", "prompt": "a b"}),
    ("?room=generate&prompt=a+b&seed=40&takes=3", {"vary": "s", "seed": 40}),
    ("?room=guidance&motion=m1&g=6", {"vary": "g", "values": "0_2_4_6", "motion": "m1"}),
    ("?room=guidance&motion=m1&g=1.35", {"vary": "g", "motion": "m1"}),
    ("?room=edit&motion=m1&prompt=bows&kind=prefix&from=1&to=2&seed=1",
     {"vary": "redraw", "values": "1_2_3", "motion": "m1", "prompt": "bows", "kind": "prefix", "from": 1.0, "to": 2.0}),
    ("?room=endless&prompt=a+b&seed=4", {"vary": "s", "prompt": "a b", "seed": 4}),
    ("?room=edit&motion=made_0_3_0_4_1_0.5_0.9&caption=a+person+sits", {"vary": "redraw", "caption": "a person sits"}),
]  # fmt: skip


@pytest.mark.parametrize(("address", "values"), CARRIED, ids=[address for address, _ in CARRIED])
def test_what_a_room_shows_goes_on(services: Services, address: str, values: dict[str, object]) -> None:
    answer = comparison(services, [address])
    state = parse(answer["query"])
    assert state.room == "compare"
    assert {key: state.values.get(key, state[key]) for key in values} == values
    *_, shown = Handlers(services).arrive(Held(), SimpleNamespace(query=answer["query"]))  # type: ignore[arg-type]
    assert shown[2] == state["vary"] and shown[1].count("<tr>") >= 3
    menu = shown[7]
    assert menu["value"] in [id for _, id in menu["choices"]]
    assert menu["value"] == state.values.get("motion", "m0")


def test_every_room_with_something_to_compare_has_a_row() -> None:
    assert set(CARRIES) == set(ROOMS) - {"compare", "learn"}


def test_hidden_controls_stay_hidden(services: Services) -> None:
    assert compared_with(services, parse("?room=guidance&hide=seed")).hide == ("seed",)


@pytest.mark.parametrize("address", ["?room=learn", "?room=compare", "?room=tokenize&motion=file%3Amine.bvh"])
def test_what_cannot_be_compared_is_said_in_a_sentence(services: Services, address: str) -> None:
    with pytest.raises(PlaygroundError):
        compared_with(services, parse(address))
    assert comparison(services, address)["error"].endswith(".")


def test_what_a_link_said_of_a_motion_goes_with_it(services: Services) -> None:
    do, held = Handlers(services), Held()
    query = "?room=compare&vary=redraw&motion=m1&caption=a+b&prompt=bows&kind=suffix&from=0&to=1"
    list(do.arrive(held, SimpleNamespace(query=query)))  # type: ignore[arg-type]
    assert {one.setting.kind for one in held.done} == {"suffix"} and held.done[0].setting.span == (0.0, 1.0)
    assert held.source is not None and held.source.caption == "a b"
    list(do.compare(held, "redraw", ["0", "1"], "bows", 4.0, 0, "m2"))
    assert {one.setting.kind for one in held.done} == {"inpaint"} and held.done[0].setting.span is None
    assert held.source.caption != "a b"


def test_a_comparison_is_stopped_between_two_settings(services: Services) -> None:
    do, held = Handlers(services), Held()
    go, cancel = do.begin(held)
    assert not go["interactive"] and cancel["interactive"]
    run = do.compare(held, "seed", ["0", "1", "2"], "a person sits", 2.0, 0, None)
    next(run)
    do.stop(held)
    rest = list(run)
    assert len(rest) == 1 and rest[0][0].text == "Stopped after 2 of 3." and len(held.done) == 2
    do.begin(held)
    assert len(list(do.compare(held, "seed", ["0", "1", "2"], "a person sits", 2.0, 0, None))) == 3
    assert [update["interactive"] for update in do.end()] == [True, False]


@pytest.mark.parametrize(
    ("address", "system"),
    [("?room=edit&motion=m1&seed=1&system=momask", "momask"), ("?room=generate&prompt=a+b&system=momask", "momask"),
     ("?room=guidance&motion=m1&system=lgtok-mid", "lgtok-mid"), ("?room=guidance&motion=m1&system=momask", None)],
)  # fmt: skip
def test_the_system_of_the_room_goes_on(address: str, system: str | None) -> None:
    engine = FakeEngine(others=("momask", "lgtok-mid"))
    services = Services(lambda: engine)  # type: ignore[arg-type, return-value]
    state, held = compared_with(services, parse(address)), Held()
    assert state.system == system
    list(Handlers(services).arrive(held, SimpleNamespace(query=query(state))))  # type: ignore[arg-type]
    assert {one.setting.system for one in held.done} == {system or "lgtok"}
