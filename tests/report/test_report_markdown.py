"""The report as Markdown holds the numbers of the JSON."""

from __future__ import annotations

import re

import pytest
from report_analyses import flown, refused, still

from magcomp.report.as_markdown import markdown
from magcomp.report.plain import table_rows

CASES = [still, flown, refused]


def rows_of(text: str, first: str) -> list[list[str]]:
    """Rows of all tables whose head begins with ``first``."""
    found, inside = [], False
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")] if line[:1] == "|" else []
        if cells and cells[0] == first:
            inside = True
        elif not cells:
            inside = False
        elif inside and not line.startswith("|---"):
            found.append(cells)
    return found


@pytest.mark.parametrize("make", CASES)
def test_the_heading_errors_are_those_of_the_json(make) -> None:
    document = make().document
    scale, title = (
        (1.0, "current (A)")
        if document["compasses"][0]["regressor"] == "current"
        else (100.0, "throttle (%)")
    )
    expected = [row for compass in document["compasses"] for row in table_rows(compass)]
    rows = rows_of(markdown(document, make().present), title)
    assert len(rows) == len(expected) > 0
    for cells, row in zip(rows, expected, strict=True):
        assert float(cells[0].strip("()")) == pytest.approx(row["u"] * scale, abs=0.5)
        if row["before"] > row["p95"]:
            assert float(cells[1]) == pytest.approx(row["before"], abs=0.0501)
        else:
            assert float(cells[1].removeprefix("≤ ")) == pytest.approx(row["p95"], abs=0.0501)
        assert float(cells[2]) == pytest.approx(row["after"], abs=0.00501)
        assert float(cells[3]) == pytest.approx(row["p95"], abs=0.00501)


@pytest.mark.parametrize("make", [still, flown])
def test_the_parameters_are_those_of_the_json_beside_the_old_ones(make) -> None:
    made = make()
    rows = rows_of(markdown(made.document, made.present), "parameter")
    expected = [
        item for compass in made.document["compasses"] for item in compass["parameters"].items()
    ]
    assert len(rows) == len(expected) > 0
    for cells, (name, value) in zip(rows, expected, strict=True):
        assert cells[0] == f"`{name}`"
        assert float(cells[1]) == pytest.approx(made.present[name], abs=0.000051)
        assert float(cells[2]) == pytest.approx(value, abs=0.000051)


@pytest.mark.parametrize(
    ("make", "verdict"), [(flown, "# At hover ("), (refused, "# Do not write")]
)
def test_the_verdict_is_the_first_line(make, verdict: str) -> None:
    assert markdown(make().document, make().present).startswith(verdict)


def test_the_log_s_name_has_no_meaning_to_markdown() -> None:
    made = flown()
    document = {**made.document, "source": "a_b_*c* [x](y) <img>.tlog"}
    head = markdown(document, made.present).split("## What to do")[0]
    assert r"a\_b\_\*c\* \[x\](y) \<img\>.tlog" in head


def test_a_parameter_the_log_does_not_hold_is_said_in_words() -> None:
    assert "not in the log" in markdown(flown().document, {})


@pytest.mark.parametrize("make", CASES)
def test_there_is_no_number_that_is_none(make) -> None:
    assert not re.search(r"\b(nan|None|inf)\b", markdown(make().document, make().present))


def test_a_fit_that_is_only_to_look_at_is_not_said_to_be_worth_writing() -> None:
    document = {**still().document, "only_to_look_at": "the firmware multiplies something else"}
    page = markdown(document, still().present)
    assert "Write nothing: the firmware multiplies something else." in page
    assert "Write them" not in page
    assert "-o compass.param" not in page
