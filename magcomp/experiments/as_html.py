"""The paper's experiments as one page: its Table 1 beside ours, and Figs 3 to 9."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from magcomp import __version__
from magcomp.experiments.as_text import FLIGHT, KINDS, TURN
from magcomp.experiments.figures import figures
from magcomp.experiments.paper import FLIGHT_COMPENSATED_DEG, FLIGHT_UNCOMPENSATED_DEG
from magcomp.experiments.reproduce import Experiments, Reproduction
from magcomp.report.figure import Figure
from magcomp.report.html_page import page
from magcomp.report.html_parts import DASH, Numbers, templates

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
    drawn = {
        name: {f"{figure.name}-{name}": figure for figure in figures(each.turntable, each.flights)}
        for name, each in done.items()
    }
    body = (
        templates("magcomp.experiments")
        .get_template("reproduction.html.j2")
        .render(
            title=_TITLE,
            version=__version__,
            kinds=[_kind(numbers, name, each, drawn[name]) for name, each in done.items()],
            turn=TURN,
            errors=_errors(numbers, done),
            methods=_METHODS,
            flight=FLIGHT,
            flights=_flights(numbers, done),
        )
    )
    pictures = {name: figure for each in drawn.values() for name, figure in each.items()}
    return page(f"magcomp: {_TITLE}", body, source, pictures)


def _kind(
    numbers: Numbers, name: str, made: Experiments, drawn: Mapping[str, Figure]
) -> dict[str, Any]:
    """One kind of vehicle: whether what the paper claims appears, and the figures."""
    show = numbers.show
    return {
        "name": KINDS[name],
        "title": _capital(KINDS[name]),
        "ellipsoid_at_rest": show(name, 0, "ellipsoid_deg", decimals=2),
        "current": show(name, 2, "current_a", decimals=0),
        "ellipsoid": show(name, 2, "ellipsoid_deg", decimals=1),
        "magcomp_at_rest": show(name, 0, "magcomp_deg", decimals=2),
        "magcomp": show(name, 2, "magcomp_deg", decimals=2),
        "source": f"{Path(made.turntable.source).name}, compass {made.turntable.compass}",
        "lag_ms": f"{1000 * made.turntable.lag_s:.0f}",
        "figures": list(drawn.items()),
    }


def _capital(words: str) -> str:
    return words[0].upper() + words[1:]


def _errors(numbers: Numbers, done: Mapping[str, Experiments]) -> dict[str, Any]:
    """A row for each control quantity of the paper and of each kind of vehicle."""
    names = {"paper": "The paper", **{name: _capital(KINDS[name]) for name in done}}
    head = ["whose", "control, ‰", "current, A", *(name for name, _, _ in _COLUMNS)]
    rows = []
    for kind, name in names.items():
        for index in range(len(numbers.at(kind))):
            keys = [papers if kind == "paper" else ours for _, ours, papers in _COLUMNS]
            # The paper prints one decimal.
            decimals = 1 if kind == "paper" else 2
            rows.append(
                [
                    name,
                    numbers.show(kind, index, "control", decimals=0),
                    numbers.show(kind, index, "current_a", decimals=0),
                    *(
                        DASH if key is None else numbers.show(kind, index, key, decimals=decimals)
                        for key in keys
                    ),
                ]
            )
    return {"head": head, "rows": rows}


def _flights(numbers: Numbers, done: Mapping[str, Experiments]) -> dict[str, Any]:
    courses = ("not compensated", "compensated", "fused by magcomp")
    head = ["whose", *(f"{course}, °" for course in courses), "apart, m"]
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
        rows.append([KINDS[name], *cells, apart])
    return {"head": head, "rows": rows}
