"""What the rooms compute, on the engine's stand-in."""

import base64

import numpy as np
import pytest

from playground.analysis.bundle import Bundle
from playground.errors import PlaygroundError
from playground.findings import ScaleSet
from playground.ui import mapping, tokenizing
from playground.ui.rooms import generate, guidance, tokenize
from playground.ui.services import Services
from playground.ui.uploads import Source
from tests.ui.double import SIZES, FakeEngine, motions, stored_analysis


@pytest.fixture
def engine() -> FakeEngine:
    return FakeEngine()


@pytest.fixture
def services(engine: FakeEngine) -> Services:
    return Services(lambda: engine)  # type: ignore[arg-type, return-value]


def millimetres(text: str) -> float:
    return float(text.split()[0])


def test_more_scales_bring_the_motion_closer(services: Services, engine: FakeEngine) -> None:
    held, view = tokenizing.run(services, tokenizing.Session(source=Source(motions()[0], "one")))
    sets = [ScaleSet("upto", used) for used in (1, 5, 10)]
    errors = [millimetres(tokenizing.run(services, held, used)[1].facts[0].value) for used in sets]
    assert errors[0] > errors[1] > errors[2] == millimetres(view.facts[0].value)
    assert engine.calls.count("tokenize") == 1  # the slider looks decodes up, it does not tokenize again
    assert [call for call in engine.calls if call.startswith("scale_study")] == ["scale_study upto"]


@pytest.mark.parametrize(("used", "tokens"), [("upto:3", SIZES[:3]), ("only:3", SIZES[2:3]), ("without:1", SIZES[1:])])
def test_tokens_are_counted_of_the_scales_in_use(services: Services, used: str, tokens: tuple[int, ...]) -> None:
    held, _ = tokenizing.run(services, tokenizing.Session(source=Source(motions()[0], "one")))
    _, view = tokenizing.run(services, held, ScaleSet.of(used, len(SIZES)))
    assert view.facts[1].value == str(sum(tokens))
    assert f"{view.controls['kind']}:{view.controls['scales']}" == used and view.controls["count"] == len(SIZES)


def test_a_forgotten_session_starts_at_the_opening_again(services: Services) -> None:
    opening = tokenize.opening_view(services)
    held = tokenizing.open_session(services, None, opening)
    assert held.source is not None and held.caption == opening.controls["caption"]


def test_an_example_that_is_gone_is_said_so(services: Services) -> None:
    with pytest.raises(PlaygroundError, match="choose another one"):
        services.example("nothing")


def test_generation_gives_one_view_a_scale(services: Services) -> None:
    wish = generate.Wish.checked("a person sits", False, 4.0, 3, 2.0, 4.0, 1.0, 0.2, 0.95)
    views = list(generate.stream(services, wish))
    assert [view.controls["level"] for view in views] == list(range(1, len(SIZES) + 1))
    rows = [sum(level["ids"] is not None for level in view.stage["tracks"][0]["levels"]) for view in views]
    assert rows == list(range(1, len(SIZES) + 1))
    assert all(len(view.stage["tracks"][0]["levels"]) == len(SIZES) for view in views)
    assert views[-1].stage["figures"][0]["caption"] == ""


def test_the_stage_hears_of_entropy_in_nats(services: Services) -> None:
    wish = generate.Wish.checked("a person sits", False, 4.0, 3, 2.0, 4.0, 1.0, 0.2, 0.95)
    *_, step = services.engine().generate_steps(wish.prompt, wish.seconds, seed=wish.seed)
    *_, view = generate.stream(services, wish)
    for level, bits in zip(view.stage["tracks"][0]["levels"], step.entropy, strict=True):
        sent = np.frombuffer(base64.b64decode(level["entropy"]), "<f4")
        assert np.allclose(np.exp(sent), 2.0**bits, rtol=1e-5)


@pytest.mark.parametrize(
    ("place", "value"), [(2, 0.2), (2, 99), (2, None), (3, -1), (3, 2**40), (3, "a"), (4, 7), (6, -1), (7, 0), (8, 1.5)]
)
def test_a_wish_out_of_bounds_is_refused(place: int, value: object) -> None:
    controls: list[object] = ["a person sits", False, 4.0, 3, 2.0, 4.0, 1.0, 0.2, 0.95]
    controls[place] = value
    with pytest.raises(PlaygroundError, match="must be a number from"):
        generate.Wish.checked(*controls)


def test_free_form_needs_no_prompt() -> None:
    assert generate.Wish.checked("", True, 4.0, 3, 2.0, 4.0, 1.0, 0.2, 0.95).prompt is None
    with pytest.raises(PlaygroundError, match="the prompt is empty"):
        generate.Wish.checked("", False, 4.0, 3, 2.0, 4.0, 1.0, 0.2, 0.95)


def test_guidance_sends_both_decodes_and_six_figures(services: Services) -> None:
    view = guidance.run(services, "m1", "a person sits", 1.5)
    assert [figure["g"] for figure in view.stage["figures"]] == ["live", 0, 1, 2, 3, 4]
    assert all(figure["joints"] is None for figure in view.stage["figures"])
    assert view.stage["features"]["guidance"] == 1.5


@pytest.fixture(scope="module")
def bundle() -> Bundle:
    return stored_analysis()


def test_neighbours_are_those_a_slow_search_finds(bundle: Bundle) -> None:
    for row in (0, 17, 89):
        distances = [(float(np.linalg.norm(bundle.means[row] - other)), n) for n, other in enumerate(bundle.means)]
        expected = [n for _, n in sorted(distances) if n != row][:4]
        assert mapping.neighbours(bundle, row) == expected


def test_the_map_opens_in_the_middle_of_the_largest_group(bundle: Bundle) -> None:
    row = mapping.first_clip(bundle)
    group = [n for n, action in enumerate(bundle.actions) if action == bundle.actions[row]]
    middle = np.mean([bundle.means[n] for n in group], axis=0)
    assert min(group, key=lambda n: float(np.linalg.norm(bundle.means[n] - middle))) == row
    assert len(group) == max(bundle.actions.count(action) for action in set(bundle.actions))
