"""Usage figures: the drawn numbers are the counted ones, clicks name codes, and empty scales are drawn too."""

import json

import numpy as np
import pytest

from playground.analysis.usage import CodeUsage
from playground.errors import PlaygroundError
from playground.figures.usage import usage_claims, usage_histogram, usage_panels, usage_summary


def usage(seed: int = 0, codes: tuple[int, ...] = (5, 9, 12)) -> CodeUsage:
    rng = np.random.default_rng(seed)
    return CodeUsage().fit([rng.integers(0, size, 40) ** 2 % size for size in codes], codes)


def texts(figure) -> str:
    return " | ".join(str(annotation.text) for annotation in figure.layout.annotations)


@pytest.mark.parametrize("order", ["sorted", "index"])
def test_a_bar_is_its_code(order: str) -> None:
    found = usage()
    bars = usage_histogram(found, 1, order=order, caption="433 test clips, seed 0").data[0]
    assert sorted(bars.customdata) == list(range(9))
    for code, height in zip(bars.customdata, bars.y, strict=True):
        assert height == pytest.approx(found.counts_[1][code] / 40 * 9, abs=1e-4)
    if order == "index":
        assert list(bars.customdata) == list(range(9))
    else:
        assert list(bars.y) == sorted(bars.y, reverse=True)


def test_the_facts_stand_in_the_figure() -> None:
    found = usage()
    figure = usage_histogram(found, 2, caption="433 test clips, seed 0")
    assert f"{len(found.dead_[2])} dead" in texts(figure)
    assert f"perplexity {found.perplexity_[2]:.1f}" in texts(figure) and "433 test clips, seed 0" in texts(figure)


@pytest.mark.parametrize("scale", [-1, 3])
def test_a_scale_that_is_not_there_is_refused(scale: int) -> None:
    with pytest.raises(PlaygroundError):
        usage_histogram(usage(), scale)


def test_panels_of_one_system_have_one_curve_a_scale() -> None:
    found = usage()
    figure = usage_panels({"lgtok": found}, (1, 3, 4), caption="seed 0")
    assert len(figure.data) == 3
    assert len({trace.line.color for trace in figure.data}) == 3
    for n, trace in enumerate(figure.data):
        np.testing.assert_allclose(trace.y, found.relative(n), atol=1e-4)
    assert "scale 1 · 1 token<br>" in texts(figure) and "scale 2 · 3 tokens" in texts(figure)


def test_panels_of_two_systems_have_their_colours_and_names() -> None:
    figure = usage_panels({"lgtok": usage(), "momask": usage(1, (5, 20, 12))}, (1, 3, 4), titles={"lgtok": "LG-Tok"})
    curves = [trace for trace in figure.data if trace.mode == "lines"]
    assert len(curves) == 6 and len({trace.line.color for trace in curves}) == 2
    assert {trace.text[0] for trace in figure.data if trace.mode == "text"} == {"LG-Tok", "momask"}
    assert all(0 < x < 100 for trace in curves for x in trace.x)


def test_panels_need_systems_of_equal_scales() -> None:
    with pytest.raises(PlaygroundError):
        usage_panels({}, (1, 2))
    with pytest.raises(PlaygroundError):
        usage_panels({"lgtok": usage()}, (1, 2))


def test_summary_shows_both_shares() -> None:
    found = usage()
    figure = usage_summary({"lgtok": found}, (1, 3, 4))
    np.testing.assert_allclose(figure.data[0].y, 100 * found.used_, atol=1e-3)
    np.testing.assert_allclose(figure.data[1].y, 100 * found.perplexity_ / [5, 9, 12], atol=1e-3)


def test_claims_weigh_perplexity_by_codebook_in_both_halves() -> None:
    even = CodeUsage().fit([np.arange(4), np.arange(8), np.arange(8), np.arange(8)], (4, 8, 8, 8))
    lean = CodeUsage().fit([np.arange(4), np.arange(8), np.zeros(9, int), np.zeros(9, int)], (4, 8, 8, 8))
    rows = usage_claims({"lgtok": even, "mosa": lean}, {"lgtok": "A", "mosa": "B"}).rows
    assert [row[1:3] for row in rows] == [("1.000", "0.562"), ("1.000", "1.000"), ("1.000", "0.125")]
    assert rows[0][0] == "A uses its codes more evenly than B, all scales"
    assert [row[3].split(",")[0].split(":")[0] for row in rows] == ["seen", "not seen", "seen"]
    alone = CodeUsage().fit([[]], (1,))
    assert all(
        "no token" in row[3] for row in usage_claims({"lgtok": alone, "mosa": alone}, {"lgtok": "A", "mosa": "B"}).rows
    )


@pytest.mark.parametrize("sizes", [(1,), (1, 2)])
def test_nothing_counted_is_drawn_as_nothing(sizes: tuple[int, ...]) -> None:
    empty = CodeUsage().fit([[] for _ in sizes], [1] * len(sizes))
    figures = [
        usage_histogram(empty, 0),
        usage_panels({"lgtok": empty}, sizes),
        usage_panels({"lgtok": empty, "mosa": empty}, sizes),
        usage_summary({"lgtok": empty}, sizes),
    ]
    for figure in figures:
        json.loads(figure.to_json())
    assert "no tokens counted" in texts(figures[0])
