"""From a plan to a vehicle that holds it: backup, journal, write, verify, roll back.

The protocol decides (protocol.py, reader.py); this file joins it to a link, a
clock and the disk.
"""

from __future__ import annotations

import contextlib
import functools
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

from magcomp import autopilots
from magcomp.errors import (
    LinkError,
    LinkTimeoutError,
    MagcompError,
    OutputError,
    VehicleRefusedError,
    WriteError,
)
from magcomp.model import ParameterSet, Vehicle
from magcomp.writing.events import Event, Outcome, Reason, Standing
from magcomp.writing.exchange import Timing
from magcomp.writing.files import write_parameter_file
from magcomp.writing.journal import Journal
from magcomp.writing.messages import Incoming, Outgoing, Peer, decode, encode
from magcomp.writing.plan import WritePlan, relevant_names
from magcomp.writing.protocol import WriteSequence
from magcomp.writing.reader import ParameterReader, ReadProgress

_LONGEST_WAIT = 0.2  # seconds until a request to stop is seen

E_co = TypeVar("E_co", covariant=True)
E = TypeVar("E")


class Connection(Protocol):
    """What a link must do: pymavlink messages, one at a time."""

    def send(self, message: Any) -> None:
        """Send a message, or lose it.

        Raises
        ------
        LinkError
            Where no message can be sent any more.
        """
        ...

    def receive(self, timeout: float) -> Any | None:
        """Next message, or None where none came within ``timeout`` seconds.

        Raises
        ------
        LinkError
            Where no message can come any more.
        """
        ...


class Machine(Protocol[E_co]):
    """What `run` drives: `ParameterReader` or `WriteSequence`."""

    @property
    def finished(self) -> bool:
        """Whether nothing more will happen."""
        ...

    def handle(self, message: Incoming, now: float) -> None:
        """Take what the vehicle said."""
        ...

    def poll(self, now: float) -> tuple[Sequence[E_co], Sequence[Outgoing]]:
        """Tell what is to be reported, then what is to be sent."""
        ...

    def wake(self, now: float) -> float:
        """When to poll next, if nothing arrives before."""
        ...

    def stop(self, now: float) -> None:
        """End because the user asks."""
        ...


def ignore(_: object) -> None:
    """Told what happens where nobody wants to know."""


def never() -> bool:
    """Asked whether to stop where nobody may stop it."""
    return False


def run(
    machine: Machine[E],
    connection: Connection,
    peer: Peer,
    *,
    clock: Callable[[], float],
    on_events: Callable[[Sequence[E]], None] = ignore,
    stop: Callable[[], bool] = never,
) -> None:
    """Drive a machine until it has finished; may be called again after an exception.

    Parameters
    ----------
    machine
        Decides what is sent.
    connection
        Carries it.
    peer
        The vehicle; other systems' messages are ignored.
    clock
        Seconds from anywhere, never going back.
    on_events
        Gets the events of each step before its messages are sent.
    stop
        Asked all the time whether to end.

    Raises
    ------
    LinkError
        Where the connection is lost for good.
    """
    while True:
        if stop():
            machine.stop(clock())
        events, outgoing = machine.poll(clock())
        if events:
            on_events(events)
        for message in outgoing:
            connection.send(encode(message, peer))
        if machine.finished:
            return
        now = clock()
        received = connection.receive(min(max(machine.wake(now) - now, 0.0), _LONGEST_WAIT))
        incoming = None if received is None else decode(received, peer)
        if incoming is not None:
            machine.handle(incoming, clock())


def fetch(
    connection: Connection,
    vehicle: Vehicle,
    names: Iterable[str] | None = None,
    *,
    clock: Callable[[], float],
    on_event: Callable[[ReadProgress], None] = ignore,
    timing: Timing | None = None,
) -> Mapping[str, float]:
    """Read all parameters of a vehicle, or those of `names` that it knows.

    Raises
    ------
    LinkTimeoutError
        Where the vehicle does not answer.
    LinkError
        Where the connection is lost for good.
    """
    reader = ParameterReader(names, now=clock(), timing=timing)

    def tell(events: Sequence[ReadProgress]) -> None:
        for event in events:
            on_event(event)

    run(reader, connection, Peer.of(vehicle), clock=clock, on_events=tell)
    if reader.failure:
        hints = f"{autopilots.of(vehicle).deaf_hint()}; if it wants signed frames, --signing-key"
        hint = "" if reader.answered else f" ({hints})"
        raise LinkTimeoutError(
            f"system {vehicle.system} must send its parameters; instead {reader.failure}{hint}"
        )
    return reader.values


def read_current(
    connection: Connection,
    vehicle: Vehicle,
    wanted: ParameterSet,
    *,
    everything: bool = False,
    clock: Callable[[], float],
    on_event: Callable[[ReadProgress], None] = ignore,
    timing: Timing | None = None,
) -> Mapping[str, float]:
    """Read what `plan` must know of a vehicle, by name; ``everything`` as there.

    Raises
    ------
    LinkTimeoutError
        Where the vehicle does not answer.
    LinkError
        Where the connection is lost for good.
    """
    names = relevant_names(vehicle.autopilot, wanted, everything=everything)
    return fetch(connection, vehicle, names, clock=clock, on_event=on_event, timing=timing)


