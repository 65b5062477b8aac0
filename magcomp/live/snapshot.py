"""A live session at one instant: everything a screen shows, frozen and already in words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from magcomp import autopilots
from magcomp.buffer import Coverage
from magcomp.geometry import heading
from magcomp.link import LinkStatistics
from magcomp.live.guide import Guidance
from magcomp.live.latest import Now, Vector
from magcomp.live.progress import Bound
from magcomp.live.refit import Refit
from magcomp.live.situation import Situation
from magcomp.model import Analysis, Grade, InForce, MotorFit, Series, Vehicle, quantity_of

_PLAUSIBLE = (150.0, 900.0)
"""mGauss: the earth's field is 220 … 670; motors and a bad calibration add to it."""

_TELLING_S = 3.0
"""What has not come so long after it was asked for does not come."""

_RATES_SETTLED_S = 8.0
_FAST_HZ = 5.0
_SLOW_SHARE = 0.6


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
        Seconds since the session was opened.
    recorded_s
        Seconds of the vehicle's own clock in which attitudes came: it stands while the link is
        lost.
    armed_until_s
        The second of these at which the motors ran last; 0 where they never did.
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
    headings
        Largest throttle at each heading, 0 … 1; NaN where it was never headed. See
        :data:`magcomp.live.progress.HEADINGS`.
    wanted_heading_deg
        Where to turn next; None where every heading was seen.
    bound
        What the newest analysis promises at the hover, and those before it.
    situation, guidance
        What is going on, and what to do next.
    early
        Too little is recorded, or was when the newest analysis was made, for a verdict against a
        compass.
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
    recorded_s: float
    armed_until_s: float
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
    headings: tuple[float, ...]
    wanted_heading_deg: float | None
    bound: Bound | None
    situation: Situation
    guidance: Guidance
    early: bool
    warnings: tuple[str, ...]
    analysis: Analysis | None
    grade: Grade | None
    stable_refits: int
    fit_trouble: str
    ready: bool
    ended: bool


def compasses_now(
    now: Now, vehicle: Vehicle | None, parameters: Mapping[str, float], refit: Refit
) -> tuple[CompassNow, ...]:
    """Work out each compass's heading, as it is and as it would be with the newest correction."""
    results = refit.analysis.compasses if refit.analysis else ()
    grades = {result.fit.compass: result.verdict.grade for result in results}
    autopilot = None if vehicle is None else autopilots.of(vehicle)
    if autopilot is None:
        return ()
    told = {number: Series(np.zeros(1), np.array([field])) for number, field in now.fields.items()}
    fields, uncorrected = autopilot.from_telemetry(told, parameters)
    found = []
    for number, series in sorted(fields.items()):
        fit, present = refit.fresh.get(number), None
        x, y, z = series.value[0].tolist()
        field = (x, y, z)
        if fit is not None or number in uncorrected:
            present = autopilot.in_force(parameters, number)
        if present is not None and number in uncorrected:
            field = _applied(field, now, present) or field
        found.append(_compass_now(number, field, now, present, fit, grades.get(number)))
    return tuple(found)


def _applied(raw: Vector, now: Now, present: InForce) -> Vector | None:
    """What the vehicle makes of a sensor's own field."""
    u = _control(present.regressor, now)
    if u is None and present.correction.motor.any():
        return None
    x, y, z = present.correction.apply(np.array([raw]), np.array([u or 0.0]))[0].tolist()
    return x, y, z


def _compass_now(
    number: int,
    field: Vector,
    now: Now,
    present: InForce | None,
    fit: MotorFit | None,
    grade: Grade | None,
) -> CompassNow:
    strength = math.hypot(*field)
    corrected = None
    if fit is not None and present is not None:
        corrected = _corrected(field, now, present, fit)
    return CompassNow(
        number=number,
        field=field,
        strength=strength,
        heading_deg=_heading_deg(field, now),
        heading_corrected_deg=None if corrected is None else _heading_deg(corrected, now),
        healthy=_PLAUSIBLE[0] < strength < _PLAUSIBLE[1],
        grade=grade,
    )


def _corrected(field: Vector, now: Now, present: InForce, fit: MotorFit) -> Vector | None:
    """Undo the correction in force and apply the fitted one."""
    u_present, u_new = _control(present.regressor, now), _control(fit.regressor, now)
    if u_new is None or (u_present is None and present.correction.motor.any()):
        return None
    raw = present.correction.undo(np.array([field]), np.array([u_present or 0.0]))
    x, y, z = fit.correction.apply(raw, np.array([u_new]))[0].tolist()
    return x, y, z


def _control(regressor: str | None, now: Now) -> float | None:
    """What the vehicle says of a control quantity."""
    quantity = quantity_of(regressor)
    return quantity.of(current=now.current, throttle=now.throttle) if quantity.is_told else None


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
        Seconds since the streams were asked for; what has not come early on may still come. 0
        where nothing could be asked for: then it is no wonder that something does not come.
    """
    autopilot = autopilots.of(vehicle)
    yield from autopilot.warnings(parameters)
    yield from autopilot.link_notes(len(vehicle.compasses))
    yield from _on_compasses(now, vehicle, parameters, streaming_s)
    if now.current_sensor is False:
        yield "there is no current sensor: throttle is used, which changes with the battery"
    if (regressor := autopilot.regressor(parameters)) is not None:
        yield (
            f"a motor compensation by {regressor} is in force ({autopilot.switch} "
            f"{parameters[autopilot.switch]:g}): it is taken into account"
        )


def slow_streams(
    asked: Mapping[str, float], received: Mapping[str, float], streaming_s: float
) -> Iterator[str]:
    """Say where the link brings much less than what was asked for, and what that costs.

    Parameters
    ----------
    asked, received
        Message name to Hz.
    streaming_s
        Seconds since the streams were asked for; rates are means over some seconds.
    """
    if streaming_s < _RATES_SETTLED_S:
        return
    slow = {
        name: received[name] / rate
        for name, rate in asked.items()
        if received.get(name, 0.0) and rate >= _FAST_HZ and received[name] < _SLOW_SHARE * rate
    }
    if slow:
        name = min(slow, key=lambda each: slow[each])
        yield (
            f"{name} comes {received[name]:.1f} times a second, though {asked[name]:.0f} were "
            "asked for: what lies between (MAVProxy needs `set streamrate -1`; a slow radio) "
            "limits it; fewer readings and coarser times make the answer less sure, so record "
            "longer"
        )


def _on_compasses(
    now: Now, vehicle: Vehicle, parameters: Mapping[str, float], streaming_s: float
) -> Iterator[str]:
    autopilot = autopilots.of(vehicle)
    if streaming_s > _TELLING_S and not now.fields:
        yield f"no compass reports: {autopilot.no_compass_hint()}"
    elif streaming_s > _TELLING_S and len(now.fields) < len(vehicle.device_ids):
        missing = [n for n in range(1, len(vehicle.device_ids) + 1) if n not in now.fields]
        yield f"{_compasses(missing)} of {len(vehicle.device_ids)} does not report"
    if now.compass_trouble:
        yield "the autopilot says that its compass is not healthy"
    for compass in compasses_now(now, vehicle, parameters, Refit()):
        if not compass.healthy:
            yield (
                f"compass {compass.number} reads {compass.strength:.0f} mGauss: the earth's field "
                "is between 220 and 670"
            )


def _compasses(numbers: list[int]) -> str:
    return f"compass{'es' if len(numbers) > 1 else ''} {' and '.join(map(str, numbers))}"
