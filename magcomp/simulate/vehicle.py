"""The simulated vehicle: bytes in, bytes out, time passed in. No sockets, no clock.

Time advances in ticks of 10 ms. Ten ticks make a block of physics, at whose end
the autopilot reads battery, throttle and compass, as ArduCopter does at 10 Hz.
Everything follows from the scenario, the seed in it and what is received when:
the same input gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp import earth
from magcomp.simulate import physics, telemetry
from magcomp.simulate.ahrs import Ahrs
from magcomp.simulate.autopilot import Autopilot
from magcomp.simulate.correction import Correction
from magcomp.simulate.habits import Habits, own_number
from magcomp.simulate.outputs import motor_outputs, motor_thrust
from magcomp.simulate.parameters import ParameterStore, initial_values
from magcomp.simulate.pilot import Pilot
from magcomp.simulate.programs import Scenario

FloatArray = NDArray[np.float64]

TICK_S = physics.STEP_S
DEFAULT_START_UNIX_S = 1_750_000_000.0

_HEARTBEAT_TICKS = 100
_TIMESYNC_TICKS = 1000
_BOOT_TICKS = 150
_FLYING_M = 0.5
# MAVLink 2 signatures count tens of microseconds since 2015-01-01.
_SIGNING_EPOCH_S = 1_420_070_400
_SIGNING_TICKS_PER_S = 100_000


class Frame(NamedTuple):
    """One MAVLink frame and when it was sent, seconds since power-up."""

    time: float
    data: bytes


class Vehicle:
    """An ArduCopter 4.6 that exists only as numbers.

    Parameters
    ----------
    scenario
        The vehicle and its programme; see :func:`magcomp.simulate.programs.scenario`.
    start_unix_s
        Date of power-up: decides the earth's field and SYSTEM_TIME.
    parameters
        Parameters that differ from the scenario's, by name.
    wait_for_ground
        Hold the programme until the first message from a ground station.
    signing_key
        32 bytes: sign every frame, and take none from the ground that is not signed with it.
    answers_errors
        Send PARAM_ERROR where 4.6 is silent, as newer firmware does.
    system
        MAVLink system number.
    habits
        What it is and does besides the ordinary.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        start_unix_s: float = DEFAULT_START_UNIX_S,
        parameters: Mapping[str, float] | None = None,
        wait_for_ground: bool = False,
        signing_key: bytes | None = None,
        answers_errors: bool = False,
        system: int = 1,
        habits: Habits | None = None,
    ) -> None:
        self.truth = scenario.truth
        seed, habits = scenario.truth.seed, habits or Habits()
        if habits.uid is None:
            habits = replace(habits, uid=own_number(seed))
        self._program = scenario.begin()
        self._pilot = Pilot(self._program)
        self._mode = scenario.mode
        self._start_unix_s = start_unix_s
        self._store = ParameterStore(
            {**initial_values(scenario.truth), **(parameters or {})},
            storage_s=habits.storage_s,
            seed=seed,
        )
        self._autopilot = Autopilot(
            self._store, system, answers_errors=answers_errors, habits=habits
        )
        self._correction = Correction(self._store)
        self._signing_key = signing_key
        self._tick = 0
        self._boot_tick = 0
        self._codec = self._new_codec()
        self._rng = np.random.default_rng([scenario.truth.seed, 3])
        self._field = earth.expected_field(*scenario.truth.home, start_unix_s)
        self._program_tick: int | None = None if wait_for_ground else 0
        self._wants_armed = False
        self._sent: list[Frame] = []
        self._physics = physics.initial_state(self.truth, self._rng)
        self._ahrs = Ahrs(tilt=np.zeros(2))
        self._throttle = 0.0
        self._battery: telemetry.Battery | None = None
        self._corrected = np.zeros((3, 3))
        self._start_block()

    @property
    def time(self) -> float:
        """Seconds since power-up that have passed."""
        return self._tick * TICK_S

    @property
    def armed(self) -> bool:
        """Whether the motors are armed."""
        return self._autopilot.armed

    @property
    def spinning(self) -> tuple[int, ...]:
        """The motors that a motor test drives at this moment, counted from 1."""
        outputs = self._autopilot.motor_test.outputs
        return tuple(np.flatnonzero(outputs > self._store["MOT_PWM_MIN"]) + 1)

    @property
    def parameters(self) -> Mapping[str, float]:
        """What the autopilot holds."""
        return self._store.values

    @property
    def program_over(self) -> bool:
        """Whether the programme has ended: disarmed, still, and ready to be written."""
        return self._program_time(self._tick) >= self._program.duration_s

    @property
    def heading_error(self) -> float:
        """How far the autopilot's heading is off the true one, radians."""
        return self._ahrs.heading_error or 0.0

    @property
    def true_position(self) -> FloatArray:
        """Metres north, east and down from home, shape (3,)."""
        return np.asarray(self._block.motion.position[-1])

    @property
    def duration_s(self) -> float:
        """How long the programme takes."""
        return self._program.duration_s

    def fly_again(self) -> None:
        """Carry the programme out once more, with what the autopilot holds by now."""
        if self.program_over:
            self._program_tick = self._tick

    def receive(self, frame: bytes, time: float) -> None:
        """Take one frame from the ground; what is not a sound MAVLink frame is ignored."""
        self._pass_until(time)
        try:
            message = self._codec.decode(bytearray(frame))
        except mavlink.MAVError:
            return
        if self._program_tick is None:
            self._program_tick = self._tick
        if self._tick < self._boot_tick:
            return
        self._autopilot.handle(message, self._boot_ms)
        self._flush()
        if self._autopilot.reboot_wanted:
            self.reboot()

    def advance(self, time: float) -> list[Frame]:
        """Let time pass and hand over every frame sent since the last call, in order."""
        self._pass_until(time)
        frames, self._sent = self._sent, []
        return frames

    def arm(self) -> None:
        """Arm, as by a pilot whom nobody expects."""
        self._autopilot.arm(force=True)

    def disarm(self) -> None:
        """Disarm, wherever it is."""
        self._autopilot.disarm(force=True)

    def reboot(self) -> None:
        """Restart: motors off, streams forgotten, stored parameters kept, a moment's silence."""
        self._store.settle(self.time)
        self._store.reboot()
        self._boot_tick = self._tick + _BOOT_TICKS
        self._codec = self._new_codec()
        self._autopilot.start_up()
        self._ahrs = Ahrs(tilt=np.zeros(2))
        self._wants_armed = False

    def _new_codec(self) -> Any:
        """Sequence numbers from 0; signatures stamped with the vehicle's own time."""
        autopilot = self._autopilot
        codec: Any = mavlink.MAVLink(
            None, srcSystem=autopilot.system, srcComponent=autopilot.component
        )
        if self._signing_key is not None:
            codec.signing.secret_key = self._signing_key
            codec.signing.sign_outgoing = True
            since = self._start_unix_s + self.time - _SIGNING_EPOCH_S
            codec.signing.timestamp = round(since * _SIGNING_TICKS_PER_S)
        return codec

    @property
    def _boot_ms(self) -> int:
        return round((self._tick - self._boot_tick) * TICK_S * 1e3)

    def _program_time(self, tick: int) -> float:
        return 0.0 if self._program_tick is None else (tick - self._program_tick) * TICK_S

    def _pass_until(self, time: float) -> None:
        last = int(np.floor(time / TICK_S + 1e-6))
        while self._tick < last:
            step = self._tick % physics.STEPS
            if step == 0 and self._tick:
                self._start_block()
            self._tick += 1
            if step == physics.STEPS - 1:
                self._read_sensors()
            if self._tick > self._boot_tick:
                self._speak(step)

    def _start_block(self) -> None:
        """Work out the coming tenth of a second."""
        if self._program_tick is None:
            motion = self._pilot.before_start()
        else:
            begun = self._tick - self._program_tick
            motion = self._pilot.block(begun, self.heading_error)
        self._obey(bool(motion.armed[-1]))
        self._autopilot.flying = bool(motion.position[-1, 2] < -_FLYING_M)
        self._physics, self._block = physics.advance(
            self._physics,
            motion,
            self.armed,
            self.truth,
            self._field.ned,
            self._rng,
            self._tested(),
        )

    def _tested(self) -> FloatArray | None:
        """What a motor test makes of each motor, 0 … 1, shape (4,); None where none runs."""
        test = self._autopilot.motor_test
        if not test.running:
            return None
        return motor_thrust(
            test.outputs, altitude_m=self.truth.home[2], parameters=self._store.values
        )

    def _obey(self, wants_armed: bool) -> None:
        """Arm and disarm when the programme's pilot does."""
        if wants_armed == self._wants_armed or self._tick < self._boot_tick:
            return
        self._wants_armed = wants_armed
        if wants_armed:
            self._autopilot.mode = self._mode
            self._autopilot.arm()
        else:
            self._autopilot.disarm(force=True)

    def _read_sensors(self) -> None:
        """What ArduCopter does ten times a second."""
        block = self._block
        # Each sample of this reading was corrected with what was known when it began.
        drive = self._drive() if self._store["COMPASS_PMOT_EN"] else None
        current = 0.0 if self._battery is None else self._battery.current
        self._corrected = self._correction.correct(block.raw, self._throttle, current, drive)
        self._battery = self._read_battery()
        self._throttle = float(block.motion.throttle[-1]) if self.armed else 0.0
        middle = block.motion.earth_from_body[physics.STEPS // 2 - 2]
        self._ahrs = self._ahrs.updated(
            self._corrected[0], middle, self._field.declination, self._rng
        )

    def _read_battery(self) -> telemetry.Battery | None:
        if not self._store["BATT_MONITOR"]:
            return None
        capacity = max(self._store["BATT_CAPACITY"] / 1e3, 1e-3)
        return telemetry.Battery(
            current=self._block.sensed_a,
            voltage=self._block.sensed_v,
            used_ah=self._block.used_ah,
            left=min(max(1.0 - self._block.used_ah / capacity, 0.0), 1.0),
        )

    def _outputs(self, demand: FloatArray) -> FloatArray:
        if self._autopilot.motor_test.running:
            return self._autopilot.motor_test.outputs
        return motor_outputs(
            demand,
            armed=self.armed,
            voltage=self._block.sensed_v,
            altitude_m=self.truth.home[2],
            parameters=self._store.values,
        )

    def _drive(self) -> FloatArray:
        """Duty of each motor times the battery's voltage, V, shape (4,)."""
        low, high = self._store["MOT_PWM_MIN"], self._store["MOT_PWM_MAX"]
        duty = (self._outputs(self._block.demand[0]) - low) / max(high - low, 1.0)
        return np.asarray(np.clip(duty, 0.0, 1.0) * self._block.sensed_v)

    def _speak(self, step: int) -> None:
        """Send what is due at this tick."""
        autopilot = self._autopilot
        since_boot = self._tick - self._boot_tick
        if since_boot % _HEARTBEAT_TICKS == 0:
            autopilot.outgoing.append(autopilot.heartbeat())
            self._accompany()
        if since_boot % _TIMESYNC_TICKS == 0:
            stamp = self._boot_ms * 1_000_000 + 1
            autopilot.outgoing.append(mavlink.MAVLink_timesync_message(tc1=0, ts1=stamp))
        autopilot.send_paced(self.time)
        wanted = autopilot.schedule.due(self._boot_ms)
        if wanted or autopilot.once:
            self._report(wanted, step)
        self._flush()

    def _report(self, wanted: list[int], step: int) -> None:
        """Build telemetry messages."""
        view = telemetry.View(
            boot_s=self._boot_ms / 1e3,
            unix_s=self._start_unix_s + self.time,
            block=self._block,
            step=step,
            attitude=self._ahrs.attitude(self._block.motion.earth_from_body[step]),
            corrected=self._corrected,
            throttle=float(self._block.motion.throttle[step]) if self.armed else 0.0,
            outputs=self._outputs(self._block.demand[step]),
            home=self.truth.home,
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

    def _accompany(self) -> None:
        """Let the other components of the system say that they are there."""
        for component, message in self._autopilot.companions():
            codec: Any = mavlink.MAVLink(
                None, srcSystem=self._autopilot.system, srcComponent=component
            )
            self._sent.append(Frame(self.time, bytes(message.pack(codec))))

    def _flush(self) -> None:
        """Put what the autopilot wants to say into frames."""
        outgoing = self._autopilot.outgoing
        while outgoing:
            data = bytes(outgoing.popleft().pack(self._codec))
            self._codec.seq = (self._codec.seq + 1) % 256
            self._sent.append(Frame(self.time, data))
