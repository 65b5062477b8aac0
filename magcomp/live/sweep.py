"""Carries a sweep out on a link: what the machine wants is sent, what the vehicle says is told.

The machine is ``magcomp.sweeping.protocol``. Whatever happens here, motors are told to stand still
before it returns or raises; what cannot be told, the autopilot's own time-out ends.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

from magcomp import autopilots
from magcomp.errors import (
    LinkError,
    LinkTimeoutError,
    MagcompError,
    MissingDataError,
    UsageError,
    VehicleRefusedError,
)
from magcomp.link import DEFAULT_RATES
from magcomp.link import Connection as Link
from magcomp.link.clock import Clock
from magcomp.live.latest import Latest
from magcomp.model import Recording, Vehicle
from magcomp.sweeping.events import Event, Outcome, Reason
from magcomp.sweeping.messages import decode, encode
from magcomp.sweeping.protocol import SweepSequence
from magcomp.sweeping.steps import ENOUGH_EACH, GENTLE, TOLD_APART, require_possible
from magcomp.writing.messages import Peer
from magcomp.writing.writer import Connection, ignore

RATES: Mapping[str, float] = {**DEFAULT_RATES, "GLOBAL_POSITION_INT": 5.0}
"""Hz of what a sweep needs: a position is asked for often, because a change of it stops."""

_LONGEST_WAIT_S = 0.05

_UNREACHED = {Reason.LINK_LOST: LinkError, Reason.UNANSWERED: LinkTimeoutError}

_Result = TypeVar("_Result")


class Session(Protocol):
    """What a sweep needs of a live session; ``LiveSession`` has it."""

    def recording(self) -> Recording:
        """All that has been received so far."""
        ...

    def alone(self, work: Callable[[Link, Vehicle, Latest, Clock], _Result]) -> _Result:
        """Let somebody speak with the vehicle while nobody else does."""
        ...


@dataclass(frozen=True)
class Bench:
    """A vehicle whose motors can be spun, and how far.

    Attributes
    ----------
    vehicle
        Which.
    motors
        How many it has.
    most
        Share of the outputs' range of the strongest step.
    apart
        Each motor is to get a vector of its own.
    """

    vehicle: Vehicle
    motors: int
    most: float
    apart: bool = False

    @property
    def name(self) -> str:
        """What has to be typed before anything spins, such as ``copter-1``."""
        return name_of(self.vehicle)

    @property
    def gentle(self) -> float:
        """Share of the first steps."""
        return GENTLE * self.most

    def is_name(self, typed: str) -> bool:
        """Whether what was typed is the vehicle's name."""
        return self.machine(0.0).confirm(typed)

    def machine(self, now: float) -> SweepSequence:
        """A machine for its sweep."""
        motor_test = autopilots.of(self.vehicle).motor_test
        each = TOLD_APART if self.apart else ENOUGH_EACH
        return SweepSequence(self.name, motor_test, self.motors, self.most, now=now, each=each)


def make_ready(session: Session, motors: int | None, most: float) -> Bench:
    """Look whether a vehicle can be swept.

    Parameters
    ----------
    session
        With the vehicle, whose calibration is read.
    motors
        How many it has; None to ask its parameters.
    most
        Share of the outputs' range of the strongest step.

    Raises
    ------
    UsageError
        It is no multirotor, or a number is out of bounds.
    VehicleRefusedError
        It is armed.
    MissingDataError
        It has no current sensor, or does not tell how many motors it has.
    """
    # Alone, so that nobody is still reading which outputs drive motors.
    vehicle, now = session.alone(lambda _link, vehicle, latest, _: (vehicle, latest.now(vehicle)))
    if vehicle.kind != "copter":
        raise UsageError(f"A sweep's vehicle must be a multirotor; instead it is a {vehicle.kind}")
    if now.armed:
        raise VehicleRefusedError(
            "The vehicle must be disarmed and on the ground for a sweep; instead it is armed"
        )
    if now.current is None:
        hint = autopilots.of(vehicle).how_to_record("current", "tlog")
        raise MissingDataError(
            f"A sweep's vehicle must tell its battery's current; instead it tells none: {hint}"
        )
    count = motor_count(session.recording()) if motors is None else motors
    require_possible(count, most)
    return Bench(vehicle, count, most)


def name_of(vehicle: Vehicle) -> str:
    """What has to be typed before a vehicle's motors spin, such as ``copter-1``."""
    return f"{vehicle.kind}-{vehicle.system}"


