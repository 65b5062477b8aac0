"""What separates good from marginal and rejected. Change them here, in the open."""

from __future__ import annotations

import math
from dataclasses import dataclass

TWO_SIDED_95 = 1.96

_DRIFTS = 1.5
"""A step of so many times the limit is no drift whatever the bound."""


@dataclass(frozen=True)
class Thresholds:
    """Limits of the judge.

    Attributes
    ----------
    good_deg, marginal_deg
        95 % bound of the heading error from 0 to the largest control quantity the data cover.
    improvement
        Share by which the held-out field variation must fall where the fit claims a change
        larger than its own uncertainty.
    least_current_a, least_throttle
        Range the control quantity must cover.
    heading, least_heading
        Share of a full turn that should, and that must, be seen in flight.
    bends
        Distance of the centres from their line, as a share of its length, beyond which the line
        is not one.
    noise_share, worthwhile
        Unexplained field after the fit, as a share of the field's strength, beyond which
        something else than the motors disturbs the compass; the correction is then only worth
        having where it removes at least the share ``worthwhile`` of what was unexplained.
    lesser_evil
        A bound beyond ``marginal_deg`` is still marginal, not rejected, where it is below this
        share of the error in force.
    departure_deg
        Heading error beyond which a plain departure from the model keeps a fit from being good.
    useless_deg
        A bound beyond this is rejected whatever was in force.
    least_seconds
        A calibration in force is not judged by less than this; a fit needs three stretches of
        four seconds, too.
    """

    good_deg: float = 2.0
    marginal_deg: float = 6.0
    improvement: float = 0.05
    least_current_a: float = 5.0
    least_throttle: float = 0.12
    heading: float = 0.6
    least_heading: float = 0.25
    bends: float = 0.15
    noise_share: float = 0.04
    worthwhile: float = 0.25
    lesser_evil: float = 1 / 3
    departure_deg: float = 1.0
    useless_deg: float = 20.0
    least_seconds: float = 12.0

    def beside(self, bound: float) -> float:
        """Degrees that something doubtful may add to a bound and leave the fit good.

        Both together are no more than a good fit may leave; but a sensor's usual drift is in the
        bound already, and what is far beyond it is none whatever the bound.

        Examples
        --------
        >>> [round(Thresholds().beside(bound), 2) for bound in (0.5, 1.6, 1.9, 3.0)]
        [1.5, 1.2, 1.0, 1.0]
        """
        if not bound < self.good_deg:
            return self.departure_deg
        left = math.sqrt(self.good_deg**2 - bound**2)
        return min(max(left, self.departure_deg), _DRIFTS * self.departure_deg)
