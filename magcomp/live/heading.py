"""A live vehicle's heading: as reported, as corrected, and fused with the gyro."""

from __future__ import annotations

import math
import queue
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from magcomp import autopilots
from magcomp.compensate import Compensator, Fusion, Motion, Reading, fuse
from magcomp.errors import MissingDataError
from magcomp.geometry import gravity_direction
from magcomp.mavlink.header import message_id, source
from magcomp.mavlink.messages import Message, decode_frame
from magcomp.model import CURRENT, InForce, Recording, Series, Vehicle, quantity_of

_USED = frozenset((Message.ATTITUDE, Message.VFR_HUD, Message.BATTERY_STATUS))
_LINK_FORMAT = "tlog"
_MESSAGES = 3
_LOOK_S = 0.2
_MEMORY = 64
"""Attitudes kept: a second and more of the 50 Hz asked for."""


@dataclass(frozen=True, slots=True)
class LiveHeading:
    """The headings at one instant, radians; NaN before the first reading.

    Attributes
    ----------
    time
        Seconds of the vehicle's own clock.
    raw
        Of the field as the autopilot reports it.
    corrected
        Of the same reading, corrected.
    fused
        Compass and gyro.
    """

    time: float
    raw: float
    corrected: float
    fused: float


class Sensors:
    """Takes every frame of a link and gives one compass's sensor events, in order.

    Parameters
    ----------
    compass
        Its number.
    vehicle
        Others on the link are left out.
    values
        Its parameters by name.

    Attributes
    ----------
    uncorrected
        The readings are the sensor's own, not what the autopilot made of them.

    Raises
    ------
    MissingDataError
        The vehicle has no such compass, as far as its parameters tell.

    Notes
    -----
    A frame repeats the field until the compass is read again: only a change is a reading
    (docs/autopilots.md, ArduPilot: timing). Its age is the lag a fit expects before it has
    estimated one.
    """

    def __init__(self, compass: int, vehicle: Vehicle, values: Mapping[str, float]) -> None:
        self._autopilot = autopilots.of(vehicle)
        told = self._autopilot.compass_messages(values)
        if compass not in told:
            raise MissingDataError(
                f"The vehicle must have a compass {compass}; instead it sends "
                f"{', '.join(map(str, told)) or 'none whose calibration is known'}"
            )
        self._compass, self._vehicle, self._values = compass, vehicle, values
        self._field_message = Message[told[compass]]
        self._gyro_message = Message[self._autopilot.first_compass_message]
        self._lag_s = self._autopilot.lag_priors(_LINK_FORMAT).field.mean
        self._wanted = _USED | {self._field_message, self._gyro_message}
        self.uncorrected = compass in self._in_body((0.0, 0.0, 1.0))[1]
        self._frames: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._attitudes: deque[tuple[float, float, float]] = deque(maxlen=_MEMORY)
        self._field: tuple[float, float, float] | None = None

    def add(self, unix_us: int, frame: bytes) -> None:  # noqa: ARG002
        """Take one whole frame, in the link's thread."""
        if message_id(frame) in self._wanted:
            self._frames.put(frame)

    @property
    def empty(self) -> bool:
        """Whether every frame taken so far was used."""
        return self._frames.empty()

    def events(self, regressor: str | None, over: Callable[[], bool]) -> Iterator[Motion | Reading]:
        """Sensor events as they arrive, until ``over``.

        Parameters
        ----------
        regressor
            The control quantity that a reading carries; None where none is needed.
        over
            Asked when nothing comes, and before each frame.
        """
        u = 0.0 if regressor is None else math.nan
        while not over():
            try:
                frame = self._frames.get(timeout=_LOOK_S)
            except queue.Empty:
                continue
            if source(frame) != (self._vehicle.system, self._vehicle.component):
                continue
            message = message_id(frame)
            content = decode_frame(frame, message)
            if message == Message.ATTITUDE:
                self._attitudes.append(
                    (_seconds(content), float(content["roll"]), float(content["pitch"]))
                )
            elif message in (Message.VFR_HUD, Message.BATTERY_STATUS):
                told = None if regressor is None else _control(content, message, regressor)
                u = u if told is None else told
            elif self._attitudes:
                yield from self._imu(message, content, u)

    def _imu(self, message: int, content: Any, u: float) -> Iterator[Motion | Reading]:
        time = _seconds(content)
        field = (float(content["xmag"]), float(content["ymag"]), float(content["zmag"]))
        # A compass the autopilot does not have is reported as exactly (0, 0, 0).
        if message == self._field_message and any(field) and field != self._field:
            self._field = field
            measured = time - self._lag_s
            roll, pitch = self._lean(measured)
            x, y, z = self._in_body(field)[0][self._compass].value[0].tolist()
            yield Reading(measured, (x, y, z), u, roll, pitch)
        if message == self._gyro_message:
            gyro = tuple(1e-3 * float(content[name]) for name in ("xgyro", "ygyro", "zgyro"))
            yield Motion(time, gyro, gravity_direction(*self._lean(time)).tolist())

    def _in_body(
        self, field: tuple[float, float, float]
    ) -> tuple[Mapping[int, Series], frozenset[int]]:
        """What the compass's message says, as a vehicle's axes have it."""
        said = Series(np.zeros(1), np.array([field]))
        told = dict.fromkeys(range(1, _MESSAGES + 1), said)
        return self._autopilot.from_telemetry(told, self._values)

    def _lean(self, time: float) -> tuple[float, float]:
        """Roll and pitch of the attitude nearest to a moment."""
        _, roll, pitch = min(self._attitudes, key=lambda known: abs(known[0] - time))
        return roll, pitch


