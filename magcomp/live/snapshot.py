"""A live session at one instant: everything a screen shows, frozen and already in words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from magcomp.autopilots import ardupilot
from magcomp.buffer import Coverage
from magcomp.geometry import heading
from magcomp.link import LinkStatistics
from magcomp.live.guide import Guidance, Situation
from magcomp.live.latest import Now, Vector
from magcomp.live.refit import Refit
from magcomp.model import THROTTLE, Analysis, Grade, MotorFit, Vehicle

_PLAUSIBLE = (150.0, 900.0)
"""mGauss: the earth's field is 220 … 670; motors and a bad calibration add to it."""


@dataclass(frozen=True)
class CompassNow:
    """One compass.

    Attributes
    ----------
    number
        1, 2 or 3: the autopilot's priority order.
    field
        As the autopilot reports it, corrected, body axes, mGauss.
    strength
        Its length, mGauss.
    heading_deg
        Magnetic, 0 … 360; None without attitude.
    heading_corrected_deg
        The same with the newest correction, brought up to date about each second; None before
        the first analysis.
    healthy
        Its readings come, and could be the earth's field.
    grade
        Of the newest analysis; None before the first.
    """

    number: int
    field: Vector
    strength: float
    heading_deg: float | None
    heading_corrected_deg: float | None
    healthy: bool
    grade: Grade | None


@dataclass(frozen=True, eq=False)
class LiveSnapshot:
    """A live session as it stands.

    Attributes
    ----------
    address
        Where the vehicle is, as the link understood it.
    vehicle
        None until it is found.
    connected
        It was heard within the last three seconds.
    link_text
        How the link is, in words.
    armed
        None before the first heartbeat.
    elapsed_s
        Seconds since the first frame.
    recording_path, recording_bytes
        The .tlog being written; None and 0 without one.
    recording
        Frames are still taken: False after ``stop_recording``, or where the disk refused.
    recording_trouble
        Why the disk refused, a sentence; empty where it did not.
    link
        Rates in Hz by message, losses, round trip, gaps.
    compasses
        Those that report, by number.
    throttle, current, voltage
        0 … 1, A, V; None where absent.
    attitude_deg
        Roll, pitch, yaw as the autopilot believes.
    height_m
        Above home; None where unknown.
    coverage
        Attitudes on the sphere by throttle level.
    levels_done
        Throttle levels (tenths) whose attitudes suffice.
    level_seconds
        Seconds at each throttle level.
    situation, guidance
        What is going on, and what to do next.
    warnings
        Sentences, most important first.
    analysis
        The newest; None before the first.
    grade
        Its grade.
    stable_refits
        Analyses in a row that said the same.
    fit_trouble
        Why the newest attempt gave no analysis; empty where it did.
    ready
        The vehicle is known, its streams were asked for, its calibration read.
    ended
        A replayed log is over.
    """

    address: str
    vehicle: Vehicle | None
    connected: bool
    link_text: str
    armed: bool | None
    elapsed_s: float
    recording_path: Path | None
    recording_bytes: int
    recording: bool
    recording_trouble: str
    link: LinkStatistics
    compasses: tuple[CompassNow, ...]
    throttle: float | None
    current: float | None
    voltage: float | None
    attitude_deg: Vector | None
    height_m: float | None
    coverage: Coverage
    levels_done: tuple[int, ...]
    level_seconds: tuple[float, ...]
    situation: Situation
    guidance: Guidance
    warnings: tuple[str, ...]
    analysis: Analysis | None
    grade: Grade | None
    stable_refits: int
    fit_trouble: str
    ready: bool
    ended: bool


def compasses_now(
    now: Now, parameters: Mapping[str, float], refit: Refit
) -> tuple[CompassNow, ...]:
    """Work out each compass's heading, as it is and as it would be with the newest correction."""
    results = refit.analysis.compasses if refit.analysis else ()
    grades = {result.fit.compass: result.verdict.grade for result in results}
    return tuple(
        _compass_now(number, field, now, parameters, refit.fresh.get(number), grades.get(number))
        for number, field in sorted(now.fields.items())
    )


