"""The other papers' tables and plots: every number where it belongs, what is missing named."""

import pytest

from playground.analysis.results import Result
from playground.errors import PlaygroundError
from playground.figures import alignment, levels, others
from playground.figures.theme import on_dark

FACTS = {"data": "tiny", "split": "test", "seed": 0, "steps": 12, "drawn_steps": 15, "training_clips": 7,
         "training_seed": 0, "repeats": 3, "held_out": "B", "evaluator": None}  # fmt: skip


def entry(mean: float, ci95: float = 0.01) -> dict:
    return {"mean": mean, "ci95": ci95, "n": 5}


def level_rows(count: int, start: float) -> list[dict]:
    return [
        {"kept": n, "tokens": 3 * n, "mpjpe_mm": entry(start - n), "energy": entry(1 / (n + 1)), "fid": start / (n + 1),
         "coupling": None if n == 0 else n / 10}
        for n in range(count + 1)
    ]  # fmt: skip


def trained(table: str, label: str, run: str, **more: object) -> dict:
    return {"table": table, "label": label, "run": run, "measured_on": "test", "status": "trained", "n": 9} | more


def absent(table: str, label: str, run: str, measured_on: str = "test") -> dict:
    return {"table": table, "label": label, "run": run, "measured_on": measured_on, "status": "not trained yet"}


STORED = Result("ablations_others", "make ablations-others", FACTS, [
    trained("mogo3", "1 level", "mogo-1", rfid=entry(0.9), mpjpe_mm=entry(80.0), rtop1=entry(0.1),
            levels=level_rows(1, 90.0), between=[[1.0]]),
    trained("mogo3", "6 levels", "mogo-base", rfid=entry(0.2), mpjpe_mm=entry(50.0), rtop1=entry(0.3),
            levels=level_rows(2, 70.0), between=[[1.0, 0.25], [0.25, 1.0]]),
    absent("mogo3", "7 levels", "mogo-7"),
    trained("snap5", "small", "snap-cross-small", gfid=entry(1.5), parameters=1_500_000,
            validation=[{"step": 5, "val_loss": 3.0}, {"step": 10, "val_loss": 2.5}]),
    absent("snap5", "large", "snap-cross-large"),
    trained("mogo1", "MOGO", "mogo-heldout", measured_on="B", rfid=entry(0.7), mpjpe_mm=entry(61.0)),
    trained("mogo1", "MOGO", "mogo-heldout-generator", measured_on="B", gfid=entry(0.8), gtop1=entry(0.05),
            gmm_dist=entry(1.2)),
    absent("mogo1", "MoMask", "momask-heldout", "B"), absent("mogo1", "MoMask", "momask-heldout-generator", "B"),
])  # fmt: skip


def row_of(table, first: str) -> dict[str, str]:
    (row,) = [row for row in table.rows if row[0] == first]
    return dict(zip(table.columns, row, strict=True))


def test_ablations_stand_beside_the_paper_row_by_row() -> None:
    table = others.runs_table(STORED, "mogo3", ("rfid", "mpjpe_mm"), "mogo_table3")
    row = row_of(table, "1 level")
    assert (row["FID, paper"], row["rFID, ours"], row["MPJPE, ours, mm"]) == ("0.070", "0.900 ± 0.010", "80.00 ± 0.01")
    assert row_of(table, "3 levels")["rFID, ours"] == "–" and row_of(table, "3 levels")["FID, paper"] == "0.021"
    assert row_of(table, "7 levels")["rFID, ours"] == "not trained yet"
    assert others.runs_table(None, "snap5", ("gfid",)).rows == (("not trained yet", "–"),)
    assert "2 of 3 rows are trained" in others.runs_line(STORED, "mogo3") and "7 clips" in others.runs_line(
        STORED, "mogo3"
    )
    assert "every clip but those of B" in others.runs_line(STORED, "mogo1")
    assert "make ablations-others" in others.runs_line(None, "mogo3")


def test_claims_follow_from_the_numbers() -> None:
    claims = others.run_claims(STORED, (
        ("six beat one", "mogo-base", "mogo-1", "rfid"), ("text fits better with six", "mogo-base", "mogo-1", "rtop1"),
        ("seven beat six", "mogo-7", "mogo-base", "rfid"),
    )).rows  # fmt: skip
    assert claims[0][3].startswith("seen") and claims[1][3].startswith("seen")
    assert claims[2][3] == "cannot be said: mogo-7 is not trained yet"
    pairs = (("CASIM is better", "mdm-casim", "mdm"),)
    assert len(others.generated_claims({"mdm": None, "mdm-casim": None}, pairs).rows) == 2


def test_a_held_out_system_joins_its_two_runs() -> None:
    table = others.heldout_table(STORED)
    row = row_of(table, "MOGO")
    assert row["rFID, ours"].startswith("0.700") and row["gFID, ours"].startswith("0.800") and row["clips"] == "9"
    assert row_of(table, "MoMask")["rFID, ours"] == "not trained yet" and "without B" in table.title
    assert others.heldout_table(None).rows[0][0] == "not trained yet"


