"""What a fit promised, and what the next flight shows: the proof a pilot can see."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from magcomp.model import Analysis, Verdict
from magcomp.report import words


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
    """One compass, at the control quantity where least is left of the promise.

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
    """

    compass: int
    u: float
    regressor: str
    promised: float
    measured: float
    doubt: float

    @property
    def kept(self) -> Kept:
        """Whether it was kept."""
        if self.measured <= self.promised:
            return Kept.YES
        return Kept.UNSURE if self.measured - self.doubt <= self.promised else Kept.NO

    @property
    def sentence(self) -> str:
        """``Compass 1 at 24 A: promised at most 0.4°, measured 0.3° ✓``."""
        at = words.quantity(self.u, self.regressor)
        return (
            f"Compass {self.compass} at {at}: promised at most {self.promised:.1f}°, measured "
            f"{self.measured:.1f}° {self.kept}{_MEANING[self.kept]}"
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
        rows = result.verdict.heading_error
        if verdict is None or not rows or not verdict.heading_error:
            continue
        each = [
            Promise(
                result.fit.compass,
                row.u,
                result.fit.regressor,
                float(np.interp(row.u, [r.u for r in rows], [r.p95 for r in rows])),
                row.before,
                row.p95 - row.before,
            )
            for row in verdict.heading_error
        ]
        found.append(max(each, key=lambda promise: promise.measured - promise.promised))
    return tuple(found)
