"""Honest stopwatches: interleaved best-of-N, and peak memory of a fresh process. Standard library only.

Machines are shared and noisy, so calls that are to be compared take turns, and the best of several turns counts: noise
only ever adds time. Peak memory of a process never falls, so each case gets a process of its own.
"""

import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent


@dataclass(frozen=True)
class Timing:
    """Seconds of one call over several turns."""

    best: float
    median: float
    turns: int


def interleave(
    calls: Mapping[str, Callable[[], object]], *, turns: int = 7, warmup: int = 1, budget: float = 60.0
) -> dict[str, Timing]:
    """Time every call once a turn, in turn, after `warmup` untimed turns.

    At least three turns are taken; after that no turn starts once `budget` seconds have passed.
    """
    for _ in range(warmup):
        for call in calls.values():
            call()
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    begun = time.perf_counter()
    for turn in range(turns):
        if turn >= 3 and time.perf_counter() - begun > budget:
            break
        for name, call in calls.items():
            start = time.perf_counter()
            call()
            seconds[name].append(time.perf_counter() - start)
    return {name: Timing(min(all_), sorted(all_)[len(all_) // 2], len(all_)) for name, all_ in seconds.items()}


def peak_bytes() -> int:
    """Largest resident size this process has had, bytes."""
    status = Path("/proc/self/status")
    if status.is_file():  # getrusage would count the parent's size at the fork
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def resident_bytes() -> int:
    """Resident size of this process now, bytes; the peak where the system does not tell."""
    status = Path("/proc/self/statm")
    if not status.is_file():
        return peak_bytes()
    return int(status.read_text().split()[1]) * resource.getpagesize()


def fresh(module: str, *arguments: str, timeout: float = 900.0) -> dict[str, Any]:
    """Run `python -m module arguments` in a new process and return the JSON object on its last line of stdout.

    RuntimeError with the last line of its stderr if it fails.
    """
    done = subprocess.run(
        [sys.executable, "-m", module, *arguments], cwd=ROOT, capture_output=True, text=True, timeout=timeout
    )
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise RuntimeError(f"{module} {' '.join(arguments)} failed: {last[-500:]}")
    answer: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return answer
