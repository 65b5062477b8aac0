"""The quantities of a Recording from the topics of a PX4 log, in the model's units."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from magcomp.autopilots.px4_correction import Compensation, stored
from magcomp.geometry import angles_of
from magcomp.model import BoolArray, FloatArray, Series
from magcomp.sources.ulog_file import MICROSECOND, Topic, UlogFile

_NO_SENSOR = -1.0
_MOST_OF_A_BATTERY = 10_000.0
"""Amperes and volts that no battery has."""
_ARMED = 2
_FIX_3D = 3
_OUTPUTS = 16
_MOTORS = 12
_ESCS = 8
_ROTARY = 1
_MOTOR_1 = 101
"""Number of the output function of motor 1."""
_THRUST_TOPIC_ALONE = (1, 14)
"""From here on P is the length of the thrust setpoint; before it was control 3."""

_EARLIEST_UTC_US = 1.0e15

_PLACES = {
    ("latitude_deg", "longitude_deg", "altitude_msl_m"): (1.0, 1.0, 1.0),
    ("lat", "lon", "alt"): (1e-7, 1e-7, 1e-3),
}
"""Fields of a receiver's position, of newer and older firmware, and what one is in °, ° and m."""


@dataclass(frozen=True, eq=False)
class Quantities:
    """A log's topics, and what is needed to understand them.

    Attributes
    ----------
    log
        The topics.
    zero
        Microseconds of time zero.
    version
        The firmware's, such as ``"1.15.2"``; empty where unknown.
    values
        Every parameter at the end.
    """

    log: UlogFile
    zero: int
    version: str
    values: Mapping[str, float]

    def rows(self) -> int:
        """Messages of all topics that are read."""
        return sum(map(len, self.log.topics.values()))

    def attitude(self) -> Series | None:
        """Roll, pitch, yaw in radians from the unit quaternion w, x, y, z."""
        topic = self.log.topic("vehicle_attitude", *(f"q[{part}]" for part in range(4)))
        if topic is None:
            return None
        q = topic.vector("q", 4)
        length = np.linalg.norm(q, axis=1)
        sound = np.isfinite(length) & (length > 0.5) & (length < 2.0)
        return _series(self._time(topic)[sound], angles_of(q[sound] / length[sound, None]))

    def gyro(self) -> Series | None:
        """Body rates in rad/s."""
        return self._vector("vehicle_angular_velocity", "xyz") or self._vector(
            "sensor_combined", "gyro_rad"
        )

    def accel(self) -> Series | None:
        """Specific force in m/s²."""
        return self._vector("vehicle_acceleration", "xyz") or self._vector(
            "sensor_combined", "accelerometer_m_s2"
        )

    def throttle(self) -> Series | None:
        """P of the compensation by thrust, 0 … 1: that of the moment, 0 while disarmed."""
        new = self._thrust_setpoint()
        old = self._thrust_control()
        numbers = tuple(int(part) for part in self.version.split(".")[:2] if part.isdigit())
        chosen = new or old if numbers >= _THRUST_TOPIC_ALONE or old is None else old
        if chosen is None:
            return None
        value = np.where(self._armed_at(chosen.time), chosen.value, 0.0)
        return _series(chosen.time, np.clip(value, 0.0, 1.0))

    def _thrust_setpoint(self) -> Series | None:
        thrust = self._vector("vehicle_thrust_setpoint", "xyz")
        return None if thrust is None else Series(thrust.time, np.linalg.norm(thrust.value, axis=1))

    def _thrust_control(self) -> Series | None:
        topic = self.log.topic("actuator_controls_0", "control[3]")
        return None if topic is None else _series(self._time(topic), topic.number("control[3]"))

    def currents(self) -> dict[int, Series]:
        """Amperes of each battery instance that has a current sensor.

        Without one the firmware says −1 A, or 0 A throughout.
        """
        found = {}
        for instance, topic in self.log.instances("battery_status", "current_a").items():
            value = topic.number("current_a")
            sound = (value != _NO_SENSOR) & (np.abs(value) < _MOST_OF_A_BATTERY)
            series = _series(self._said(topic), value, sound)
            if series is not None and series.value.any():
                found[instance] = series
        return found

    def battery(self, currents: Mapping[int, Series]) -> int:
        """The instance whose current the firmware multiplies, or could: 0 or 1."""
        switched = stored(self.values, 1).compensation is Compensation.CURRENT_1
        first, second = (1, 0) if switched else (0, 1)
        return second if first not in currents and second in currents else first

    def esc_currents(self) -> dict[int, Series]:
        """Current of each speed controller, A, by the motor it drives, counted from 0.

        From 1.13 on it says by itself which motor that is.
        """
        topic = self.log.topic("esc_status")
        found: dict[int, Series] = {}
        for place in range(_ESCS):
            name, function = (
                f"esc[{place}].{part}" for part in ("esc_current", "actuator_function")
            )
            if topic is None or name not in topic:
                continue
            value = topic.number(name)
            series = _series(self._said(topic), value, np.abs(value) < _MOST_OF_A_BATTERY)
            if series is None or not series.value.any():
                continue
            driven = int(topic.number(function)[-1]) - _MOTOR_1 if function in topic else place
            found.setdefault(driven if 0 <= driven < _MOTORS else place, series)
        return dict(sorted(found.items()))

    def voltage(self, battery: int) -> Series | None:
        """Volts of a battery instance."""
        topic = self.log.topic("battery_status", "voltage_v", instance=battery)
        if topic is None:
            return None
        value = topic.number("voltage_v")
        return _series(self._said(topic), value, np.abs(value) < _MOST_OF_A_BATTERY)

    def outputs(self) -> Series | None:
        """Motor outputs in microseconds, shape (n, 16); 0 where none is driven."""
        parts = [f"control[{motor}]" for motor in range(_MOTORS)]
        topic = self.log.topic("actuator_motors", *parts)
        if topic is not None:
            control = topic.vector("control", _MOTORS)
            value = np.zeros((len(control), _OUTPUTS))
            driven = np.isfinite(control)
            value[:, :_MOTORS][driven] = 1000.0 + 1000.0 * np.clip(control[driven], 0.0, 1.0)
            return _series(self._time(topic), value)
        return self._servo_outputs()

    def _servo_outputs(self) -> Series | None:
        """Of whichever instance moves most: motors move more than what holds still in flight."""
        parts = [f"output[{channel}]" for channel in range(_OUTPUTS)]
        best, most = None, 0.0
        for topic in self.log.instances("actuator_outputs", *parts).values():
            value = topic.vector("output", _OUTPUTS)
            sane = np.isfinite(value) & (value >= 800.0) & (value <= 2200.0)
            value = np.where(sane, value, 0.0)
            moved = float(np.ptp(value, axis=0).sum())
            if moved > most:
                best, most = Series(self._time(topic), value), moved
        return best

    def armed(self) -> Series | None:
        """1 armed, 0 disarmed."""
        if (topic := self.log.topic("vehicle_status", "arming_state")) is not None:
            armed = topic.number("arming_state") == _ARMED
        elif (topic := self.log.topic("actuator_armed", "armed")) is not None:
            armed = topic.number("armed") > 0
        else:
            return None
        return Series(self._said(topic), armed.astype(np.float64))

    def forward(self) -> Series | None:
        """1 where a VTOL flies on its wings or is in transition; None of any other vehicle."""
        topic = self.log.topic("vehicle_status", "is_vtol", "vehicle_type", "in_transition_mode")
        if topic is None or not topic.number("is_vtol").any():
            return None
        hovers = topic.number("vehicle_type") == _ROTARY
        away = ~hovers | (topic.number("in_transition_mode") > 0)
        return Series(self._said(topic), away.astype(np.float64))

    def _armed_at(self, time: FloatArray) -> BoolArray:
        armed = self.armed()
        if armed is None:
            return np.ones(len(time), dtype=bool)
        row = np.clip(np.searchsorted(armed.time, time, side="right") - 1, 0, None)
        return np.asarray(armed.value[row] > 0.5)

    def position(self) -> Series | None:
        """Latitude and longitude in degrees, altitude above sea level in m."""
        if (topic := self.log.topic("vehicle_global_position", "lat", "lon", "alt")) is not None:
            value = np.stack([topic.number(name) for name in ("lat", "lon", "alt")], axis=1)
            return _series(self._time(topic), value, _on_earth(value))
        for topic in self._receivers():
            forms = (names for names in _PLACES if all(name in topic for name in names))
            if (names := next(forms, None)) is None:
                continue
            units = _PLACES[names]
            value = np.stack([topic.number(name) for name in names], axis=1) * units
            fixed = topic.number("fix_type") >= _FIX_3D
            found = _series(self._time(topic), value, fixed & _on_earth(value))
            if found is not None:
                return found
        return None

    def start_unix_s(self) -> float:
        """Unix time of time zero by satellite; NaN where none told it."""
        for topic in self._receivers():
            if "time_utc_usec" in topic:
                utc = topic.number("time_utc_usec")
                told = utc > _EARLIEST_UTC_US
                if told.any():
                    start = utc * MICROSECOND - self._said(topic)
                    return float(np.median(start[told]))
        return float("nan")

    def _receivers(self) -> list[Topic]:
        names = ("vehicle_gps_position", "sensor_gps")
        return list(
            itertools.chain(*(self.log.instances(name, "fix_type").values() for name in names))
        )

    def _vector(self, name: str, field: str) -> Series | None:
        topic = self.log.topic(name, *(f"{field}[{axis}]" for axis in range(3)))
        return None if topic is None else _series(self._time(topic), topic.vector(field, 3))

    def _time(self, topic: Topic) -> FloatArray:
        """When each row was measured, seconds, never decreasing."""
        return topic.measured(self.zero)

    def _said(self, topic: Topic) -> FloatArray:
        """When each row was said, seconds."""
        return topic.said(self.zero)


def _on_earth(value: FloatArray) -> BoolArray:
    latitude, longitude, altitude = value.T
    sound = np.isfinite(value).all(axis=1) & (np.abs(latitude) <= 90.0)
    sound &= (np.abs(longitude) <= 180.0) & (np.abs(altitude) < 20_000.0)
    return np.asarray(sound & ((latitude != 0.0) | (longitude != 0.0)))


def _series(time: FloatArray, value: FloatArray, rows: BoolArray | None = None) -> Series | None:
    """Rows that are finite, in order of time; None where there is none."""
    sound = np.isfinite(value).all(axis=tuple(range(1, value.ndim)))
    if rows is not None:
        sound &= rows
    if not sound.any():
        return None
    time, value = time[sound], value[sound]
    if (np.diff(time) < 0).any():
        order = np.argsort(time, kind="stable")
        time, value = time[order], value[order]
    return Series(time, value)
