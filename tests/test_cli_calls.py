"""Every call of the command line on tiny inputs, as a person would: once in its own process, variations in ours."""

import contextlib
import io
import json
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from playground import cli
from playground.data.library import Library
from playground.engine import default_engine
from playground.limits import LIMITS
from playground.motion.formats import read_motion
from tests.browser.server import serving
from tests.conftest import drifting

ROOT = Path(__file__).resolve().parent.parent
SYSTEM = "lgtok"


def run(*call: object, status: int = 0) -> subprocess.CompletedProcess[str]:
    """One call; its exit status is checked."""
    words = [sys.executable, "-m", "playground", *(str(word) for word in call)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=600)
    assert done.returncode == status, f"{done.args}\n{done.stdout}\n{done.stderr}"
    assert "Traceback" not in done.stderr
    return done


def call(*words: object, status: int = 0) -> tuple[str, str]:
    """The same without a process: what it says on stdout and stderr."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        assert cli.main([str(word) for word in words]) == status, err.getvalue()
    return out.getvalue(), err.getvalue()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("calls")


@pytest.fixture(scope="module")
def clip(folder: Path) -> Path:
    """An npz file of 12 seconds."""
    np.savez(folder / "clip.npz", joints=drifting(240), fps=np.float32(20), caption="it glides along")
    return folder / "clip.npz"


@pytest.fixture(scope="module")
def tokens(clip: Path) -> Path:
    out = clip.with_name("deep") / "tokens.json"
    done = run("tokenize", clip, "--caption", "a person glides", "--system", SYSTEM, "--json", out)
    assert "cut to the first" in done.stdout and str(out) in done.stdout
    return out


@pytest.fixture(scope="module")
def library(folder: Path) -> Path:
    """A prepared library of 8 clips of 3 seconds."""
    source = folder / "source"
    source.mkdir()
    clips = [drifting(61, seed=number) for number in range(8)]
    scale, offsets = np.float32(0.0006), np.arange(9) * 61
    np.savez(source / "motions.npz", joints=np.round(np.concatenate(clips) / scale).astype(np.int16), scale=scale,
             offsets=offsets, fps=np.float32(20))  # fmt: skip
    lines = []
    for number in range(8):
        entry = {"index": number, "id": f"clip{number}", "source": "AB"[number % 2], "label": "walk"}
        entry |= {"split": ("train", "train", "val", "test")[number % 4], "captions": [{"text": "a person glides"}]}
        lines.append(json.dumps(entry))
    (source / "clips.jsonl").write_text("\n".join(lines) + "\n")
    out = folder / "library"
    assert "8 clips" in run("prepare", "joints-npz", source, "--out", out).stdout
    return out


def test_prepare(library: Path) -> None:
    opened = Library.open(library)
    assert [len(opened.split(name)) for name in ("train", "val", "test")] == [4, 2, 2]


def test_tokenize(tokens: Path) -> None:
    file = json.loads(tokens.read_text())
    assert list(file) == ["format", "system", "checkpoint", "caption", "frames", "fps", "levels"]
    assert (file["format"], file["system"], file["caption"]) == (1, SYSTEM, "a person glides")
    assert (file["frames"], file["fps"]) == (LIMITS.max_frames, 20) and file["checkpoint"]
    for level in file["levels"]:
        assert len(level["ids"]) == level["size"] and min(level["ids"]) >= 0 and max(level["ids"]) < level["codes"]
    sizes = [level["size"] for level in file["levels"]]
    assert sizes == sorted(sizes) and len(sizes) > 1


def test_tokenize_takes_another_start_a_library_clip_and_stdout(clip: Path, library: Path) -> None:
    later = json.loads(call("tokenize", clip, "--start", "8")[0])
    assert later["frames"] == 76 and later["caption"] == "it glides along"
    stored = json.loads(call("tokenize", "clip3", "--library", library)[0])
    assert stored["frames"] == 60 and stored["caption"] == "a person glides"


def test_tokenize_takes_an_example() -> None:
    example = default_engine().examples()[0]
    tokens = json.loads(call("tokenize", example.id)[0])
    assert tokens["caption"] == example.caption and tokens["frames"] > 0


def test_decode(tokens: Path) -> None:
    out = tokens.with_suffix(".npz")
    done = run("decode", tokens, "--caption", "it slides", "--guidance", "2.0", "--out", out)
    assert f"{out}: 196 poses" in done.stdout
    with np.load(out, allow_pickle=False) as archive:
        assert archive["joints"].shape == (LIMITS.max_frames, 22, 3) and archive["joints"].dtype == np.float32
        assert float(archive["fps"]) == 20 and str(archive["caption"]) == "it slides"


def test_decode_to_other_formats(tokens: Path) -> None:
    for suffix in (".bvh", ".glb"):
        call("decode", tokens, "--out", tokens.with_suffix(suffix))
    assert read_motion(tokens.with_suffix(".bvh")).motion.frames == LIMITS.max_frames
    assert tokens.with_suffix(".glb").read_bytes()[:4] == b"glTF"


def test_generate_is_repeatable_and_as_long_as_asked(folder: Path) -> None:
    words = ["generate", "a person steadily walks forward", "--seconds", "2.5", "--system", SYSTEM, "--out"]
    run(*words, folder / "first.npz", "--seed", 3)
    call(*words, folder / "again.npz", "--seed", 3)
    call(*words, folder / "other.npz", "--seed", 4)
    joints = []
    for name in ("first", "again", "other"):
        with np.load(folder / f"{name}.npz") as archive:
            joints.append(archive["joints"])
            assert str(archive["caption"]) == "a person steadily walks forward"
    assert joints[0].shape == (48, 22, 3) and joints[0].dtype == np.float32  # floor(20 * 2.5 / 4) * 4
    np.testing.assert_allclose(joints[0], joints[1], atol=1e-4)
    assert np.abs(joints[0] - joints[2]).max() > 1e-2


def test_generate_free_form_with_its_tokens(folder: Path) -> None:
    out, to = folder / "free.bvh", folder / "free.json"
    assert "40 poses" in call("generate", "--no-text", "--seconds", "2", "--out", out, "--json", to)[0]
    file = json.loads(to.read_text())
    assert file["frames"] == 40 and file["caption"] == ""
    call("decode", to, "--out", folder / "free.npz")


def test_tokens_of_another_shape_are_refused(tokens: Path, folder: Path) -> None:
    file = json.loads(tokens.read_text())
    (folder / "fewer.json").write_text(json.dumps(file | {"levels": file["levels"][:-1]}))
    _, err = call("decode", folder / "fewer.json", "--out", folder / "x.npz", status=2)
    assert len(err.splitlines()) == 1 and "does not fit" in err


def test_systems() -> None:
    rows = json.loads(call("systems", "--json")[0])
    shipped = {row["name"]: row for row in rows}[SYSTEM]
    assert shipped["checkpoint"] == "shipped" and shipped["tokenizer"] and shipped["generator"]
    assert shipped["parameters"] > 1_000_000


def test_evaluate(library: Path, folder: Path) -> None:
    run("evaluate", SYSTEM, "--library", library, "--split", "test", "--json", folder / "result.json")
    result = json.loads((folder / "result.json").read_text())
    assert result["mpjpe_mm"] > 0 and result["mpjpe_mm_source_mean"] > 0
    assert list(result["by_source"]) == ["B"]
    assert json.loads(call("evaluate", SYSTEM, "--library", library)[0])["mpjpe_mm"] == pytest.approx(
        result["mpjpe_mm"]
    )


def test_evaluate_everything_and_once_more(library: Path, folder: Path) -> None:
    out = folder / "whole.json"
    words = ("evaluate", SYSTEM, "--library", library, "--mm-texts", "1", "--mm-samples", "10", "--json", out)
    run(*words, "--repeats", "1", "--seed", "2")
    result = json.loads(out.read_text())
    assert (result["repeats"], result["seed"], result["mm_texts"], result["mm_samples"]) == (1, 2, 1, 10)
    for table in ("metrics", "real", "reconstruction"):
        for entry in result[table].values():
            assert entry["mean"] is not None or entry["why"]
    assert result["metrics"]["prompts_obeyed"]["n"] == 24 and result["metrics"]["usage"]["mean"] > 0
    state = out.with_name("whole.state.json")
    before = state.read_text()
    call(*words, "--repeats", "1", "--seed", "2")
    assert json.loads(out.read_text()) == result and state.read_text() == before
    _, err = call(*words, "--repeats", "1", "--seed", "3", status=2)
    assert "another seed" in err.splitlines()[-1]


def test_train_stops_and_goes_on(library: Path, folder: Path) -> None:
    out = folder / "run"
    words = ("train", f"{SYSTEM}-tokenizer", "--library", library, "--out", out)
    run(*words, "--steps", "1")
    assert list(out.rglob("*.safetensors")), "a finished run leaves a checkpoint"
    assert "resume" in call(*words, "--steps", "1", status=2)[1].splitlines()[-1]
    run(*words, "--steps", "2", "--resume")


def test_app_serves_the_page() -> None:
    with serving("-m", "playground", "app", "--host", "127.0.0.1", "--port", "{port}") as address:
        assert "Motion Token Playground" in page(address)


def test_app_py_serves_the_page_where_the_host_says() -> None:
    code = (
        "import os, runpy; os.environ['GRADIO_SERVER_PORT'] = '{port}'; runpy.run_path('app.py', run_name='__main__')"
    )
    with serving("-c", code) as address:
        assert "Motion Token Playground" in page(address)


def test_an_address_that_cannot_be_used_is_one_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        _, err = call("app", "--port", taken.getsockname()[1], status=2)
    assert len(err.splitlines()) == 1 and "--port" in err
    _, err = call("app", "--host", "no such host", status=2)
    assert len(err.splitlines()) == 1 and "--host" in err


def page(address: str) -> str:
    with urllib.request.urlopen(address, timeout=60) as answer:
        return answer.read().decode("utf-8")
