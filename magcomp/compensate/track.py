"""A log's headings: as reported, as corrected, and fused with the gyro."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from magcomp.align import (
    controls,
    currents_of_motors,
    expected_earth,
    readings,
    reported,
    to_undo,
)
from magcomp.compensate.compensator import Compensator
from magcomp.compensate.fusion import Fusion, Motion, Reading, Tuning, fuse
from magcomp.errors import MissingDataError
from magcomp.fit import Problem, best_form, solvable
from magcomp.fit.flight import estimate_lags
from magcomp.geometry import gravity_direction, heading
from magcomp.model import (
    CURRENT,
    DRIVE,
    MOTORS,
    Control,
    Correction,
    FloatArray,
    Recording,
    Samples,
    Series,
    interpolate,
    quantity_of,
)

Gravity = Literal["attitude", "accelerometer"]
"""Where the fusion takes the direction of gravity from."""


@dataclass(frozen=True, eq=False)
class Track:
    """The headings of one compass through a log.

    Attributes
    ----------
    compass
        1, 2 or 3.
    time
        When each reading was measured, seconds, shape (n,).
    reported
        Heading of the field as the autopilot reported it, radians, shape (n,).
    corrected
        Heading of the field with the correction, radians, shape (n,).
    fused
        Compass and gyro, at the gyro's own times; NaN before the first reading. None where the
        log holds no gyro.
    field_lag_s, regressor_lag_s
        The delays that were taken into account.
    declination
        Radians; included in all headings.
    """

    compass: int
    time: FloatArray
    reported: FloatArray
    corrected: FloatArray
    fused: Series | None
    field_lag_s: float
    regressor_lag_s: float
    declination: float


def track(
    recording: Recording,
    compass: int,
    correction: Correction,
    regressor: str | None,
    *,
    exponent: float = 1.0,
    origin: str = "",
    tuning: Tuning | None = None,
    gravity: Gravity = "attitude",
    start: float = -np.inf,
    end: float = np.inf,
) -> Track:
    """Correct one compass of a log and fuse it with the gyro.

    Parameters
    ----------
    recording
        From any source.
    compass
        1, 2 or 3.
    correction
        From a fit or from parameters.
    regressor
        The control quantity its motor vector belongs to; None where that vector is zero.
    exponent
        The control quantity is raised to it; see :class:`magcomp.model.InForce`.
    origin
        Which form of the control quantity was fitted; see :class:`magcomp.model.MotorFit`.
    tuning
        Of the fusion.
    gravity
        The autopilot's attitude, or the first IMU's accelerometer. A multirotor's accelerometer
        feels thrust, which stands still in the body however the vehicle leans: fused headings
        are two to four times worse with it in a lively flight, and as good on a turntable.
    start, end
        Seconds since the recording began.

    Raises
    ------
    MissingDataError
        Without the compass, the attitude, or the control quantity.

    Notes
    -----
    The lags are estimated from strength and dip of the corrected field, which no heading
    enters. Without a position the declination is taken as 0.
    """
    earth = expected_earth(recording)
    new = readings(recording, compass, start=start, end=end)
    found = controls(recording)
    in_force = to_undo(recording, found)
    if regressor is None:
        forms = [Control(CURRENT, Series(new.time[:1], np.zeros(1)), "no motor correction")]
    else:
        of_motors = currents_of_motors(recording) if regressor == MOTORS else ()
        drive = [in_force[DRIVE]] if DRIVE in in_force else []
        each = (*found, *of_motors, *drive)
        forms = [_raised(one, exponent) for one in each if one.kind == regressor]
    if not forms:
        raise MissingDataError(
            f"{recording.source} must hold the {regressor} that the correction of compass "
            f"{compass} multiplies; instead it holds {', '.join(reported(found)) or 'neither'}"
            f"{quantity_of(regressor).how_to_have}"
        )
    forms = [one for one in forms if one.origin == origin] or forms
    with solvable(compass):
        problem = best_form([Problem(new, form, in_force, earth) for form in forms])
        lags, _ = estimate_lags(problem, correction)
    samples = problem.sample(lags)
    if problem.control.parts > 1:
        # A compensator multiplies one quantity: what the motors' parts add is in the readings then.
        inside = np.linalg.solve(correction.soft_iron, correction.added(samples.u).T).T
        samples = replace(samples, raw=samples.raw + inside)
        correction = replace(correction, motor=np.zeros(3))
    compensator = Compensator(correction, earth.declination)
    roll, pitch = samples.attitude[:, 0], samples.attitude[:, 1]
    _, corrected = compensator.correct_all(samples.raw, samples.total, roll, pitch)
    return Track(
        compass=compass,
        time=samples.time - lags.field,
        reported=heading(problem.readings.reported, roll, pitch, earth.declination),
        corrected=corrected,
        fused=_fused(recording, samples, compensator, tuning, gravity),
        field_lag_s=lags.field,
        regressor_lag_s=lags.regressor,
        declination=earth.declination,
    )


def _raised(control: Control, exponent: float) -> Control:
    """What a correction multiplies: a quantity to a power."""
    if control.kind != DRIVE:
        return control
    series = control.series
    raised = Series(series.time, np.maximum(series.value, 0.0) ** exponent)
    # Under a name of its own: what was in force is undone by the quantity as it was told.
    return replace(control, kind=MOTORS, series=raised)


def _fused(
    recording: Recording,
    samples: Samples,
    compensator: Compensator,
    tuning: Tuning | None,
    gravity: Gravity,
) -> Series | None:
    if recording.gyro is None or not len(recording.gyro):
        return None
    answers = list(fuse(events(recording, samples, gravity), compensator, Fusion(tuning)))
    return Series(
        np.array([answer.time for answer in answers]),
        np.array([answer.fused for answer in answers]),
    )


def events(
    recording: Recording, samples: Samples, gravity: Gravity = "attitude"
) -> Iterator[Motion | Reading]:
    """A log's sensor events in the order they arrived, as a live link would give them.

    Parameters
    ----------
    recording
        With a gyro.
    samples
        Readings of one compass; they say from when to when.
    gravity
        See :func:`track`.

    Raises
    ------
    MissingDataError
        Without the gyro, or without what gravity is to be taken from.
    """
    gyro = recording.gyro
    if gyro is None:
        raise MissingDataError(
            f"{recording.source} must hold the rates of a gyro (RAW_IMU or SCALED_IMU); instead it "
            "holds none"
        )
    rows = (gyro.time >= samples.time[0]) & (gyro.time <= samples.time[-1])
    time, rates = gyro.time[rows], gyro.value[rows]
    down = _down(recording, time, gravity)
    # A message that carries gyro and field brings a field that is older than its gyro.
    arrived = np.searchsorted(samples.time, time, side="left")
    measured = (samples.time - samples.lags.field).tolist()
    raw, u, attitude = samples.raw.tolist(), samples.total.tolist(), samples.attitude.tolist()
    told = 0
    for instant, rate, direction, count in zip(
        time.tolist(), rates.tolist(), down.tolist(), arrived.tolist(), strict=True
    ):
        for index in range(told, count):
            roll, pitch, _ = attitude[index]
            yield Reading(measured[index], raw[index], u[index], roll, pitch)
        told = count
        yield Motion(instant, rate, direction)


def _down(recording: Recording, time: FloatArray, gravity: Gravity) -> FloatArray:
    """Direction of gravity in body axes, shape (n, 3)."""
    if gravity == "accelerometer":
        if recording.accel is None:
            raise MissingDataError(
                f"{recording.source} must hold an accelerometer (RAW_IMU or SCALED_IMU); instead "
                "it holds none"
            )
        return -interpolate(recording.accel, time)
    if recording.attitude is None:
        raise MissingDataError(
            f"{recording.source} must hold the vehicle's attitude (message ATTITUDE); instead it "
            "holds none"
        )
    angles = recording.attitude.value
    # The vector, not the angles: roll jumps by half a turn where the nose points straight up.
    known = Series(recording.attitude.time, gravity_direction(angles[:, 0], angles[:, 1]))
    return interpolate(known, time)
