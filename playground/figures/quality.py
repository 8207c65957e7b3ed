"""Quality of LG-Tok's systems: our side of Tables 1, 2 and 3, Fig 2 and the perplexities, from stored results alone."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from playground.analysis.cited import cited
from playground.analysis.results import NOT_TRAINED, Estimate
from playground.engine import ASSETS
from playground.figures.colors import SystemColor, system_color
from playground.figures.tables import (
    DASH,
    Claim,
    Column,
    Results,
    Table,
    claims_table,
    error_bars,
    number,
    of_system,
    systems_table,
)
from playground.figures.theme import finish, reference_line
from playground.systems import BASE_SYSTEM, SYSTEMS, checkpoint_path, header

SAME = "_same_caption"
TABLE1 = ("lgtok-mini", "lgtok-mid", BASE_SYSTEM, "lgtok")
TABLE2 = ("lgtok", BASE_SYSTEM, "mosa", "momask", "momaskpp", "mogo", "t2mgpt", "mdm")
TABLE3 = (BASE_SYSTEM, "lgtok-notext", "lgtok-rvq", "momask", "mosa", "t2mgpt", "lgtok-mid", "lgtok-mini", "lgtok")
PERPLEXITY = (BASE_SYSTEM, "lgtok-notext", "lgtok-nodrop", "lgtok-mid", "lgtok-mini", "lgtok")


def _generated(head: str, key: str) -> Column:
    return Column(head, key)


def _rebuilt(head: str, key: str) -> Column:
    return Column(head, key, (("of", "reconstruction"),))


def table1(results: Results) -> Table:
    """Reconstruction and generation FID against the number of tokens."""
    chosen = {system: results.get(system) for system in TABLE1}
    columns = (_rebuilt("rFID", "fid"), _rebuilt("MPJPE, mm", "mpjpe_mm"), _generated("gFID", "fid"))
    return systems_table(chosen, columns, "Ours: tokens against quality", draws=False, guided=True)


def table2(results: Results) -> Table:
    """Generated motions beside the recorded ones, in the columns of the paper."""
    columns = (
        _generated("Top 1", "r_precision_top1_pool32"), _generated("Top 3", "r_precision_top3_pool32"),
        _generated("FID", "fid"), _generated("MM-Dist", "mm_dist"), _generated("Diversity", "diversity"),
        _generated("MModality", "multimodality"), _generated("CLIP-style score", "clip_score"),
    )  # fmt: skip
    note = (
        "Top k: own motion only, pool of 32. Real motion is compared with other windows of the same clips: its FID says"
        " how far the windows alone move it."
    )
    return _with_real(systems_table(results, columns, "Ours: generated motions", note, guided=True), results, columns)


def table2_more(results: Results) -> Table:
    """What the paper does not print: the other readings, and what can be measured without a network."""
    columns = (
        _generated("Top 3, same caption counts", "r_precision_top3_pool32" + SAME),
        _generated("Top 3, pool of 100", "r_precision_top3_pool100"),
        Column("prompts obeyed, %", "prompts_obeyed", scale=100.0), _generated("foot sliding, mm/s", "foot_sliding"),
        _generated("bone drift, mm", "bone_drift"),
    )  # fmt: skip
    return _with_real(systems_table(results, columns, "Ours: other readings", guided=True), results, columns)


def _with_real(table: Table, results: Results, columns: Sequence[Column]) -> Table:
    """The table with a first row of recorded motions, from the first system that was measured."""
    first = next((result for result in results.values() if result is not None), None)
    if first is None:
        return table
    real = ["real motion", DASH, DASH, *(number(first.estimate(c.key, of="real"), c.scale) for c in columns)]
    return Table(table.columns, (tuple(real), *table.rows), table.title, table.caption)


def table3(results: Results) -> Table:
    """Reconstruction by every tokenizer, and the generation on top of it."""
    chosen = {system: results.get(system) for system in TABLE3}
    columns = (
        _rebuilt("rFID", "fid"), _rebuilt("Top 1", "r_precision_top1_pool32"), _rebuilt("MPJPE, mm", "mpjpe_mm"),
        Column("MPJPE, mean over sources", "mpjpe_mm_source_mean", (("of", "every clip once"),)),
        _generated("gFID", "fid"), _generated("MM-Dist", "mm_dist"),
    )  # fmt: skip
    return systems_table(chosen, columns, "Ours: tokenizers", draws=False, guided=True)


def quality_claims(results: Results) -> Table:
    """Tables 1 to 3: more tokens, text at both ends. Claims on systems that were not asked for are left out."""

    low, mid, bare = "lgtok-mini", "lgtok-mid", "lgtok-notext"
    rows = (
        ("160 tokens rebuild better than 104 (rFID)", mid, low, "reconstruction", "fid"),
        ("236 tokens rebuild better than 160 (rFID)", BASE_SYSTEM, mid, "reconstruction", "fid"),
        ("160 tokens generate better than 236 (gFID; Table 1, without text)", mid, BASE_SYSTEM, "generated", "fid"),
        ("text at both ends rebuilds better (rFID)", BASE_SYSTEM, bare, "reconstruction", "fid"),
        ("text at both ends rebuilds more to the caption (Top 1)", BASE_SYSTEM, bare, "reconstruction",
         "r_precision_top1_pool32"),
        ("text at both ends generates better (gFID)", BASE_SYSTEM, bare, "generated", "fid"),
    )  # fmt: skip
    return claims_table([
        Claim(text, of_system(results, better, key, of=of), of_system(results, worse, key, of=of), key == "fid")
        for text, better, worse, of, key in rows
        if better in results and worse in results
    ])  # fmt: skip


def perplexity_table(results: Results) -> Table:
    """How surprised the generator is by the true tokens, and how evenly codes are used."""
    chosen = {system: results.get(system) for system in PERPLEXITY}
    columns = (
        _generated("of the true tokens", "model_perplexity_nll"),
        _generated("of arg-max codes", "model_perplexity_argmax"),
        _generated("codes used evenly", "code_perplexity"),
        Column("codes used, %", "usage", (("of", "generated"),), 100.0),
    )  # fmt: skip
    return systems_table(chosen, columns, "Ours: perplexity, mean over scales", note=(
        "Of the true tokens: exp of the mean negative log likelihood, teacher-forced, lower is more certain. Of arg-max"
        " codes: exp of the entropy of the histogram of the most probable codes, which is what the published program"
        " computes; lower means fewer different codes. Codes used evenly: the same of the recorded motions' own tokens."
    ))  # fmt: skip


def perplexity_claims(results: Results) -> Table:
    """With text at both ends of the tokenizer the generator is more certain."""

    def claim(text: str, key: str) -> Claim:
        with_text, without = (of_system(results, name, key, of="generated") for name in (BASE_SYSTEM, "lgtok-notext"))
        return Claim(text, with_text, without)

    return claims_table((
        claim("text guidance lowers the perplexity (of the true tokens)", "model_perplexity_nll"),
        claim("text guidance lowers the perplexity (of arg-max codes)", "model_perplexity_argmax"),
    ))  # fmt: skip


def evaluators_table() -> Table:
    """How well the evaluators find real motions by their captions, and the best that any reader could do."""
    readings = {
        "own": "own motion only",
        "same_caption": "any motion with the same caption",
        "ceiling_caption": "ceiling: captions told apart perfectly",
        "ceiling_action": "ceiling: only the action known",
    }
    rows: list[tuple[str, ...]] = []
    for name in ("tmr", "clip"):
        head = header(checkpoint_path(ASSETS, "evaluators", name))
        facts = _facts(head["__metadata__"]).get("retrieval") or {} if head else {}
        if not facts:
            rows.append((name, NOT_TRAINED, DASH, DASH, DASH))
        for pool in (key for key in facts if key.startswith("pool")):
            for reading, words in readings.items():
                tops = [number(Estimate.of(facts[pool][reading][f"top{k}"])) for k in (1, 2, 3)]
                rows.append((name, f"{words}, pool of {pool.removeprefix('pool')}", *tops))
    heads = ("evaluator", "real motions, held out", "Top 1", "Top 2", "Top 3")
    return Table(heads, tuple(rows), "What the evaluators know")


def _facts(metadata: Mapping[str, str]) -> dict[str, Any]:
    return dict(json.loads(metadata["facts"]))


# ---- plots ----------------------------------------------------------------------------------------------------------


def methods_plot(results: Results) -> go.Figure:
    """Fig 2: FID against Top 1 of generated motions, the paper's HumanML3D numbers and ours, each on their own axes."""
    figure = make_subplots(1, 2, horizontal_spacing=0.13, subplot_titles=("paper, HumanML3D", "ours"))
    figure.update_annotations(font={"size": 12}, yshift=2)
    quoted = cited("table2_humanml3d")
    for row in quoted.rows:
        values = dict(zip(quoted.columns, row, strict=True))
        if values["FID"] is not None:
            name = str(values["method"])
            _point(figure, 1, Estimate.of(values["FID"]), Estimate.of(values["Top 1"]), name, system_color(name))
    for system in results:
        pair = [of_system(results, system, key, of="generated") for key in ("fid", "r_precision_top1_pool32")]
        _point(figure, 2, pair[0], pair[1], SYSTEMS[system].title, system_color(system))
    first = next((result for result in results.values() if result is not None), None)
    ours = first.estimate("r_precision_top1_pool32", of="real") if first else Estimate(None)
    for column, value in enumerate((Estimate.of(quoted.value("real motion", "Top 1")), ours), 1):
        if value.mean is not None:
            annotation = {"text": "real motion", "font": {"size": 11}}
            figure.add_hline(
                y=value.mean,
                line=reference_line(),
                annotation=annotation,
                annotation_position="top left",
                col=column,
                row=1,
            )
        figure.update_xaxes(title="FID of generated motions, lower is better", row=1, col=column)
    for column in (1, 2):
        _room(figure, column)
    figure.update_yaxes(title="Top 1, higher is better", col=1)
    return finish(figure, title="Quality of generated motions", caption=_caption(results), heads=1)


