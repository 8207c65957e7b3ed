"""The command line's manners: whatever is wrong with a call, one line on stderr and exit status 2, at once."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from playground import cli
from playground.limits import LIMITS
from tests.conftest import drifting

ROOT = Path(__file__).resolve().parent.parent
LONG = "walk " * 2000
BAD_CALLS = {
    "nothing": [],
    "an unknown command": ["dance"],
    "an unknown option": ["systems", "--yaml"],
    "a shortened option": ["systems", "--js"],
    "a port of words": ["app", "--port", "http"],
    "a port too high": ["app", "--port", "70000"],
    "no clip": ["tokenize"],
    "a clip that is not there": ["tokenize", "none.bvh"],
    "a clip id that is not there": ["tokenize", "no-such-clip"],
    "an empty clip": ["tokenize", ""],
    "a folder as clip": ["tokenize", "."],
    "a clip name of 10,000 letters": ["tokenize", LONG],
    "tokenize with an unknown system": ["tokenize", "clip.npz", "--system", "gpt"],
    "tokenize with a long caption": ["tokenize", "clip.npz", "--caption", LONG],
    "a negative start": ["tokenize", "clip.npz", "--start", "-1"],
    "a start after the end": ["tokenize", "clip.npz", "--start", "100"],
    "a start of words": ["tokenize", "clip.npz", "--start", "soon"],
    "a library that is not there": ["tokenize", "clip7", "--library", "nowhere"],
    "a folder to write to": ["tokenize", "clip.npz", "--json", "."],
    "a text file as clip": ["tokenize", "text.npz"],
    "a text file as bvh": ["tokenize", "text.bvh"],
    "a binary file as npy": ["tokenize", "binary.npy"],
    "an empty file as npz": ["tokenize", "empty.npz"],
    "a clip with NaN": ["tokenize", "nan.npz"],
    "a clip of one pose": ["tokenize", "one.npy"],
    "a clip of pickles": ["tokenize", "pickle.npy"],
    "a clip of 21 joints": ["tokenize", "joints.npy"],
    "no token file": ["decode", "none.json", "--out", "a.npz"],
    "a text as token file": ["decode", "text.npz", "--out", "a.npz"],
    "a binary as token file": ["decode", "binary.npy", "--out", "a.npz"],
    "decode without out": ["decode", "tokens.json"],
    "decode to a picture": ["decode", "tokens.json", "--out", "a.png"],
    "decode with guidance too high": ["decode", "tokens.json", "--out", "a.npz", "--guidance", "100"],
    "decode with a guidance of words": ["decode", "tokens.json", "--out", "a.npz", "--guidance", "much"],
    "decode with an unknown system": ["decode", "unknown.json", "--out", "a.npz"],
    "decode with levels that do not fit": ["decode", "tokens.json", "--out", "a.npz"],
    "no prompt": ["generate", "--out", "a.npz"],
    "an empty prompt": ["generate", "", "--out", "a.npz"],
    "a blank prompt": ["generate", " \t\n", "--out", "a.npz"],
    "a prompt of nothing visible": ["generate", "\u200b\u200d", "--out", "a.npz"],
    "a prompt of 10,000 letters": ["generate", LONG, "--out", "a.npz"],
    "two prompts": ["generate", "walks", "runs", "--out", "a.npz"],
    "a prompt and --no-text": ["generate", "walks", "--no-text", "--out", "a.npz"],
    "generate without out": ["generate", "walks"],
    "generate to a text": ["generate", "walks", "--out", "a.txt"],
    "generate to nothing": ["generate", "walks", "--out", ""],
    "generate below a file": ["generate", "walks", "--out", "clip.npz/a.npz"],
    "no seconds at all": ["generate", "walks", "--seconds", "0", "--out", "a.npz"],
    "an hour": ["generate", "walks", "--seconds", "3600", "--out", "a.npz"],
    "NaN seconds": ["generate", "walks", "--seconds", "nan", "--out", "a.npz"],
    "endless seconds": ["generate", "walks", "--seconds", "inf", "--out", "a.npz"],
    "a seed below zero": ["generate", "walks", "--seed", "-1", "--out", "a.npz"],
    "a seed too large": ["generate", "walks", "--seed", "99999999999", "--out", "a.npz"],
    "a seed with a point": ["generate", "walks", "--seed", "1.5", "--out", "a.npz"],
    "guidance below zero": ["generate", "walks", "--guidance", "-1", "--out", "a.npz"],
    "generate with an unknown system": ["generate", "walks", "--system", "gpt", "--out", "a.npz"],
    "rewrite nothing": ["rewrite"],
    "rewrite an empty prompt": ["rewrite", " "],
    "rewrite a prompt of 10,000 letters": ["rewrite", LONG],
    "rewrite marks": ["rewrite", "...", "--rules"],
    "segment no file": ["segment", "none.bvh"],
    "segment one pose": ["segment", "one.npy"],
    "segment with a seed below zero": ["segment", "clip.npz", "--seed", "-1"],
    "segment to a picture": ["segment", "clip.npz", "--html", "a.png"],
    "cut what is cut": ["prepare", "deepmimic", "--cut", "--out", "lib"],
    "snapmogen to the wrong file": ["snapmogen", "clip.npz", "--out", "a.npz"],
    "snapmogen of joints": ["snapmogen", "clip.npz", "--out", "a.bvh"],
    "snapmogen of no file": ["snapmogen", "none.bvh", "--out", "a.npz"],
    "snapmogen of a text": ["snapmogen", "text.bvh", "--out", "a.npz"],
    "an unknown source": ["prepare", "amass", ".", "--out", "lib"],
    "a source without its folder": ["prepare", "bvh", "--out", "lib"],
    "a source with a folder too many": ["prepare", "deepmimic", ".", "--out", "lib"],
    "a folder that is not there": ["prepare", "joints-npz", "nowhere", "--out", "lib"],
    "a folder without data": ["prepare", "humanml3d", ".", "--out", "lib"],
    "prepare into a file": ["prepare", "joints-npz", ".", "--out", "clip.npz"],
    "prepare without out": ["prepare", "joints-npz", "."],
    "an unknown training": ["train", "everything", "--library", "lib", "--out", "run"],
    "train on no library": ["train", "lgtok-tokenizer", "--library", ".", "--out", "run"],
    "train without a library": ["train", "lgtok-tokenizer", "--out", "run"],
    "train for no steps": ["train", "lgtok-tokenizer", "--library", ".", "--out", "run", "--steps", "many"],
    "train on no devices": ["train", "lgtok-tokenizer", "--library", ".", "--out", "run", "--devices", "0"],
    "train for no time": ["train", "lgtok-tokenizer", "--library", ".", "--out", "run", "--minutes", "0"],
    "train another size": ["train", "lgtok-tokenizer", "--library", ".", "--out", "run", "--size", "huge"],
    "train with odd precision": ["train", "lgtok-tokenizer", "--library", ".", "--out", "run", "--precision", "8"],
    "evaluate an unknown system": ["evaluate", "gpt", "--library", "lib"],
    "evaluate on no library": ["evaluate", "lgtok", "--library", "."],
    "evaluate an unknown split": ["evaluate", "lgtok", "--library", "lib", "--split", "dev"],
    "repeats below zero": ["evaluate", "lgtok", "--library", "lib", "--repeats", "-1"],
    "repeats of words": ["evaluate", "lgtok", "--library", "lib", "--repeats", "many"],
    "a million texts": ["evaluate", "lgtok", "--library", "lib", "--mm-texts", "1000000"],
    "samples below zero": ["evaluate", "lgtok", "--library", "lib", "--mm-samples", "-3"],
    "evaluate with a seed too large": ["evaluate", "lgtok", "--library", "lib", "--seed", "99999999999"],
    "evaluate with guidance too high": ["evaluate", "lgtok", "--library", "lib", "--guidance", "100"],
    "evaluate with a cfg that is no number": ["evaluate", "lgtok", "--library", "lib", "--cfg", "nan"],
    "evaluate without a library": ["evaluate", "lgtok", "--repeats", "1"],
    "bench into a folder": ["bench", "--json", "."],
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with good and bad files in it."""
    monkeypatch.chdir(tmp_path)
    np.savez("clip.npz", joints=drifting(60), fps=20, caption="it glides")
    np.savez("nan.npz", joints=np.full((60, 22, 3), np.nan, np.float32), fps=20)
    np.save("one.npy", drifting(1))
    np.save("joints.npy", drifting(60)[:, :21])
    np.save("pickle.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    Path("binary.npy").write_bytes(bytes(range(256)) * 10)
    Path("empty.npz").write_bytes(b"")
    for name in ("text.npz", "text.bvh"):
        Path(name).write_text("nothing to see\n" * 5)
    tokens = {"format": 1, "system": "lgtok", "checkpoint": "", "caption": "", "frames": 40, "fps": 20}
    tokens |= {"levels": [{"size": 1, "codes": 2, "ids": [1]}]}
    Path("tokens.json").write_text(json.dumps(tokens))
    Path("unknown.json").write_text(json.dumps(tokens | {"system": "gpt"}))
    return tmp_path


@pytest.mark.parametrize("call", BAD_CALLS.values(), ids=BAD_CALLS.keys())
def test_a_bad_call_is_one_line(call: list[str], folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    before = sorted(folder.rglob("*"))
    status = cli.main(call)
    out, err = capfd.readouterr()
    assert status == 2
    assert err.count("\n") == 1 and err.endswith("\n") and len(err.splitlines()) == 1
    assert len(err.strip()) > 20 and "Traceback" not in err and "Errno" not in err
    assert out == ""
    assert sorted(folder.rglob("*")) == before, "a refused call left something behind"


def test_the_shell_sees_the_same(folder: Path) -> None:
    call = [sys.executable, "-m", "playground", "generate", "", "--out", "a.npz"]
    done = subprocess.run(call, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2 and done.stdout == "" and len(done.stderr.splitlines()) == 1
    assert "empty" in done.stderr


@pytest.mark.parametrize(
    "command", ["", "app", "systems", "tokenize", "decode", "generate", "prepare", "train", "evaluate", "bench"]
)
def test_help_is_there(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main([*command.split(), "--help"])
    assert caught.value.code == 0
    assert capsys.readouterr().out.startswith("usage: playground")


def test_systems_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["systems", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert "lgtok" in [row["name"] for row in rows]
    for row in rows:
        assert list(row) == ["name", "tokenizer", "generator", "text", "parameters", "data", "checkpoint"]
        assert row["checkpoint"] in {"shipped", "absent"} and isinstance(row["parameters"], int)
        assert (row["checkpoint"] == "shipped") == (row["parameters"] > 0)


def test_systems_as_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["systems"]) == 0
    assert re.search(r"^lgtok +.*checkpoint (shipped|absent)$", capsys.readouterr().out, re.MULTILINE)


def test_an_interrupt_is_no_error_message(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("playground.commands.default_engine", interrupted)
    assert cli.main(["systems"]) == 130
    assert capsys.readouterr().err == "playground: stopped\n"


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def missing() -> None:
        raise ModuleNotFoundError("No module named 'lightning'", name="lightning")

    monkeypatch.setattr("playground.commands.default_engine", missing)
    assert cli.main(["systems"]) == 2
    assert "lightning is not installed" in capsys.readouterr().err


def test_a_mistake_of_ours_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> None:
        raise ModuleNotFoundError("No module named 'playground.gone'", name="playground.gone")

    monkeypatch.setattr("playground.commands.default_engine", broken)
    with pytest.raises(ModuleNotFoundError):
        cli.main(["systems"])


def test_the_longest_prompt_is_the_limit(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["generate", "a" * (LIMITS.max_prompt_chars + 1), "--out", "a.npz"]) == 2
    assert str(LIMITS.max_prompt_chars) in capsys.readouterr().err
