"""Numbers as people read them, and bars of blocks."""

from __future__ import annotations

import io
import json
import math
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from magcomp.cli.output import complain
from magcomp.report import words
from magcomp.report.as_json import dumps
from magcomp.report.bars import BEFORE_AFTER, Row, bar, lines


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (-1.12616, 0.0197, "-1.126 ± 0.020"),
        (178.66, 2.1, "178.7 ± 2.1"),
        (97.2, 11.4, "97 ± 11"),
        (0.72757, 0.00002, "0.728 ± 0.001"),
        (-0.0002, 0.031, "0.000 ± 0.031"),
        (1.5, math.nan, "1.5"),
    ],
)
def test_a_value_has_the_digits_its_error_allows(value: float, std: float, text: str) -> None:
    assert words.with_std(value, std) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (-0.0001, "0"), (2.0, "2"), (100.0, "100"), (-1.83, "-1.83"), (math.nan, "?")],
)
def test_a_parameter_has_no_needless_noughts(value: float, text: str) -> None:
    assert words.number(value) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(58.4, "58 s"), (59.6, "1 min 0 s"), (278.0, "4 min 38 s"), (7500.0, "2 h 5 min")],
)
def test_a_duration_is_in_words(seconds: float, text: str) -> None:
    assert words.duration(seconds) == text


@pytest.mark.parametrize(
    ("lag", "std", "text"),
    [
        (0.1497, 0.0011, "150 ± 1"),
        (0.05, 0.0001, "50 ± 1"),
        (0.05, math.nan, "50"),
        (math.nan, math.nan, "–"),
    ],
)
def test_a_lag_is_in_milliseconds(lag: float, std: float, text: str) -> None:
    assert words.milliseconds(lag, std) == text


def test_compasses_are_listed_as_people_do() -> None:
    assert words.compasses([2]) == "compass 2"
    assert words.compasses([1, 3]) == "compasses 1 and 3"
    assert words.compasses([1, 2, 3]) == "compasses 1, 2 and 3"


@given(st.floats(0.0, 180.0), st.floats(0.0, 180.0), st.integers(1, 60))
def test_a_bar_is_as_long_as_its_value_says(value: float, other: float, width: int) -> None:
    largest = max(value, other)
    drawn = bar(value, largest, width)
    eighths = 8 * drawn.count("█") + sum("▏▎▍▌▋▊▉".index(c) + 1 for c in drawn if c != "█")
    assert 1 <= len(drawn) <= width
    expected = value / largest * width * 8 if largest > 0.0 else 0.0
    assert eighths == pytest.approx(max(expected, 1.0), abs=0.5001)


def test_all_bars_of_a_picture_have_one_scale() -> None:
    rows = [Row("0 A", (10.0, 5.0)), Row("10 A", (20.0, 2.5))]
    _, first, second = lines("heading error", ("now", "corrected"), rows, BEFORE_AFTER, 80)
    assert first.plain.count("█") == 11 + 5
    assert second.plain.count("█") == 22 + 2


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.text() | st.floats(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    )
)
def test_json_never_holds_what_is_no_number(value: object) -> None:
    def refuse(word: str) -> float:
        raise AssertionError(f"{word} is not JSON")

    text = dumps({"value": value, "array": np.array([math.nan, 1.0, math.inf])})
    assert text.isascii()
    assert json.loads(text, parse_constant=refuse)["array"] == [None, 1.0, None]


class Terminal(io.StringIO):
    """A stderr that somebody looks at."""

    encoding = "utf-8"

    def isatty(self) -> bool:
        return True


def test_on_a_terminal_a_sentence_breaks_between_words_and_a_path_does_not_break(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    monkeypatch.setattr("sys.stderr", Terminal())
    words = "take the propellers off, or hold the vehicle down so that it cannot move or tilt"
    path = "/" + "long-folder/" * 8
    complain(f"{words}\n  {path}")
    *lines, last = sys.stderr.getvalue().splitlines()
    assert max(map(len, lines)) <= 60
    assert " ".join(lines) == f"magcomp: {words}."
    assert last == f"  {path}"
