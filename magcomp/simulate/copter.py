"""ArduCopter 4.6 in a simulated vehicle: what it reads ten times a second, and what it says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.simulate import physics, telemetry
from magcomp.simulate.ahrs import Ahrs
from magcomp.simulate.autopilot import Autopilot
from magcomp.simulate.correction import Correction
from magcomp.simulate.firmware import Board
from magcomp.simulate.moment import Moment
from magcomp.simulate.motion import FloatArray
from magcomp.simulate.outputs import motor_outputs, motor_thrust
from magcomp.simulate.parameters import ParameterStore, initial_values
from magcomp.simulate.talker import Talker

_HEARTBEAT_MS = 1000
_TIMESYNC_MS = 10_000


class Copter:
    """See :class:`magcomp.simulate.firmware.Firmware`."""

    def __init__(self, board: Board) -> None:
        truth, habits = board.truth, board.habits
        self._truth = truth
        self._declination = board.field.declination
        self._rng = board.rng
        self._store = ParameterStore(
            {**initial_values(truth), **board.parameters},
            storage_s=habits.storage_s,
            seed=truth.seed,
        )
        self._autopilot = Autopilot(
            self._store, board.system, answers_errors=board.answers_errors, habits=habits
        )
        self._correction = Correction(self._store)
        self._ahrs = Ahrs(tilt=np.zeros(2))
        self._throttle = 0.0
        self._battery: telemetry.Battery | None = None
        self._corrected = np.zeros((3, 3))

    @property
    def talker(self) -> Talker:
        """Its side of the link."""
        return self._autopilot

    @property
    def parameters(self) -> Mapping[str, float]:
        """What it holds, hidden ones too."""
        return self._store.values

    @property
    def heading_error(self) -> float:
        """Radians."""
        return self._ahrs.heading_error or 0.0

    def truth(self) -> Mapping[str, Any]:
        """What the vehicle really is."""
        return self._truth.as_json()

    @property
    def spinning(self) -> tuple[int, ...]:
        """The motors that a motor test drives at this moment, counted from 1."""
        outputs = self._autopilot.motor_test.outputs
        return tuple(np.flatnonzero(outputs > self._store["MOT_PWM_MIN"]) + 1)

    def tested(self) -> FloatArray | None:
        """What a motor test makes of each motor."""
        test = self._autopilot.motor_test
        if not test.running:
            return None
        return motor_thrust(
            test.outputs, altitude_m=self._truth.home[2], parameters=self._store.values
        )

    def fly(self, mode: int) -> None:
        """Take a flight mode and arm."""
        self._autopilot.mode = mode
        self._autopilot.arm()

    def reboot(self, time: float) -> None:
        """Forget all but what is stored."""
        self._store.settle(time)
        self._store.reboot()
        self._autopilot.start_up()
        self._ahrs = Ahrs(tilt=np.zeros(2))

    def sense(self, moment: Moment) -> None:
        """What ArduCopter does ten times a second."""
        if moment.step != physics.STEPS - 1:
            return
        block, armed = moment.block, self._autopilot.armed
        # Each sample of this reading was corrected with what was known when it began.
        drive = self._drive(moment) if self._store["COMPASS_PMOT_EN"] else None
        current = 0.0 if self._battery is None else self._battery.current
        self._corrected = self._correction.correct(block.raw, self._throttle, current, drive)
        self._battery = self._read_battery(moment)
        self._throttle = float(block.motion.throttle[-1]) if armed else 0.0
        middle = block.motion.earth_from_body[physics.STEPS // 2 - 2]
        self._ahrs = self._ahrs.updated(self._corrected[0], middle, self._declination, self._rng)

    def speak(self, moment: Moment) -> None:
        """Heartbeat, time, parameters, and what is streamed."""
        autopilot, now_ms = self._autopilot, moment.boot_ms
        if now_ms % _HEARTBEAT_MS == 0:
            autopilot.outgoing.append(autopilot.heartbeat())
        if now_ms % _TIMESYNC_MS == 0:
            stamp = now_ms * 1_000_000 + 1
            autopilot.outgoing.append(mavlink.MAVLink_timesync_message(tc1=0, ts1=stamp))
        autopilot.send_paced(moment.time)
        wanted = autopilot.schedule.due(now_ms)
        if wanted or autopilot.once:
            self._report(wanted, moment)

    def _report(self, wanted: list[int], moment: Moment) -> None:
        """Build telemetry messages."""
        step = moment.step
        view = telemetry.View(
            **vars(moment),
            attitude=self._ahrs.attitude(moment.block.motion.earth_from_body[step]),
            corrected=self._corrected,
            demand=moment.throttle if self._autopilot.armed else 0.0,
            outputs=self._outputs(moment, moment.block.demand[step]),
            battery=self._battery,
        )
        autopilot = self._autopilot
        while autopilot.once:
            message = autopilot.once.popleft()
            if message == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
                autopilot.outgoing.append(autopilot.version())
            else:
                wanted = [message, *wanted]
        built = (telemetry.build(message, view) for message in wanted)
        autopilot.outgoing.extend(message for message in built if message is not None)

    def _read_battery(self, moment: Moment) -> telemetry.Battery | None:
        if not self._store["BATT_MONITOR"]:
            return None
        block = moment.block
        capacity = max(self._store["BATT_CAPACITY"] / 1e3, 1e-3)
        return telemetry.Battery(
            current=block.sensed_a,
            voltage=block.sensed_v,
            used_ah=block.used_ah,
            left=min(max(1.0 - block.used_ah / capacity, 0.0), 1.0),
        )

    def _outputs(self, moment: Moment, demand: FloatArray) -> FloatArray:
        if self._autopilot.motor_test.running:
            return self._autopilot.motor_test.outputs
        return motor_outputs(
            demand,
            armed=self._autopilot.armed,
            voltage=moment.block.sensed_v,
            altitude_m=self._truth.home[2],
            parameters=self._store.values,
        )

    def _drive(self, moment: Moment) -> FloatArray:
        """Duty of each motor times the battery's voltage, V, shape (4,)."""
        low, high = self._store["MOT_PWM_MIN"], self._store["MOT_PWM_MAX"]
        duty = self._outputs(moment, moment.block.demand[0]) - low
        duty = np.clip(duty / max(high - low, 1.0), 0.0, 1.0)
        return np.asarray(duty * moment.block.sensed_v)
