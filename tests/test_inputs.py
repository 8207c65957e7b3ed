"""The commands about what goes in, called as the command line calls them."""

import json
from pathlib import Path

import numpy as np
import pytest

from playground import cli
from playground.motion.bvh import read_bvh
from tests.conftest import drifting
from tests.data.published import snap_features, snap_motion


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


def test_snapmogen_columns_become_bvh_and_come_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    positions, quaternions = snap_motion()
    rows = snap_features(positions, quaternions, np.zeros(len(positions)))
    np.save(tmp_path / "rows.npy", rows)
    assert cli.main(["snapmogen", str(tmp_path / "rows.npy"), "--out", str(tmp_path / "deep" / "rig.bvh")]) == 0
    rig = read_bvh((tmp_path / "deep" / "rig.bvh").read_bytes())
    np.testing.assert_allclose(rig.positions - rig.positions[:1, :1], (positions - positions[:1, :1])[:-1], atol=1e-2)
    assert cli.main(["snapmogen", str(tmp_path / "deep" / "rig.bvh"), "--out", str(tmp_path / "back.npz")]) == 0
    with np.load(tmp_path / "back.npz") as back:
        assert back["features"].shape == (len(rows) - 1, 296) and back["offsets"].shape == (24, 3) and back["fps"] == 30
    assert f"{len(rows) - 1} rows of 296 columns" in capsys.readouterr().out
