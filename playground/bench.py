"""`python -m playground bench`: speed and memory against the goals and the cited times of the reference code.

Every case runs in a process of its own (benchmarks/cases.py), so that peak memory is that case's and nothing is warm
that a visitor would find cold. Figures are printed and written, never asserted.
"""

import json
import os
import platform
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from benchmarks.timing import ROOT, fresh
from playground.errors import PlaygroundError

GOALS = {  # seconds, shipped checkpoint, 2 cores
    "tokenize and reconstruct": 0.5,
    "generate": 1.0,
    "scale scrubber": 0.4,
    "page ready": 3.0,
}
ENDLESS = ("2", "1")  # threads
FLAT = 8_000_000  # bytes that an endless motion may gain after its first half minute
FULL = ("tokenize", "detokenize", "generate", "text-to-motion")
SETTINGS = (("batch 1", 1, 2), ("batch 32", 32, 2), ("batch 1, 1 thread", 1, 1))  # label, batch, threads
TRAINING = ("train-tokenizer", "train-generator")
PATIENCE = 120.0  # seconds to wait for the page


@dataclass(frozen=True)
class Row:
    """One figure."""

    section: str
    what: str
    unit: str  # s | MB | x (times real time) | m/s³
    value: float
    goal: float | None = None
    reference: float | None = None  # cited, another machine
    note: str = ""
    least: bool = False  # is the goal the least that is wanted, not the most?

    @property
    def good(self) -> bool | None:
        """Whether the goal is reached; None without one."""
        if self.goal is None:
            return None
        return self.value >= self.goal if self.least else self.value <= self.goal

    def line(self) -> str:
        """For the table on the screen."""
        parts = [f"{self.what:<42}{_number(self.value):>9} {self.unit:<3}"]
        if self.goal is not None:
            parts.append(f"goal {_number(self.goal):>7} {'ok  ' if self.good else 'under' if self.least else 'over'}")
        if self.reference is not None:
            parts.append(f"reference {_number(self.reference):>7}, ratio {self.value / self.reference:.2f}")
        return "  ".join([*parts, self.note]).rstrip()


def run(out: Path | None = None) -> None:
    """Measure everything, print a line a figure as it comes, and write the JSON where `out` says.

    PlaygroundError if a case fails.
    """
    reference = json.loads((ROOT / "benchmarks" / "reference.json").read_text(encoding="utf-8"))
    machine = this_machine()
    _say(f"{machine['processor']}, {machine['cores']} cores, load {machine['load']:.1f}, torch {machine['torch']}")
    rows: list[Row] = []
    section = ""
    try:
        for row in _rows(reference):
            if row.section != section:
                section = row.section
                _say(f"\n{section}")
            _say(row.line())
            rows.append(row)
    except (RuntimeError, subprocess.TimeoutExpired) as error:
        raise PlaygroundError(f"the benchmark stopped: {error}") from error
    finally:
        if out is not None and rows:
            out.parent.mkdir(parents=True, exist_ok=True)
            report = {"machine": machine, "rows": [asdict(row) for row in rows], "reference": reference}
            out.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    _say(f"\nreference: {reference['hardware']}")


def _rows(reference: dict[str, Any]) -> Iterator[Row]:
    yield from _shipped()
    yield from _endless()
    yield from _full_size(reference)
    yield from _training(reference)


def _shipped() -> Iterator[Row]:
    """The checkpoint that comes with the repository, on the machine as it is."""
    section = "shipped checkpoint, 196 frames"
    answer = fresh("benchmarks.cases", "shipped")
    for what, seconds in answer["seconds"].items():
        yield Row(section, what, "s", seconds, GOALS.get(what))
    if answer["seconds"]:
        yield Row(section, "peak memory", "MB", answer["peak"] / 1e6)
    else:
        _say("no checkpoint is shipped here; train one with the train command")
    yield Row(section, "page ready", "s", page_ready(), GOALS["page ready"], note="process start to answer of the page")


