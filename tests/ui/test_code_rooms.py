"""Copy as Python, room by room: one rich address a room, its script run, its tokens and numbers those of the engine."""

from collections.abc import Callable
from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from playground.engine import default_engine
from playground.systems import checkpoint_path
from playground.ui.bar import script
from playground.ui.code import SCRIPTS
from playground.ui.comparing import run as compare_all
from playground.ui.placing import SECONDS, SEED
from playground.ui.services import Services
from playground.ui.state import State
from playground.ui.walking import is_here
from tests.conftest import drifting
from tests.ui.test_code import NO_SCRIPT, ids, run

CLIP = "{the fourth clip of the maps}"
Left = dict[str, Any]
Check = Callable[[Services, State, Left], None]


@pytest.fixture(scope="module")
def services() -> Services:
    engine = default_engine()
    needed = [checkpoint_path(engine.assets, "lgtok", part) for part in ("tokenizer", "generator")]
    if not all(path.is_file() for path in needed) or not (engine.assets / "analysis" / "lgtok.npz").is_file():
        pytest.skip("no trained system is shipped with this copy")
    return Services(default_engine)


def opened(services: Services, state: State) -> Any:
    """The tokens of the state's example with the state's caption."""
    return default_engine().tokenize(services.example_motion(state["motion"]), state["caption"], str(state.system))


def tokenize(services: Services, state: State, left: Left) -> None:
    tokens = opened(services, state)
    assert ids(left["tokens"].levels) == ids(tokens.levels)
    assert left["back"].mpjpe_mm == default_engine().reconstruct(tokens, scales="only:3").mpjpe_mm
    swap = default_engine().swap(tokens, 2, 1, 9)
    assert ids(left["swap"].levels) == ids(swap.levels) and np.array_equal(left["swap"].difference, swap.difference)
    assert left["language"].misled_share == default_engine().language(tokens, "a person sits").misled_share


def placed_like(result: Any, left: Left) -> None:
    """Where a new point lies, by the script and by the engine."""
    found = default_engine().place(result)
    assert ids(left["new"].levels) == ids(result.levels) and left["placed"].nearest == found.nearest
    assert np.array_equal(left["placed"].tsne, found.tsne) and np.array_equal(left["placed"].pca, found.pca)


def map_of_an_example(services: Services, state: State, left: Left) -> None:
    bundle, example = services.bundle("lgtok"), services.example("synthetic-bow")
    assert left["row"] == bundle.position(str(state["motion"])) and ids(left["tokens"].levels) == ids(
        bundle.levels(left["row"])
    )
    placed_like(default_engine().tokenize(example.motion(), example.caption), left)


def map_of_a_prompt(services: Services, state: State, left: Left) -> None:
    placed_like(default_engine().generate('a person "bows"', SECONDS, "lgtok", seed=SEED), left)


def map_of_a_file(services: Services, state: State, left: Left) -> None:
    from playground.ui.uploads import read_upload

    placed_like(default_engine().tokenize(read_upload("my walk.npz").window(), ""), left)


def codebooks(services: Services, state: State, left: Left) -> None:
    usage, engine = services.bundle("lgtok").usage, default_engine()
    assert [one.tolist() for one in left["frequencies"]] == [
        usage.relative(scale, "sorted").tolist() for scale in range(len(usage.used_))
    ]
    like, stands_for = engine.neighbours("lgtok", 4, 17), engine.prototype("lgtok", 4, 17)
    assert np.array_equal(left["like"].codes, like.codes) and np.array_equal(left["like"].similarity, like.similarity)
    assert np.allclose(left["prototype"].motion.joints, stands_for.motion.joints, atol=1e-5)


def generate(services: Services, state: State, left: Left) -> None:
    made = default_engine().generate_many("a person jumps", 2.0, "lgtok", seeds=(5, 6))[1]
    made = default_engine().regenerate(made, scale=7, seed=3)
    assert ids(left["made"].levels) == ids(made.levels)


def guidance(services: Services, state: State, left: Left) -> None:
    tokens = opened(services, state)
    guided = default_engine().reconstruct(tokens, guidance=3.5)
    assert ids(left["tokens"].levels) == ids(tokens.levels) and left["guided"].mpjpe_mm == guided.mpjpe_mm
    assert np.allclose(left["blended"], guided.features, atol=1e-4)


def edit(services: Services, state: State, left: Left) -> None:
    edited = default_engine().edit(opened(services, state), (0, 30), "a person bows", 2, "suffix", measured=True)
    assert ids(left["edited"].levels) == ids(edited.levels)
    assert [astuple(seam) for seam in left["edited"].seams] == [astuple(seam) for seam in edited.seams]


