"""The address: what it says comes back, what it cannot mean falls back, and nothing in it does harm."""

from urllib.parse import quote, urlencode

import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.limits import LIMITS
from playground.systems import SYSTEMS
from playground.ui.state import (
    CONTROLS,
    KINDS,
    ROOMS,
    Control,
    Scales,
    Span,
    State,
    Token,
    control,
    controls_of,
    parse,
    query,
    table_json,
    text_of,
)

SYSTEM = next(iter(SYSTEMS))
EXAMPLE = "?room=generate&prompt=a+person+waves&seed=7&system=lgtok&hide=seed"


def values_of(row: Control) -> st.SearchStrategy[object]:
    """Values that a row accepts."""
    name = st.from_regex(r"\A[A-Za-z0-9][A-Za-z0-9_.+-]{0,30}\Z")
    words = st.text(st.characters(exclude_categories=["Cs", "Cc", "Cf", "Co", "Cn", "Z"]), min_size=1, max_size=40)
    token = st.builds(Token, st.sampled_from(list(SYSTEMS)), st.integers(1, 999), st.integers(0, 999))
    span = st.tuples(st.integers(0, 90), st.integers(91, LIMITS.max_frames)).map(lambda pair: Span(*pair))
    kinds = st.sampled_from(["upto", "only", "without"])
    table: dict[str, st.SearchStrategy[object]] = {
        "choice": st.sampled_from(row.choices or ("",)),
        "name": name,
        "flag": st.booleans(),
        "text": words,
        "number": st.floats(row.low, row.high),
        "whole": st.integers(int(row.low), int(row.high)),
        "scales": st.builds(Scales, kinds, st.integers(int(row.low), int(row.high))),
        "systems": st.lists(st.sampled_from(list(SYSTEMS)), min_size=1, max_size=3, unique=True).map(tuple),
        "selection": token | span,
    }
    return table[row.kind]


@st.composite
def states(draw: st.DrawFn) -> State:
    room = draw(st.sampled_from(ROOMS))
    rows = draw(st.lists(st.sampled_from(controls_of(room)), unique=True)) if controls_of(room) else []
    hidden = draw(st.lists(st.sampled_from(["seed", "prompt", "link", "g"]), unique=True))
    return State(room, {row.key: draw(values_of(row)) for row in rows}, tuple(hidden))


def test_the_link_of_the_readme_means_what_it_says() -> None:
    state = parse(EXAMPLE)
    assert state.room == "generate" and state.hide == ("seed",)
    assert (state["prompt"], state["seed"], state.system, state["seconds"]) == ("a person waves", 7, "lgtok", 5.0)
    assert parse(query(state)) == state


@given(states())
def test_a_state_comes_back_from_its_address(state: State) -> None:
    again = parse(query(state))
    assert again.room == state.room and again.hide == state.hide
    for row in controls_of(state.room):
        assert again[row.key] == state[row.key], row.key
    assert len(query(state)) < 6 * LIMITS.max_link_chars


@given(st.text(max_size=300))
def test_any_text_gives_a_state(text: str) -> None:
    state = parse(text)
    assert state.room in ROOMS and parse(query(state)) == state


@given(st.dictionaries(st.sampled_from([row.key for row in CONTROLS]) | st.text(max_size=8), st.text(max_size=60)))
def test_any_values_of_known_keys_stay_inside_the_table(values: dict[str, str]) -> None:
    state = parse(urlencode(values))
    for key, value in state.values.items():
        row = control(state.room, key)
        assert KINDS[row.kind](row, text_of(row, value)) == value
        if row.kind in ("number", "whole"):
            assert row.low <= value <= row.high
        if row.kind == "text":
            assert len(value) <= row.high and value.isprintable()


@pytest.mark.parametrize(
    "bad",
    ["seed=-1", "seed=99999999999", "seed=7.5", "seed=٣", "seed=1e3", "seconds=nan", "seconds=inf", "seconds=0.1",
     "seconds=1_0", "seconds=" + "9" * 300, "g=-0.01", "g=6.1", "free=yes", "system=../../etc", "system=",
     "prompt=", "prompt=%00%00", "prompt=" + "a" * 501, "selection=lgtok.0.1", "selection=nobody.1.1",
     "selection=9-3", "selection=1-2-3", "selection=1e3-5", "topk=0", "nothing=1", "prompt"],
)  # fmt: skip
def test_what_cannot_be_meant_is_as_good_as_absent(bad: str) -> None:
    assert parse(f"room=generate&{bad}") == State("generate")


@pytest.mark.parametrize("bad", ["motion=../x", "motion=file:../x.bvh", "motion=<script>", "scales=0", "scales=only-",
                                 "scales=most-3", "start=-1", "scales=only-99"])  # fmt: skip
def test_names_and_scales_are_checked(bad: str) -> None:
    assert parse(f"room=tokenize&{bad}") == State("tokenize")


def test_markup_and_quotes_are_only_text() -> None:
    evil = "\"><img src=x onerror=alert(1)>'\u202e{{7*7}}"
    state = parse(f"room=generate&prompt={quote(evil)}&hide=seed%7D%20*%7Bcolor:red,prompt")
    assert state["prompt"] == evil.replace("\u202e", "")  # what turns text round is taken out
    assert state.hide == ("prompt",)
    assert "<" not in query(state) and '"' not in query(state)


def test_a_flood_is_cut() -> None:
    assert parse("&".join(f"k{n}=1" for n in range(5_000))) == State()
    assert parse("room=generate&prompt=" + "%41" * 1_000_000) == State("generate", {"prompt": "A" * 500}) or parse(
        "room=generate&prompt=" + "%41" * 1_000_000
    ) == State("generate")
    assert parse("room=generate&seed=1&seed=2")["seed"] == 1  # the first one counts


def test_what_stands_at_its_default_is_left_out() -> None:
    assert query(State()) == "" and query(State("generate", {"seed": 0, "seconds": 5.0})) == "?room=generate"
    assert query(State("guidance", {"g": 2.5})) == "?room=guidance&g=2.5"
    assert query(State("tokenize", {"caption": ""})) == "?room=tokenize&caption="  # no caption is not the usual one
    assert parse("room=tokenize&caption=").values == {"caption": ""}


def test_the_table_is_sound() -> None:
    pairs = [(row.room, row.key) for row in CONTROLS]
    assert len(set(pairs)) == len(pairs)
    assert {row.room for row in CONTROLS} <= {"", *ROOMS} and {row.kind for row in CONTROLS} == set(KINDS)
    elements = [row.element for row in CONTROLS if row.element]
    assert len(set(elements)) == len(elements)
    for row in CONTROLS:
        if row.default not in (None, ()):
            assert KINDS[row.kind](row, text_of(row, row.default)) == row.default, row
    wanted = {"room", "system", "motion", "prompt", "caption", "seconds", "seed", "g", "scales", "selection", "hide"}
    assert wanted <= {row.key for row in CONTROLS}
    assert "</" not in table_json()
