"""How much longer a recording must be, from how its bound has fallen so far. No I/O, no clock."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

FEWEST = 2
"""Analyses before anything is foretold."""

_LAST = 12
_SPAN = 1.2


def seconds_until(goal_deg: float, history: Sequence[tuple[float, float]]) -> float | None:
    """Seconds flown at which the bound will have fallen to a goal, if it goes on as before.

    Parameters
    ----------
    goal_deg
        The bound that is wanted, degrees.
    history
        Seconds flown and the bound of each analysis, degrees, oldest first.

    Returns
    -------
    float | None
        None where the history is too short, does not fall, or ends above the goal however long
        it goes on.

    Notes
    -----
    What is random averages out and what is systematic stays: b² = f² + c / t (docs/method.md,
    How long to record). f² and c are the least squares of the relative errors of the last twelve
    b², neither below 0; f is 0 where there are two, which always lie on a curve.

    Examples
    --------
    >>> from magcomp.live.forecast import seconds_until
    >>> round(seconds_until(0.5, [(40.0, 2.0), (80.0, 2.0**0.5), (160.0, 1.0)]))
    640
    """
    last = [(t, b) for t, b in history[-_LAST:] if t > 0.0 and 0.0 < b < np.inf]
    if len(last) < FEWEST or last[-1][0] < _SPAN * last[0][0]:
        return None
    inverse, square = np.array([(1.0 / t, b * b) for t, b in last]).T
    rows = np.column_stack([np.ones(len(last)), inverse]) / square[:, None]
    floor, slope = np.linalg.lstsq(rows, np.ones(len(last)))[0].tolist()
    if floor < 0.0 or len(last) == FEWEST:
        floor, slope = 0.0, float(rows[:, 1].sum() / (rows[:, 1] @ rows[:, 1]))
    random = goal_deg**2 - floor
    if slope <= 0.0 or random <= 0.0:
        return None
    seconds, bound = last[-1]
    until = slope / random
    # Foretold for a time that is over: then the newest bound alone tells.
    return until if until > seconds or bound <= goal_deg else seconds * (bound / goal_deg) ** 2
