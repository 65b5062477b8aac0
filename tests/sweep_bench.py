"""A sweep of a simulated vehicle on a virtual clock, with whatever befalls it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from magcomp import autopilots
from magcomp.live.sweep import RATES as SWEEP_RATES
from magcomp.live.sweep import carry_out, name_of
from magcomp.model import Vehicle as Known
from magcomp.simulate import Faults, FaultyLink, Frame, Scenario, Vehicle, scenario
from magcomp.simulate.ground import Asker
from magcomp.simulate.local import LocalConnection
from magcomp.simulate.motion import Motion, Program, rotation, still
from magcomp.sweeping.events import Event, Outcome, Reason
from magcomp.sweeping.protocol import SweepSequence
from magcomp.sweeping.steps import ENOUGH_EACH
from magcomp.sweeping.watch import Limits

KNOWN = Known("ardupilot", "copter", 1, 1)
MOTOR_TEST = autopilots.named("ardupilot").motor_test
WARM_UP_S = 1.2
MID_STEP_S = 3.6
"""In the middle of the first step."""
LIMITS = Limits()

_NUMBERS = {"RAW_IMU": 27, "SCALED_IMU2": 116, "SCALED_IMU3": 129, "ATTITUDE": 30, "VFR_HUD": 74}
_NUMBERS |= {"BATTERY_STATUS": 147, "SERVO_OUTPUT_RAW": 36, "SYS_STATUS": 1}
_NUMBERS |= {"GLOBAL_POSITION_INT": 33, "SCALED_IMU": 26}
_ARDUPILOT = {message: min(hertz, 10.0) for message, hertz in SWEEP_RATES.items()}
_PX4 = {("SCALED_IMU" if each == "RAW_IMU" else each): hz for each, hz in SWEEP_RATES.items()}
RATES = {"ardupilot": _ARDUPILOT, "px4": _PX4}
"""What a sweep asks for, as far as it tells anything new."""

SLOW = {"ATTITUDE": 10.0, "BATTERY_STATUS": 10.0, "GLOBAL_POSITION_INT": 5.0}
"""What the protocol itself needs."""


class Befallen:
    """Lies still on the ground until something befalls it.

    Parameters
    ----------
    after_s
        When.
    tilt_rad, turn_rad_s, north_m
        How far it is tilted, how fast it turns, and how far it is moved from then on.
    """

    duration_s = 1.0
    heeds_heading = False

    def __init__(
        self, after_s: float, tilt_rad: float = 0.0, turn_rad_s: float = 0.0, north_m: float = 0.0
    ) -> None:
        self._after_s = after_s
        self._tilt_rad, self._turn_rad_s, self._north_m = tilt_rad, turn_rad_s, north_m

    def motion(self, time: np.ndarray, heading_error: float) -> Motion:
        since = np.clip(time - self._after_s, 0.0, None)
        befallen = since > 0.0
        tilted = rotation(np.eye(3)[0], np.where(befallen, self._tilt_rad, 0.0))
        turned = rotation(np.eye(3)[2], self._turn_rad_s * since)
        motion = still(turned @ tilted, np.zeros(len(time)), np.zeros(len(time), dtype=bool))
        motion.position[:, 0] = np.where(befallen, self._north_m, 0.0)
        return motion


@dataclass
class Cable:
    """What lies between the ground and the vehicle; may be pulled, either way alone.

    Attributes
    ----------
    machine
        The vehicle.
    heard, spoken
        Whether frames pass down, and up.
    spun
        The motors driven at each 10 ms: (time, motors).
    frames
        All that the vehicle sent.
    received
        When frames arrived at the vehicle.
    """

    machine: Vehicle
    heard: bool = True
    spoken: bool = True
    spun: list[tuple[float, tuple[int, ...]]] = field(default_factory=list)
    frames: list[Frame] = field(default_factory=list)
    received: list[float] = field(default_factory=list)

    def receive(self, frame: bytes, time: float) -> None:
        if self.spoken:
            self.received.append(time)
            self.machine.receive(frame, time)

    def advance(self, time: float) -> list[Frame]:
        frames: list[Frame] = []
        while self.machine.time + 0.0051 < time:
            frames += self.machine.advance(self.machine.time + 0.01)
            self.spun.append((self.machine.time, self.machine.spinning))
        self.frames += frames
        return frames if self.heard else []

    @property
    def last_spun_s(self) -> float:
        """When a motor was driven last."""
        return max(time for time, motors in self.spun if motors)

    @property
    def longest_s(self) -> float:
        """The longest that one motor was driven without a break."""
        longest, since = 0.0, dict.fromkeys((1, 2, 3, 4))
        for time, motors in self.spun:
            for motor in since:
                if motor not in motors:
                    since[motor] = None
                elif since[motor] is None:
                    since[motor] = time
                else:
                    longest = max(longest, time - since[motor])
        return longest


class Bench:
    """A ground station with a sweep at hand, and a vehicle at the other end of a cable."""

    def __init__(
        self,
        program: Program | None = None,
        *,
        name: str = "parked",
        seed: int = 3,
        rates: dict[str, float] | None = None,
        most: float = 0.5,
        warm_up_s: float = WARM_UP_S,
        faults: Faults | None = None,
        autopilot: str = "ardupilot",
        each: float = ENOUGH_EACH,
    ) -> None:
        chosen = scenario(name, seed)
        if program is not None:
            chosen = Scenario(chosen.truth, lambda: program, chosen.mode)
        self.known = Known(autopilot, "copter", 1, 1)
        self.vehicle = Vehicle(chosen, autopilot=autopilot)
        self.cable = Cable(self.vehicle)
        between = self.cable if faults is None else FaultyLink(self.cable, faults, seed)
        self.link = LocalConnection(between)
        for message, hertz in (rates or SLOW).items():
            self.vehicle.receive(Asker().rate(_NUMBERS[message], hertz), 0.0)
        if warm_up_s > WARM_UP_S:
            self.vehicle.advance(warm_up_s - WARM_UP_S)
            self.link = LocalConnection(between, self.vehicle.time)
        self.hear(WARM_UP_S)
        self.machine = SweepSequence(
            name_of(self.known),
            autopilots.of(self.known).motor_test,
            4,
            most,
            now=self.now,
            each=each,
            limits=LIMITS,
        )
        self.events: list[tuple[float, Event]] = []

    @property
    def now(self) -> float:
        return self.link.clock()

    def hear(self, seconds: float) -> None:
        """Let time pass without doing anything."""
        until = self.now + seconds
        while self.now < until:
            self.link.receive(0.01)

    def sweep(
        self,
        befalls: Callable[[Bench], Reason | None] = lambda _: None,
        typed: str = "copter-1",
    ) -> Outcome:
        """Carry the sweep out; ``befalls`` is asked all the time, and may do what it likes."""
        self.machine.confirm(typed)
        return carry_out(
            self.machine,
            self.link,
            self.known,
            clock=self.link.clock,
            pressed=lambda: befalls(self),
            on_event=lambda event: self.events.append((self.now, event)),
        )


class Once:
    """Does something once, in the middle of the first step unless told otherwise."""

    def __init__(
        self, does: Callable[[Bench], Reason | None], not_before: float = MID_STEP_S
    ) -> None:
        self._does, self._not_before = does, not_before
        self.at: float | None = None

    def __call__(self, bench: Bench) -> Reason | None:
        if self.at is not None or bench.now < self._not_before:
            return None
        assert bench.vehicle.spinning, "it must befall while a motor spins"
        self.at = bench.now
        return self._does(bench)