def write(
    plan: WritePlan,
    connection: Connection,
    *,
    backup: Path,
    clock: Callable[[], float],
    on_event: Callable[[Event], None] = ignore,
    stop: Callable[[], bool] = never,
    timing: Timing | None = None,
) -> Outcome:
    """Write a plan to the vehicle and verify it, or put everything back.

    The backup and its journal are on the disk before the first write. Ctrl-C,
    `stop`, or an exception out of `on_event` rolls back; a second Ctrl-C gives up at once.

    Parameters
    ----------
    plan
        What to write. Where nothing differs, nothing is written, no file either.
    backup
        Parameter file to be created; restore from it with a plan of its content.
    on_event
        Told everything as it happens.

    Returns
    -------
    Outcome
        See `raise_for_failure`.

    Raises
    ------
    OutputError
        Where backup or journal cannot be created; then the vehicle is untouched.
    KeyboardInterrupt
        At the second Ctrl-C; `read_journal` tells what stands.
    Exception
        Whatever `on_event` or `stop` raised, after the roll-back, with a note of what stands.
    """
    if not plan.changes:
        return Outcome(Standing.NEW)
    write_parameter_file(backup, plan.backup, only_mine=True)
    with Journal(backup, plan) as journal:
        return _Drive(plan, connection, journal, clock, on_event, stop, timing).run()


class _Drive:
    """A write under way, whatever fails around it: the disk, the link, the user's own code."""

    def __init__(
        self,
        plan: WritePlan,
        connection: Connection,
        journal: Journal,
        clock: Callable[[], float],
        on_event: Callable[[Event], None],
        stop: Callable[[], bool],
        timing: Timing | None,
    ) -> None:
        self._plan = plan
        self._connection = connection
        self._journal = journal
        self._clock = clock
        self._on_event = on_event
        self._stop = stop
        self._sequence = WriteSequence(plan, now=clock(), timing=timing)
        self._journal_works = True
        self._interrupted = False
        self._failure: Exception | None = None

    def run(self) -> Outcome:
        """Go on until it has ended; raises what the user's code raised."""
        sequence = self._sequence
        while sequence.outcome is None:
            try:
                self._run()
            except KeyboardInterrupt:
                if self._interrupted:
                    raise
                self._interrupted = True
                sequence.stop(self._clock())
        with contextlib.suppress(OutputError):
            self._tell(sequence.poll(self._clock())[0])
        if self._failure is not None:
            # The user sees it below the error, whatever that was.
            self._failure.add_note(
                f"It came while the vehicle was written: {stands(sequence.outcome)}"
            )
            raise self._failure
        return sequence.outcome

    def _run(self) -> None:
        peer = Peer.of(self._plan.vehicle)
        try:
            run(
                self._sequence,
                self._connection,
                peer,
                clock=self._clock,
                on_events=self._tell,
                stop=self._stopped,
            )
        except LinkError as error:
            self._sequence.abandon(str(error))
        except OutputError as error:
            # Without journal nothing new may begin, but what was begun must be undone.
            self._journal_works = False
            self._sequence.stop(self._clock(), Reason.JOURNAL, str(error))
        except Exception as error:
            if self._failure is not None:
                self._sequence.abandon(_of_error(error))
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        self._failure = self._failure or error
        self._sequence.stop(self._clock(), Reason.ERROR, _of_error(error))

    def _tell(self, events: Sequence[Event]) -> None:
        if self._journal_works:
            self._journal.record(events)
        for event in events:
            self._guarded(functools.partial(self._on_event, event), None)

    def _stopped(self) -> bool:
        return self._guarded(self._stop, otherwise=False)

    def _guarded(self, call: Callable[[], E], otherwise: E) -> E:
        """Call the user's code; should it fail, undo what was begun and call it no more."""
        if self._failure is not None:
            return otherwise
        try:
            return call()
        except Exception as error:
            self._fail(error)
            return otherwise


def _of_error(error: Exception) -> str:
    return f"of an error in the program ({type(error).__name__}: {error})"


def stands(outcome: Outcome) -> str:
    """What the vehicle holds, as a clause."""
    return {
        Standing.OLD: "the vehicle holds everything as before",
        Standing.NEW: "the vehicle holds everything as wanted",
        Standing.OFF: "the vehicle's motor compensation is off and some values are not restored",
        Standing.UNSURE: (
            "the vehicle holds everything as before, everything as wanted, "
            "or has its motor compensation off"
        ),
    }[outcome.standing]


def restore_command(backup: Path, *reach: str) -> str:
    """What to type to bring a vehicle back: it is reached by an address and options."""
    return shlex.join(["magcomp", "restore", str(backup), *reach])


def raise_for_failure(outcome: Outcome, backup: Path, *reach: str) -> None:
    """Do nothing for a good outcome; otherwise say what happened, what stands, what to do.

    Parameters
    ----------
    reach
        The vehicle's address, and the options by which it was reached.

    Raises
    ------
    VehicleRefusedError
        Armed, or another vehicle.
    LinkError
        The link was lost.
    LinkTimeoutError
        The vehicle answered too little.
    WriteError
        A parameter was not taken, or reads back differently; or the write was stopped.
    """
    if outcome.reason is None:
        return
    kinds: dict[Reason, type[MagcompError]] = {
        Reason.ARMED: VehicleRefusedError,
        Reason.ANOTHER_VEHICLE: VehicleRefusedError,
        Reason.LINK_LOST: LinkError,
        Reason.TIMEOUT: LinkTimeoutError,
        Reason.JOURNAL: OutputError,
    }
    text = f"The write failed because {outcome.why}; {stands(outcome)}."
    if outcome.standing in {Standing.OFF, Standing.UNSURE}:
        text += f" Bring it back with:\n  {restore_command(backup, *(reach or ('ADDRESS',)))}"
    raise kinds.get(outcome.reason, WriteError)(text)
