"""The README tells the truth: its Python runs, its make targets and commands exist, its links and folders are there."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from playground.cli import parser

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
PYTHON = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
COMMANDS = re.findall(r"^python -m playground (.*)$", README, re.MULTILINE)


@pytest.mark.parametrize("code", PYTHON)
def test_python_blocks_run(code: str, tmp_path: Path) -> None:
    script = tmp_path / "example.py"
    script.write_text(f"import sys\nsys.path.insert(0, {str(ROOT)!r})\n{code}")
    done = subprocess.run([sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip(), "the example prints nothing"


def test_there_is_a_python_example_and_commands() -> None:
    assert len(PYTHON) == 1
    assert {line.split()[0] for line in COMMANDS} == {
        "app", "systems", "tokenize", "decode", "generate", "prepare", "train", "evaluate", "bench",
        "convert", "rewrite", "segment", "snapmogen",
    }  # fmt: skip


def test_make_targets_exist() -> None:
    named = set(re.findall(r"`make ([a-z]+)", README)) | set(re.findall(r"^ {4}make ([a-z]+)", README, re.MULTILINE))
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert {"setup", "app", "test", "notebooks", "train", "bench", "lint", "screenshots"} <= named
    assert named <= targets


@pytest.mark.parametrize("line", COMMANDS)
def test_commands_parse(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    options = parser().parse_args(shlex.split(line))
    assert callable(options.run)


def test_links_and_pictures_exist() -> None:
    targets = re.findall(r"\]\(([^)#]+)\)", README)
    missing = [target for target in targets if "://" not in target and not (ROOT / target).is_file()]
    assert targets and not missing, missing


def test_the_map_names_what_is_there() -> None:
    block = README.split("## Map of the folders", 1)[1].split("```")[1]
    inside = False
    for line in block.splitlines():
        if not line.strip():
            continue
        name = line.split()[0]
        inside = inside and line.startswith(" ")
        assert (ROOT / ("playground" if inside else "") / name).exists(), f"the map names {name}, which is not there"
        inside = inside or name == "playground/"


def test_every_requirement_has_a_reason() -> None:
    table = README.split("## What it stands on", 1)[1].split("## ", 1)[0]
    for file in ROOT.glob("requirements*.txt"):
        for line in file.read_text().splitlines():
            if line and not line.startswith(("-", "#")):
                package = re.split(r"[<>=!~\[; ]", line, maxsplit=1)[0]
                assert re.search(rf"\b{re.escape(package)}\b", table), (
                    f"{package} of {file.name} has no reason in README"
                )
