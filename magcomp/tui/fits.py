"""Several fits of one vehicle side by side: what was chosen, how good, how far apart."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from magcomp.analysis import Options
from magcomp.geometry import body_from_earth, horizontal_part
from magcomp.judge.heading_error import attitudes, largest_shift
from magcomp.model import Analysis, CompassResult, Grade, MotorFit, Recording
from magcomp.report import words
from magcomp.tui.pictures import CompassPicture

MOST_FITS = 5


@dataclass(frozen=True, eq=False)
class Tried:
    """A fit that was carried out.

    Attributes
    ----------
    options
        What was asked for.
    recording
        What was fitted.
    analysis, pictures
        The answer, and what is drawn of it by compass.
    """

    options: Options
    recording: Recording | None
    analysis: Analysis
    pictures: Mapping[int, CompassPicture]


@dataclass(frozen=True)
class FitRow:
    """One fit of one compass.

    Attributes
    ----------
    number
        From 1.
    shown
        It is the one that is shown, and would be written.
    method, by, time
        How it was made, in words.
    grade
        The judge's word.
    bound
        Heading error at most (95 %) at the largest load reached, degrees.
    apart
        How far its heading is from that of the fit shown, at most, degrees; NaN where the two
        cannot be compared.
    """

    number: int
    shown: bool
    method: str
    by: str
    time: str
    grade: Grade
    bound: float
    apart: float


def with_fit(tried: Sequence[Tried], new: Tried) -> tuple[Tried, ...]:
    """The fits with a new one, which takes the place of one made with the same options."""
    others = [each for each in tried if each.options != new.options]
    return (*others, new)[-MOST_FITS:]


def fit_rows(tried: Sequence[Tried], shown: Analysis, compass: int) -> tuple[FitRow, ...]:
    """A row for each fit of a compass."""
    here = _result(shown, compass)
    rows = []
    for number, each in enumerate(tried, start=1):
        result = _result(each.analysis, compass)
        if result is None or here is None:
            continue
        rows.append(
            FitRow(
                number,
                each.analysis is shown,
                result.fit.method,
                result.fit.regressor,
                time_range(each.options),
                result.verdict.grade,
                _bound(result),
                difference_deg(here.fit, result.fit),
            )
        )
    return tuple(rows)


def difference_deg(one: MotorFit, other: MotorFit) -> float:
    """Largest difference of heading that two fits make, degrees.

    Over a full turn, level and tilted, at the lowest and the largest load that the first has
    seen. Fits by different control quantities are compared at the loads of each.
    """
    roll, pitch, yaw = attitudes()
    horizontal = horizontal_part(one.strength, one.vertical)
    field = body_from_earth(roll, pitch, yaw) @ np.array([horizontal, 0.0, one.vertical])
    alike = one.regressor == other.regressor
    loads = ((one.u_low, other.u_low), (one.u_high, other.u_high))
    worst = 0.0
    for u, u_other in loads:
        raw = one.correction.undo(field, np.full(len(field), u))
        found = other.correction.apply(raw, np.full(len(field), u if alike else u_other))
        worst = max(worst, largest_shift(found, field, roll, pitch))
    return worst


def time_range(options: Options) -> str:
    """``whole``, or ``20 … 60 s``."""
    start, end = max(options.start, 0.0), options.end
    if math.isinf(end):
        return "whole" if start == 0.0 else f"from {start:g} s"
    return f"{start:g} … {end:g} s"


def _result(analysis: Analysis, compass: int) -> CompassResult | None:
    return next((each for each in analysis.compasses if each.fit.compass == compass), None)


def _bound(result: CompassResult) -> float:
    rows = result.verdict.heading_error
    if not rows:
        return math.nan
    u, p95 = [row.u for row in rows], [row.p95 for row in rows]
    return float(np.interp(result.verdict.coverage.u_high, u, p95))


def degrees(value: float) -> str:
    """``0.4°``, or a dash where there is none."""
    return f"{words.number(value, 1)}°" if math.isfinite(value) else "–"
