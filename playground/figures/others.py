"""The other papers' tables: ours beside what they print, from stored results alone."""

from collections.abc import Mapping, Sequence
from typing import Any

import plotly.graph_objects as go

from playground.analysis.cited import cited
from playground.analysis.results import NOT_TRAINED, Estimate, Result
from playground.figures.tables import (
    DASH,
    Claim,
    Column,
    Results,
    Table,
    claims_table,
    measured_on,
    number,
    of_system,
    systems_table,
)
from playground.figures.theme import finish

OURS = {  # columns of the ablations -> heads
    "rfid": "rFID, ours", "mpjpe_mm": "MPJPE, ours, mm", "rtop1": "Top 1 rebuilt, ours", "gfid": "gFID, ours",
    "gtop1": "Top 1 generated, ours", "gmm_dist": "MM-Dist generated, ours",
}  # fmt: skip
_SIZES = ("#d55e00", "#e69f00", "#882255", "#0072b2"), ("#f0843c", "#f2b53a", "#e0709c", "#3b9fe0")
_DASHES = ("solid", "dash", "dot", "dashdot")


def rebuilt_table(results: Results) -> Table:
    """Tokenizers side by side, rebuilt motions."""
    columns = tuple(
        Column(head, key, (("of", of),))
        for head, key, of in (
            ("rFID", "fid", "reconstruction"), ("Top 1", "r_precision_top1_pool32", "reconstruction"),
            ("MPJPE, mm", "mpjpe_mm", "reconstruction"),
            ("mean over sources", "mpjpe_mm_source_mean", "every clip once"),
        )
    )  # fmt: skip
    return systems_table(results, columns, "Ours: tokenizers", draws=False)


def generated_table(results: Results) -> Table:
    """Generators side by side in the columns of the papers' result tables."""
    columns = tuple(
        Column(head, key)
        for head, key in (
            ("Top 1", "r_precision_top1_pool32"), ("Top 2", "r_precision_top2_pool32"),
            ("Top 3", "r_precision_top3_pool32"), ("Top 3, pool of 100", "r_precision_top3_pool100"), ("FID", "fid"),
            ("MM-Dist", "mm_dist"), ("Diversity", "diversity"), ("MModality", "multimodality"),
            ("CLIP-style score", "clip_score"),
        )
    )  # fmt: skip
    return systems_table(results, columns, "Ours: generated motions", "Top k: own motion only, pool of 32.")


def generated_claims(results: Results, pairs: Sequence[tuple[str, str, str]]) -> Table:
    """Whether the first system of a pair generates better than the second; pairs: (what the paper says, first, second).

    Both by FID and by Top 1.
    """
    claims = [
        Claim(
            f"{text} ({head})",
            of_system(results, better, key, of="generated"),
            of_system(results, worse, key, of="generated"),
            lower,
        )
        for text, better, worse in pairs
        for head, key, lower in (("FID", "fid", True), ("Top 1", "r_precision_top1_pool32", False))
    ]
    return claims_table(claims, caption=measured_on(results))


# ---- ablations ------------------------------------------------------------------------------------------------------


def runs_table(stored: Result | None, table: str, keys: Sequence[str], quoted: str = "") -> Table:
    """One table of the ablations: the paper's columns, if any are quoted, and ours (keys of OURS), row by row.

    Rows of one side alone stand there as well.
    """
    paper = cited(quoted) if quoted else None
    printed = {row[0]: row[1:] for row in paper.printed} if paper else {}
    heads = tuple(f"{name}, paper" for name in paper.columns[1:]) if paper else ()
    ours = {row["label"]: row for row in (stored.rows if stored else []) if row["table"] == table}
    rows = []
    for label in dict.fromkeys([*printed, *ours]):
        left = printed.get(label, (DASH,) * len(heads))
        rows.append((label, *left, *_cells(ours.get(label), keys)))
    caption = f"{paper.where}. {paper.note}".strip() if paper else ""
    title = paper.title if paper else "Ours"
    columns = ("row", *heads, *(OURS[key] for key in keys))
    return Table(columns, tuple(rows) or ((NOT_TRAINED, *[DASH] * (len(columns) - 1)),), title, caption)


def _cells(row: Mapping[str, Any] | None, keys: Sequence[str]) -> tuple[str, ...]:
    if row is None:
        return (DASH,) * len(keys)
    if row["status"] == NOT_TRAINED:
        return (NOT_TRAINED, *[DASH] * (len(keys) - 1))
    return tuple(number(Estimate.of(row.get(key))) for key in keys)


