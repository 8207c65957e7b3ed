"""Systems beside the one of the room Tokenize: figures, tracks, whose tokens can be taken apart, links and scripts."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from playground.errors import PlaygroundError
from playground.motion.measures import mpjpe
from playground.systems import SystemInfo
from playground.ui.beside import MOST, beside_it
from playground.ui.closer import Closer
from playground.ui.code import python_for
from playground.ui.rooms import tokenize
from playground.ui.rooms.tokenize import Handlers
from playground.ui.services import Services
from playground.ui.state import parse, query
from playground.ui.tokenizing import Session, stage_of
from tests.ui.double import FakeEngine

OTHERS = ("momask", "mogo", "t2mgpt", "momaskpp", "mosa", "lgtok-rvq")


class Many(FakeEngine):
    """The stand-in with seven shipped systems, and one that makes features without tokens."""

    def systems(self) -> list[SystemInfo]:
        (first,) = super().systems()
        others = [replace(first, name=name, title=name.title()) for name in OTHERS]
        return [first, *others, replace(first, name="mdm", title="MDM", tokenizer=None)]


@pytest.fixture
def services() -> Services:
    engine = Many()
    return Services(lambda: engine)  # type: ignore[arg-type, return-value]


@pytest.fixture
def do(services: Services) -> Handlers:
    return Handlers(services, tokenize.opening_view(services))


def tracks(services: Services, held: Session) -> list[str]:
    return [track["system"] for track in stage_of(services, held)["tracks"]]


def test_every_system_has_a_figure_with_its_own_error_and_a_track(services: Services, do: Handlers) -> None:
    held = do.join(["momask", "mogo"], None)[0]
    stage = stage_of(services, held)
    assert tracks(services, held) == ["lgtok", "momask", "mogo"]
    assert [figure["name"] for figure in stage["figures"]] == ["Original", "LG-Tok", "Momask", "Mogo"]
    assert {figure["frames"] for figure in stage["figures"]} == {held.tokenized.motion.frames}
    for name, figure in zip(("momask", "mogo"), stage["figures"][2:], strict=True):
        found = held.found.beside[name]
        assert found.tokenized.caption == held.tokenized.caption
        error = mpjpe(found.tokenized.motion.joints, found.decoded.motion.joints)
        assert float(figure["caption"].split()[1]) == pytest.approx(error, rel=0.06)  # as the screen rounds it
        assert figure["ghost_of"] == "original"


def test_tokens_are_made_once_and_stay_while_scales_change(services: Services, do: Handlers) -> None:
    held = do.join(["momask"], None)[0]
    engine = services.engine()
    engine.calls.clear()  # type: ignore[attr-defined]
    held = do.rebuild(3, "upto", held)[0]
    held = do.join(["momask", "mogo"], held)[0]
    assert engine.calls.count("tokenize") == 1  # type: ignore[attr-defined]
    assert tracks(services, do.join([], held)[0]) == ["lgtok"]


def test_others_follow_to_another_motion_and_system(services: Services, do: Handlers) -> None:
    held = do.join(["momask"], None)[0]
    other = services.examples()[-1].id
    held = do.choose(other, held)[0]
    assert held.example == other and tracks(services, held) == ["lgtok", "momask"]
    held = do.change("mogo", held)[0]
    assert tracks(services, held) == ["mogo", "momask"]
    assert tracks(services, do.change("momask", held)[0]) == ["momask"]  # not beside itself


def test_what_is_not_here_or_too_many_is_left_out(services: Services) -> None:
    assert beside_it(services, ["mdm", "lgtok-lite", "momask", "momask", 3, "nonsense"]) == ("momask",)
    assert beside_it(services, OTHERS) == OTHERS[:MOST]


def test_only_tokens_of_the_system_are_taken_apart(services: Services, do: Handlers) -> None:
    held = do.join(["momask"], None)[0]
    closer = Closer(services, do.opening)

    def select(system: str) -> Any:
        event: Any = SimpleNamespace(selection={"system": system, "scale": 1, "position": 0})
        return list(closer.select(held, event))[-1]

    with pytest.raises(PlaygroundError, match="a token of Momask; choose Momask under System"):
        select("momask")
    assert tracks(services, select("lgtok")[0]) == ["lgtok", "momask"]


def test_a_link_brings_them_along(services: Services, do: Handlers) -> None:
    state = parse("?room=tokenize&system=mogo&beside=momask,mdm,lgtok")
    held = do.arrive(None, SimpleNamespace(query=query(state)))[0]  # type: ignore[arg-type]
    assert tracks(services, held) == ["mogo", "momask", "lgtok"]
    script = python_for("tokenize", state.with_values(motion="clip-walk", caption="x"))
    assert "for name in ['momask', 'mdm', 'lgtok']:" in script
