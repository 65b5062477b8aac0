"""Text for people: it follows the width, down to 60 columns, and does without Unicode."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from report_analyses import Case, still

from magcomp.report import as_text
from magcomp.report.as_json import analysis_object
from magcomp.report.ascii import encodable, in_words
from magcomp.report.bars import BEFORE_AFTER, Row, lines
from magcomp.report.look import Look

WIDTHS = [60, 66, 73, 74, 80, 100]


def text_of(case: Case, look: Look, *, verbose: bool = True) -> str:
    # Where a path stands it stands whole, to be copied.
    analysis = replace(case.analysis, source="a.tlog")
    parameters = {
        name: value
        for compass in analysis_object(analysis)["compasses"]
        for name, value in compass["parameters"].items()
    }
    return as_text.analysis_text(analysis, parameters, case.present, look, verbose=verbose)


@pytest.mark.parametrize("columns", WIDTHS)
def test_no_line_is_wider_than_the_terminal(columns: int) -> None:
    text = text_of(still(), Look(columns))
    assert max(map(len, text.splitlines())) <= columns


def test_a_narrow_terminal_is_told_no_less() -> None:
    wide, narrow = (text_of(still(), Look(columns)) for columns in (100, 60))
    for number in (1, 2, 3):
        assert narrow.count(f"compass {number}\n") == wide.count(f"compass {number}\n") or (
            f"compass {number}" in narrow
        )
    assert narrow.count("±") == wide.count("±")
    assert narrow.count("→") == wide.count("→")


@pytest.mark.parametrize("width", range(60, 101, 4))
def test_the_bars_grow_with_the_width(width: int) -> None:
    rows = [Row("10 A", (5.0, 20.0)), Row("(100 A)", (179.9, 1.0), is_bound=True)]
    drawn = [
        line.plain.rstrip()
        for line in lines(
            "heading error", ("now", "corrected, at most (95 %)"), rows, BEFORE_AFTER, width
        )
    ]
    assert max(map(len, drawn)) <= width
    assert drawn[2].count("█") == min(22, (width - 34) // 2)


def test_without_unicode_degrees_are_a_word_and_columns_stay_under_each_other() -> None:
    text = text_of(still(), Look(74, ascii_only=True), verbose=False)
    assert text.isascii()
    assert max(map(len, text.splitlines())) <= 80
    assert " deg" in text
    assert "?" not in text
    bars = [line for line in text.splitlines() if line.endswith(("#", "|")) and " deg  " in line]
    assert len(bars) > 3
    assert len({line.index(" deg  ") for line in bars}) == 1


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("17.0° wrong", "17.0 deg wrong"),
        ("a      0.1 ± 0.2", "a     0.1 +- 0.2"),
        ("0 → 2", "0 -> 2"),
        ("15 A … 43 A", "15 A .. 43 A"),
        ("≤1.0°", "<1.0 deg"),
        ("  ● GOOD\n  ─", "  * GOOD\n  -"),
        ("plain", "plain"),
    ],
)
def test_a_sign_that_ascii_lacks_is_said_in_others(text: str, said: str) -> None:
    assert in_words(text) == said


@given(st.text())
def test_any_text_can_be_said_in_ascii(text: str) -> None:
    assert in_words(text).isascii()


@pytest.mark.parametrize(
    ("encoding", "said"), [("utf-8", "é 5° ██"), ("latin-1", "é 5° ##"), ("ascii", "e 5' ##")]
)
def test_an_encoding_gets_what_it_has(encoding: str, said: str) -> None:
    assert encodable("é 5° ██", encoding) == said


@given(st.text(), st.sampled_from(["ascii", "latin-1", "cp437", "cp1252", "utf-8"]))
def test_what_is_encodable_can_be_encoded(text: str, encoding: str) -> None:
    encodable(text, encoding).encode(encoding)


@pytest.mark.parametrize(
    ("autopilot", "file", "loader"),
    [
        ("ardupilot", "compass.param", "your ground station (MAVProxy: param load)"),
        ("px4", "compass.params", "QGroundControl (Parameters, Tools, Load from file)"),
    ],
)
def test_the_file_is_one_that_the_vehicles_ground_station_loads(autopilot, file, loader) -> None:
    found = still().analysis
    analysis = replace(found, vehicle=replace(found.vehicle, autopilot=autopilot))
    before = " ".join(as_text.analysis_text(analysis, {}, {}, Look(100)).split())
    after = " ".join(as_text.analysis_text(analysis, {}, {}, Look(100), written=file).split())
    assert f"-o {file} " in before
    assert f"Written to {file}. Load it with {loader}" in after