def runs_line(stored: Result | None, *tables: str) -> str:
    """What the ablations of some tables were trained and measured on, and which command trains them."""
    if stored is None:
        return f"{NOT_TRAINED}: `make ablations-others` trains and measures them"
    facts, rows = stored.provenance, [row for row in stored.rows if row["table"] in tables]
    done = sum(row["status"] != NOT_TRAINED for row in rows)
    parts = [f"{done} of {len(rows)} rows are trained (`make ablations-others` trains the others)"]
    unseen = any(row["measured_on"] == facts["held_out"] for row in rows)
    clips = f"every clip but those of {facts['held_out']}" if unseen else f"{facts['training_clips']:,} clips"
    parts += [f"tokenizers {facts['steps']:,} steps on {clips}"]
    parts += [f"generators {facts['drawn_steps']:,} steps", f"seed {facts['training_seed']}"]
    measured = ", ".join(dict.fromkeys(row["measured_on"] for row in rows)) or facts["split"]
    return ", ".join([*parts, f"measured on {measured} of {facts['data']}, {facts['repeats']} repeats"])


def run_value(stored: Result | None, run: str, key: str) -> Estimate:
    """A number of one ablation by the name of its run; where there is none, why."""
    row = stored.row(run=run) if stored else {}
    if row.get("status", NOT_TRAINED) == NOT_TRAINED:
        return Estimate(None, why=f"{run} is {NOT_TRAINED}")
    return Estimate.of(row.get(key))


def run_claims(stored: Result | None, claims: Sequence[tuple[str, str, str, str]]) -> Table:
    """Claims on two runs: (what the paper says, the better run, the other one, key of OURS). Top 1 counts upwards."""
    return claims_table(
        [
            Claim(text, run_value(stored, better, key), run_value(stored, worse, key), not key.endswith("top1"))
            for text, better, worse, key in claims
        ],
        caption="Intervals: repeats of the measurement, or clips (MPJPE). Another seed would move them further.",
    )


def heldout_table(stored: Result | None) -> Table:
    """Systems that have not seen one source, measured on it: rebuilt and generated."""
    rows: dict[str, dict[str, Any]] = {}
    for row in stored.rows if stored else []:
        if row["table"] == "mogo1":
            known = rows.setdefault(row["label"], {"status": NOT_TRAINED})
            trained = row["status"] != NOT_TRAINED
            rows[row["label"]] = known | (row if trained else {})
    keys = ("rfid", "mpjpe_mm", "gfid", "gtop1", "gmm_dist")
    cells = [(label, str(row.get("n", DASH)), *_cells(row, keys)) for label, row in rows.items()]
    source = stored.provenance["held_out"] if stored else "one source"
    heads = ("system", "clips", *(OURS[key] for key in keys))
    empty = ((NOT_TRAINED, *[DASH] * (len(heads) - 1)),)
    return Table(heads, tuple(cells) or empty, f"Ours: trained without {source}, measured on all of it")


def validation_plot(stored: Result | None, table: str = "snap5") -> go.Figure:
    """Loss on the validation split against the training steps, a line a generator: where it turns up, it over-fits."""
    figure = go.Figure()
    rows = [row for row in (stored.rows if stored else []) if row["table"] == table]
    absent = [row["label"] for row in rows if row["status"] == NOT_TRAINED]
    for place, row in enumerate(rows):
        curve = row.get("validation") or []
        if row["label"] in absent or not curve:
            continue
        name = f"{row['label']}, {row['parameters'] / 1e6:.1f} M"
        figure.add_trace(
            go.Scatter(
                x=[point["step"] for point in curve], y=[point["val_loss"] for point in curve], name=name,
                mode="lines+markers", showlegend=True, meta={"dark": {"line.color": _SIZES[1][place % 4]}},
                line={"color": _SIZES[0][place % 4], "dash": _DASHES[place % 4], "width": 1.5},
                hovertemplate="step %{x}: %{y:.3f}<extra>" + name + "</extra>",
            )
        )  # fmt: skip
    if not figure.data:
        figure.add_annotation(text=NOT_TRAINED, showarrow=False, xref="paper", yref="paper", x=0.5, y=0.5)
    figure.update_xaxes(title="training steps", rangemode="tozero")
    figure.update_yaxes(title="loss on the validation split")
    missing = [f"{NOT_TRAINED}: {', '.join(absent)}"] if absent else []
    return finish(
        figure, title="Validation loss", caption="; ".join([runs_line(stored, table), *missing]), right=24
    )  # fmt: skip


# ---- data sets ------------------------------------------------------------------------------------------------------


def contents_table(stored: Result | None) -> Table:
    """What the library holds, by source."""
    heads = ("source", "clips", "hours", "captions", "words a caption", "different captions")
    if stored is None:
        return Table(heads, (("not counted yet", *[DASH] * 5),), "Ours", "`make figures` counts a prepared library")
    rows = tuple(
        (
            row["source"], f"{row['clips']:,}", f"{row['hours']:.2f}", f"{row['captions']:,}",
            number(Estimate.of(row["words"])), f"{row['different']:,}",
        )
        for row in stored.rows
    )  # fmt: skip
    return Table(heads, rows, f"Ours: {stored.provenance['data']}", "Mirrored copies are not counted.")
