"""Tables as notebooks show them: escaped cells, readable numbers, verdicts that follow from the numbers."""

from html.parser import HTMLParser

import pytest

from playground.analysis.results import Estimate
from playground.errors import PlaygroundError
from playground.figures.tables import Claim, Table, cited_table, claims_table, number, significant


class Cells(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        if tag in ("td", "th"):
            self.found.append("")

    def handle_data(self, data: str) -> None:
        if self.found:
            self.found[-1] += data


def test_html_holds_every_cell_and_no_markup_of_its_own() -> None:
    table = Table(("a", "<b>"), (("1 & 2", "<script>"), ("", "–")), "<title>", "first\nsecond")
    reader = Cells()
    reader.feed(table._repr_html_().partition("</tbody>")[0])
    assert reader.found == ["a", "<b>", "1 & 2", "<script>", "", "–"]
    assert "<script>" not in table._repr_html_() and "&lt;title&gt;" in table._repr_html_()
    assert str(table).splitlines() == ["<title>", "a | <b>", "1 & 2 | <script>", " | –", "first", "second"]


def test_rows_of_another_length_are_told() -> None:
    with pytest.raises(PlaygroundError, match="2 columns"):
        Table(("a", "b"), (("1",),))


@pytest.mark.parametrize(("value", "words"), [
    (433.2, "433"), (27.68, "27.7"), (0.05712, "0.0571"), (0.0, "0"), (-3.14159, "-3.14"), (1234567.0, "1,234,567"),
    (1e-12, "0.000000"), (float("nan"), "–"),
])  # fmt: skip
def test_significant_digits(value: float, words: str) -> None:
    assert significant(value) == words


def test_a_number_with_its_interval() -> None:
    assert number(Estimate(0.76502, 0.00679)) == "0.765 ± 0.007"
    assert number(Estimate(0.931, 0.02), 100) == "93.1 ± 2.0"
    assert number(Estimate(109.24, 0.18)) == "109.2 ± 0.2" and number(Estimate(433.0, 0.0)) == "433 ± 0"
    assert number(Estimate(433.0, 1e-9)) == "433.00 ± 0.00"  # two more places at most
    assert number(Estimate(27.7)) == "27.7" and number(Estimate(None)) == "–"


def test_claims_carry_both_numbers_and_the_verdict() -> None:
    table = claims_table([Claim("a beats b", Estimate(1.0, 0.1), Estimate(2.0, 0.1)),
                          Claim("b beats a", Estimate(2.0, 0.1), Estimate(1.0, 0.1)),
                          Claim("more is better", Estimate(2.0), Estimate(1.0), lower=False)])  # fmt: skip
    assert [row[3].partition(",")[0] for row in table.rows] == [
        "seen", "not seen: it is the other way round", "seen",
    ]  # fmt: skip
    assert table.rows[0][1:3] == ("1.00 ± 0.10", "2.00 ± 0.10")


def test_a_quoted_table_names_its_place() -> None:
    table = cited_table("table3_humanml3d")
    assert ("LG-Tok", "0.022", "0.502", "39.0") in table.rows and "Table 3" in table.caption