def _compass_now(
    number: int,
    field: Vector,
    now: Now,
    parameters: Mapping[str, float],
    fit: MotorFit | None,
    grade: Grade | None,
) -> CompassNow:
    strength = math.hypot(*field)
    corrected = None if fit is None else _corrected(field, now, parameters, fit)
    return CompassNow(
        number=number,
        field=field,
        strength=strength,
        heading_deg=_heading_deg(field, now),
        heading_corrected_deg=None if corrected is None else _heading_deg(corrected, now),
        healthy=_PLAUSIBLE[0] < strength < _PLAUSIBLE[1],
        grade=grade,
    )


def _corrected(
    field: Vector, now: Now, parameters: Mapping[str, float], fit: MotorFit
) -> Vector | None:
    """Undo the correction in force and apply the fitted one."""
    present = ardupilot.calibration(parameters, fit.compass)
    by_throttle = present.compensation is ardupilot.MotorCompensation.THROTTLE
    u_present = now.throttle if by_throttle else now.current
    u_new = now.throttle if fit.regressor == THROTTLE else now.current
    if u_new is None or (u_present is None and present.motor.any()):
        return None
    raw = ardupilot.uncorrect(np.array(field), np.array(u_present or 0.0), present)
    x, y, z = fit.correction.apply(raw[None, :], np.array([u_new]))[0].tolist()
    return x, y, z


def _heading_deg(field: Vector, now: Now) -> float | None:
    if now.attitude is None:
        return None
    roll, pitch, _ = now.attitude
    return math.degrees(float(heading(np.array(field), roll, pitch))) % 360.0


def warnings(
    now: Now, vehicle: Vehicle, parameters: Mapping[str, float], streaming_s: float
) -> Iterator[str]:
    """What a pilot should know of the vehicle, in words.

    Parameters
    ----------
    streaming_s
        Seconds since the streams were asked for; what has not come early on may still come.
    """
    if parameters.get("COMPASS_PMOT_EN"):
        yield (
            "COMPASS_PMOT_EN is on: compass 1 is corrected per motor and is left out; "
            "set it to 0 to calibrate compass 1"
        )
    yield from _on_compasses(now, vehicle, parameters, streaming_s)
    if streaming_s > 3.0 and now.current is None:
        yield "there is no current sensor: throttle is used, which changes with the battery"
    kind = ardupilot.calibration(parameters, 1).compensation
    if kind is not ardupilot.MotorCompensation.OFF:
        name = "throttle" if kind is ardupilot.MotorCompensation.THROTTLE else "current"
        yield (
            f"a motor compensation by {name} is in force (COMPASS_MOTCT {kind.value}): it is "
            "taken into account"
        )
    if parameters.get("COMPASS_LEARN"):
        yield (
            f"COMPASS_LEARN is {parameters['COMPASS_LEARN']:.0f}: the offsets may move while this "
            "is recorded; set it to 0"
        )


def _on_compasses(
    now: Now, vehicle: Vehicle, parameters: Mapping[str, float], streaming_s: float
) -> Iterator[str]:
    if streaming_s > 3.0 and not now.fields:
        yield "no compass reports: is COMPASS_ENABLE 1, and does the link carry RAW_IMU?"
    elif streaming_s > 3.0 and len(now.fields) < len(vehicle.device_ids):
        missing = [n for n in range(1, len(vehicle.device_ids) + 1) if n not in now.fields]
        yield f"{_compasses(missing)} of {len(vehicle.device_ids)} does not report"
    if now.compass_trouble:
        yield "the autopilot says that its compass is not healthy"
    for number, field in sorted(now.fields.items()):
        strength = math.hypot(*field)
        if not _PLAUSIBLE[0] < strength < _PLAUSIBLE[1]:
            yield (
                f"compass {number} reads {strength:.0f} mGauss: the earth's field is "
                "between 220 and 670"
            )
        if parameters.get(f"COMPASS_USE{ardupilot.suffix(number)}", 1.0) == 0.0:
            yield f"compass {number} is not used for the heading (COMPASS_USE is 0)"


def _compasses(numbers: list[int]) -> str:
    return f"compass{'es' if len(numbers) > 1 else ''} {' and '.join(map(str, numbers))}"
