"""A live vehicle from the first heartbeat to the verified write, without a user interface.

``LiveSession`` owns the link, the recorder and the buffer. Its threads find and
prepare the vehicle, watch what happens, and refit; everything it shows is frozen.
A terminal interface draws ``snapshot()`` and calls the rest.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Self, TypeVar

from magcomp.analysis.analyse import Options, Progress, analyse
from magcomp.buffer import Buffer
from magcomp.errors import InputError, LinkError, LinkTimeoutError, MagcompError
from magcomp.link import (
    DEFAULT_RATES,
    GROUND_STATION_SYSTEM,
    Connection,
    FrameSink,
    Recorder,
    connect,
)
from magcomp.link.clock import Clock, SystemClock
from magcomp.live.latest import Latest
from magcomp.live.prepare import Preparation
from magcomp.live.refit import DEFAULT_SHARE, Refit, Refitter
from magcomp.live.situation import Manoeuvre
from magcomp.live.snapshot import LiveSnapshot
from magcomp.live.tap import Tap
from magcomp.live.upload import finish_restore, make_plan, read_backup, wait_disarmed, write_plan
from magcomp.live.watch import LOOK_S, Watch
from magcomp.model import Analysis, ParameterSet, Recording, Vehicle
from magcomp.writing.events import Event, Outcome
from magcomp.writing.files import is_own
from magcomp.writing.in_force import in_force_sentence
from magcomp.writing.plan import WritePlan
from magcomp.writing.writer import ignore, never

_Result = TypeVar("_Result")


class LiveSession:
    """A live vehicle. Use as a context manager, made with ``open``.

    Methods may be called from any thread. Those that speak with the vehicle
    (``upload_plan``, ``upload``, ``restore_plan``) block, one at a time.

    Parameters
    ----------
    connection
        The link; the session closes it.
    tap
        Takes every frame of it.
    clock
        The computer's clocks unless given.
    rates
        Message name to Hz.
    options
        What the refits fit.
    refit_share
        Share of one core that refitting may take; 0 for none.
    """

    def __init__(
        self,
        connection: Connection,
        tap: Tap,
        *,
        clock: Clock,
        rates: Mapping[str, float],
        options: Options,
        refit_share: float,
    ) -> None:
        self.connection = connection
        self._tap = tap
        self._clock = clock
        self._asked = threading.Lock()
        self._preparation = Preparation(connection, rates, clock)
        self._stop = threading.Event()
        self._refits = (options, refit_share)
        self._refitter: Refitter | None = None
        self._watch = Watch(
            connection, tap, self._preparation, clock, lambda: self.refit, self._hurry
        )
        self._threads = [
            threading.Thread(target=work, name=f"magcomp-{name}", daemon=True)
            for name, work in (
                ("prepare", self._prepare),
                ("watch", lambda: self._watch.run(self._stop)),
            )
        ]
        for thread in self._threads:
            thread.start()

    @classmethod
    def open(  # noqa: PLR0913 - what a command line offers
        cls,
        address: str,
        *,
        record: Path | None = None,
        force: bool = False,
        system: int | None = None,
        component: int | None = None,
        baud: int | None = None,
        signing_key: bytes | None = None,
        source_system: int = GROUND_STATION_SYSTEM,
        clock: Clock | None = None,
        rates: Mapping[str, float] = DEFAULT_RATES,
        options: Options | None = None,
        refit_share: float = DEFAULT_SHARE,
    ) -> LiveSession:
        """Open an address; returns at once, see ``wait_ready``.

        Parameters
        ----------
        address
            A connection string as in ``magcomp.link.address``; a .tlog is replayed.
        record
            Write all that arrives into this .tlog.
        force
            Overwrite it.
        system, component, baud, signing_key, source_system
            See ``magcomp.link.connect``; the key is 32 bytes from ``read_signing_key``.
        clock, rates, options, refit_share
            See the class.

        Raises
        ------
        AddressError, LinkError
            The address is none, or cannot be opened.
        OutputError
            The recording cannot be made.
        LogError
            The log to replay is none.
        """
        recorder = None if record is None else Recorder(record, force=force)
        source = address if record is None else str(record)
        tap = Tap(Buffer(source), Latest(), recorder)
        try:
            connection = connect(
                address,
                baud=baud,
                system=system,
                component=component,
                key=signing_key,
                source_system=source_system,
                sinks=[tap],
                clock=clock,
            )
        except MagcompError:
            tap.close()
            raise
        return cls(
            connection,
            tap,
            clock=clock or SystemClock(),
            rates=rates,
            options=options or Options(),
            refit_share=refit_share,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    # ---------------------------------------------------------------- waiting

    def wait_ready(self, timeout: float = 10.0) -> Vehicle:
        """Wait until the vehicle is found, then until its calibration is read.

        Parameters
        ----------
        timeout
            Seconds for the vehicle to be found; reading takes what it takes.

        Raises
        ------
        LinkTimeoutError
            No vehicle in time; says what arrived instead. Or it does not send its parameters.
        LinkError
            Several vehicles and none chosen, or the link is lost for good.
        """
        vehicle = self.connection.wait_vehicle(timeout)
        while not self._preparation.over.wait(LOOK_S):
            if self._stop.is_set():
                raise LinkError(f"The connection to {self.connection.address} is closed.")
        if self._preparation.failure is not None:
            raise self._preparation.failure
        return self.connection.vehicle or vehicle

    # ---------------------------------------------------------------- what is shown

    def snapshot(self) -> LiveSnapshot:
        """Everything a screen shows, now. Costs well under a millisecond."""
        return self._watch.snapshot()

    @property
    def refit(self) -> Refit:
        """How the refitting stands."""
        return Refit() if self._refitter is None else self._refitter.state

    @property
    def elapsed_s(self) -> float:
        """Seconds since the session was opened; of the log, where one is replayed."""
        return self._watch.elapsed_s

    @property
    def manoeuvre(self) -> Manoeuvre | None:
        """What the user says that is being done, None to find out; may be set at any time."""
        return self._watch.manoeuvre

    @manoeuvre.setter
    def manoeuvre(self, said: Manoeuvre | None) -> None:
        self._watch.manoeuvre = said

    @property
    def armed(self) -> bool | None:
        """What the newest heartbeat says; None where the vehicle is not heard."""
        vehicle = self.connection.vehicle
        if vehicle is None or not self.connection.statistics().up:
            return None
        return self._tap.latest.now(vehicle).armed

    # ---------------------------------------------------------------- the answer

    def recording(self) -> Recording:
        """All that has been received so far, as a log reader would give it.

        Raises
        ------
        LogError
            No vehicle has been heard yet.
        """
        vehicle = self.connection.vehicle
        if vehicle is None:
            return self._tap.buffer.snapshot()
        return self._tap.buffer.snapshot(vehicle.system, vehicle.component)

    def analyse(
        self, options: Options | None = None, progress: Progress = lambda _what, _share: None
    ) -> Analysis:
        """Fit and judge what has been received so far; see ``magcomp.analysis.analyse``.

        Raises
        ------
        InputError
            There is too little for a fit.
        LinkError, LinkTimeoutError
            There is too little, because the vehicle could not be asked.
        """
        try:
            return analyse(self.recording(), options, progress)
        except InputError as error:
            if self._preparation.failure is not None:
                raise self._preparation.failure from error
            raise

    def listen(self, sink: FrameSink) -> None:
        """Give a sink every frame from now on, in the link's thread."""
        self._tap.listen(sink)

    def stop_recording(self) -> None:
        """Take no more frames into buffer and file; the file is closed. The link stays."""
        if self._refitter is not None:
            self._refitter.close()
        self._tap.stop()

    def alone(self, work: Callable[[Connection, Vehicle, Latest, Clock], _Result]) -> _Result:
        """Let somebody speak with the vehicle while nobody else does; see magcomp.live.sweep."""
        with self._asked:
            self.connection.discard()
            return work(self.connection, self._known_vehicle(), self._tap.latest, self._clock)

    # ---------------------------------------------------------------- writing

    def upload_plan(
        self, wanted: ParameterSet, any_vehicle: bool = False, everything: bool = False
    ) -> WritePlan:
        """Read the vehicle's calibration and compare; see ``magcomp.live.upload.make_plan``."""
        with self._asked:
            return make_plan(
                self.connection,
                self._known_vehicle(),
                wanted,
                any_vehicle=any_vehicle,
                everything=everything,
            )

    def restore_plan(self, backup: Path, any_vehicle: bool = False) -> WritePlan:
        """Compare the vehicle with a backup.

        Raises
        ------
        ParameterFileError
            The backup is missing or none; otherwise as ``upload_plan``.
        """
        wanted = read_backup(backup)[0]
        return self.upload_plan(wanted, any_vehicle, everything=is_own(wanted))

    def upload(
        self,
        plan: WritePlan,
        backup_path: Path,
        on_event: Callable[[Event], None] = ignore,
        stop: Callable[[], bool] = never,
    ) -> Outcome:
        """Write and verify a plan, or put everything back; nothing while armed.

        See ``magcomp.writing.writer.write``; ``raise_for_failure`` makes words of the outcome.
        """
        with self._asked:
            return write_plan(
                plan,
                self.connection,
                self._tap.latest,
                backup=backup_path,
                clock=self._clock.monotonic,
                unix_us=self._clock.unix_us,
                on_event=on_event,
                stop=stop,
            )

    def what_acts(self, plan: WritePlan) -> str:
        """Look whether what was written is in force; see ``in_force_sentence``."""
        with self._asked:
            return in_force_sentence(
                self.connection, plan, self._clock.monotonic, self.connection.requested_rates
            )

    def restore(
        self,
        backup: Path,
        plan: WritePlan,
        backup_path: Path,
        on_event: Callable[[Event], None] = ignore,
        stop: Callable[[], bool] = never,
    ) -> Outcome:
        """Write the plan that ``restore_plan(backup)`` made, and note it in the journal."""
        outcome = self.upload(plan, backup_path, on_event, stop)
        if outcome.good:
            finish_restore(backup)
        return outcome

    def wait_disarmed(
        self,
        seconds: float,
        tell: Callable[[str], None] = ignore,
        stop: Callable[[], bool] = never,
    ) -> None:
        """Wait until the vehicle is disarmed; see ``magcomp.live.upload.wait_disarmed``."""
        wait_disarmed(lambda: self.armed, seconds=seconds, tell=tell, stop=stop)

    def close(self) -> None:
        """Restore the stream rates, close link and file. Closing twice is harmless."""
        self._stop.set()
        self.connection.close()
        for thread in self._threads:
            thread.join()
        if self._refitter is not None:
            self._refitter.close()
        self._tap.close()

    # ---------------------------------------------------------------- the threads

    def _prepare(self) -> None:
        with contextlib.ExitStack() as held:
            self._preparation.run(
                self._stop, before_asking=lambda: held.enter_context(self._asked), then=self._begin
            )

    def _begin(self) -> None:
        options, share = self._refits
        if share and not self._stop.is_set():
            self._refitter = Refitter(self.recording, options, share=share)

    # ---------------------------------------------------------------- inside

    def _hurry(self) -> bool:
        if self._refitter is None or not self._tap.taking:
            return False
        self._refitter.hurry()
        return True

    def _known_vehicle(self) -> Vehicle:
        vehicle = self.connection.vehicle
        if vehicle is None:
            raise LinkTimeoutError(
                f"A vehicle must be on {self.connection.address}; instead none is heard yet."
            )
        return vehicle