def test_validation_curves() -> None:
    figure = on_dark(others.validation_plot(STORED))
    assert [trace.name for trace in figure.data] == ["small, 1.5 M"] and list(figure.data[0].y) == [3.0, 2.5]
    (caption,) = [note.text for note in figure.layout.annotations if note.name == "caption"]
    assert "large" in caption
    assert not others.validation_plot(None).data


def test_levels_of_systems_and_of_runs() -> None:
    found = levels.of_systems({
        "lgtok": Result("levels", "", {"system": "lgtok"}, level_rows(2, 60.0), {"between": [[1.0]]}),
        "mogo": None,
    })  # fmt: skip
    figure = levels.kept_plot(found, "mpjpe_mm", "tokens")
    assert (
        list(figure.data[0].x) == [0, 3, 6] and list(figure.data[0].y) == [60.0, 59.0, 58.0] and len(figure.data) == 1
    )
    assert any("MOGO: " in (note.text or "") for note in figure.layout.annotations)
    runs = levels.of_runs(STORED, "mogo3")
    assert [len(one.rows) for one in runs] == [2, 3, 0]
    table = levels.levels_table([*found, *runs])
    assert ("LG-Tok", "2", "6", "58.00 ± 0.01", "0.333 ± 0.010", "20.0", "0.200") in table.rows
    maps = on_dark(levels.between_maps(runs))
    assert [list(line) for line in maps.data[1].z] == [[1.0, 0.25], [0.25, 1.0]] and not levels.between_maps([]).data
    assert not levels.kept_plot(levels.of_runs(None, "mogo3")).data


def test_an_alignment_shows_both_orders() -> None:
    rows = [
        {"prompt": f"{first} then {second}", "first": first, "second": second, "seconds": 4.0, "kept": entry(share),
         "words": ["walks", "then", "bows"], "weights": [[0.5, 0.0, 0.1], [0.25, 0.0, 0.3]], "what": "a layer",
         "lag": 0.5}
        for first, second, share in (("walk", "hands", 1.0), ("hands", "walk", 0.5))
    ]  # fmt: skip
    bare = [row | {"words": None, "weights": None, "lag": None, "why": "it reads no words"} for row in rows]
    results = {
        "t2mgpt-casim": Result("alignment", "", {"system": "t2mgpt-casim"}, rows),
        "t2mgpt": Result("alignment", "", {"system": "t2mgpt"}, bare),
        "mdm": None,
    }
    table = alignment.order_table(results)
    row = row_of(table, "T2M-GPT with CASIM")
    assert (row["order kept, %"], row["hands, walk"], row["lag of attention"]) == ("75.0", "50.0", "0.500")
    assert row_of(table, "T2M-GPT")["lag of attention"] == "–" and row_of(table, "MDM")["walk, hands"] == "–"
    figure = on_dark(alignment.alignment_maps(results, "t2mgpt-casim", "hands", "walk"))
    assert [note.text for note in figure.layout.annotations][:2] == ["hands then walk", "walk then hands"]
    assert [list(line) for line in figure.data[0].z[:2]] == [[1.0, 0.5], [0.0, 0.0]] and figure.data[0].dx == 2.0
    why = alignment.alignment_maps(results, "t2mgpt", "walk", "hands")
    assert not why.data and any(note.text == "it reads no words" for note in why.layout.annotations)
    assert not alignment.alignment_maps(results, "mdm", "walk", "hands").data


def test_contents() -> None:
    rows = [{"source": "all", "clips": 1234, "hours": 1.5, "captions": 3, "words": entry(7.25), "different": 2}]
    table = others.contents_table(Result("contents", "", {"data": "tiny"}, rows))
    assert table.rows == (("all", "1,234", "1.50", "3", "7.25 ± 0.01", "2"),)
    assert others.contents_table(None).rows[0][0] == "not counted yet"


def test_tables_of_systems_take_their_own_side() -> None:
    rows = [{"of": of, "fid": entry(start), "r_precision_top1_pool32": entry(start + 1), "mpjpe_mm": entry(start + 2)}
            for of, start in (("generated", 10.0), ("reconstruction", 20.0))]  # fmt: skip
    rows.append({"of": "every clip once", "mpjpe_mm_source_mean": 47.0})
    results = {"lgtok": Result("evaluation", "", {"system": "lgtok", "tokens": 5}, rows), "mogo": None}
    assert row_of(others.rebuilt_table(results), "LG-Tok")["rFID"].startswith("20")
    assert row_of(others.rebuilt_table(results), "LG-Tok")["mean over sources"] == "47.0"
    assert row_of(others.generated_table(results), "LG-Tok")["FID"].startswith("10")


def test_an_unknown_quote_is_told() -> None:
    with pytest.raises(PlaygroundError, match="nothing is quoted"):
        others.runs_table(STORED, "mogo3", ("rfid",), "mogo_table99")