def tokens_plot(results: Results) -> go.Figure:
    """Table 1 as lines: FID of rebuilt and of generated motions against the number of tokens."""
    figure = make_subplots(1, 2, horizontal_spacing=0.13, subplot_titles=("paper, Motion-X, without text", "ours"))
    figure.update_annotations(font={"size": 12}, yshift=2)
    quoted = cited("table1")
    counts = [row[quoted.columns.index("tokens")] for row in quoted.rows]
    for key, label, dash in (("rFID", "rebuilt", "solid"), ("gFID", "generated", "dash")):
        values = [Estimate.of(row[quoted.columns.index(key)]) for row in quoted.rows]
        _line(figure, 1, counts, values, label, dash)
    found = [(system, result) for system, result in results.items() if result is not None and system in TABLE1[:3]]
    ordered = sorted(found, key=lambda entry: entry[1].provenance["tokens"])
    places = [result.provenance["tokens"] for _, result in ordered]
    for of, label, dash in (("reconstruction", "rebuilt", "solid"), ("generated", "generated", "dash")):
        _line(figure, 2, places, [result.estimate("fid", of=of) for _, result in ordered], label, dash)
    if not ordered:
        figure.add_annotation(text=NOT_TRAINED, showarrow=False, xref="x2 domain", yref="y2 domain", x=0.5, y=0.5)
    figure.update_xaxes(title="tokens a motion", range=[80, 260])
    figure.update_yaxes(title="FID", rangemode="tozero")
    return finish(figure, title="Tokens against quality", caption=_caption(dict(ordered)), heads=1)


