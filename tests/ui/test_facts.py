"""Numbers and sentences as text: significant digits, units, escaping."""

from decimal import Decimal
from html.parser import HTMLParser

import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.ui.errors import OUR_FAULT, error_line, note_line
from playground.ui.facts import Fact, badge, bits, bits_text, facts_line, millimetres, seconds_text, significant, table


@given(st.floats(1e-6, 1e9))
def test_two_significant_digits_are_right_to_half_a_step(value: float) -> None:
    shown = float(significant(value).replace(",", ""))
    step = Decimal(10) ** (Decimal(value).adjusted() - (2 if value >= 99.5 else 1))
    assert abs(Decimal(shown) - Decimal(value)) <= step * Decimal("0.5000001")


@pytest.mark.parametrize(
    ("value", "text"),
    [(38.42, "38"), (0.2149, "0.21"), (1234.0, "1,230"), (7.05, "7.0"), (0.0, "0"), (99.6, "100"), (-4.21, "-4.2"),
     (float("nan"), "not measured"), (float("inf"), "not measured"), (0.00012, "0.00012")],
)  # fmt: skip
def test_numbers_read_well(value: float, text: str) -> None:
    assert significant(value) == text


def test_units() -> None:
    assert millimetres(38.42) == "38 mm" and millimetres(None) == "–"
    assert seconds_text(0.0001) == "<0.01 s" and seconds_text(0.213) == "0.21 s"
    assert bits_text(840) == "840 bit" and bits_text(1740) == "1.7 kbit"


@given(st.lists(st.tuples(st.integers(1, 60), st.integers(1, 4096)), max_size=12))
def test_bits_are_what_counting_the_messages_gives(levels: list[tuple[int, int]]) -> None:
    messages = 1
    for size, codes in levels:
        messages *= codes**size
    expected = messages.bit_length() - 1 if messages & (messages - 1) == 0 else None
    found = bits([size for size, _ in levels], [codes for _, codes in levels])
    if expected is not None:
        assert found == pytest.approx(expected)
    assert messages.bit_length() - 1 <= found + 1e-6 and found <= messages.bit_length() + 1e-6


class Reader(HTMLParser):
    """Keeps tags and text, and fails on anything left open."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open.append(tag)
        self.tags.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def read(text: str) -> Reader:
    reader = Reader()
    reader.feed(text)
    assert not reader.open
    return reader


@given(st.text(max_size=60), st.text(max_size=60))
def test_whatever_stands_in_a_fact_stays_text(value: str, card: str) -> None:
    reader = read(facts_line([Fact(value, "label", card)], badge("live", 0.2)))
    assert set(reader.tags) <= {"dl", "div", "dd", "dt", "span"}


@given(st.text(max_size=200))
def test_an_error_is_one_sentence_of_plain_text(sentence: str) -> None:
    reader = read(error_line(sentence))
    assert reader.tags == ["p"]
    assert reader.text and reader.text[-1] in ".!?" and "\n" not in reader.text
    read(note_line(sentence))


def test_an_empty_error_still_says_something() -> None:
    assert read(error_line("  ")).text == OUR_FAULT


@given(st.lists(st.lists(st.text(max_size=8), min_size=2, max_size=2), max_size=4))
def test_a_table_has_its_rows(rows: list[list[str]]) -> None:
    reader = read(table(["a", "b"], rows, "<caption>"))
    assert reader.tags.count("tr") == len(rows) + 1 and reader.tags.count("td") == len(rows)


def test_badges_say_where_a_result_comes_from() -> None:
    assert "live, 0.21 s" in read(badge("live", 0.21)).text
    assert read(badge("stored", 3.0)).text == "stored"
