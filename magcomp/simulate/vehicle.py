"""The simulated vehicle: bytes in, bytes out, time passed in. No sockets, no clock.

Time advances in ticks of 10 ms. Ten ticks make a block of physics; what the autopilot makes of it
is its firmware's affair. Everything follows from the scenario, the seed in it and what is received
when: the same input gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp import earth
from magcomp.errors import UsageError
from magcomp.simulate import physics
from magcomp.simulate.copter import Copter
from magcomp.simulate.firmware import Board, Firmware
from magcomp.simulate.habits import Habits, own_number
from magcomp.simulate.moment import Moment
from magcomp.simulate.pilot import Pilot
from magcomp.simulate.programs import Scenario
from magcomp.simulate.px4 import Px4
from magcomp.simulate.truth import write_truth

FloatArray = NDArray[np.float64]

TICK_S = physics.STEP_S
DEFAULT_START_UNIX_S = 1_750_000_000.0

AUTOPILOTS: Mapping[str, type[Copter] | type[Px4]] = {"ardupilot": Copter, "px4": Px4}
"""The firmware that a vehicle may have, by ``Vehicle.autopilot``."""

_HEARTBEAT_TICKS = 100
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
    """A quadrotor that exists only as numbers, with ArduCopter 4.6 or PX4 1.15.

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
        Send PARAM_ERROR where the firmware is silent, as newer firmware does.
    autopilot
        ``"ardupilot"`` or ``"px4"``.
    system
        MAVLink system number.
    habits
        What it is and does besides the ordinary.

    Raises
    ------
    UsageError
        For an autopilot that is none of these.
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
        autopilot: str = "ardupilot",
        system: int = 1,
        habits: Habits | None = None,
    ) -> None:
        if autopilot not in AUTOPILOTS:
            raise UsageError(
                f"The simulated vehicle's autopilot must be one of {', '.join(AUTOPILOTS)}; "
                f"instead received {autopilot!r}"
            )
        self.truth = truth = scenario.truth
        habits = habits or Habits()
        if habits.uid is None:
            habits = replace(habits, uid=own_number(truth.seed))
        self._program = scenario.begin()
        self._pilot = Pilot(self._program)
        self._mode = scenario.mode
        self._start_unix_s = start_unix_s
        self._rng = np.random.default_rng([truth.seed, 3])
        self._field = earth.expected_field(*truth.home, start_unix_s)
        self._firmware: Firmware = AUTOPILOTS[autopilot](
            Board(
                truth,
                parameters or {},
                self._field,
                self._rng,
                system=system,
                habits=habits,
                answers_errors=answers_errors,
            )
        )
        self._talker = self._firmware.talker
        self._signing_key = signing_key
        self._tick = 0
        self._boot_tick = 0
        self._codec = self._new_codec()
        self._program_tick: int | None = None if wait_for_ground else 0
        self._wants_armed = False
        self._sent: list[Frame] = []
        self._physics = physics.initial_state(self.truth, self._rng)
        self._start_block()

    @property
    def time(self) -> float:
        """Seconds since power-up that have passed."""
        return self._tick * TICK_S

    @property
    def armed(self) -> bool:
        """Whether the motors are armed."""
        return self._talker.armed

    @property
    def spinning(self) -> tuple[int, ...]:
        """The motors that a motor test drives at this moment, counted from 1."""
        return self._firmware.spinning

    @property
    def parameters(self) -> Mapping[str, float]:
        """What the autopilot holds."""
        return self._firmware.parameters

    @property
    def program_over(self) -> bool:
        """Whether the programme has ended: disarmed, still, and ready to be written."""
        return self._program_time(self._tick) >= self._program.duration_s

    @property
    def heading_error(self) -> float:
        """How far the autopilot's heading is off the true one, radians."""
        return self._firmware.heading_error

    @property
    def true_position(self) -> FloatArray:
        """Metres north, east and down from home, shape (3,)."""
        return np.asarray(self._block.motion.position[-1])

    @property
    def duration_s(self) -> float:
        """How long the programme takes."""
        return self._program.duration_s

    @property
    def firmware(self) -> Firmware:
        """Its autopilot, inside which nobody on the link can look."""
        return self._firmware

    def write_truth(self, path: Path) -> None:
        """Write what the vehicle really is.

        Raises
        ------
        OutputError
            Where the file cannot be written.
        """
        write_truth(path, self._firmware.truth())

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
        self._talker.handle(message, self._boot_ms)
        self._flush()
        if self._talker.reboot_wanted:
            self.reboot()

    def advance(self, time: float) -> list[Frame]:
        """Let time pass and hand over every frame sent since the last call, in order."""
        self._pass_until(time)
        frames, self._sent = self._sent, []
        return frames

    def arm(self) -> None:
        """Arm, as by a pilot whom nobody expects."""
        self._talker.arm(force=True)

    def disarm(self) -> None:
        """Disarm, wherever it is."""
        self._talker.disarm(force=True)

    def reboot(self) -> None:
        """Restart: motors off, streams forgotten, stored parameters kept, a moment's silence."""
        self._boot_tick = self._tick + _BOOT_TICKS
        self._codec = self._new_codec()
        self._firmware.reboot(self.time)
        self._wants_armed = False

    def _new_codec(self) -> Any:
        """Sequence numbers from 0; signatures stamped with the vehicle's own time."""
        talker = self._talker
        codec: Any = mavlink.MAVLink(None, srcSystem=talker.system, srcComponent=talker.component)
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
            moment = Moment(
                time=self.time,
                boot_s=self._boot_ms / 1e3,
                unix_s=self._start_unix_s + self.time,
                block=self._block,
                step=step,
                home=self.truth.home,
            )
            self._firmware.sense(moment)
            if self._tick > self._boot_tick:
                self._speak(moment)

    def _start_block(self) -> None:
        """Work out the coming tenth of a second."""
        if self._program_tick is None:
            motion = self._pilot.before_start()
        else:
            begun = self._tick - self._program_tick
            motion = self._pilot.block(begun, self.heading_error)
        self._obey(bool(motion.armed[-1]))
        self._talker.flying = bool(motion.position[-1, 2] < -_FLYING_M)
        self._physics, self._block = physics.advance(
            self._physics,
            motion,
            self.armed,
            self.truth,
            self._field.ned,
            self._rng,
            self._firmware.tested(),
        )

    def _obey(self, wants_armed: bool) -> None:
        """Arm and disarm when the programme's pilot does."""
        if wants_armed == self._wants_armed or self._tick < self._boot_tick:
            return
        self._wants_armed = wants_armed
        if wants_armed:
            self._firmware.fly(self._mode)
        else:
            self._talker.disarm(force=True)

    def _speak(self, moment: Moment) -> None:
        """Send what is due at this tick."""
        self._firmware.speak(moment)
        if (self._tick - self._boot_tick) % _HEARTBEAT_TICKS == 0:
            self._accompany()
        self._flush()

    def _accompany(self) -> None:
        """Let the other components of the system say that they are there."""
        for component, message in self._talker.companions():
            codec: Any = mavlink.MAVLink(
                None, srcSystem=self._talker.system, srcComponent=component
            )
            self._sent.append(Frame(self.time, bytes(message.pack(codec))))

    def _flush(self) -> None:
        """Put what the autopilot wants to say into frames."""
        outgoing = self._talker.outgoing
        while outgoing:
            data = bytes(outgoing.popleft().pack(self._codec))
            self._codec.seq = (self._codec.seq + 1) % 256
            self._sent.append(Frame(self.time, data))
