"""Carries a sweep out on a link: what the machine wants is sent, what the vehicle says is told.

The machine is ``magcomp.sweeping.protocol``. Whatever happens here, motors are told to stand still
before it returns or raises; what cannot be told, the autopilot's own time-out ends.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

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
from magcomp.model import Recording, Vehicle
from magcomp.sweeping.events import Event, Outcome, Reason
from magcomp.sweeping.messages import decode, encode
from magcomp.sweeping.protocol import SweepSequence
from magcomp.writing.messages import Peer
from magcomp.writing.writer import Connection

RATES: Mapping[str, float] = {**DEFAULT_RATES, "GLOBAL_POSITION_INT": 5.0}
"""Hz of what a sweep needs: a position is asked for often, because a change of it stops."""

_LONGEST_WAIT_S = 0.05

_UNREACHED = {Reason.LINK_LOST: LinkError, Reason.UNANSWERED: LinkTimeoutError}


def _silent(_: object) -> None:
    pass


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
    outputs = recording.outputs
    motors = None
    if outputs is not None and len(outputs):
        width = outputs.value.shape[1]
        motors = autopilots.of(recording).motor_outputs(recording.parameters, width)
    if outputs is None or motors is None:
        raise MissingDataError(
            f"{recording.source} must tell the motors' outputs (SERVO_OUTPUT_RAW); instead it "
            "tells none. Give their number with --motors"
        )
    return sum(bool(outputs.value[:, channel].any()) for channel in motors.channels)


def require_sweepable(vehicle: Vehicle) -> None:
    """Refuse a vehicle whose motors magcomp does not spin.

    Raises
    ------
    UsageError
        It is no multirotor.
    """
    if vehicle.kind != "copter":
        raise UsageError(f"A sweep's vehicle must be a multirotor; instead it is a {vehicle.kind}")


def carry_out(
    machine: SweepSequence,
    connection: Connection,
    vehicle: Vehicle,
    *,
    clock: Callable[[], float],
    pressed: Callable[[], Reason | None],
    on_event: Callable[[Event], None] = _silent,
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
        _drive(machine, connection, peer, clock, lambda: None, _silent)
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
