"""The paper's Table 1 beside ours, for a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.padding import Padding
from rich.rule import Rule
from rich.table import Table
from rich.text import Text

from magcomp.experiments.mission import Course, Flights
from magcomp.experiments.paper import (
    FLIGHT_COMPENSATED_DEG,
    FLIGHT_UNCOMPENSATED_DEG,
    TABLE_1,
    PaperRow,
)
from magcomp.experiments.reproduce import Reproduction
from magcomp.experiments.turntable import Row
from magcomp.report.as_text import render
from magcomp.report.look import Look

KINDS = {"simulated": "simulated vehicle", "recorded": "real firmware"}
"""What the experiments were carried out on, for people."""

TURN = (
    "Largest absolute error of the heading over one level turn against the true yaw, in degrees; "
    "no correction has seen that turn. Means over 15° of turn, so that noise does not count."
)
FLIGHT = (
    "Largest (and root mean square) error of the heading while airborne, in degrees. Fused: what "
    "magcomp makes afterwards of the log of the flight that was not compensated: fitted, "
    "corrected and fused with the gyro. Apart: how far the two true paths are from each other."
)
_LABELS = (
    ("uncorrected", "uncorrected_deg", "dim"),
    ("ellipsoid only", "ellipsoid_deg", "red"),
    ("the paper's method", "paper_deg", "yellow"),
    ("magcomp", "magcomp_deg", "bold green"),
)
_LABEL, _CELL, _GAP = 18, 6, "  "
_PAPER_NAMES = {"paper_deg": "method_deg"}


def reproduction_text(made: Reproduction, look: Look) -> str:
    """What ``magcomp reproduce`` prints."""
    experiments = {"simulated": made.simulated, "recorded": made.recorded}
    done = {KINDS[name]: each for name, each in experiments.items() if each is not None}
    return render(
        [
            Text(),
            _title("Table 1 of the paper, and ours"),
            Padding(Text(TURN, style="dim"), (0, 1)),
            Text(),
            *_table({name: each.turntable.rows for name, each in done.items()}),
            Text(),
            _title("The flights, Figs 8 and 9"),
            Padding(Text(FLIGHT, style="dim"), (0, 1)),
            Text(),
            _flights({name: each.flights for name, each in done.items()}),
            Text(),
        ],
        look,
    )


def _title(words: str) -> Rule:
    return Rule(Text(words, style="bold"), align="left", style="dim")


def _table(measured: Mapping[str, Sequence[Row]]) -> list[Text]:
    """Three columns for the paper and for each kind of vehicle."""
    names = ["the paper", *measured]
    every: list[PaperRow | Row] = [*TABLE_1, *(row for rows in measured.values() for row in rows)]
    lines = [
        _line("", [f"{name:>{3 * _CELL}}" for name in names], "bold"),
        _line("control, ‰", _threes([str(row.control) for row in every]), "dim"),
        _line("current, A", _threes([f"{row.current_a:.0f}" for row in every]), "dim"),
    ]
    for label, key, style in _LABELS:
        paper = [getattr(row, _PAPER_NAMES.get(key, key), None) for row in TABLE_1]
        values = paper + [getattr(row, key) for rows in measured.values() for row in rows]
        cells = ["–" if value is None else _degrees(value) for value in values]
        lines.append(_line(label, _threes(cells), style))
    return lines


def _line(label: str, groups: Sequence[str], style: str) -> Text:
    line = Text(f" {label:<{_LABEL}}")
    for group in groups:
        line.append(_GAP)
        line.append(group, style=style)
    return line


def _threes(cells: Sequence[str]) -> list[str]:
    right = [f"{cell:>{_CELL}}" for cell in cells]
    return ["".join(right[index : index + 3]) for index in range(0, len(right), 3)]


def _flights(measured: Mapping[str, Flights]) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 1), show_edge=False)
    table.add_column(min_width=20)
    for name, width in (("not compensated", 15), ("compensated", 13), ("fused", 13), ("apart", 8)):
        table.add_column(Text(name, style="bold"), justify="right", min_width=width)
    table.add_row(
        " the paper",
        Text(f"{FLIGHT_UNCOMPENSATED_DEG:.0f}       ", style="red"),
        Text(f"{FLIGHT_COMPENSATED_DEG:.0f}       ", style="green"),
        "–       ",
        "–",
    )
    for name, flown in measured.items():
        table.add_row(
            f" {name}",
            Text(_course(flown.uncompensated.believed), style="red"),
            Text(_course(flown.compensated.believed), style="green"),
            Text(_course(flown.fused), style="bold green"),
            f"{flown.apart_m:.1f} m",
        )
    return table


def _course(course: Course) -> str:
    return f"{_degrees(course.largest_deg)} ({_degrees(course.rms_deg):>4})"


def _degrees(value: float) -> str:
    return f"{value:.1f}" if value >= 1.0 else f"{value:.2f}"
