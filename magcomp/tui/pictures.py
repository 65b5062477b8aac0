"""What the pictures of the fit show, as plain numbers: made once a fit, drawn often."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from magcomp.model import CompassResult, FloatArray
from magcomp.report import as_json, words
from magcomp.report.evidence import CompassPlots
from magcomp.report.plain import is_no_better, with_quoted
from magcomp.report.shift import Shift, shift_of

AXIS_WORDS = ("forward", "right", "down")
AXES = tuple(word[0] for word in AXIS_WORDS)
"""How a picture marks them."""


@dataclass(frozen=True)
class ErrorRow:
    """Largest heading error at one control quantity, degrees.

    Attributes
    ----------
    label
        ``20 A`` or ``40 %``.
    before, after, bound
        Now, corrected, and corrected at most with 95 % probability.
    covered
        The recording was flown at this control quantity.
    is_quoted
        The sentences are of this row.
    """

    label: str
    before: float
    after: float
    bound: float
    covered: bool
    is_quoted: bool = False

    @property
    def floor(self) -> float:
        """What is in force cannot be told from the fit below this, degrees; else 0."""
        return self.bound if is_no_better({"before": self.before, "p95": self.bound}) else 0.0

    @property
    def now(self) -> str:
        """What is in force, in figures; a bound where it is no better known."""
        return f"≤{self.floor:.1f}" if self.floor else f"{self.before:.1f}"


def error_rows(result: CompassResult) -> tuple[ErrorRow, ...]:
    """Heading error by control quantity, as the judge found it."""
    covered, quoted = result.verdict.coverage, as_json.quoted_row(as_json.quoted(result))
    rows = with_quoted(result.verdict.heading_error, quoted, result.fit.regressor)
    return tuple(
        ErrorRow(
            words.quantity(row.u, result.fit.regressor),
            row.before,
            row.after,
            row.p95,
            words.is_flown(row.u, covered.u_low, covered.u_high),
            is_quoted=row is quoted,
        )
        for row in rows
    )


@dataclass(frozen=True, eq=False)
class Unexplained:
    """Field that is left unexplained, in time.

    Attributes
    ----------
    time
        Seconds, shape (n,).
    before, after
        mGauss, shape (n,).
    """

    time: FloatArray
    before: FloatArray
    after: FloatArray


_DRAWN = 240


def unexplained(plots: CompassPlots) -> Unexplained:
    """Lengths of the residuals, thinned to what a terminal can show: the median of each stretch."""
    count = len(plots.time)
    edges = np.unique(np.linspace(0, count, min(count, _DRAWN) + 1).astype(int))

    def medians(values: FloatArray) -> FloatArray:
        rows = itertools.pairwise(edges)
        return np.array([np.median(values[first:last]) for first, last in rows])

    return Unexplained(
        time=medians(plots.time),
        before=medians(np.linalg.norm(plots.before, axis=1)),
        after=medians(np.linalg.norm(plots.after, axis=1)),
    )


@dataclass(frozen=True, eq=False)
class CompassPicture:
    """Everything the fit screen shows of one compass."""

    result: CompassResult
    errors: tuple[ErrorRow, ...]
    shift: Shift
    unexplained: Unexplained


def picture(result: CompassResult, plots: CompassPlots) -> CompassPicture:
    """Make the pictures of one compass; runs beside the fit, off the screen's thread."""
    return CompassPicture(result, error_rows(result), shift_of(result.fit), unexplained(plots))


def round_ticks(low: float, high: float, most: int) -> list[float]:
    """At most ``most`` numbers from ``low`` to ``high``, steps of 1, 2 or 5 times a power of 10."""
    span = high - low
    if span <= 0.0 or not np.isfinite(span):
        return [low]
    power = 10.0 ** np.floor(np.log10(span / most))
    steps = (power * factor for factor in (1.0, 2.0, 5.0, 10.0, 20.0))
    step = next(each for each in steps if span / each <= most - 1 or each >= 20.0 * power)
    first = np.ceil(low / step - 1e-9)
    ticks = step * np.arange(first, np.floor(high / step + 1e-9) + 1)
    return [float(tick) + 0.0 for tick in ticks]  # adding 0 turns −0 into 0