def edit_of_a_window(services: Services, state: State, left: Left) -> None:
    from playground.ui.uploads import read_upload

    tokens = default_engine().tokenize(read_upload("my walk.npz").window(2.5), "a person drifts")
    edited = default_engine().edit(tokens, (40, 80), "a person bows", 0)
    assert ids(left["edited"].levels) == ids(edited.levels)


def compare(services: Services, state: State, left: Left) -> None:
    *_, done = compare_all(services, state.values["settings"], services.example_motion(str(state["motion"])))
    assert list(left["results"]) == [one.setting.name for one in done] == ["g = 0", "g = 4"]
    for one in done:
        assert left["results"][one.setting.name].mpjpe_mm == one.error_mm
        assert ids(left["tokens"][one.setting.name].levels) == ids(one.levels)


def compare_edits(services: Services, state: State, left: Left) -> None:
    motion = services.example_motion("synthetic-kick")
    for name, kind in (("In-painting", "inpaint"), ("Suffix", "suffix")):
        edited = default_engine().edit(motion, (10, 30), "a person bows", 4, kind, caption="a kick")
        assert ids(left["results"][name].levels) == ids(edited.levels)


def compare_a_clip(services: Services, state: State, left: Left) -> None:
    bundle = services.bundle("lgtok")
    motion = default_engine().decode(bundle.token_file(3)).motion
    tokens = default_engine().tokenize(motion, bundle.clips[3].caption)
    assert ids(left["tokens"]["Scales 1 to 2"].levels) == ids(tokens.levels)
    assert left["results"]["Scales 1 to 4"].mpjpe_mm == default_engine().reconstruct(tokens, scales=4).mpjpe_mm


def endless(services: Services, state: State, left: Left) -> None:
    session = default_engine().endless("a person walks", seed=2)
    first = session.advance(1.0)
    assert np.array_equal(left["parts"][0], first.joints) and len(left["parts"]) == left["session"].frames // 20
    assert [switch.prompt for switch in left["seams"].switches] == ["a person jumps"]


ADDRESSES: list[tuple[str, str, Check]] = [
    ("tokenize", "motion=synthetic-kick&scales=only-3&selection=lgtok.2.1&code=9&wrong=a+person+sits", tokenize),
    ("embedding-map", "each=token&place=synthetic-bow", map_of_an_example),
    ("embedding-map", "prompt=a+person+%22bows%22", map_of_a_prompt),
    ("embedding-map", "place=file%3Amy+walk.npz", map_of_a_file),
    ("codebooks", "k=5&code=lgtok.4.17", codebooks),
    ("generate", "prompt=a+person+jumps&seconds=2&seed=5&takes=2&take=1&changes=7.s3", generate),
    ("guidance", "motion=synthetic-run&caption=someone+hurries&g=3.5", guidance),
    ("edit", "motion=synthetic-kick&kind=suffix&from=0&to=1.5&prompt=a+person+bows&seed=2&measured=1", edit),
    ("edit", "motion=file%3Amy+walk.npz&start=2.5&caption=a+person+drifts&from=2&to=4&prompt=a+person+bows",
     edit_of_a_window),
    ("endless", "prompt=a+person+walks&seed=2&then=2+a+person+jumps", endless),
    ("compare", "vary=g&values=0_4&motion=synthetic-kick", compare),
    ("compare", "vary=kind&values=inpaint_suffix&motion=synthetic-kick&caption=a+kick&prompt=a+person+bows&seed=4"
     "&from=0.5&to=1.5", compare_edits),
    ("compare", f"vary=scales&values=2_4&motion={CLIP}", compare_a_clip),
]  # fmt: skip


def test_every_room_is_checked() -> None:
    assert {room for room, _, _ in ADDRESSES} == set(SCRIPTS)


@pytest.mark.parametrize(("room", "query", "check"), ADDRESSES, ids=[check.__name__ for _, _, check in ADDRESSES])
def test_the_script_gives_what_the_room_shows(
    services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, room: str, query: str, check: Check
) -> None:
    if room == "endless" and not is_here(services):
        pytest.skip("the system of endless motion is not shipped with this copy")
    query = query.replace(CLIP, services.bundle("lgtok").ids[3])
    np.savez(tmp_path / "my walk.npz", joints=drifting(400), fps=20.0)
    state, left = run(services, f"?room={room}&{query}", tmp_path, monkeypatch)
    check(services, state, left)


@pytest.mark.parametrize("room", sorted(NO_SCRIPT))
def test_a_room_without_a_result_says_so(services: Services, room: str) -> None:
    assert "nothing to copy here" in script(services, f"?room={room}")["error"]