def _room(figure: go.Figure, column: int) -> None:
    """Ranges that leave room for the names beside and above the points; FID begins at 0."""
    axis = f"x{column if column > 1 else ''}"
    points = [(trace.x[0], trace.y[0]) for trace in figure.data if trace.xaxis == axis]
    lines = [shape.y0 for shape in figure.layout.shapes if str(shape.xref).startswith(f"{axis} ")]
    if points:
        heights = [y for _, y in points] + lines
        span = max(max(heights) - min(heights), 0.01)
        figure.update_xaxes(range=[0, 1.2 * max(x for x, _ in points)], row=1, col=column)
        figure.update_yaxes(range=[min(heights) - 0.1 * span, max(heights) + 0.2 * span], row=1, col=column)


def _line(figure: go.Figure, column: int, x: Sequence[Any], values: Sequence[Estimate], label: str, dash: str) -> None:
    color = system_color("lgtok")
    figure.add_trace(
        go.Scatter(
            x=list(x), y=[value.mean for value in values], error_y=error_bars(values), mode="lines+markers+text",
            name=label,
            text=[*[""] * (len(values) - 1), label][: len(values)], textposition="top center", showlegend=False,
            line={"color": color.light, "dash": dash}, meta={"dark": {"line.color": color.dark}},
            hovertemplate="%{x} tokens: %{y:.3f}" + f"<extra>{label}</extra>",
        ), 1, column,
    )  # fmt: skip


def _point(figure: go.Figure, column: int, x: Estimate, y: Estimate, label: str, color: SystemColor) -> None:
    if x.mean is None or y.mean is None:
        return
    figure.add_trace(
        go.Scatter(
            x=[x.mean], y=[y.mean], error_x=error_bars([x]), error_y=error_bars([y]), mode="markers+text", text=[label],
            textposition="top center", textfont={"size": 11}, showlegend=False, name=label,
            marker={"color": color.light, "size": 9},
            meta={"dark": {"marker.color": color.dark}}, hovertemplate="FID %{x:.3f}, Top 1 %{y:.3f}",
        ), 1, column,
    )  # fmt: skip


def _caption(results: Results) -> str:
    return "; ".join(result.line for result in results.values() if result is not None)
