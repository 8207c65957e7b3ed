"""What language does at the decoder: our side of Table 5, Fig 5 and Table 8, from stored results alone."""

import math

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from playground.analysis.results import NOT_MEASURED, Estimate, Result, why_absent
from playground.figures.colors import system_color
from playground.figures.tables import DASH, Claim, Results, Table, claims_table, error_bars, measured_on, number
from playground.figures.theme import finish, reference_line
from playground.systems import BASE_SYSTEM, DEFAULT_SYSTEM, SYSTEMS

TABLE5 = (BASE_SYSTEM, "lgtok-nodrop", "lgtok-notext", "lgtok")
SHOWN = (0.0, 1.0, 2.0)  # g of Table 5: none, the paper's on Motion-X, on HumanML3D
TOP = "r_precision_top3_pool32"
ONE_READING = "any: its decoder reads no text"


def best_guidance(result: Result, key: str = "fid", lower: bool = True) -> tuple[float, Estimate] | None:
    """The g of a sweep with the best mean of a metric, and that number; None where nothing is measured."""
    rows = [(float(row["g"]), result.value(row.get(key))) for row in result.rows]
    rows = [(g, value) for g, value in rows if value.mean is not None]
    if not rows:
        return None
    return min(rows, key=lambda entry: (1 if lower else -1) * (entry[1].mean or 0.0))


def sweep_plot(results: Results, *, title: str = "Guidance sweep", height: int = 380) -> go.Figure:
    """FID and Top 3 of generated motions against g, with 95 % intervals; the dashed line is recorded motion."""
    panels = (("fid", "FID, lower is better"), (TOP, "Top 3, pool of 32, higher is better"))
    figure = make_subplots(1, 2, horizontal_spacing=0.12)
    found = {system: result for system, result in results.items() if result is not None}
    for column, (key, words) in enumerate(panels, 1):
        for system, result in found.items():
            _curve(figure, column, result, key, SYSTEMS[system].title)
        real = next((result.value(result.more["real"].get(key)) for result in found.values()), Estimate(None))
        if real.mean is not None:
            annotation = {"text": "real motion", "font": {"size": 11}, "yanchor": "top" if key == TOP else "bottom"}
            figure.add_hline(y=real.mean, line=reference_line(), annotation=annotation, row=1, col=column)
        figure.update_yaxes(title=words, row=1, col=column)
    if not found:
        figure.add_annotation(text=NOT_MEASURED, showarrow=False, xref="paper", yref="paper", x=0.5, y=0.5)
    figure.update_xaxes(title="guidance scale g of the decoder")
    return finish(figure, title=title, caption="; ".join(result.line for result in found.values()), height=height)


def _curve(figure: go.Figure, column: int, result: Result, key: str, label: str) -> None:
    rows = [(float(row["g"]), result.value(row.get(key))) for row in result.rows]
    rows = [(g, value) for g, value in rows if value.mean is not None]
    color = system_color(result.system)
    figure.add_trace(
        go.Scatter(
            x=[g for g, _ in rows], y=[value.mean for _, value in rows], name=label, mode="lines+markers+text",
            error_y=error_bars([value for _, value in rows]),
            text=[*[""] * (len(rows) - 1), label][: len(rows)], textposition="top left", showlegend=False,
            line={"color": color.light, "dash": color.dash, "width": 2}, marker={"size": 6},
            meta={"dark": {"line.color": color.dark}}, hovertemplate="g = %{x:g}: %{y:.4f}" + f"<extra>{label}</extra>",
        ), 1, column,
    )  # fmt: skip


def sweep_table(results: Results) -> Table:
    """The best g of every system, by FID and by Top 3, beside g = 0."""
    rows = []
    for system, result in results.items():
        title = SYSTEMS[system].title
        if result is None:
            rows.append((title, why_absent(system), *[DASH] * 4))
            continue
        cells = [title]
        if _alike(*(result.estimate("fid", g=float(row["g"])) for row in result.rows)):
            values = [number(result.estimate(key, g=0.0)) for key in ("fid", TOP)]
            rows.append((title, ONE_READING, values[0], ONE_READING, values[1], DASH))
            continue
        for key, lower in (("fid", True), (TOP, False)):
            best = best_guidance(result, key, lower)
            cells += (
                [f"{best[0]:g}", f"{number(best[1])}; at 0: {number(result.estimate(key, g=0.0))}"]
                if best
                else [DASH] * 2
            )
        rows.append((*cells, f"{result.provenance['own_guidance']:g}"))
    heads = ("system", "best g by FID", "FID", "best g by Top 3", "Top 3", "g by default")
    return Table(heads, tuple(rows), "Ours: the best g", measured_on(results))


