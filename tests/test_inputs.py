"""The commands about what goes in, called as the command line calls them."""

import json
from pathlib import Path

import numpy as np
import pytest

from playground import cli
from tests.conftest import drifting


def test_rewrite_tells_steps_and_why(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.delenv("PLAYGROUND_LLM_URL", raising=False)
    assert cli.main(["rewrite", "he walks for 3 seconds, then waves"]) == 0
    told = capsys.readouterr().out
    assert told.startswith("a person walks, then waves\n   3.0 s  a person walks\n") and "as the prompt says" in told
    assert cli.main(["rewrite", "wave", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert set(record) == {"original", "normalised", "steps", "expressive", "notes"}
    assert record["steps"] == [{"text": "a person waves", "seconds": 3.0}]


def test_rewrite_asks_the_endpoint_unless_told_not_to(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PLAYGROUND_LLM_URL", "nowhere")
    assert cli.main(["rewrite", "wave"]) == 2
    assert "PLAYGROUND_LLM_URL" in capsys.readouterr().err
    assert cli.main(["rewrite", "wave", "--rules"]) == 0


def test_segment_lists_the_parts_and_draws_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    np.savez(tmp_path / "take.npz", joints=drifting(500), fps=np.float32(20))
    assert cli.main(["segment", str(tmp_path / "take.npz"), "--html", str(tmp_path / "deep" / "cuts.html")]) == 0
    lines = capsys.readouterr().out.splitlines()
    parts = [line.split() for line in lines[:-1]]
    assert float(parts[0][0]) == 0 and float(parts[-1][2]) == 25 and len(parts) >= 3
    assert all(4 <= float(part[4]) <= 12 for part in parts)
    assert "plotly" in (tmp_path / "deep" / "cuts.html").read_text(encoding="utf-8").lower()
