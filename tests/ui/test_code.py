"""Copy as Python: every room's script runs and gives the tokens that the engine gives for that state."""

import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.engine import default_engine
from playground.errors import PlaygroundError
from playground.motion.formats import write_motion
from playground.motion.synthetic import corpus
from playground.systems import checkpoint_path
from playground.ui.bar import script
from playground.ui.code import SCRIPTS, python_for
from playground.ui.complete import complete
from playground.ui.services import Services
from playground.ui.state import ROOMS, State, parse
from tests.conftest import drifting

ROOT = Path(__file__).parents[2]
NO_SCRIPT = {"learn"}


@pytest.fixture(scope="module")
def services() -> Services:
    engine = default_engine()
    needed = [checkpoint_path(engine.assets, "lgtok", part) for part in ("tokenizer", "generator")]
    if not all(path.is_file() for path in needed):
        pytest.skip("no trained system is shipped with this copy")
    return Services(default_engine)


def run(services: Services, query: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[State, dict[str, Any]]:
    """What the script of an address leaves behind, run in an empty folder; and the state that it was made from."""
    answer = script(services, query)
    (folder / "copied.py").write_text(answer["code"], encoding="utf-8")
    monkeypatch.chdir(folder)
    return complete(services, parse(query)), runpy.run_path(str(folder / "copied.py"))


def ids(levels: Any) -> list[list[int]]:
    return [level.ids.tolist() for level in levels]


def test_every_room_has_a_script() -> None:
    assert set(SCRIPTS) == set(ROOMS) - NO_SCRIPT
    with pytest.raises(PlaygroundError, match="nothing to copy"):
        python_for("learn", State("learn"))


@pytest.mark.parametrize("query", ["", "?room=tokenize&motion=synthetic-kick&scales=4&caption="])
def test_tokenize(services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, query: str) -> None:
    state, left = run(services, query, tmp_path, monkeypatch)
    engine = default_engine()
    tokens = engine.tokenize(services.example_motion(state["motion"]), state["caption"], str(state.system))
    back = engine.reconstruct(tokens, scales=state["scales"].n if state["scales"] else None)
    assert ids(left["tokens"].levels) == ids(tokens.levels)
    assert left["back"].mpjpe_mm == pytest.approx(back.mpjpe_mm) and np.allclose(
        left["back"].motion.joints, back.motion.joints, atol=1e-5
    )


def test_closer_looks(services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    query = "?room=tokenize&motion=synthetic-kick&selection=lgtok.4.1&code=7&wrong=a+person+%22sits%22"
    state, left = run(services, query, tmp_path, monkeypatch)
    engine = default_engine()
    tokens = engine.tokenize(services.example_motion(state["motion"]), state["caption"], str(state.system))
    swap, language = engine.swap(tokens, 4, 1, 7), engine.language(tokens, 'a person "sits"')
    assert ids(left["swap"].levels) == ids(swap.levels) and left["swap"].span == swap.span
    assert left["language"].bare_share == language.bare_share and left["language"].wrong == language.wrong


def test_a_file_of_ones_own(services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    np.savez(tmp_path / "my walk.npz", joints=drifting(400), fps=20.0)
    _, left = run(services, "?room=tokenize&motion=file%3Amy+walk.npz&start=3.5&caption=x", tmp_path, monkeypatch)
    from playground.ui.uploads import read_upload

    source = read_upload(str(tmp_path / "my walk.npz"))
    assert ids(left["tokens"].levels) == ids(default_engine().tokenize(source.window(3.5), "x").levels)


def test_generate(services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    query = "?room=generate&prompt=someone+%22waves%22&seed=7&seconds=2.4&temperature=0.85&topk=0.33&g=1.5&s=2.5"
    _, left = run(services, query, tmp_path, monkeypatch)
    made = default_engine().generate(
        'someone "waves"', 2.4, "lgtok", seed=7, guidance=1.5, cfg=2.5, temperature=0.85, top_k=0.33
    )
    assert ids(left["made"].levels) == ids(made.levels)
    assert (tmp_path / "generated.bvh").stat().st_size > 1_000


def test_generate_plants_feet_where_the_switch_says_so() -> None:
    given = {"prompt": "a person sits", "g": 0, "s": 4, "temperature": 1, "topk": 0.5, "topp": 0.5}
    given |= {"system": ("lgtok",)}
    code = python_for("generate", State("generate", {**given, "seed": 1, "seconds": 2.0, "plant": True}))
    assert code.count("made = engine.refine(made)") == 1
    assert code.index("engine.generate(") < code.index("engine.refine(") < code.index("write_motion(made.motion")
    assert "refine" not in python_for("generate", State("generate", {**given, "seed": 1, "seconds": 2.0}))


def test_generate_without_a_prompt(services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _, left = run(services, "?room=generate&free=1&seconds=2&seed=3", tmp_path, monkeypatch)
    assert ids(left["made"].levels) == ids(default_engine().generate(None, 2.0, "lgtok", seed=3).levels)


def test_guidance(services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _, left = run(services, "?room=guidance&motion=synthetic-bow&g=1.25", tmp_path, monkeypatch)
    engine, example = default_engine(), services.example("synthetic-bow")
    tokens = engine.tokenize(example.motion(), example.caption)
    guided = engine.reconstruct(tokens, guidance=1.25)
    assert ids(left["tokens"].levels) == ids(tokens.levels)
    assert np.allclose(left["blended"], guided.features, atol=1e-4)
    assert np.allclose(left["guided"].motion.joints, guided.motion.joints, atol=1e-5)


def test_embedding_map(services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bundle = services.bundle("lgtok")
    row = len(bundle) // 2
    _, left = run(services, f"?room=embedding-map&motion={bundle.ids[row]}", tmp_path, monkeypatch)
    assert ids(left["tokens"].levels) == ids(bundle.levels(row)) and left["row"] == row
    assert left["motion"].frames == bundle.clips[row].frames


def test_codebooks(services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _, left = run(services, "?room=codebooks&order=index", tmp_path, monkeypatch)
    bundle = services.bundle("lgtok")
    assert len(left["frequencies"]) == len(bundle.sizes)
    for scale, found in enumerate(left["frequencies"]):
        assert np.array_equal(found, bundle.usage.relative(scale, "index"))


def test_a_script_stands_on_its_own(services: Services, tmp_path: Path) -> None:
    """In a process of its own, as a person runs it."""
    code = script(services, "?room=codebooks")["code"]
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.count("scale ") == len(services.bundle("lgtok").sizes)


@given(st.text(max_size=80))
def test_no_text_breaks_out_of_its_literal(text: str) -> None:
    given = {"prompt": text, "free": False, "system": ("lgtok",), "g": 1.0, "s": 1.0, "temperature": 1.0}
    code = python_for("generate", State("generate", {**given, "topk": 0.5, "topp": 0.5, "seed": 1, "seconds": 2.0}))
    import ast

    (call,) = [node for node in ast.walk(ast.parse(code)) if isinstance(node, ast.Call) and node.args
               and isinstance(node.func, ast.Attribute) and node.func.attr == "generate"]  # fmt: skip
    assert isinstance(call.args[0], ast.Constant) and call.args[0].value == text


def test_a_motion_that_is_gone_gives_way_to_the_opening_one(services: Services) -> None:
    filled = complete(services, parse("?room=tokenize&motion=gone&scales=3"))
    assert filled["motion"] == services.opening_example().id and filled["scales"].n == 3


def test_a_written_file_can_be_named(tmp_path: Path) -> None:
    """The names that files of synthetic motions get are names that the address takes."""
    path = tmp_path / "my walk (2).bvh".replace("(", "").replace(")", "")
    write_motion(corpus(1, seed=1)[0].motion, path)
    assert parse(f"?room=tokenize&motion=file%3A{path.name.replace(' ', '+')}")["motion"] == f"file:{path.name}"