def live_headings(
    sensors: Sensors,
    wanted: InForce,
    present: InForce,
    declination: float,
    over: Callable[[], bool],
) -> Iterator[LiveHeading]:
    """Headings of a live vehicle, one for each message of its gyro.

    Parameters
    ----------
    sensors
        A sink of the vehicle's link.
    wanted, present
        The correction to show, and the one the autopilot applies already.
    declination
        Radians, east positive.
    over
        Ends it; asked at least five times a second.

    Raises
    ------
    InputError
        The two corrections multiply different control quantities.
    """
    regressor = wanted.regressor or present.regressor
    kind = regressor or CURRENT
    compensator = Compensator.over(wanted.correction, present, kind, declination)
    unchanged = Compensator.over(present.correction, present, kind, declination)
    if sensors.uncorrected:
        compensator = Compensator(wanted.correction, declination)
        unchanged = Compensator(present.correction, declination)
    raw, multiplies = math.nan, sensors.uncorrected and present.regressor is not None

    def watched() -> Iterator[Motion | Reading]:
        nonlocal raw
        for event in sensors.events(regressor, over):
            if isinstance(event, Reading):
                u = event.u if multiplies else 0.0
                raw = unchanged.correct(event.field, u, event.roll, event.pitch)
            yield event

    for answer in fuse(watched(), compensator, Fusion()):
        yield LiveHeading(answer.time, raw, answer.corrected, answer.fused)


def corrections(
    recording: Recording, chosen: Mapping[str, float], compass: int
) -> tuple[InForce, InForce]:
    """The correction to show and the one in force.

    Parameters
    ----------
    recording
        Of the vehicle; its last parameters are in force.
    chosen
        Values to be taken instead; empty for the correction in force.
    compass
        Its number.
    """
    autopilot, present = autopilots.of(recording), recording.parameters.latest
    return (
        autopilot.in_force({**present, **chosen}, compass),
        autopilot.in_force(present, compass),
    )


def _seconds(content: Any) -> float:
    if "time_usec" in content.dtype.names:
        return float(content["time_usec"]) * 1e-6
    return float(content["time_boot_ms"]) * 1e-3


def _control(content: Any, message: int, regressor: str) -> float | None:
    """The control quantity, where this message tells it."""
    if not quantity_of(regressor).is_throttle:
        # A second battery's current multiplies nothing; −1 says there is no sensor.
        if message != Message.BATTERY_STATUS or content["id"] or content["current_battery"] < 0:
            return None
        return float(content["current_battery"]) * 0.01
    return float(content["throttle"]) * 0.01 if message == Message.VFR_HUD else None
