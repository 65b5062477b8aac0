"""What to do next, in words: from what has been seen so far to one sentence. No I/O, no clock.

How the recording is being made is told by magcomp.live.situation.

Rules
-----
1. A pilot in the air is never told a throttle, a bank or anything else that could cost
   height: only to turn, to climb, to descend when high enough, and to land when it is enough.
2. Throttle is spoken of only to somebody who holds the vehicle or has tied it down.
3. Where it is not known whether it flies, only what is right for both is said.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from magcomp.buffer import BANDS, LEVELS, SECTORS, Coverage, sphere_cell
from magcomp.live.situation import Situation, Vector
from magcomp.model import Grade

LEVEL_ENOUGH = 0.3
"""Share of the sphere at which a level is done: about three turns, one about each axis."""

LEVELS_ENOUGH = 3
STEPS_ENOUGH = 5
STEP_S = 3.0
DISARMED_S = 3.0
FLIGHT_S = 60.0
SECTORS_ENOUGH = SECTORS - 1
THROTTLES_ENOUGH = 3
_THROTTLE_SHARE_S = 2.0
_HELD_LEVELS = (0, 2, 4, 3, 1, 5)
_LOW_M = 8.0
_STABLE_REFITS = 2
_ALMOST = 0.9
STEADY = "a sure answer"
FINE_DEG = 0.5
LONG_S = 240.0
"""A bound that is worth waiting for, and how long."""


@dataclass(frozen=True)
class Guidance:
    """What to do next.

    Attributes
    ----------
    text
        A sentence for the pilot, without full stop.
    share_done
        0 … 1.
    enough
        Nothing more is needed.
    missing
        What is, in a word or two each.
    """

    text: str
    share_done: float
    enough: bool = False
    missing: tuple[str, ...] = ()

    @property
    def early(self) -> bool:
        """Too little is recorded for a verdict against a compass.

        Where only the answer is wanting, everything was flown: then a rejection is one.
        """
        return not self.enough and self.missing != (STEADY,)


@dataclass(frozen=True, eq=False)
class View:
    """What guidance is made of.

    Attributes
    ----------
    situation
        See magcomp.live.situation.
    armed
        None while unknown.
    throttle
        0 … 1; None while unknown.
    attitude
        Roll, pitch, yaw in radians; None while unknown.
    height_m
        Above home; None while unknown.
    coverage
        Attitudes seen at each throttle level.
    seconds
        Recorded with attitude.
    grade
        Of the newest analysis; None before the first.
    stable_refits
        Analyses in a row that said the same.
    bound_deg
        Heading error that the newest analysis promises not to be exceeded (95 %), degrees.
    was_enough
        It was enough before; data do not become fewer.
    answered
        The newest analysis has all that was recorded before the motors were switched off.
    """

    situation: Situation
    armed: bool | None
    throttle: float | None
    attitude: Vector | None
    height_m: float | None
    coverage: Coverage
    seconds: float
    grade: Grade | None = None
    stable_refits: int = 0
    bound_deg: float = 0.0
    was_enough: bool = False
    answered: bool = True


def guide(view: View) -> Guidance:
    """Say what to do next.

    Notes
    -----
    See the rules at the top of the file.
    """
    if view.was_enough:
        return Guidance(_ending(view), 1.0, enough=True)
    match view.situation:
        case Situation.FLYING:
            return _guide_flight(view)
        case Situation.HELD:
            return _guide_held(view)
        case Situation.STILL:
            return _guide_still(view)
        case Situation.UNSURE:
            return _guide_unsure(view)
        case _:
            return _guide_ground(view)


def is_settled(view: View) -> bool:
    """Whether the judge is content and has been for a while, and more data would help little."""
    steady = view.grade is Grade.GOOD and view.stable_refits >= _STABLE_REFITS
    return steady and (view.bound_deg <= FINE_DEG or view.seconds >= LONG_S)


def pilot_is_done(situation: Situation, disarmed_s: float, levels: int) -> bool:
    """Whether the pilot has ended the measurement by disarming.

    Parameters
    ----------
    disarmed_s
        Seconds since the motors were switched off; 0 while they are on or have not been.
    levels
        How many throttle levels are done.
    """
    if disarmed_s < DISARMED_S or situation is Situation.GROUND:
        return False
    # Whoever holds it may switch the motors off to turn it over, and goes on.
    return situation is not Situation.HELD or levels >= LEVELS_ENOUGH


def level_seconds(view: View) -> tuple[float, ...]:
    """Seconds recorded at each throttle level."""
    return tuple((view.coverage.share * view.seconds).tolist())


def levels_done(coverage: Coverage) -> tuple[int, ...]:
    """Throttle levels whose attitudes are enough for an ellipsoid."""
    return tuple(np.flatnonzero(coverage.fraction >= LEVEL_ENOUGH).tolist())


def _guide_ground(view: View) -> Guidance:
    if view.attitude is None:
        return Guidance("waiting for the vehicle's attitude", 0.0)
    return Guidance(
        "arm and fly: turns, climbs and descents; or hold it on a stand without propellers and "
        "turn it about every axis at three steady throttles",
        0.0,
    )


def _guide_unsure(view: View) -> Guidance:
    """It may hover, or hang on a stand: only what is right for both."""
    shares = {
        "headings": min(len(_sectors(view)) / SECTORS_ENOUGH, 1.0),
        "time": min(view.seconds / FLIGHT_S, 1.0),
        STEADY: _sureness(view) if view.grade is Grade.GOOD else 0.0,
    }
    missing = _missing(shares)
    if not missing:
        return Guidance(_ending(view), 1.0, enough=True)
    share = 0.9 * float(np.mean(list(shares.values())))
    return Guidance(f"keep the throttle as it is and {_turn(view)}", share, missing=missing)


# -------------------------------------------------------------------------- flying


def _guide_flight(view: View) -> Guidance:
    sectors = _sectors(view)
    throttles = sum(seconds >= _THROTTLE_SHARE_S for seconds in level_seconds(view))
    shares = {
        "headings": min(len(sectors) / SECTORS_ENOUGH, 1.0),
        "climbs and descents": min(throttles / THROTTLES_ENOUGH, 1.0),
        "time": min(view.seconds / FLIGHT_S, 1.0),
        STEADY: _sureness(view) if view.grade is Grade.GOOD else 0.0,
    }
    turns, climbs, *_ = shares.values()
    share = float(np.mean(list(shares.values())))
    missing = _missing(shares)
    landed = view.armed is False and view.answered and view.grade is Grade.GOOD
    if landed or not missing:
        return Guidance(_ending(view), 1.0, enough=True)
    if not view.armed and not view.answered:
        text = "wait for the answer: the whole flight is being fitted"
    elif not view.armed:
        text = "this flight was not enough: fly once more with turns and climbs"
    elif turns < 1.0 and turns <= climbs:
        text = _turn(view)
    elif climbs < 1.0:
        text = _climb_or_descend(view)
    elif turns < 1.0:
        text = _turn(view)
    else:
        text = f"keep flying: {_turn_more(view)} and {_climb_or_descend(view)}"
    return Guidance(text, share, missing=missing)


def _sureness(view: View, *, settled: bool | None = None) -> float:
    """How near the answer is to one that more data would not change; 1 only where it is one."""
    if is_settled(view) if settled is None else settled:
        return 1.0
    return _ALMOST * min(view.stable_refits / _STABLE_REFITS, 1.0)


def _missing(shares: Mapping[str, float]) -> tuple[str, ...]:
    return tuple(name for name, share in shares.items() if share < 1.0)


def _climb_or_descend(view: View) -> str:
    """Climbing needs more throttle than hovering, descending less: both ends are wanted."""
    if view.height_m is None or view.height_m < _LOW_M:
        return "climb"
    seconds = level_seconds(view)
    hover = int(np.argmax(seconds[1:])) + 1 if any(seconds[1:]) else 0
    return "climb" if sum(seconds[hover + 1 :]) <= sum(seconds[1:hover]) else "descend"


# -------------------------------------------------------------------------- held


def _guide_held(view: View) -> Guidance:
    fraction = view.coverage.fraction
    done = levels_done(view.coverage)
    best = np.sort(np.minimum(fraction / LEVEL_ENOUGH, 1.0))[::-1][:LEVELS_ENOUGH]
    shares = {
        "turns at three throttles": float(best.sum()) / LEVELS_ENOUGH,
        STEADY: _sureness(view) if len(done) >= LEVELS_ENOUGH else 0.0,
    }
    turns, steadiness = shares.values()
    share, missing = 0.9 * turns + 0.1 * steadiness, _missing(shares)
    if not missing:
        return Guidance(_ending(view), 1.0, enough=True)
    level = _level(view)
    wanted = next((each for each in _HELD_LEVELS if each not in done), LEVELS // 2 + 1)
    if level not in done:
        text = f"hold the throttle and {_held_motion(view, level)}"
    elif len(done) >= LEVELS_ENOUGH:
        text = f"disarm to end, or make it surer: {_throttle_to(wanted, level)}"
    else:
        text = _throttle_to(wanted, level)
    return Guidance(text, share, missing=missing)


def _held_motion(view: View, level: int) -> str:
    cells = view.coverage.counts[level].reshape(BANDS, SECTORS) > 0
    if cells.any(axis=0).sum() < SECTORS_ENOUGH:
        return _turn(view, level)
    above, below = cells[: BANDS // 2].sum(), cells[BANDS // 2 :].sum()
    if above >= below:
        return "lay it on its side and turn it slowly right round"
    if (cells.sum() % 2) == 0:
        return "tilt the nose down and turn it slowly over"
    return "lay it on its side and turn it slowly right over"


def _throttle_to(wanted: int, level: int) -> str:
    verb = "raise" if wanted > level else "lower"
    return f"{verb} the throttle to {100 * wanted // LEVELS} % and hold"


# -------------------------------------------------------------------------- still


def _guide_still(view: View) -> Guidance:
    seconds = level_seconds(view)
    done = [level for level, time in enumerate(seconds) if time >= STEP_S]
    # Who stands still cannot show more than the motors' part: marginal is the best there is.
    steady = view.grade is Grade.MARGINAL and view.stable_refits >= _STABLE_REFITS
    sureness = _sureness(view, settled=steady or is_settled(view))
    shares = {
        f"{STEPS_ENOUGH} steps of the throttle": min(len(done) / STEPS_ENOUGH, 1.0),
        STEADY: sureness if len(done) >= STEPS_ENOUGH else 0.0,
    }
    steps, steadiness = shares.values()
    share, missing = 0.9 * steps + 0.1 * steadiness, _missing(shares)
    if not missing:
        return Guidance(_ending(view), 1.0, enough=True)
    level = _level(view)
    wanted = next((each for each in range(STEPS_ENOUGH) if each not in done), None)
    if not view.armed:
        text = (
            f"arm and hold {STEPS_ENOUGH} steps of the throttle, only if it is tied down"
            if wanted is not None
            else "wait for the answer; every step is held"
        )
        return Guidance(text, share, missing=missing)
    if wanted is None:
        wanted = min(done[-1] + 1, LEVELS // 2 + 1) if level < done[-1] else 0
    if level not in done or wanted == level:
        return Guidance("hold the throttle where it is", share, missing=missing)
    text = f"only if it is tied down: {_throttle_to(wanted, level)}"
    return Guidance(text, share, missing=missing)


# -------------------------------------------------------------------------- all


def _ending(view: View) -> str:
    if not view.armed:
        return "that is enough"
    if view.situation is Situation.FLYING:
        return "that is enough: land and disarm to write"
    if view.situation is Situation.UNSURE:
        return "that is enough: land, or rest, and disarm to write"
    return "that is enough: lower the throttle and disarm to write"


def _level(view: View) -> int:
    return min(int((view.throttle or 0.0) * LEVELS), LEVELS - 1)


def _sectors(view: View, level: int | None = None) -> set[int]:
    counts = view.coverage.counts if level is None else view.coverage.counts[level]
    seen = counts.reshape(-1, BANDS, SECTORS).any(axis=(0, 1))
    return set(np.flatnonzero(seen).tolist())


def _turn(view: View, level: int | None = None) -> str:
    """Turn towards the nearest direction not yet seen."""
    if view.attitude is None:
        return "turn slowly"
    right, left = _steps_to_missing(view, level)
    return f"turn slowly to the {'right' if right <= left else 'left'}"


def wanted_heading(view: View) -> float | None:
    """The heading to turn to next, radians; None where every one was seen.

    The sentence of :func:`guide` names the side it lies on.
    """
    if view.attitude is None or len(_sectors(view)) == SECTORS:
        return None
    right, left = _steps_to_missing(view)
    turn = right if right <= left else -left
    return (view.attitude[2] + turn * math.tau / SECTORS) % math.tau


def _steps_to_missing(view: View, level: int | None = None) -> tuple[int, int]:
    """Sectors to turn right, and left, to the nearest one not yet seen.

    Notes
    -----
    Turning right by an angle turns the field to the left by it, in body axes: to lower sectors.
    """
    missing = set(range(SECTORS)) - _sectors(view, level)
    here = _sector(view.attitude[2]) if view.attitude is not None else 0
    right = next((step for step in range(SECTORS) if (here - step) % SECTORS in missing), 0)
    left = next((step for step in range(SECTORS) if (here + step) % SECTORS in missing), 0)
    return right, left


def _turn_more(view: View) -> str:
    return _turn(view).replace("slowly ", "")


def _sector(yaw: float) -> int:
    """Sector of a level, northward field at a heading."""
    return sphere_cell(math.cos(yaw), -math.sin(yaw), 0.0) % SECTORS
