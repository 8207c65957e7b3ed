"""Export: what the browser sends is checked, files are what they say, rendering ends when it is to end."""

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.motion.formats import read_motion
from playground.motion.synthetic import corpus
from playground.tokenizers.token_file import TokenFile
from playground.ui import export
from playground.ui.export import Control, Handlers, Wish, read_wish, render, slug, write
from playground.ui.services import Services
from tests.ui.double import CODES, SIZES, FakeEngine


@pytest.fixture(scope="module")
def services() -> Services:
    engine = FakeEngine()
    return Services(lambda: engine)  # type: ignore[arg-type, return-value]


def joints(frames: int = 24) -> np.ndarray:
    return corpus(1, seed=4)[0].motion.joints[:frames]


def figure(array: np.ndarray | None = None, **more: Any) -> dict[str, Any]:
    packed = base64.b64encode((joints() if array is None else array).astype("<f4").tobytes()).decode()
    return {"name": "From tokens", "caption": "MPJPE 3 mm", "color": "#0072b2", "joints": packed, **more}


def track(**more: Any) -> dict[str, Any]:
    rows = [{"codes": codes, "ids": [0] * (size - 1) + [codes - 1]} for size, codes in zip(SIZES, CODES, strict=True)]
    return {"system": "lgtok", "frames": 96, "levels": rows, **more}


def detail(kind: str, query: str = "?room=generate&prompt=a+person+waves&seed=7", **more: Any) -> dict[str, Any]:
    return {"kind": kind, "query": query, "dark": False, "figures": [figure()], "track": track(), **more}


@pytest.mark.parametrize("kind", export.MOTIONS)
def test_a_motion_file_holds_the_motion(services: Services, tmp_path: Path, kind: str) -> None:
    path, _ = write(read_wish(services, detail(kind)), tmp_path)
    assert path.name == f"generate-a-person-waves-seed-7-from-tokens.{kind}"
    if kind == "glb":
        assert path.read_bytes()[:4] == b"glTF"
    else:
        assert np.abs(read_motion(path).motion.joints[:20] - joints()[:20]).mean() < 0.03


def test_tokens_come_with_caption_and_can_be_read_again(services: Services, tmp_path: Path) -> None:
    path, _ = write(read_wish(services, detail("json")), tmp_path)
    file = TokenFile.read(path)
    assert (file.system, file.caption, file.frames) == ("lgtok", "a person waves", 96)
    assert [level.ids[-1] for level in file.levels] == [codes - 1 for codes in CODES]
    free = read_wish(services, detail("json", "?room=generate&free=1&prompt=x")).tokens
    assert free is not None and free.caption == ""
    clip = services.bundle("lgtok").clips[3]
    mapped = read_wish(services, detail("json", f"?room=embedding-map&motion={clip.id}")).tokens
    assert mapped is not None and mapped.caption == clip.caption


@pytest.mark.parametrize(
    "bad",
    [None, [], "x", {}, {"kind": "exe", "query": ""}, detail("mp4", figures=[]), detail("mp4", figures=[{}]),
     detail("mp4", figures="x"), detail("bvh", figures=[figure(np.zeros((0, 22, 3)))]),
     detail("bvh", figures=[figure(np.full((4, 22, 3), np.nan))]), detail("bvh", figures=[figure(np.zeros(67))]),
     detail("bvh", figures=[figure(np.zeros((LIMITS.max_frames + 2, 22, 3)))]),
     detail("bvh", figures=[figure(np.full((4, 22, 3), 1e9))]), detail("bvh", figures=[figure(joints="%%%")]),
     detail("bvh", figures=[figure(joints="A" * 10_000_000)]), detail("gif", figures=[figure(color="red;}")]),
     detail("json", track=None), detail("json", track=track(system="nobody")), detail("json", track=track(frames=0)),
     detail("json", track=track(frames=10**9)), detail("json", track=track(levels=[])),
     detail("json", track=track(levels=[{"codes": 128, "ids": [10**30]}])),
     detail("json", track=track(levels=[*track()["levels"][:-1], {"codes": 384, "ids": [384] * 36}])),
     detail("json", track=track(levels=[*track()["levels"][:-1], {"codes": 384, "ids": []}]))],
)  # fmt: skip
def test_what_is_no_wish_is_one_sentence(services: Services, bad: Any) -> None:
    with pytest.raises(PlaygroundError) as refusal:
        read_wish(services, bad)
    assert "\n" not in str(refusal.value) and len(str(refusal.value)) < 200