def motor_count(recording: Recording) -> int:
    """How many motors a vehicle drives, by its parameters and its outputs.

    Raises
    ------
    MissingDataError
        Neither says.
    """
    autopilot, outputs = autopilots.of(recording), recording.outputs
    counted = recording.parameters.last(autopilot.motor_test.count_name, 0.0)
    if counted > 0.0:
        return int(counted)
    motors = None
    if outputs is not None and len(outputs) and not autopilot.motor_test.count_name:
        motors = autopilot.motor_outputs(recording.parameters, outputs.value.shape[1])
    if outputs is None or motors is None:
        raise MissingDataError(
            f"{recording.source} must tell how many motors there are; instead neither outputs nor "
            "parameters do. Give their number with --motors"
        )
    return sum(bool(outputs.value[:, channel].any()) for channel in motors.channels)


def sweep(
    session: Session,
    bench: Bench,
    typed: str,
    pressed: Callable[[], Reason | None],
    on_event: Callable[[Event], None] = ignore,
) -> Outcome:
    """Spin a vehicle's motors step by step; see :func:`carry_out`.

    Parameters
    ----------
    session
        With the vehicle.
    bench
        From :func:`make_ready`.
    typed
        The vehicle's name, by which somebody says that nothing can come to harm.
    pressed
        Asked all the time whether somebody wants it to stop, and why.
    on_event
        Told everything as it happens.
    """

    def work(link: Link, vehicle: Vehicle, _: Latest, clock: Clock) -> Outcome:
        now = clock.monotonic
        machine = bench.machine(now())
        machine.confirm(typed)
        return carry_out(machine, link, vehicle, clock=now, pressed=pressed, on_event=on_event)

    return session.alone(work)


def carry_out(
    machine: SweepSequence,
    connection: Connection,
    vehicle: Vehicle,
    *,
    clock: Callable[[], float],
    pressed: Callable[[], Reason | None],
    on_event: Callable[[Event], None] = ignore,
) -> Outcome:
    """Drive a machine until it has finished.

    Parameters
    ----------
    machine
        Its name must have been typed, or nothing happens until it is.
    connection
        Carries messages; other systems' are ignored.
    vehicle
        Whose motors spin.
    clock
        Seconds from anywhere, never going back.
    pressed
        Asked all the time whether somebody wants it to stop, and why.
    on_event
        Told everything as it happens.

    Raises
    ------
    LinkError
        Where the connection is closed; the autopilot's time-out stops the motors.
    BaseException
        Whatever ``pressed`` or ``on_event`` raised, a second Ctrl-C too, after the stop.
    """
    peer = Peer.of(vehicle)
    try:
        _drive(machine, connection, peer, clock, pressed, on_event)
    except BaseException:
        machine.stop(Reason.ERROR, clock())
        _drive(machine, connection, peer, clock, lambda: None, ignore)
        raise
    if machine.outcome is None:
        raise LinkError("A sweep must end with an outcome; instead there is none")
    return machine.outcome


def _drive(
    machine: SweepSequence,
    connection: Connection,
    peer: Peer,
    clock: Callable[[], float],
    pressed: Callable[[], Reason | None],
    on_event: Callable[[Event], None],
) -> None:
    while True:
        reason = pressed()
        if reason is not None:
            machine.stop(reason, clock())
        events, commands = machine.poll(clock())
        for command in commands:
            connection.send(encode(command, peer))
        # After the commands: nothing that is told may hold a stop up.
        _tell(events, on_event)
        if machine.finished:
            return
        now = clock()
        wait = min(max(machine.wake(now) - now, 0.0), _LONGEST_WAIT_S)
        received = connection.receive(wait)
        incoming = None if received is None else decode(received, peer)
        if incoming is not None:
            machine.handle(incoming, clock())


def _tell(events: Sequence[Event], on_event: Callable[[Event], None]) -> None:
    for event in events:
        on_event(event)


def raise_for_failure(outcome: Outcome) -> None:
    """Make an error of an outcome that is not complete, other than one that the user asked for.

    Raises
    ------
    LinkTimeoutError
        The vehicle did not answer.
    LinkError
        The link was lost.
    VehicleRefusedError
        The vehicle refused, moved, or was not in a state to be swept.
    """
    if outcome.reason in (None, Reason.KEY, Reason.INTERRUPTED):
        return
    kind: type[MagcompError] = VehicleRefusedError
    if outcome.reason is not None:
        kind = _UNREACHED.get(outcome.reason, VehicleRefusedError)
    raise kind(f"The sweep was stopped because {outcome.why}")
