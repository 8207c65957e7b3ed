"""Does a generated motion do what its prompt says? Judged by joint geometry, no network (issue: prompts obeyed).

    report = judge_all(lambda prompt, seconds, seed: joints, seeds=(0, 1, 2))
    python -m playground.evaluation.prompts_obeyed --system lgtok --json obeyed.json

The judges and their thresholds are in judges.py; how recorded clips fare with them is in
tests/evaluation/test_prompts_obeyed.py.
"""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from playground.errors import PlaygroundError
from playground.evaluation import judges
from playground.evaluation.judges import THRESHOLDS, Judge, judge_motion
from playground.systems import DEFAULT_SYSTEM

Array = NDArray[np.floating]


@dataclass(frozen=True)
class Prompt:
    """A prompt, how many seconds are asked for, and who judges it. plain: one of the eight that the issue counts."""

    text: str
    seconds: float
    judge: Judge
    plain: bool = True


PROMPTS: tuple[Prompt, ...] = (
    Prompt("a person steadily walks forward for a while", 5.0, judges.walk_forward),
    Prompt("a person steadily walks forward and turns left", 6.0, judges.turn_left),
    Prompt("a person steadily walks forward and turns right", 6.0, judges.turn_right),
    Prompt("a person raises the left hand to head height", 3.0, judges.raise_left_hand),
    Prompt("a person raises the right hand to head height", 3.0, judges.raise_right_hand),
    Prompt("a person is running forward", 3.0, judges.run),
    Prompt("a person is walking backwards", 5.0, judges.walk_backwards),
    Prompt("a person is waving with both hands", 3.0, judges.wave_both_hands),
    Prompt("a person raises the left hand", 3.0, judges.raise_left_hand, plain=False),  # or is it to be waved?
    Prompt("a person raises the right hand", 3.0, judges.raise_right_hand, plain=False),
    Prompt("a person is waving with the left hand", 3.0, judges.wave_left_hand, plain=False),
    Prompt("a person is waving with the right hand", 3.0, judges.wave_right_hand, plain=False),
    Prompt("a person kicks with one leg", 3.0, judges.kick, plain=False),
    Prompt("a person jumps up", 3.0, judges.jump, plain=False),
    Prompt("a person squats down and stands up again", 3.0, judges.squat, plain=False),
    Prompt("a person sits down on a chair", 4.0, judges.sit, plain=False),
    Prompt("a person bows and straightens up again", 3.0, judges.bow, plain=False),
)


@dataclass(frozen=True)
class PromptResult:
    """One prompt over all seeds. failures: for every seed what was missed, empty where the motion obeyed."""

    text: str
    seconds: float
    judge: str
    plain: bool
    failures: dict[int, list[str]]

    @property
    def obeyed(self) -> int:
        """Number of seeds that did what the prompt says."""
        return sum(not missed for missed in self.failures.values())


@dataclass(frozen=True)
class ObeyedReport:
    """All prompts. share(plain=True) is the number that the model card states."""

    results: tuple[PromptResult, ...]
    seeds: tuple[int, ...]

    def share(self, plain: bool = True) -> float:
        """Share of obeyed motions among the plain prompts, or among the others; nan if there is none."""
        rows = [result for result in self.results if result.plain == plain]
        return sum(row.obeyed for row in rows) / (len(rows) * len(self.seeds)) if rows else float("nan")

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        rows = [asdict(result) | {"obeyed": result.obeyed} for result in self.results]
        return {"prompts_obeyed": self.share(), "others_obeyed": self.share(plain=False), "seeds": list(self.seeds),
                "thresholds": asdict(THRESHOLDS), "prompts": rows}  # fmt: skip


def judge_all(
    generate: Callable[[str, float, int], Array], seeds: Sequence[int] = (0, 1, 2), prompts: Sequence[Prompt] = PROMPTS
) -> ObeyedReport:
    """Generate every prompt with every seed and judge it. generate(prompt, seconds, seed) -> joints [F, 22, 3]."""
    results = []
    for prompt in prompts:
        failures = {seed: judge_motion(prompt.judge, generate(prompt.text, prompt.seconds, seed)) for seed in seeds}
        name = getattr(prompt.judge, "__name__", "judge")
        results.append(PromptResult(prompt.text, prompt.seconds, name, prompt.plain, failures))
    return ObeyedReport(tuple(results), tuple(seeds))


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line: judge a system of the engine, write the report as JSON. Exit status 2 and one line on bad input."""
    parser = argparse.ArgumentParser(prog="python -m playground.evaluation.prompts_obeyed", description=__doc__)
    parser.add_argument("--system", default=DEFAULT_SYSTEM, help="name of a system, see `python -m playground systems`")
    parser.add_argument("--json", type=Path, required=True, help="where the report goes")
    parser.add_argument("--seeds", type=int, default=3, help="seeds 0, 1, ... a prompt")
    options = parser.parse_args(arguments)
    from playground.engine import default_engine

    engine = default_engine()

    def generate(prompt: str, seconds: float, seed: int) -> Array:
        sys.stderr.write(f"\r{prompt} (seed {seed})".ljust(70))
        return engine.generate(prompt, seconds, options.system, seed=seed).motion.joints

    try:
        report = judge_all(generate, tuple(range(max(options.seeds, 1))))
        options.json.write_text(json.dumps({"system": options.system, **report.as_dict()}, indent=1), encoding="utf-8")
    except (PlaygroundError, OSError) as error:
        sys.stderr.write(f"\r{error}\n")
        return 2
    sys.stderr.write(f"\rplain prompts obeyed: {report.share():.0%}".ljust(70) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
