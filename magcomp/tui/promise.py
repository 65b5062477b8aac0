"""What a fit promised, and what the next flight shows: the proof a pilot can see."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from magcomp.judge.judge import error_at
from magcomp.model import Analysis, CompassResult, HeadingError, Verdict
from magcomp.report import words
from magcomp.report.as_json import quoted


class Kept(StrEnum):
    """Whether a promise was kept."""

    YES = "✓"
    UNSURE = "?"
    NO = "✗"


_MEANING = {
    Kept.YES: "",
    Kept.UNSURE: ": more than promised, but this flight cannot tell it so finely",
    Kept.NO: ": more than promised, so fit this flight and write again",
}


@dataclass(frozen=True)
class Promise:
    """One compass, at the control quantity that the fit's sentences quote.

    Attributes
    ----------
    compass
        1, 2 or 3.
    u, regressor
        The control quantity, and which.
    promised
        Heading error at most (95 %), as the fit said, degrees.
    measured, doubt
        Heading error that the flight shows, and what it may be more or less (95 %), degrees.
    elsewhere
        The same at another control quantity where it is broken and here it is not; else None.
    """

    compass: int
    u: float
    regressor: str
    promised: float
    measured: float
    doubt: float
    elsewhere: Promise | None = None

    @property
    def kept(self) -> Kept:
        """Whether it was kept."""
        if self.measured <= self.promised:
            return Kept.YES
        return Kept.UNSURE if self.measured - self.doubt <= self.promised else Kept.NO

    @property
    def sentence(self) -> str:
        """``Compass 1 at 24 A: promised at most 0.4°, measured 0.3° ✓``."""
        other = self.elsewhere
        if other is None:
            return f"Compass {self.compass} {self._found}{_MEANING[self.kept]}"
        return f"Compass {self.compass} {self._found}, but {other._found}{_MEANING[other.kept]}"

    @property
    def _found(self) -> str:
        at = words.quantity(self.u, self.regressor)
        return (
            f"at {at}: promised at most {self.promised:.1f}°, measured "
            f"{self.measured:.1f}° {self.kept}"
        )


def promises(analysis: Analysis, verdicts: Mapping[int, Verdict]) -> tuple[Promise, ...]:
    """Compare a fit with the judge's word on a flight with it in force.

    Parameters
    ----------
    analysis
        The fit that was written.
    verdicts
        On the calibration in force, by compass; see :func:`magcomp.analysis.check`.

    Returns
    -------
    tuple of Promise
        One for each compass that both tell of.
    """
    found = []
    for result in analysis.compasses:
        verdict = verdicts.get(result.fit.compass)
        if verdict is None or not result.verdict.heading_error or not verdict.heading_error:
            continue
        rows = verdict.heading_error
        # Beyond what this flight was flown at it measures nothing.
        u = float(np.clip(quoted(result)["u"], rows[0].u, rows[-1].u))
        here = _promise(result, error_at(rows, u))
        least = max((_promise(result, row) for row in rows), key=_broken_by)
        broken = least.kept is Kept.NO and here.kept is not Kept.NO
        found.append(replace(here, elsewhere=least if broken else None))
    return tuple(found)


def _promise(result: CompassResult, measured: HeadingError) -> Promise:
    promised = error_at(result.verdict.heading_error, measured.u).p95
    doubt = measured.p95 - measured.before
    fit = result.fit
    return Promise(fit.compass, measured.u, fit.regressor, promised, measured.before, doubt)


def _broken_by(promise: Promise) -> tuple[bool, float]:
    return promise.kept is Kept.NO, promise.measured - promise.promised
