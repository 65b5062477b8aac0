"""The paper's turntable, Figs 3 to 7 and docs/method.md, Table 1.

The vehicle is held and turned about z, y and x at each control quantity, then
turned once more, level. The turns about three axes are what the corrections
are made of; the last, level turn is what they are measured on, and *no
correction sees it*.

The residual heading error is the heading of the corrected field, levelled with
the true roll and pitch, less the true yaw of the moment the field was measured.
How long that is before its report is found once for the recording, by the truth
and without any of the corrections under test (:func:`true_lag`), because an
error of timing is none of a correction: at 20°/s every 50 ms would count as 1°.

A turn is divided into 24 sectors of 15° of true heading. The residual of a
sector is the mean of its readings (about seven), so that a
number speaks of the correction and not of the noise of one reading; a table's
number is the largest absolute residual of the 24.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from magcomp.align import controls, expected_earth, readings, reported
from magcomp.earth import EarthField
from magcomp.errors import MissingDataError
from magcomp.experiments.methods import METHODS, Corrections, corrections
from magcomp.experiments.motion import true_motion
from magcomp.experiments.paper import CONTROLS
from magcomp.fit import Problem
from magcomp.geometry import heading, wrap_angle
from magcomp.model import CURRENT, BoolArray, FloatArray, IntArray, Lags, Recording, Samples, Series
from magcomp.sources.truth import Truth

SECTORS = 24

_LEVEL_RAD = np.radians(2.0)
_TURNING_RAD_S = np.radians(3.0)
_WHOLE_TURN_RAD = np.radians(345.0)
_MARGIN_S = 0.5
_LAG_BOUNDS_S = (-0.2, 0.5)


@dataclass(frozen=True)
class Row:
    """One line of Table 1: largest absolute residual heading error over the turn, degrees.

    Attributes
    ----------
    control
        Control quantity, per mille.
    current_a
        Mean current during the turn.
    uncorrected_deg
        The sensor's field as it is.
    ellipsoid_deg
        One ellipsoid, fitted at control quantity 0, used at all of them.
    paper_deg
        The paper's iteration: an ellipsoid and centre for each control quantity, the line
        through the centres, the position along it looked up.
    magcomp_deg
        What ``magcomp fit`` writes with everything on its defaults.
    """

    control: int
    current_a: float
    uncorrected_deg: float
    ellipsoid_deg: float
    paper_deg: float
    magcomp_deg: float


@dataclass(frozen=True, eq=False)
class Turn:
    """The level turn at one control quantity: one of Figs 5 to 7.

    Attributes
    ----------
    control, current_a
        See :class:`Row`.
    heading_deg
        Middles of the sectors, shape (24,).
    residual_deg
        By name of the method, shape (24,); NaN for a sector without a reading.
    """

    control: int
    current_a: float
    heading_deg: FloatArray
    residual_deg: Mapping[str, FloatArray]

    @property
    def row(self) -> Row:
        """Its line of Table 1."""
        largest = {
            name: float(np.nanmax(np.abs(residual))) for name, residual in self.residual_deg.items()
        }
        return Row(
            self.control,
            self.current_a,
            **{f"{name}_deg": largest[name] for name in METHODS},
        )


@dataclass(frozen=True, eq=False)
class Turntable:
    """Everything of one turntable recording.

    Attributes
    ----------
    source
        Where it comes from.
    compass
        1, 2 or 3.
    turns
        By control quantity.
    corrections
        What was found from the other turns.
    lag_s
        By how much the field is late, by the truth.
    """

    source: str
    compass: int
    turns: tuple[Turn, ...]
    corrections: Corrections
    lag_s: float

    @property
    def rows(self) -> tuple[Row, ...]:
        """Table 1."""
        return tuple(turn.row for turn in self.turns)


def turntable(recording: Recording, truth: Truth, compass: int = 1) -> Turntable:
    """Carry out the paper's turntable experiment on a recording of it.

    Parameters
    ----------
    recording
        Three control quantities; at each, turns about three axes and a level turn.
    truth
        Of the same recording; it only judges.
    compass
        1, 2 or 3.

    Raises
    ------
    MissingDataError
        Where the recording is not of this experiment.
    """
    spans = _measured_turns(recording, truth)
    earth = expected_earth(recording)
    found = reported(controls(recording))
    if CURRENT not in found:
        raise MissingDataError(
            f"{recording.source} must hold the battery current; instead it holds none"
        )
    problem = Problem(readings(recording, compass), found[CURRENT], found, earth)
    everything = problem.sample(Lags())
    lag = true_lag(everything, truth, earth)
    seen = _without(recording, spans)
    made = corrections(seen, compass, earth)
    turns = tuple(
        _turn(
            control,
            everything.where(_within(everything.time, span)),
            made,
            index,
            truth,
            lag,
            earth.declination,
        )
        for index, (control, span) in enumerate(zip(CONTROLS, spans, strict=True))
    )
    return Turntable(
        source=recording.source,
        compass=compass,
        turns=turns,
        corrections=made,
        lag_s=lag,
    )


def _turn(
    control: int,
    samples: Samples,
    made: Corrections,
    level: int,
    truth: Truth,
    lag: float,
    declination: float,
) -> Turn:
    motion = true_motion(truth, samples.time - lag)
    sector = np.floor(np.degrees(motion.yaw) % 360.0 * (SECTORS / 360.0)).astype(np.intp)
    residuals = {}
    for method in METHODS:
        field = made.apply(method, samples.raw, samples.total, level)
        found = heading(field, motion.roll, motion.pitch, declination)
        residuals[method] = _by_sector(np.degrees(wrap_angle(found - motion.yaw)), sector)
    return Turn(
        control=control,
        current_a=float(samples.total.mean()),
        heading_deg=np.arange(0.5, SECTORS) * (360.0 / SECTORS),
        residual_deg=residuals,
    )


def _by_sector(residual: FloatArray, sector: IntArray) -> FloatArray:
    count = np.bincount(sector, minlength=SECTORS)
    total = np.bincount(sector, weights=residual, minlength=SECTORS)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def true_lag(samples: Samples, truth: Truth, earth: EarthField) -> float:
    """By how much the field is reported later than it was measured, seconds.

    Parameters
    ----------
    samples
        Readings at all attitudes, with lags of 0.
    truth
        The true attitude.
    earth
        The earth's field.

    Notes
    -----
    The lag at which a symmetric matrix, an offset and a motor vector, all free, explain the raw
    field best (docs/method.md, Equation 3): it depends on none of the corrections compared.
    """
    u = samples.total

    def unexplained(lag: float) -> float:
        pose = true_motion(truth, samples.time - lag).earth_from_body
        field = np.einsum("nji,j->ni", pose, earth.ned)
        x, y, z = field.T
        zero, one = np.zeros_like(x), np.ones_like(x)
        rows = [
            (x, zero, zero, y, z, zero, one, zero, zero, u, zero, zero),
            (zero, y, zero, x, zero, z, zero, one, zero, zero, u, zero),
            (zero, zero, z, zero, x, y, zero, zero, one, zero, zero, u),
        ]
        design = np.concatenate([np.stack(row, axis=1) for row in rows])
        value = samples.raw.T.reshape(-1)
        solution = np.linalg.lstsq(design, value, rcond=None)[0]
        return float(np.mean((value - design @ solution) ** 2))

    return float(minimize_scalar(unexplained, bounds=_LAG_BOUNDS_S, method="bounded").x)


def _measured_turns(recording: Recording, truth: Truth) -> tuple[tuple[float, float], ...]:
    """The last level turn at each control quantity, in order: start and end, seconds."""
    throttle = recording.throttle
    if throttle is None:
        raise MissingDataError(
            f"{recording.source} must hold the throttle (VFR_HUD); instead it holds none"
        )
    last: dict[int, tuple[float, float]] = {}
    for start, end in _level_turns(truth.attitude):
        value = float(np.interp(0.5 * (start + end), throttle.time, throttle.value))
        last[round(100.0 * value)] = (start, end)
    if len(last) != len(CONTROLS):
        raise MissingDataError(
            f"{recording.source} must hold a level turn at {len(CONTROLS)} control quantities; "
            f"instead it holds them at {len(last)}"
        )
    return tuple(last[value] for value in sorted(last))


def _level_turns(attitude: Series) -> list[tuple[float, float]]:
    """Stretches in which the level vehicle turns once around."""
    yaw = np.unwrap(attitude.value[:, 2])
    step = np.maximum(np.diff(attitude.time), 1e-6)
    turning = np.abs(np.diff(yaw)) / step > _TURNING_RAD_S
    turning &= np.abs(attitude.value[1:, :2]).max(axis=1) < _LEVEL_RAD
    edges = np.flatnonzero(np.diff(np.concatenate([[0], turning.astype(int), [0]])))
    spans = [(first, last) for first, last in edges.reshape(-1, 2).tolist()]
    return [
        (float(attitude.time[first]), float(attitude.time[last]))
        for first, last in spans
        if abs(yaw[last] - yaw[first]) > _WHOLE_TURN_RAD
    ]


def _within(time: FloatArray, span: tuple[float, float]) -> BoolArray:
    return np.asarray((time >= span[0]) & (time <= span[1]))


def _without(recording: Recording, spans: tuple[tuple[float, float], ...]) -> Recording:
    """The recording as it would be without the readings of the measured turns."""
    fields = {}
    for compass, series in recording.field.items():
        keep = np.ones(len(series), dtype=bool)
        for start, end in spans:
            keep &= ~_within(series.time, (start - _MARGIN_S, end + _MARGIN_S))
        fields[compass] = Series(series.time[keep], series.value[keep])
    return replace(recording, field=fields)
