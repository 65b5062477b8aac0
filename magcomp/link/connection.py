"""A live vehicle: a thread that carries bytes between a transport and the link's state."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Self

from magcomp.errors import LinkError, LinkTimeoutError
from magcomp.link.address import (
    Address,
    Carried,
    SerialLine,
    TcpClient,
    TcpServer,
)
from magcomp.link.diagnosis import why_ambiguous, why_no_vehicle
from magcomp.link.events import LinkEvent
from magcomp.link.framing import GROUND_STATION_SYSTEM, Message
from magcomp.link.quality import LinkStatistics
from magcomp.link.sinks import FrameSink, Sinks
from magcomp.link.state import LinkState
from magcomp.link.streams import DEFAULT_RATES, StreamReport, affordable, as_sent_by
from magcomp.link.transport import ReplayEndedError, Transport, TransportClosedError
from magcomp.model import Vehicle

_POLL_S = 0.05
_INBOX = 4096
_EVENTS = 1000
_REOPEN_FIRST_S = 0.1
_REOPEN_LONGEST_S = 2.0
_REOPEN_AFTER_SILENCE_S = 10.0
_RESTORE_S = 3.0
_SLOW_BAUD = 115_200


class Connection:
    """One vehicle on one link. Use as a context manager, made with ``connect``.

    A thread reads, keeps the link alive, and hands each frame to the sinks. When the
    other end goes away the address is opened again until it is back.

    Parameters
    ----------
    address
        Where the vehicle is.
    opener
        Opens the transport, first now and again after each loss.
    system, component
        The vehicle to speak to; None takes the only system there is, and the component that
        autopilots have.
    key
        Signing key of 32 bytes; None where the link is not signed.
    source_system
        The number this ground station gives itself.
    sinks
        Take every frame that arrives, whoever sent it.

    Raises
    ------
    LinkError
        The address cannot be opened.
    """

    def __init__(
        self,
        address: Address | Carried,
        opener: Callable[[], Transport],
        *,
        system: int | None = None,
        component: int | None = None,
        key: bytes | None = None,
        source_system: int = GROUND_STATION_SYSTEM,
        sinks: Sequence[FrameSink] = (),
    ) -> None:
        self.address = address
        self._opener = opener
        self._system = system
        self._sinks = Sinks(sinks)
        self._transport = opener()
        clock = self._transport.clock
        self._state = LinkState(
            system=system,
            component=component,
            key=key,
            unix_us=clock.unix_us(),
            source_system=source_system,
        )
        self._inbox: deque[Message] = deque(maxlen=_INBOX)
        self._events: deque[LinkEvent] = deque(maxlen=_EVENTS)
        self._changed = threading.Condition()
        self._writing = threading.Lock()
        self._stop = threading.Event()
        self._ended = False
        self._failure: BaseException | None = None
        self._opened_at = clock.monotonic()
        self._reopened = 0
        self._unsent = 0
        self._thread = threading.Thread(target=self._run, name="magcomp-link", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    # ---------------------------------------------------------------- the vehicle

    @property
    def vehicle(self) -> Vehicle | None:
        """The vehicle as far as known; None before its first heartbeat."""
        with self._changed:
            return self._state.vehicle

    @property
    def ended(self) -> bool:
        """A replayed log is over; always False on a live link."""
        return self._ended

    def wait_vehicle(self, timeout: float = 10.0) -> Vehicle:
        """Wait until the vehicle is found and identified.

        Raises
        ------
        LinkTimeoutError
            No vehicle within ``timeout`` seconds; says what arrived instead.
        LinkError
            Several vehicles are there and none was chosen.
        """
        with self._changed:
            self._changed.wait_for(self._vehicle_clear, timeout)
            self._raise_failure()
            if self._state.ambiguous():
                raise LinkError(
                    why_ambiguous(
                        str(self.address), self._state.heartbeats, twins=self._state.has_twin
                    )
                )
            vehicle = self._state.vehicle
            if vehicle is None:
                raise LinkTimeoutError(self._why_no_vehicle(timeout))
            return vehicle

    # ---------------------------------------------------------------- messages

    def send(self, message: Message) -> None:
        """Send a message, or lose it where the link is down at the moment, as radio does.

        Raises
        ------
        LinkError
            The connection was closed.
        """
        if self._stop.is_set():
            raise LinkError(f"The connection to {self.address} is closed.")
        self._raise_failure()
        self._write(message)

    def receive(self, timeout: float) -> Message | None:
        """Give the vehicle's next message, or None when none came within ``timeout`` seconds.

        Messages of other systems and components are never given. At most 4096 wait; the
        oldest of more are dropped.

        Raises
        ------
        LinkError
            The connection was closed.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._inbox or self._over(), max(timeout, 0.0))
            self._raise_failure()
            if self._inbox:
                return self._inbox.popleft()
            if self._stop.is_set():
                raise LinkError(f"The connection to {self.address} is closed.")
            return None

    def discard(self) -> None:
        """Forget the messages that wait, so that the next ones received are new."""
        with self._changed:
            self._inbox.clear()

    def request_streams(
        self, rates: Mapping[str, float] = DEFAULT_RATES, timeout: float = 10.0
    ) -> StreamReport:
        """Ask the vehicle for message rates; given back on ``close``.

        On a serial line slower than 115200 baud all rates are lowered alike until they fit.

        Parameters
        ----------
        rates
            Message name to Hz.
        timeout
            Seconds to wait for the answers; asking goes on after that.

        Returns
        -------
        StreamReport
            How each was answered; what really comes is in ``statistics().rates``.

        Raises
        ------
        LinkTimeoutError
            No vehicle has been found yet.
        UsageError
            A message magcomp does not stream, or a rate that is not above 0.
        """
        address = self.address
        if isinstance(address, SerialLine) and address.baud < _SLOW_BAUD:
            rates = affordable(rates, address.baud / 10)
        with self._changed:
            if (vehicle := self._state.vehicle) is not None:
                rates = as_sent_by(vehicle, rates)
            self._state.request_streams(rates, self._now())
            report = self._state.stream_report
            if report is None:
                raise LinkTimeoutError(self._why_no_vehicle(0.0))
            self._changed.wait_for(self._streams_idle, timeout)
            self._raise_failure()
            return self._state.stream_report or report

    @property
    def requested_rates(self) -> Mapping[str, float]:
        """Message name to Hz, as asked for last; empty before that."""
        with self._changed:
            report = self._state.stream_report
        return {} if report is None else report.requested

    # ---------------------------------------------------------------- how it goes

    def statistics(self) -> LinkStatistics:
        """Losses, rates, round trip and gaps up to now; never waits for a slow link or disk."""
        with self._changed:
            return self._state.statistics(self._now(), reopened=self._reopened, unsent=self._unsent)

    def take_events(self) -> tuple[LinkEvent, ...]:
        """What happened since the last call, oldest first."""
        with self._changed:
            events = tuple(self._events)
            self._events.clear()
            return events

    def close(self) -> None:
        """Restore the message rates and close the transport. Closing twice is harmless."""
        if not self._stop.is_set():
            with self._changed:
                if self._state.stream_report is not None and not self._state.in_gap:
                    self._state.restore_streams()
                    self._changed.wait_for(self._streams_idle, _RESTORE_S)
            self._stop.set()
        self._thread.join()
        self._transport.close()
        with self._changed:
            self._changed.notify_all()

    # ---------------------------------------------------------------- the thread

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                self._step()
        except ReplayEndedError:
            self._ended = True
        except Exception as error:  # whatever it is, the caller's thread must hear of it
            self._failure = error
        with self._changed:
            self._changed.notify_all()

    def _step(self) -> None:
        try:
            data = self._transport.read(_POLL_S)
            self._pump(data)
        except TransportClosedError as error:
            self._reopen(str(error))
            return
        if self._stalled():
            self._reopen("silence")

    def _pump(self, data: bytes) -> None:
        # Disk and line may be slow, so neither is waited for while others need the state.
        with self._changed:
            now, unix_us = self._now(), self._transport.clock.unix_us()
            taken = self._state.receive(data, now, self._transport.peer)
            due = self._state.due(now)
            self._transport.keep_to(self._state.peer)
        failed = [
            event
            for received in taken
            if not received.from_stranger
            for event in self._sinks.add(unix_us, received.frame.raw, now)
        ]
        with self._changed:
            self._inbox.extend(each.frame.message for each in taken if each.from_vehicle)
            self._events.extend(failed)
            self._events.extend(self._state.take_events())
            self._changed.notify_all()
        for message in due:
            self._write(message)

    def _write(self, message: Message) -> None:
        with self._writing:  # frames are numbered and signed in the order in which they are sent
            with self._changed:
                transport = self._transport
                raw = self._state.pack(message, transport.clock.unix_us())
            try:
                transport.write(raw)
            except TransportClosedError:
                self._unsent += 1  # the reading thread notices and opens it again

    def _stalled(self) -> bool:
        """Tell whether a connected transport may be dead without knowing it."""
        if not isinstance(self.address, TcpClient | TcpServer | SerialLine):
            return False
        now = self._now()
        quiet = min(self._state.silent_for(now), now - self._opened_at)
        return self._state.vehicle is not None and quiet > _REOPEN_AFTER_SILENCE_S

    def _reopen(self, reason: str) -> None:
        with self._changed:
            self._state.closed(self._now(), reason)
            self._events.extend(self._state.take_events())
            self._changed.notify_all()
        self._transport.close()
        delay = _REOPEN_FIRST_S
        while not self._stop.wait(delay):
            try:
                transport = self._opener()
            except LinkError:
                delay = min(2 * delay, _REOPEN_LONGEST_S)
                continue
            with self._changed:
                self._transport = transport
                self._reopened += 1
                self._opened_at = self._now()
                self._state.reopened(self._now())
            return

    # ---------------------------------------------------------------- inside

    def _now(self) -> float:
        return self._transport.clock.monotonic()

    def _over(self) -> bool:
        """Tell whether nothing more can arrive."""
        return self._ended or self._failure is not None or self._stop.is_set()

    def _vehicle_clear(self) -> bool:
        now = self._now()
        found = self._state.settled(now) and (
            self._state.ambiguous() or self._state.identified(now)
        )
        return found or self._over()

    def _streams_idle(self) -> bool:
        report = self._state.stream_report
        return report is None or report.complete or self._over()

    def _why_no_vehicle(self, seconds: float) -> str:
        return why_no_vehicle(
            str(self.address),
            seconds,
            self._state.statistics(self._now()),
            self._state.heartbeats,
            self._state.companions,
            self._state.foreign,
            system=self._system,
            baud=self.address.baud if isinstance(self.address, SerialLine) else None,
        )

    def _raise_failure(self) -> None:
        if self._failure is not None:
            raise LinkError(
                f"The link to {self.address} must stay open; instead it failed "
                f"({str(self._failure).rstrip('.')}). Look at cable and power, and begin again."
            ) from self._failure