def test_only_as_many_figures_as_a_stage_holds(services: Services) -> None:
    assert len(read_wish(services, detail("gif", figures=[figure()] * 500)).actors) == LIMITS.max_figures
    assert len(read_wish(services, detail("bvh", figures=[figure()] * 5)).actors) == 1


@given(st.text(max_size=200))
def test_a_file_name_is_safe_whatever_is_in_it(text: str) -> None:
    name = slug(text)
    assert 1 <= len(name) <= 60 and set(name) <= set("abcdefghijklmnopqrstuvwxyz0123456789-")
    assert not name.startswith("-") and not name.endswith("-")


def test_words_on_a_picture_are_one_line(services: Services) -> None:
    (actor,) = read_wish(services, detail("gif", figures=[figure(name="a\nb\u202e<b>" + "c" * 500)])).actors
    assert actor.name.startswith("a b <b>ccc") and len(actor.name) <= 60


def test_rendering_tells_how_far_it_is_and_leaves_a_file(services: Services, tmp_path: Path) -> None:
    wish = read_wish(services, detail("gif", figures=[figure(joints()[:4])]))
    *news, path = render(wish, tmp_path, Control())
    assert isinstance(path, Path) and path.parent == tmp_path and path.read_bytes()[:6] == b"GIF89a"
    assert news[-1] == (2, 2)


def test_rendering_can_be_stopped(services: Services, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[Any] = []
    real = export.subprocess.Popen
    monkeypatch.setattr(export.subprocess, "Popen", lambda *a, **k: started.append(real(*a, **k)) or started[-1])
    wish = read_wish(services, detail("mp4"))
    with pytest.raises(PlaygroundError, match="stopped"):
        list(render(wish, tmp_path, Control(stop=True)))
    run = render(wish, tmp_path, Control())
    late = Wish("mp4", wish.state, wish.actors)
    monkeypatch.setattr(export, "LIMITS", type("Short", (), {"picture_seconds": 0.0}))
    with pytest.raises(PlaygroundError, match="longer than 0 s"):
        list(render(late, tmp_path, Control()))
    run.close()  # a visitor who leaves before it began
    assert len(started) == 2 and all(process.poll() is not None for process in started)
    assert list(tmp_path.iterdir()) == []


def test_handlers_answer_in_words_the_browser_reads(services: Services, tmp_path: Path) -> None:
    do = Handlers(services, str(tmp_path))
    event = type("Event", (), {"wish": detail("bvh")})()
    done = do.write(Control(), event)
    assert done["state"] == "done" and Path(done["file"]["path"]).is_file()
    assert Path(done["file"]["path"]).resolve().is_relative_to(tmp_path.resolve())
    failed = do.write(Control(), type("Event", (), {"wish": {"kind": "exe", "query": ""}})())
    assert failed == {"state": "error", "message": "'exe' is nothing that can be exported."}
    assert json.dumps(done) and list(do.render(Control(), type("E", (), {"wish": None})()))[-1]["state"] == "error"
    assert [path.parent for path in tmp_path.rglob("*") if path.is_file()] == [Path(done["file"]["path"]).parent]


def test_a_visitor_who_leaves_leaves_nothing_behind(services: Services, tmp_path: Path) -> None:
    do, event = Handlers(services, str(tmp_path)), type("Event", (), {"wish": detail("mp4")})()
    run = do.render(Control(), event)
    assert next(run)["state"] == "working" and len(list(tmp_path.iterdir())) == 1
    run.close()  # type: ignore[attr-defined]
    assert list(tmp_path.iterdir()) == []


def test_stop_counts_for_its_own_run_even_before_that_has_begun(services: Services, tmp_path: Path) -> None:
    do, control = Handlers(services, str(tmp_path)), Control()
    asked = {run: type("Event", (), {"wish": {**detail("mp4"), "run": run}})() for run in (1, 2)}
    do.stop(control, type("Event", (), {"run": 1})())  # type: ignore[arg-type]
    assert list(do.render(control, asked[1]))[-1] == {"state": "error", "message": "Stopped; nothing was saved."}
    later = do.render(control, asked[2])
    assert next(later)["state"] == "working" and not control.stop
    later.close()  # type: ignore[attr-defined]
