"""The paper's experiments as one page: its Table 1 beside ours, and Figs 3 to 9."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from magcomp import __version__
from magcomp.experiments.as_text import FLIGHT, KINDS, TURN
from magcomp.experiments.figures import figures
from magcomp.experiments.paper import FLIGHT_COMPENSATED_DEG, FLIGHT_UNCOMPENSATED_DEG
from magcomp.experiments.reproduce import Experiments, Reproduction
from magcomp.report.figure import Figure
from magcomp.report.html_page import canvas, page
from magcomp.report.html_parts import DASH, Numbers, table, text

_TITLE = "Three-axis compass correction under varying control quantity, reproduced"
_COLUMNS = (
    ("uncorrected", "uncorrected_deg", "uncorrected_deg"),
    ("ellipsoid only", "ellipsoid_deg", "ellipsoid_deg"),
    ("the paper’s method", "paper_deg", "method_deg"),
    ("magcomp", "magcomp_deg", None),
)
_METHODS = (
    ("uncorrected", "the sensor’s field as it is"),
    (
        "ellipsoid only",
        "one ellipsoid, fitted with the motors off, used at every control quantity: the classic "
        "correction",
    ),
    (
        "the paper’s method",
        "an ellipsoid for each control quantity, the paper’s line through their centres "
        "(equations 14–16), and the position along it looked up by the control quantity",
    ),
    (
        "magcomp",
        "what magcomp fit writes with everything on its defaults: one shape for all control "
        "quantities, the weighted line, one motor vector per ampere",
    ),
)


def html(made: Reproduction) -> str:
    """The page."""
    source = json.dumps(made.document(), allow_nan=False)
    numbers = Numbers(json.loads(source))
    kinds = {"simulated": made.simulated, "recorded": made.recorded}
    done = {name: each for name, each in kinds.items() if each is not None}
    drawn = {name: figures(each.turntable, each.flights) for name, each in done.items()}
    body = (
        f'<header style="margin-top:2rem"><p class="overline">magcomp {__version__} reproduce</p>'
        f"<h1><span>{text(_TITLE)}</span></h1></header><main>"
        f"{_summary(numbers, done)}"
        f"<section><h2>Table 1</h2><p>{text(TURN)}</p>{_table(numbers, done)}{_methods()}"
        "</section>"
        f"<section><h2>The flights</h2><p>{text(FLIGHT)}</p>{_flights(numbers, done)}</section>"
        + "".join(_pictures(name, done[name], drawn[name]) for name in done)
        + "</main>"
    )
    pictures = {f"{f.name}-{name}": f for name, figs in drawn.items() for f in figs}
    return page(f"magcomp: {_TITLE}", body, source, pictures)


def _summary(numbers: Numbers, done: Mapping[str, Experiments]) -> str:
    """What the paper claims, and whether it appears."""
    items = "".join(
        f"<li><b>{text(_capital(KINDS[name]))}.</b> At rest the ellipsoid alone leaves "
        f"{numbers.show(name, 0, 'ellipsoid_deg', decimals=2)}°, at "
        f"{numbers.show(name, 2, 'current_a', decimals=0)} A "
        f"{numbers.show(name, 2, 'ellipsoid_deg', decimals=1)}°; magcomp leaves "
        f"{numbers.show(name, 0, 'magcomp_deg', decimals=2)}° and "
        f"{numbers.show(name, 2, 'magcomp_deg', decimals=2)}°.</li>"
        for name in done
    )
    return (
        "<p>The paper’s claim: a correction made with the motors off grows wrong with the control "
        "quantity, one that follows the ellipsoid’s centre along its line does not.</p>"
        f'<ul class="reasons">{items}</ul>'
    )


def _capital(words: str) -> str:
    return words[0].upper() + words[1:]


def _table(numbers: Numbers, done: Mapping[str, Experiments]) -> str:
    """A row for each control quantity of the paper and of each kind of vehicle."""
    names = {"paper": "The paper", **{name: _capital(KINDS[name]) for name in done}}
    head = ["", "control, ‰", "current, A", *(name for name, _, _ in _COLUMNS)]
    rows = []
    for kind, name in names.items():
        for index in range(len(numbers.at(kind))):
            keys = [papers if kind == "paper" else ours for _, ours, papers in _COLUMNS]
            # The paper prints one decimal.
            decimals = 1 if kind == "paper" else 2
            rows.append(
                [
                    text(name) if index == 0 else "",
                    numbers.show(kind, index, "control", decimals=0),
                    numbers.show(kind, index, "current_a", decimals=0),
                    *(
                        DASH if key is None else numbers.show(kind, index, key, decimals=decimals)
                        for key in keys
                    ),
                ]
            )
    return table(head, rows, "Residual heading error, °", "numbers")


def _methods() -> str:
    items = "".join(f"<li><b>{text(name)}</b>: {text(what)}</li>" for name, what in _METHODS)
    return (
        "<details><summary>What the lines are, and how they were measured</summary>"
        f"<ul>{items}</ul><p>The corrections come from the turns about three axes; the level turn "
        "they are measured on is kept from them. The field is compared with the true yaw of the "
        "moment it was measured: how late it is reported is found by the truth, once for a "
        "recording and without any of the corrections.</p></details>"
    )


def _flights(numbers: Numbers, done: Mapping[str, Experiments]) -> str:
    head = ["heading error, °", "not compensated", "compensated", "fused by magcomp", "apart, m"]
    paper = [f"{FLIGHT_UNCOMPENSATED_DEG:.0f}", f"{FLIGHT_COMPENSATED_DEG:.0f}", DASH, DASH]
    rows = [["the paper", *paper]]
    for name in done:
        cells = [
            numbers.show("flights", name, course, "largest_deg", decimals=1)
            + " ("
            + numbers.show("flights", name, course, "rms_deg", decimals=1)
            + ")"
            for course in ("uncompensated", "compensated", "fused")
        ]
        apart = numbers.show("flights", name, "paths_apart_m", decimals=1)
        rows.append([text(KINDS[name]), *cells, apart])
    return table(head, rows, "Largest (root mean square) error while airborne", "numbers")


def _pictures(name: str, made: Experiments, drawn: Sequence[Figure]) -> str:
    source = text(f"{Path(made.turntable.source).name}, compass {made.turntable.compass}")
    shown = "".join(canvas(f"{figure.name}-{name}", figure) for figure in drawn)
    return (
        f"<section><h2>Figures: {text(KINDS[name])}</h2>"
        f'<p class="note">Turntable: {source}; the field is reported '
        f"{1000 * made.turntable.lag_s:.0f} ms after it was measured.</p>"
        f'<div class="figures">{shown}</div></section>'
    )
