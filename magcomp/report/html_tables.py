"""The tables of the page; every number of a result comes from the JSON form."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from typing import Any

from markupsafe import Markup

from magcomp.model import Recording
from magcomp.report import plain, words
from magcomp.report.evidence import CompassPlots
from magcomp.report.figure import Quantity, quantity_of
from magcomp.report.html_parts import DASH, Key, Numbers, facts, minus, part, table

_MOST_DECIMALS = 4


def cards(numbers: Numbers) -> list[dict[str, Any]]:
    """A card a compass: verdict, heading error before and after."""
    found = []
    for index, compass in enumerate(numbers.at("compasses")):
        quantity = quantity_of(compass["regressor"])
        key = ("compasses", index, "quoted")
        known = "p95" if plain.is_no_better(compass["quoted"]) else "before"
        now, bound = (
            numbers.show(*key, name, decimals=words.degree_decimals(numbers.at(*key, name)))
            for name in (known, "p95")
        )
        found.append(
            {
                "number": compass["compass"],
                "grade": compass["verdict"],
                "u": numbers.show(*key, "u", decimals=0, scale=quantity.scale),
                "unit": _unit(quantity),
                "now": "≤ " + now if known == "p95" else now,
                "bound": bound,
            }
        )
    return found


def _unit(quantity: Quantity) -> str:
    return quantity.unit if quantity.scale == 1.0 else f"{quantity.unit} {quantity.name}"


def heading_errors(numbers: Numbers, index: int, quantity: Quantity) -> str:
    """Heading error by control quantity."""
    compass = numbers.at("compasses", index)
    places: list[Key] = [
        ("heading_error_deg", k)
        for k, row in enumerate(compass["heading_error_deg"])
        if not plain.reads_as_quoted(row, compass)
    ]
    keys: list[Key] = [("compasses", index, *place) for place in (*places, ("quoted",))]
    rows = [
        _heading_row(numbers, key, compass["coverage"], quantity)
        for key in sorted(keys, key=lambda key: float(numbers.at(*key, "u")))
    ]
    errors = table(
        [quantity.name.capitalize(), "In force", "Fit, expected", "Fit, 95 % bound"],
        rows,
        "Largest heading error over a full turn, level and tilted 20°",
        "numbers",
    )
    return part("heading_errors", errors)


def _heading_row(
    numbers: Numbers, key: Key, covered: Mapping[str, float], quantity: Quantity
) -> list[Markup]:
    row = numbers.at(*key)
    u = numbers.show(*key, "u", decimals=0, scale=quantity.scale) + f" {quantity.unit}"
    if not words.is_flown(row["u"], covered["u_low"], covered["u_high"]):
        u = "(" + u + ")"
    after, bound = (numbers.show(*key, name, decimals=2) for name in ("after", "p95"))
    now = numbers.show(*key, "before", decimals=1)
    if plain.is_no_better(row):
        now = "≤\N{NO-BREAK SPACE}" + numbers.show(*key, "p95", decimals=1)
    cells = [u, *(cell + "°" for cell in (now, after, bound))]
    if key[-1] == "quoted":
        return [part("strong", cell) for cell in cells]
    return cells


def parameters(numbers: Numbers, index: int, present: Mapping[str, float]) -> str:
    """The parameters of one compass, old and new; what does not change is folded away."""
    key = ("compasses", index, "parameters")
    changed, same = [], []
    for name, value in numbers.at(*key).items():
        old = present.get(name)
        shown = minus(words.parameter(old)) if old is not None else "not in the log"
        row = (part("code", name), shown, numbers.show(*key, name))
        if old is not None and old == value:
            same.append(row)
        else:
            changed.append(row)
    return part("parameters", ("Parameter", "In the log", "New"), changed, same)


def findings(numbers: Numbers, index: int, quantity: Quantity) -> str:
    """Interference, lags, coverage and how the answer was found."""
    compass = ("compasses", index)
    per = "mGauss per A" if quantity.scale == 1.0 else "mGauss at full throttle"
    interference = f"Interference, {per}"
    pairs = [
        (
            interference,
            Markup("").join(_axis(numbers, index, axis) for axis in range(3)),
        ),
        ("Field behind attitude", _lag(numbers, index, "field")),
        (f"{quantity.name.capitalize()} against field", _lag(numbers, index, "regressor")),
        ("Unexplained field, in force", _residual(numbers, index, "before")),
        ("Unexplained field, fit", _residual(numbers, index, "after")),
        (
            "The same on unseen data",
            _residual(numbers, index, "held_out_before")
            + " → "
            + _residual(numbers, index, "held_out"),
        ),
        ("Straightness of the line", _straightness(numbers, index)),
        (
            "Earth’s field",
            numbers.show(*compass, "earth_mgauss", "strength", decimals=0)
            + " mGauss, vertical "
            + numbers.show(*compass, "earth_mgauss", "vertical", decimals=0),
        ),
    ]
    return facts(pairs, whole=interference)


def _axis(numbers: Numbers, index: int, axis: int) -> str:
    """One component of the interference, to the second digit of its standard error."""
    std = numbers.at("compasses", index, "std_mgauss", axis)
    decimals = 1 - math.floor(math.log10(std)) if std else _MOST_DECIMALS
    decimals = min(max(decimals, 0), _MOST_DECIMALS)
    value, doubt = (
        numbers.show("compasses", index, name, axis, decimals=decimals)
        for name in ("interference_mgauss", "std_mgauss")
    )
    return part("axis", words.AXES[axis], value, doubt)


def _lag(numbers: Numbers, index: int, which: str) -> str:
    key = ("compasses", index)
    value = numbers.show(*key, "lag_s", which, decimals=0, scale=1000.0)
    if value == DASH:
        return "not visible to this method"
    std = numbers.show(*key, "lag_std_s", which, decimals=0, scale=1000.0)
    return part("with_aside", value + " ms", "± " + std)


def _residual(numbers: Numbers, index: int, which: str) -> str:
    return numbers.show("compasses", index, "field_residual_mgauss", which, decimals=1) + " mGauss"


def _straightness(numbers: Numbers, index: int) -> str:
    key = ("compasses", index, "line")
    if numbers.at(*key) is None:
        return DASH
    off = numbers.show(*key, "rms_mgauss", decimals=2)
    straightness = numbers.show(*key, "straightness", decimals=4)
    return part("with_aside", straightness, "(" + off + " mGauss off it)")


def coverage(numbers: Numbers, index: int, plots: CompassPlots, quantity: Quantity) -> str:
    """What the data cover, and of what quality they are."""
    key = ("compasses", index, "coverage")
    low, high = (
        numbers.show(*key, name, decimals=0, scale=quantity.scale) for name in ("u_low", "u_high")
    )
    pairs = [
        (quantity.name.capitalize(), low + " to " + high + f" {quantity.unit}"),
        ("Headings", numbers.show(*key, "heading", decimals=0, scale=100.0) + " % of a turn"),
        ("Directions", numbers.show(*key, "sphere", decimals=0, scale=100.0) + " % of the sphere"),
        ("Largest tilt", numbers.show(*key, "tilt_deg", decimals=0) + "°"),
        ("Time in use", numbers.show(*key, "seconds", decimals=0) + " s"),
        (
            "New readings",
            f"{plots.count} of {plots.reported_count} messages"
            + (f", {plots.rate_hz:.1f} a second" if plots.count > 1 else ""),
        ),
        (
            "Longest gap",
            f"{plots.longest_gap_s:.1f} s" if plots.count > 1 else DASH,
        ),
    ]
    return facts(pairs)


def vehicle(numbers: Numbers, recording: Recording) -> str:
    """Who flew, and what the recording holds."""
    of = recording.vehicle
    pairs = [
        ("Vehicle", words.vehicle(of)),
        ("Board", of.board or "not named in the log"),
        ("Compass device ids", ", ".join(map(str, of.device_ids)) or "not in the log"),
        ("Recorded", _date(recording.start_unix_s)),
        ("Length", numbers.show("duration_s", decimals=0) + " s"),
        ("Log", numbers.at("source")),
    ]
    return facts(pairs)


def _date(unix_s: float) -> str:
    try:
        return datetime.fromtimestamp(unix_s, UTC).strftime("%Y-%m-%d %H:%M UTC")
    except (OverflowError, OSError, ValueError):
        return "unknown"


def quality(recording: Recording) -> str:
    """What the reader made of the bytes, and how often each quantity came."""
    report = recording.report
    others = ", ".join(f"{system}:{component}" for system, component in report.others)
    pairs = [
        ("Size", f"{report.size / 1e6:.1f} MB"),
        ("Messages", f"{report.used} used of {report.frames}"),
        ("Damaged messages", str(report.bad_checksum)),
        ("Bytes of no message", str(report.skipped)),
        ("Repeated messages", str(report.duplicates)),
        ("Other systems left out", others or "none"),
        *_rates(recording),
    ]
    return facts(pairs)


def _rates(recording: Recording) -> Iterator[tuple[str, str]]:
    series = {
        "Attitude": recording.attitude,
        "Current": recording.current,
        "Throttle": recording.throttle,
        "Motor outputs": recording.outputs,
    }
    for name, of in series.items():
        if of is None or len(of) < 2:
            yield name, "none in the log"
        else:
            span = float(of.time[-1] - of.time[0])
            rate = f"{(len(of) - 1) / span:.1f} a second" if span > 0 else DASH
            yield name, rate
