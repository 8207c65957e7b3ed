"""The ablations of LG-Tok: our side of Tables 4, 6 and 7 beside the paper's, from assets/results/ablations.json."""

from collections.abc import Mapping
from typing import Any

import plotly.graph_objects as go

from playground.analysis.cited import cited
from playground.analysis.paired import difference
from playground.analysis.results import NOT_TRAINED, Estimate, Result
from playground.figures.colors import system_color
from playground.figures.tables import DASH, Claim, Table, claims_table, error_bars, number
from playground.figures.theme import finish, reference_line

TABLES = ("4a", "4b", "4c", "4d", "4e", "4f", "4g")
_BASE = "base"


def ablation_table(stored: Result | None, table: str) -> Table:
    """One of Tables 4a to 4g: the paper's numbers and ours, row by row; rows of one side alone as well."""
    quoted = cited(f"table{table}")
    ours = [row for row in (stored.rows if stored else []) if row["table"] == table]
    labels = list(dict.fromkeys([str(row[0]) for row in quoted.rows] + [row["label"] for row in ours]))
    known = {row[0]: row[1:] for row in quoted.printed}
    mine = {row["label"]: row for row in ours}
    rows = [(label, *known.get(label, (DASH, DASH)), *_ablation(mine.get(label))) for label in labels]
    heads = ("row", "rFID, paper", "MPJPE, paper", "rFID, ours", "MPJPE, ours, mm", "longer clips, mm")
    return Table(heads, tuple(rows), quoted.title, f"{quoted.where}. {quoted.note}".strip())


def _ablation(row: Mapping[str, Any] | None) -> tuple[str, str, str]:
    if row is None:
        return DASH, DASH, DASH
    if row["status"] == NOT_TRAINED:
        return NOT_TRAINED, DASH, DASH
    error = Estimate(row.get("mpjpe_mm"), row.get("mpjpe_mm_ci95"))
    return number(Estimate.of(row.get("fid"))), number(error), number(Estimate.of(row.get("mpjpe_mm_long")))


def ablations_line(stored: Result | None) -> str:
    """What the ablations were trained and measured on."""
    if stored is None:
        return f"{NOT_TRAINED}: `make ablations` trains and measures them"
    facts = stored.provenance
    done = sum(row["status"] != NOT_TRAINED for row in stored.rows)
    parts = [f"{done} of {len(stored.rows)} rows are trained", f"size {facts['size']}", f"{facts['steps']:,} steps"]
    parts += [f"batch {facts['batch']}", f"{facts['training_clips']:,} training clips"]
    parts += [f"seed {facts['training_seed']}", f"measured on the split {facts['split']} of {facts['data']}"]
    return ", ".join(parts)


def ablation_value(stored: Result | None, run: str, key: str = "fid") -> Estimate:
    """A number of one ablation by the name of its run."""
    row = stored.row(run=run) if stored else {}
    if key not in row:
        return Estimate(None, why=f"{run} is {NOT_TRAINED}")
    return Estimate(row[key], row.get(f"{key}_ci95")) if key == "mpjpe_mm" else Estimate.of(row[key])


def ablation_gain(stored: Result | None, run: str) -> Estimate | None:
    """By how many mm of MPJPE the base is better than a run, clip by clip; None unless both say so of their clips."""
    base, other = ((stored.row(run=name) if stored else {}).get("by_clip") for name in (_BASE, run))
    if not base or not other:
        return None
    return Estimate(*difference(base["mm"], other["mm"], base["frames"]))


def ablation_claims(stored: Result | None) -> Table:
    """What Table 4 says, on our tiny tokenizers."""
    claims = [
        Claim(
            f"{text} ({head})",
            ablation_value(stored, _BASE, key),
            ablation_value(stored, other, key),
            gain=ablation_gain(stored, other) if key == "mpjpe_mm" else None,
        )
        for text, other in (
            ("RMSNorm is better than LayerNorm", "layer-norm"),
            ("SwiGLU is better than GELU", "gelu"),
            ("skips are better than none", "no-skips"),
            ("text in both is better than no text", "text-none"),
            ("text in both is better than in the tokenizer alone", "text-tokenizer"),
            ("text in both is better than in the detokenizer alone", "text-detokenizer"),
        )
        for key, head in (("fid", "rFID"), ("mpjpe_mm", "MPJPE"))
    ]
    note = (
        "Intervals: repeats of the measurement (rFID), clips (MPJPE); the verdict on MPJPE compares every clip with"
        " itself. Another training seed would move them further."
    )
    return claims_table(claims, caption=note)


def ablation_plot(stored: Result | None) -> go.Figure:
    """Mean joint error of every trained row with its interval; the dashed line is the base that all rows share."""
    rows = [row for row in (stored.rows if stored else []) if row["table"] in TABLES and row["status"] != NOT_TRAINED]
    labels = [f"{row['table']}  {row['label']}" for row in rows]
    color = system_color("lgtok")
    figure = go.Figure(
        go.Scatter(
            x=[row["mpjpe_mm"] for row in rows], y=labels, mode="markers", showlegend=False,
            error_x=error_bars([Estimate(row["mpjpe_mm"], row.get("mpjpe_mm_ci95")) for row in rows]),
            marker={"color": color.light, "size": 8}, meta={"dark": {"marker.color": color.dark}},
            hovertemplate="%{y}: %{x:.1f} mm<extra></extra>",
        )
    )  # fmt: skip
    base = ablation_value(stored, _BASE, "mpjpe_mm")
    if base.mean is not None:
        figure.add_vline(x=base.mean, line=reference_line())
    if not rows:
        figure.add_annotation(text=NOT_TRAINED, showarrow=False, xref="paper", yref="paper", x=0.5, y=0.5)
    figure.update_yaxes(autorange="reversed")
    figure.update_xaxes(title="MPJPE on the test split, mm")
    return finish(
        figure, title="Ours: tiny tokenizers", caption=ablations_line(stored), height=140 + 18 * len(rows), left=260
    )


def table6(stored: Result | None) -> Table:
    """The CLIP-style evaluator trained with batches of several sizes."""
    ours = {row["label"]: row for row in (stored.rows if stored else []) if row["table"] == "6"}
    rows: list[tuple[str, ...]] = []
    for label, score in cited("table6").printed:
        row = ours.get(label, {"status": NOT_TRAINED})
        if row["status"] == NOT_TRAINED:
            rows.append((label, score, NOT_TRAINED, DASH, DASH))
            continue
        pool = ((row.get("retrieval") or {}).get("pool32") or {}).get("own") or {}
        tops = [number(Estimate.of(pool.get(top))) for top in ("top1", "top3")]
        rows.append((label, score, number(Estimate.of(row.get("clip_score"))), *tops))
    heads = ("row", "CLIP score, paper", "mean cosine of true pairs, ours", "Top 1, ours", "Top 3, ours")
    return Table(heads, tuple(rows), "Batch size of the contrastive evaluator", "Top k: own motion only, pool of 32.")


def table7(stored: Result | None) -> Table:
    """Short clips alone against short clips and long windows."""
    rows = [
        (row["label"], *_ablation(row))
        for row in (stored.rows if stored else [])
        if row["table"] == "7"
    ]  # fmt: skip
    heads = ("training", "rFID, all clips", "MPJPE, all clips, mm", "MPJPE, longer clips, mm")
    return Table(heads, tuple(rows) or ((NOT_TRAINED, DASH, DASH, DASH),), "Ours: training with long windows")
