"""What is done once on a live link: find the vehicle, ask for streams, read its calibration."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping

from magcomp import autopilots
from magcomp.errors import LinkError, LinkTimeoutError, MagcompError, unforeseen
from magcomp.link import Connection, Replay
from magcomp.link.clock import Clock
from magcomp.model import Vehicle
from magcomp.writing.writer import fetch

_STREAMS_S = 6.0


class Preparation:
    """Prepares a link, in the thread that calls ``run``; others look at the attributes.

    Parameters
    ----------
    connection
        The link. A replayed log is asked nothing.
    rates
        Message name to Hz.
    clock
        The computer's clocks.

    Attributes
    ----------
    over
        Set once the vehicle can be fitted and written, or that failed.
    failure
        Why it failed; None where it did not.
    trouble
        What is wrong at the moment, a sentence; empty where nothing is.
    streaming_since
        When the streams were asked for; None before.
    """

    def __init__(self, connection: Connection, rates: Mapping[str, float], clock: Clock) -> None:
        self._connection = connection
        self._rates = rates
        self._clock = clock
        self.over = threading.Event()
        self.failure: MagcompError | None = None
        self.trouble = ""
        self.streaming_since: float | None = None

    def run(
        self,
        stop: threading.Event,
        *,
        before_asking: Callable[[], object],
        then: Callable[[], None],
    ) -> None:
        """Do it all.

        Parameters
        ----------
        stop
            Ends the waiting for a vehicle.
        before_asking
            Called when the vehicle is found, before anything is asked of it.
        then
            Called when the calibration is known.
        """
        try:
            vehicle = self._wait_for_vehicle(stop)
            before_asking()
            asks = vehicle is not None and not isinstance(self._connection.address, Replay)
            if vehicle is not None and asks:
                self._connection.request_streams(self._rates, _STREAMS_S)
                self.streaming_since = self._clock.monotonic()
                autopilot = autopilots.of(vehicle)
                self._read(vehicle, (*autopilot.relevant_names(), *autopilot.useful_names()))
            then()
            self.over.set()
            if vehicle is not None and asks:
                self._read(vehicle, autopilots.of(vehicle).output_names())
        except MagcompError as error:
            if not self.over.is_set():
                self.failure = error
            self.trouble = str(error)
        except Exception as error:
            self.trouble = unforeseen(error)
            self.failure = LinkError(self.trouble)
            self.failure.__cause__ = error
        finally:
            self.over.set()

    def _wait_for_vehicle(self, stop: threading.Event) -> Vehicle | None:
        while not stop.is_set() and not self._connection.ended:
            try:
                vehicle = self._connection.wait_vehicle(1.0)
            except LinkTimeoutError as error:
                self.trouble = str(error)
            else:
                self.trouble = ""
                return vehicle
        return None

    def _read(self, vehicle: Vehicle, names: tuple[str, ...]) -> None:
        self._connection.discard()
        fetch(self._connection, vehicle, names, clock=time.monotonic)
