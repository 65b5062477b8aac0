"""What a recording lacks for a smaller bound: what the next flight should add."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from magcomp.judge.heading_error import variance_shares
from magcomp.model import Coverage, FloatArray, MotorFit, Samples, quantity_of

SECTORS = 36
"""Headings are counted in sectors of 10°."""

_LEAST_GAP_DEG = 60.0
_LEANS_ENOUGH_DEG = 12.0
_HARDLY_CHANGES = 0.5
_HARD_SHARE = 2 / 3


def lacking(fit: MotorFit, samples: Samples, covered: Coverage, u: float) -> str:
    """What to fly next, by what the bound at a control quantity comes from.

    Parameters
    ----------
    fit
        With its covariance.
    samples, covered
        The readings, and what they cover.
    u
        Where the bound is largest.

    Notes
    -----
    The variance of the heading at ``u`` is shared out among the motor vector, the offsets and the
    soft iron. Motor vectors are told apart from offsets by load that changes at every heading;
    offsets and soft iron by headings and leans.
    """
    shares = variance_shares(fit, u)
    if max(shares, key=lambda name: shares[name]) == "motor":
        return _for_motors(fit, samples, covered)
    return _for_calibration(samples, covered, shares)


def _for_motors(fit: MotorFit, samples: Samples, covered: Coverage) -> str:
    in_words = quantity_of(fit.regressor).in_sentence
    if covered.u_low > _HARDLY_CHANGES * covered.u_high:
        low, high = in_words(covered.u_low), in_words(covered.u_high)
        return (
            f"the motors only worked between {low} and {high}: "
            "climb hard, descend, and do both at several headings"
        )
    hard = covered.u_low + _HARD_SHARE * (covered.u_high - covered.u_low)
    gap = widest_gap(samples.attitude[samples.total > hard, 2])
    if gap is not None:
        return f"{_unseen(gap, f' above {in_words(hard)}')}: climb hard while facing {_there(gap)}"
    return "record longer, with more climbs and descents at all headings"


def _for_calibration(samples: Samples, covered: Coverage, shares: Mapping[str, float]) -> str:
    gap = widest_gap(samples.attitude[:, 2])
    if gap is not None:
        return f"{_unseen(gap)}: turn slowly all the way round"
    if covered.tilt_deg < _LEANS_ENOUGH_DEG:
        return (
            f"the vehicle never leaned more than {covered.tilt_deg:.0f}°: fly fast legs, "
            "forward and to both sides, facing several ways"
        )
    if shares["offset"] > shares["soft iron"]:
        return "record longer, and turn all the way round with the motors working little as well"
    return "record longer, with fast legs and turns at all headings"


def widest_gap(yaw: FloatArray) -> tuple[float, float] | None:
    """The widest range of headings that was never seen, degrees, clockwise; None where none is.

    Parameters
    ----------
    yaw
        Headings, radians, shape (n,).

    Examples
    --------
    >>> widest_gap(np.radians(np.arange(0.0, 200.0)))
    (200.0, 360.0)
    >>> widest_gap(np.radians(np.arange(0.0, 360.0))) is None
    True
    """
    width = 360.0 / SECTORS
    seen = np.zeros(SECTORS, dtype=bool)
    seen[np.floor(np.mod(np.degrees(yaw), 360.0) / width).astype(np.intp) % SECTORS] = True
    if not seen.any():
        return (0.0, 360.0)
    places = np.flatnonzero(seen)
    following = np.append(places[1:], places[0] + SECTORS)
    empty = following - places - 1
    widest = int(np.argmax(empty))
    if empty[widest] * width < _LEAST_GAP_DEG:
        return None
    first = (places[widest] + 1) % SECTORS
    return float(first * width), float(first * width + empty[widest] * width)


def _unseen(gap: tuple[float, float], where: str = "") -> str:
    """In words which headings are missing, or which there are where those are fewer."""
    first, last = gap
    if not _is_most(gap):
        return f"headings {_named(first, last)} were never seen{where}"
    return f"only headings {_named(last, first)} were seen{where}"


def _there(gap: tuple[float, float]) -> str:
    return "other ways" if _is_most(gap) else "there"


def _is_most(gap: tuple[float, float]) -> bool:
    return 180.0 < gap[1] - gap[0] < 360.0


def _named(first: float, last: float) -> str:
    """In words: 350° to 70°."""
    return f"{first % 360.0:.0f}° to {last if last <= 360.0 else last - 360.0:.0f}°"
