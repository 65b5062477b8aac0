"""PX4 1.15 in a simulated vehicle: what it reads, and what it says."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from magcomp.autopilots.px4_correction import Compensation
from magcomp.simulate import physics
from magcomp.simulate.ahrs import Ahrs
from magcomp.simulate.firmware import Board
from magcomp.simulate.moment import Moment
from magcomp.simulate.px4.autopilot import Px4Talker
from magcomp.simulate.px4.compasses import Compasses
from magcomp.simulate.px4.parameters import Parameters, initial_values
from magcomp.simulate.px4.sensors import as_json
from magcomp.simulate.px4.telemetry import Battery, View, build
from magcomp.simulate.talker import Talker

FloatArray = NDArray[np.float64]

_HEARTBEAT_MS = 1000
_MGAUSS = 1000.0
_NO_CURRENT = -1.0
_FILTER_S = 0.5
"""Time constant of battery_status.current_filtered_a, which BATTERY_STATUS carries up to 1.15."""


class Px4:
    """See :class:`magcomp.simulate.firmware.Firmware`."""

    def __init__(self, board: Board) -> None:
        truth = board.truth
        self._truth, self._field = truth, board.field
        self._rng = board.rng
        self._parameters = Parameters({**initial_values(truth), **board.parameters})
        self._talker = Px4Talker(
            self._parameters, board.system, answers_errors=board.answers_errors, habits=board.habits
        )
        self._compasses = Compasses(truth, board.field.ned, self._parameters, board.rng)
        self._ahrs = Ahrs(tilt=np.zeros(2))
        self._battery = Battery(0.0, 0.0, truth.power.full_v, 1.0)
        self._capacity_ah = truth.power.capacity_ah
        self._was_armed = False

    @property
    def talker(self) -> Talker:
        """Its side of the link."""
        return self._talker

    @property
    def compasses(self) -> Compasses:
        """What corrects its compasses just now, which nobody on the link is told."""
        return self._compasses

    @property
    def parameters(self) -> Mapping[str, float]:
        """What it holds, hidden ones too."""
        return self._parameters.values

    @property
    def heading_error(self) -> float:
        """Radians."""
        return self._ahrs.heading_error or 0.0

    def truth(self) -> Mapping[str, Any]:
        """What the vehicle really is."""
        return as_json(self._truth, self._field)

    @property
    def spinning(self) -> tuple[int, ...]:
        """The motors that an actuator test drives at this moment, counted from 1."""
        return tuple(np.flatnonzero(self._talker.actuator_test.thrust) + 1)

    def tested(self) -> FloatArray | None:
        """What an actuator test makes of each motor."""
        test = self._talker.actuator_test
        return test.thrust if test.running else None

    def fly(self, mode: int) -> None:
        """Take a flight mode and arm."""
        self._talker.take_mode(mode)
        self._talker.arm()

    def hold(self, name: str, value: float) -> None:
        """Set a parameter as from the vehicle's own console."""
        self._parameters.set(name, value, 0.0)

    def reboot(self, time: float) -> None:
        """Forget all but what is saved."""
        self._parameters.settle(time)
        self._parameters.reboot()
        self._talker.start_up()
        self._compasses.restart()
        self._ahrs = Ahrs(tilt=np.zeros(2))
        self._was_armed = False

    def sense(self, moment: Moment) -> None:
        """Read the compasses; the battery and the attitude ten times a second."""
        armed, compasses = self._talker.armed, self._compasses
        compasses.look(moment.time, armed=armed)
        compasses.sense(moment, self._powers(moment))
        if self._was_armed and not armed:
            compasses.land(moment.time)
        self._was_armed = armed
        if moment.step == physics.STEPS - 1:
            self._battery = self._read_battery(moment)
            compasses.learn(moment, flying=armed and self._talker.flying)
            middle = moment.block.motion.earth_from_body[physics.STEPS // 2 - 1]
            seen = (compasses.corrected - compasses.bias) * _MGAUSS
            self._ahrs = self._ahrs.updated(seen, middle, self._field.declination, self._rng)

    def speak(self, moment: Moment) -> None:
        """Heartbeat, parameters, and what is streamed."""
        talker, now_ms = self._talker, moment.boot_ms
        if now_ms % _HEARTBEAT_MS == 0:
            talker.outgoing.append(talker.heartbeat())
        talker.send_paced(moment.time)
        wanted = [*talker.once, *talker.schedule.due(now_ms)]
        talker.once.clear()
        if wanted:
            view = self._view(moment)
            talker.outgoing.extend(build(message, view) for message in wanted)

    def _powers(self, moment: Moment) -> dict[Compensation, float]:
        thrust = moment.throttle if self._talker.armed else 0.0
        return {
            Compensation.THRUST: thrust,
            Compensation.CURRENT_0: self._battery.current / 1000.0,
        }

    def _view(self, moment: Moment) -> View:
        return View(
            **vars(moment),
            attitude=self._ahrs.attitude(moment.block.motion.earth_from_body[moment.step]),
            raw=self._compasses.raw,
            field=self._compasses.corrected - self._compasses.bias,
            thrust=moment.throttle if self._talker.armed else 0.0,
            armed=self._talker.armed or self._talker.actuator_test.running,
            battery=self._battery,
        )

    def _read_battery(self, moment: Moment) -> Battery:
        block, before = moment.block, self._battery
        current = _NO_CURRENT if self._talker.habits.no_current_sensor else block.sensed_a
        keep = math.exp(-physics.BLOCK_S / _FILTER_S)
        return Battery(
            current=current,
            filtered=keep * before.filtered + (1.0 - keep) * current,
            voltage=block.sensed_v,
            left=min(max(1.0 - block.used_ah / self._capacity_ah, 0.0), 1.0),
        )