def _endless() -> Iterator[Row]:
    """Five minutes of motion, a second at a time."""
    for threads in ENDLESS:
        answer = fresh("benchmarks.endless", threads)
        if answer["note"]:
            _say(f"\n{answer['note']}")
        yield from endless_rows(answer)


def endless_rows(answer: dict[str, Any]) -> Iterator[Row]:
    """What benchmarks/endless.py measured, figure by figure."""
    section = f"endless, {answer['seconds']} s of motion, threads: {answer['threads']}"
    speed, memory, jerk = answer["speed"], answer["bytes"], answer["jerk"]
    worst = f"second {speed['worst_at'] + 1}"
    yield Row(section, "motion per computing, mean", "x", speed["mean"], 1.0, least=True)
    yield Row(section, "   the worst single second", "x", speed["worst"], 1.0, note=worst, least=True)
    yield Row(section, "until the first second is there", "s", answer["first"])
    yield Row(section, "memory, settled", "MB", memory["settled"] / 1e6)
    yield Row(section, "   the largest after that", "MB", memory["most"] / 1e6, (memory["settled"] + FLAT) / 1e6)
    yield Row(section, "   at the end", "MB", memory["end"] / 1e6, (memory["settled"] + FLAT) / 1e6)
    yield Row(section, "   of it the past of the motion", "MB", answer["held"]["most"] / 1e6)
    for what, key in (("jerk at switches", "at_switches"), ("jerk elsewhere", "elsewhere")):
        if jerk[key] is not None:
            yield Row(section, what, "m/s³", jerk[key], note=f"{answer['switches']} switches")


def _full_size(reference: dict[str, Any]) -> Iterator[Row]:
    """The paper's size with random weights."""
    section = "full size, random weights, 196 frames, float32"
    for label, batch, threads in SETTINGS:
        for case in FULL:
            answer = fresh("benchmarks.cases", case, str(batch), str(threads))
            cited = reference["seconds"][case][label]
            yield Row(section, f"{case}, {label}", "s", answer["best"], cited / 2, cited)
            memory = reference["bytes"].get(f"peak, {label}") if case == "text-to-motion" else None
            cited_mb = None if memory is None else memory / 1e6
            yield Row(section, "   peak memory", "MB", answer["peak"] / 1e6, cited_mb, cited_mb,
                      f"loaded {answer['loaded'] / 1e6:.0f} MB")  # fmt: skip


def _training(reference: dict[str, Any]) -> Iterator[Row]:
    section = "full size, one training step, batch 8"
    for case in TRAINING:
        answer = fresh("benchmarks.cases", case, "8", "2")
        cited = reference["seconds"][case]["batch 8"]
        yield Row(section, case, "s", answer["best"], cited / 2, cited)


def page_ready() -> float:
    """Seconds from the start of the app's process to the first whole answer of its page. RuntimeError if none."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "playground", "app", "--port", str(port)]
    with tempfile.TemporaryFile() as log:
        start = time.perf_counter()
        process = subprocess.Popen(command, cwd=ROOT, stdout=log, stderr=subprocess.STDOUT)
        try:
            while time.perf_counter() - start < PATIENCE and process.poll() is None:
                try:
                    with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=PATIENCE) as answer:
                        if answer.status == 200 and answer.read():
                            return time.perf_counter() - start
                except (urllib.error.URLError, ConnectionError):
                    time.sleep(0.02)
            log.seek(0)
            raise RuntimeError(f"the app did not answer: {log.read()[-300:].decode(errors='replace').strip()}")
        finally:
            process.terminate()
            process.wait(timeout=30)


def this_machine() -> dict[str, Any]:
    """What the figures were measured on."""
    from importlib.metadata import version

    processor = platform.processor() or platform.machine()
    table = Path("/proc/cpuinfo")
    if table.is_file():
        lines = [line for line in table.read_text().splitlines() if line.startswith("model name")]
        processor = lines[0].split(":", 1)[1].strip() if lines else processor
    return {
        "processor": processor,
        "cores": os.cpu_count() or 1,
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0,
        "python": platform.python_version(),
        "torch": version("torch"),
        "system": platform.platform(),
    }


def _number(value: float) -> str:
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()
