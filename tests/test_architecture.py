"""The house rules that a program can check: which way imports go, what is heavy and where, sizes, forbidden calls."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "playground"

# One row a floor, from the ground up; an import goes down or stays on its floor.
FLOORS = (
    {"errors", "limits", "progress"},
    {"motion", "nn"},
    {"text", "data"},
    {"tokenizers"},
    {"generators"},
    {"architectures", "checkpoints", "systems", "results", "findings", "stored"},
    {"runtime", "probes", "engine", "launch"},
    {"training", "evaluation", "analysis", "convert", "bench"},
    {"figures"},
    {"ui", "cli", "commands", "inputs", "__main__"},
)
HEAVY = {  # package -> where it may be imported
    "gradio": ("playground/ui/", "app.py"),
    "plotly": ("playground/figures/",),
    "pyvista": ("playground/figures/",),
    "vtk": ("playground/figures/",),
}
WITHOUT_TORCH = ("playground/motion/", "playground/figures/")  # never, not even inside a function
LIGHT_TO_IMPORT = ("engine", "systems", "results", "cli", "commands", "motion", "figures", "ui", "limits", "errors")
LONG_FILES = ("playground/nn/", "playground/tokenizers/", "playground/generators/")  # model files: 400 lines
SOURCES = sorted(PACKAGE.rglob("*.py"))
ALL_CODE = sorted([*SOURCES, *(ROOT / "tests").rglob("*.py"), *(ROOT / "benchmarks").rglob("*.py"), ROOT / "app.py"])
SCRIPTS = sorted([*PACKAGE.rglob("*.js"), *PACKAGE.rglob("*.mjs"), *PACKAGE.rglob("*.css")])


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


def imports(path: Path) -> Iterator[tuple[int, str]]:
    """(line, dotted name) of every import of a file, wherever it stands; names used for types only do not count."""
    tree = parsed(path)
    types_only = {
        (inner.lineno, inner.col_offset)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for inner in node.body
        if hasattr(inner, "lineno")
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom) and (node.lineno, node.col_offset) in types_only:
            continue
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{name_of(path)}:{node.lineno} has a relative import; write the whole name"
            yield from ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)


def floor_of(part: str) -> int:
    for number, floor in enumerate(FLOORS):
        if part in floor:
            return number
    raise AssertionError(f"playground/{part} stands on no floor; add it to FLOORS")


def part_of(path: Path) -> str:
    """The name that a file has in FLOORS: its folder in the package, or itself."""
    inside = path.relative_to(PACKAGE)
    return inside.parts[0] if len(inside.parts) > 1 else inside.stem


def inner_imports() -> Iterator[tuple[Path, int, str]]:
    """(file, line, part imported) for every import inside the package."""
    for path in SOURCES:
        for line, name in imports(path):
            parts = name.split(".")
            if parts[0] == "playground" and len(parts) > 1:
                yield path, line, parts[1]


def test_imports_never_go_up() -> None:
    wrong = []
    for path, line, target in inner_imports():
        if path == PACKAGE / "__init__.py":
            continue
        if floor_of(target) > floor_of(part_of(path)):
            wrong.append(f"{name_of(path)}:{line} imports playground.{target}")
    assert not wrong, wrong


def test_parts_of_one_floor_do_not_import_each_other_in_a_circle() -> None:
    uses: dict[str, set[str]] = {}
    for path, _, target in inner_imports():
        if path != PACKAGE / "__init__.py" and target != part_of(path):
            uses.setdefault(part_of(path), set()).add(target)
    for start in uses:
        seen, waiting = set(), list(uses[start])
        while waiting:
            part = waiting.pop()
            if part not in seen:
                seen.add(part)
                waiting.extend(uses.get(part, ()))
        assert start not in seen, f"playground.{start} imports itself by way of {sorted(seen & set(uses))}"


@pytest.mark.parametrize("package", HEAVY)
def test_heavy_packages_stay_where_they_belong(package: str) -> None:
    wrong = [
        f"{name_of(path)}:{line}"
        for path in [*SOURCES, ROOT / "app.py"]
        for line, name in imports(path)
        if name.split(".")[0] == package and not name_of(path).startswith(HEAVY[package])
    ]
    assert not wrong, f"{package} is imported in {wrong}"


def test_motion_and_figures_know_no_torch() -> None:
    wrong = [
        f"{name_of(path)}:{line}"
        for path in SOURCES
        if name_of(path).startswith(WITHOUT_TORCH)
        for line, name in imports(path)
        if name.split(".")[0] in {"torch", "lightning"}
    ]
    assert not wrong, wrong


def test_training_knows_no_screen() -> None:
    reached, waiting = set(), [path for path in SOURCES if part_of(path) in {"training", "evaluation"}]
    while waiting:
        path = waiting.pop()
        if path in reached:
            continue
        reached.add(path)
        for line, name in imports(path):
            assert name.split(".")[0] not in {"gradio", "plotly", "pyvista"}, f"{name_of(path)}:{line} imports {name}"
            module = ROOT / Path(*name.split("."))
            found = (module.with_suffix(".py"), module.parent.with_suffix(".py"), module / "__init__.py")
            waiting.extend(file for file in found if file.is_file())


def modules_under(part: str) -> list[str]:
    files = sorted((PACKAGE / part).rglob("*.py")) if (PACKAGE / part).is_dir() else [PACKAGE / f"{part}.py"]
    names = [".".join(file.relative_to(ROOT).with_suffix("").parts) for file in files]
    return [name.removesuffix(".__init__") for name in names]


@pytest.mark.parametrize("part", LIGHT_TO_IMPORT)
def test_light_parts_import_without_torch(part: str) -> None:
    code = f"import sys\nfor name in {modules_under(part)!r}: __import__(name)\nprint('torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "False", f"importing playground.{part} imports torch"


def test_the_command_line_starts_without_gradio_or_plotly() -> None:
    code = "import sys, playground.cli; print(sorted({'gradio', 'plotly', 'pyvista', 'sklearn'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stdout + done.stderr


@pytest.mark.parametrize("path", [*ALL_CODE, *SCRIPTS], ids=name_of)
def test_files_and_functions_stay_short(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    limit = 400 if name_of(path).startswith(LONG_FILES) else 300
    assert len(text.splitlines()) <= limit, f"{name_of(path)} has more than {limit} lines"
    if path.suffix == ".py":
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                length = (node.end_lineno or node.lineno) - node.lineno + 1
                assert length <= 60, f"{name_of(path)}:{node.lineno} {node.name} has {length} lines, the limit is 60"


def calls(path: Path) -> Iterator[tuple[int, str]]:
    """(line, dotted name) of every call."""
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Call):
            yield node.lineno, ast.unparse(node.func)


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_nothing_forbidden_is_called(path: Path) -> None:
    name = name_of(path)
    forked = [  # inside `with torch.random.fork_rng()` a seed ends with the block
        range(node.lineno, (node.end_lineno or node.lineno) + 1)
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.With) and any("fork_rng" in ast.unparse(item) for item in node.items)
    ]
    for line, called in calls(path):
        where = f"{name}:{line} calls {called}"
        assert called != "print", where
        assert not called.endswith(".cuda"), where
        assert called not in {"np.random.seed", "random.seed", "torch.random.manual_seed", "torch.seed"}, where
        assert called != "torch.manual_seed" or any(line in lines for lines in forked), where
        assert called != "torch.load" or name == "playground/convert.py", where
        assert called not in {"eval", "exec", "compile", "breakpoint"}, where
    for line, imported in imports(path):
        root = imported.split(".")[0]
        assert root not in {"pickle", "dill", "joblib", "shelve", "marshal"}, f"{name}:{line} imports {imported}"
        assert not imported.endswith(".*"), f"{name}:{line} imports everything of {imported}"
    tree = parsed(path)
    for node in ast.walk(tree):
        if isinstance(node, ast.ExceptHandler):
            assert node.type is not None, f"{name}:{node.lineno} catches everything without saying so"
        if isinstance(node, ast.keyword) and node.arg == "allow_pickle":
            assert isinstance(node.value, ast.Constant) and node.value.value is False, f"{name}: pickle is allowed"


@pytest.mark.parametrize("path", SOURCES, ids=name_of)
def test_every_module_says_what_it_is(path: Path) -> None:
    if path.name != "__init__.py":
        assert ast.get_docstring(parsed(path)), f"{name_of(path)} has no docstring"


def text_files() -> list[Path]:
    folders = ("playground", "tests", "benchmarks", "notebooks", ".ci")
    kinds = {".py", ".js", ".mjs", ".css", ".md", ".toml", ".txt", ".ipynb", ".html", ".json", ""}
    found = [file for folder in folders for file in (ROOT / folder).rglob("*")]
    found += [file for file in ROOT.iterdir() if file.name not in {".git", ".venv"}]
    return sorted(file for file in found if file.is_file() and file.suffix in kinds and "__pycache__" not in file.parts)


def test_no_path_of_a_machine_and_no_loose_end() -> None:
    here = re.compile("|".join(["/wo" + "rk/", "/ho" + r"me/(?!somebody)\w", "/Use" + r"rs/\w", r"\.\./sha" + "red"]))
    loose = re.compile(
        r"\b(?:" + "|".join(["TO" + "DO", "FIX" + "ME", "XX" + "X", "NotImplemented" + "Error"]) + r")\b"
    )
    wrong = []
    for path in text_files():
        for number, line in enumerate(path.read_text(encoding="utf-8", errors="ignore").splitlines(), 1):
            if name_of(path) != ".ci/run" and here.search(line):
                wrong.append(f"{name_of(path)}:{number} names a folder of one machine")
            if loose.search(line):
                wrong.append(f"{name_of(path)}:{number} leaves something undone")
    assert not wrong, wrong