def _alike(*values: Estimate) -> bool:
    """Whether numbers differ by nothing but rounding."""
    means = [value.mean for value in values if value.mean is not None]
    return len(means) > 1 and math.isclose(min(means), max(means), rel_tol=1e-4)


def table5(results: Results) -> Table:
    """FID and Top 3 of generated motions with and without language drop and text, at several g."""
    rows = []
    for system in TABLE5:
        result = results.get(system)
        if result is None:
            rows.append((SYSTEMS[system].title, why_absent(system), *[DASH] * (2 * len(SHOWN) - 1)))
        else:
            cells = [number(result.estimate(key, g=g)) for key in ("fid", TOP) for g in SHOWN]
            rows.append((SYSTEMS[system].title, *cells))
    heads = ("system", *(f"FID, g = {g:g}" for g in SHOWN), *(f"Top 3, g = {g:g}" for g in SHOWN))
    note = "The tokens of a row are the same for every g. Without text the decoder has one branch: g does nothing."
    chosen = {system: results.get(system) for system in TABLE5}
    return Table(heads, tuple(rows), "Ours: language drop and guidance", f"{measured_on(chosen)}\n{note}")


def table5_claims(results: Results) -> Table:
    """What Table 5 says; a system's number is the one at its best g of SHOWN above 0, or at 0."""

    def at(system: str, guided: bool) -> Estimate:
        result = results.get(system)
        if result is None:
            return Estimate(None, why=f"{system} is {why_absent(system)}")
        values = [result.estimate("fid", g=g) for g in SHOWN if (g > 0) == guided]
        there = [value for value in values if value.mean is not None]
        return min(there, key=lambda value: value.mean or 0.0) if there else Estimate(None, why="no such g was swept")

    claims = [
        Claim(
            f"language-free guidance helps (FID, {SYSTEMS[BASE_SYSTEM].title}, best g above 0 against 0)",
            at(BASE_SYSTEM, True),
            at(BASE_SYSTEM, False),
        ),
        Claim(f"the same, {SYSTEMS[DEFAULT_SYSTEM].title}", at(DEFAULT_SYSTEM, True), at(DEFAULT_SYSTEM, False)),
        Claim(
            "guidance needs language drop: without it g = 0 is better than any g above 0 (FID)",
            at("lgtok-nodrop", False),
            at("lgtok-nodrop", True),
        ),
        Claim("language drop helps, with guidance (FID)", at(BASE_SYSTEM, True), at("lgtok-nodrop", True)),
        Claim("language drop helps, without guidance (FID)", at(BASE_SYSTEM, False), at("lgtok-nodrop", False)),
        Claim("text helps, with guidance (FID)", at(BASE_SYSTEM, True), at("lgtok-notext", False)),
        Claim("text helps, without guidance (FID)", at(BASE_SYSTEM, False), at("lgtok-notext", False)),
    ]
    return claims_table(claims, caption="The best of two g is chosen on the same motions, which flatters it a little.")


# ---- Table 8 ---------------------------------------------------------------------------------------------------------


def table8(results: Results) -> Table:
    """FID and more of tokens drawn with and without text, read in several ways; a block of rows a system."""
    rows = []
    for system, result in results.items():
        if result is None:
            rows.append((SYSTEMS[system].title, why_absent(system), *[DASH] * 4))
            continue
        for row in result.rows:
            words = "with the caption" if row["drawn"] == "prompted" else "free-form"
            values = [number(result.value(row.get(key))) for key in ("fid", TOP, "diversity")]
            rows.append((SYSTEMS[system].title, words, row["read"], *values))
    heads = ("system", "tokens drawn", "tokens read with", "FID", "Top 3", "Diversity")
    return Table(heads, tuple(rows), "Ours: free-form generation", measured_on(results))


def table8_claims(results: Results) -> Table:
    """What Table 8 says: language decoding improves free-form motions. And: free-form is the harder case."""
    claims = []
    for system, result in results.items():
        if result is None:
            continue
        title = SYSTEMS[system].title

        def fid(drawn: str, read: str, found: Result = result) -> Estimate:
            return found.estimate("fid", drawn=drawn, read=read)

        plain = fid("free", "text, g = 0")
        if _alike(plain, fid("free", "no text")):
            continue  # its decoder reads no text: there is nothing to compare
        claims += [
            Claim(f"free-form: language decoding with g = 2 helps (FID, {title})", fid("free", "text, g = 2"), plain),
            Claim(f"free-form: language decoding with g = 1 helps (FID, {title})", fid("free", "text, g = 1"), plain),
            Claim(f"free-form: a caption at the decoder helps (FID, {title})", plain, fid("free", "no text")),
            Claim(
                f"tokens drawn with the caption beat free-form (FID, {title})", fid("prompted", "text, g = 0"), plain
            ),
        ]
    return claims_table(claims)
