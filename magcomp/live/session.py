"""A live vehicle from the first heartbeat to the verified write, without a user interface.

``LiveSession`` owns the link, the recorder and the buffer. Its threads find and
prepare the vehicle, watch what happens, and refit; everything it shows is frozen.
A terminal interface draws ``snapshot()`` and calls the rest.
"""

from __future__ import annotations

import contextlib
import math
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from magcomp.analysis.analyse import Options, Progress, analyse
from magcomp.buffer import Buffer
from magcomp.errors import LinkError, LinkTimeoutError, MagcompError
from magcomp.link import (
    DEFAULT_RATES,
    Connection,
    FrameSink,
    GapEnded,
    GapStarted,
    LinkEvent,
    Recorder,
    Replay,
    VehicleFound,
    VehicleRebooted,
    connect,
)
from magcomp.link.clock import Clock, SystemClock
from magcomp.live.guide import (
    Guidance,
    SituationWatch,
    View,
    guide,
    level_seconds,
    levels_done,
)
from magcomp.live.latest import Latest, Now
from magcomp.live.prepare import Preparation
from magcomp.live.refit import DEFAULT_SHARE, Refit, Refitter
from magcomp.live.snapshot import LiveSnapshot, compasses_now, warnings
from magcomp.live.tap import Tap
from magcomp.live.upload import finish_restore, make_plan, read_backup, wait_disarmed, write_plan
from magcomp.model import Analysis, Grade, ParameterSet, Recording, Vehicle
from magcomp.writing.events import Event, Outcome
from magcomp.writing.plan import WritePlan

_LOOK_S = 0.2
_NOTHING = Now(0, None, {}, (), None, None, None, None, None, None, False)


def _silent(_: object) -> None:
    pass


def _never() -> bool:
    return False


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
        self._opened = clock.monotonic()
        self._asked = threading.Lock()
        self._preparation = Preparation(connection, rates, clock)
        self._stop = threading.Event()
        self._situation = SituationWatch()
        self._notes: list[str] = []
        self._refits = (options, refit_share)
        self._refitter: Refitter | None = None
        self._threads = [
            threading.Thread(target=work, name=f"magcomp-{name}", daemon=True)
            for name, work in (("prepare", self._prepare), ("watch", self._watch))
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
        system, component, baud, signing_key
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
        while not self._preparation.over.wait(_LOOK_S):
            if self._stop.is_set():
                raise LinkError(f"The connection to {self.connection.address} is closed.")
        if self._preparation.failure is not None:
            raise self._preparation.failure
        return self.connection.vehicle or vehicle

    # ---------------------------------------------------------------- what is shown

    def snapshot(self) -> LiveSnapshot:
        """Everything a screen shows, now. Costs well under a millisecond."""
        vehicle = self.connection.vehicle
        latest = self._tap.latest
        now = _NOTHING if vehicle is None else latest.now(vehicle)
        parameters = {} if vehicle is None else latest.parameters(vehicle)
        link, refit = self.connection.statistics(), self.refit
        view = self._view(now)
        return LiveSnapshot(
            address=str(self.connection.address),
            vehicle=vehicle,
            connected=link.up,
            link_text=self._link_text(vehicle, link.up),
            armed=now.armed,
            elapsed_s=self.elapsed_s,
            recording_path=self._tap.path,
            recording_bytes=self._tap.size,
            recording=self._tap.taking and not self._tap.failure,
            recording_trouble=self._tap.failure,
            link=link,
            compasses=compasses_now(now, vehicle, parameters, refit),
            throttle=now.throttle,
            current=now.current,
            voltage=now.voltage,
            attitude_deg=_degrees(now),
            height_m=now.height_m,
            coverage=view.coverage,
            levels_done=levels_done(view.coverage),
            level_seconds=level_seconds(view),
            situation=view.situation,
            guidance=self._guidance(vehicle, view),
            warnings=self._warnings(now, vehicle, parameters),
            analysis=refit.analysis,
            grade=view.grade,
            stable_refits=refit.stable,
            fit_trouble=refit.trouble,
            ready=self._preparation.over.is_set(),
            ended=self.connection.ended,
        )

    @property
    def vehicle(self) -> Vehicle | None:
        """The vehicle as far as known."""
        return self.connection.vehicle

    @property
    def analysis(self) -> Analysis | None:
        """The newest refit; None before the first."""
        return self.refit.analysis

    @property
    def refit(self) -> Refit:
        """How the refitting stands."""
        return Refit() if self._refitter is None else self._refitter.state

    @property
    def elapsed_s(self) -> float:
        """Seconds since the session was opened; of the log, where one is replayed."""
        if isinstance(self.connection.address, Replay):
            return self._tap.latest.span_s
        return self._clock.monotonic() - self._opened

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
        """
        return analyse(self.recording(), options, progress)

    def listen(self, sink: FrameSink) -> None:
        """Give a sink every frame from now on, in the link's thread."""
        self._tap.listen(sink)

    def stop_recording(self) -> None:
        """Take no more frames into buffer and file; the file is closed. The link stays."""
        if self._refitter is not None:
            self._refitter.close()
        self._tap.stop()

    # ---------------------------------------------------------------- writing

    def upload_plan(self, wanted: ParameterSet, any_vehicle: bool = False) -> WritePlan:
        """Read the vehicle's calibration and compare; see ``session.upload.make_plan``."""
        with self._asked:
            return make_plan(
                self.connection, self._known_vehicle(), wanted, any_vehicle=any_vehicle
            )

    def restore_plan(self, backup: Path, any_vehicle: bool = False) -> WritePlan:
        """Compare the vehicle with a backup.

        Raises
        ------
        ParameterFileError
            The backup is missing or none; otherwise as ``upload_plan``.
        """
        return self.upload_plan(read_backup(backup)[0], any_vehicle)

    def upload(
        self,
        plan: WritePlan,
        backup_path: Path,
        on_event: Callable[[Event], None] = _silent,
        stop: Callable[[], bool] = _never,
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

    def restore(
        self,
        backup: Path,
        plan: WritePlan,
        backup_path: Path,
        on_event: Callable[[Event], None] = _silent,
        stop: Callable[[], bool] = _never,
    ) -> Outcome:
        """Write the plan that ``restore_plan(backup)`` made, and note it in the journal."""
        outcome = self.upload(plan, backup_path, on_event, stop)
        if outcome.good:
            finish_restore(backup)
        return outcome

    def wait_disarmed(
        self,
        seconds: float,
        tell: Callable[[str], None] = _silent,
        stop: Callable[[], bool] = _never,
    ) -> None:
        """Wait until the vehicle is disarmed; see ``session.upload.wait_disarmed``."""
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

    def _watch(self) -> None:
        while not self._stop.wait(_LOOK_S):
            for event in self.connection.take_events():
                self._take(event)
            vehicle = self.connection.vehicle
            if vehicle is None:
                continue
            now = self._tap.latest.now(vehicle)
            # By the vehicle's clock: a replay, or a simulation, may be faster than ours.
            self._situation.update(
                self._tap.seconds, now.armed, now.attitude, now.height_m, now.speed
            )

    def _take(self, event: LinkEvent) -> None:
        match event:
            case GapStarted():
                self._note("the link was lost")
            case GapEnded(duration=duration):
                self._note(f"the link was gone for {duration:.0f} s")
            case VehicleRebooted():
                self._note("the vehicle rebooted")
            case VehicleFound():
                self._preparation.trouble = ""

    def _note(self, text: str) -> None:
        self._notes = [*self._notes[-4:], text]

    # ---------------------------------------------------------------- inside

    def _known_vehicle(self) -> Vehicle:
        vehicle = self.connection.vehicle
        if vehicle is None:
            raise LinkTimeoutError(f"No vehicle is on {self.connection.address}.")
        return vehicle

    def _view(self, now: Now) -> View:
        refit = self.refit
        return View(
            situation=self._situation.situation,
            armed=now.armed,
            throttle=now.throttle,
            attitude=now.attitude,
            height_m=now.height_m,
            coverage=self._tap.buffer.coverage(),
            seconds=self._tap.seconds,
            grade=None if refit.analysis is None else refit.analysis.grade,
            stable_refits=refit.stable,
            bound_deg=_bound_deg(refit.analysis),
        )

    def _guidance(self, vehicle: Vehicle | None, view: View) -> Guidance:
        if vehicle is None:
            return Guidance("waiting for the vehicle's heartbeat", 0.0)
        if not self._preparation.over.is_set():
            return Guidance("reading the vehicle's calibration", 0.0)
        return guide(view)

    def _link_text(self, vehicle: Vehicle | None, up: bool) -> str:
        if vehicle is None:
            return self._preparation.trouble or "waiting for a heartbeat"
        if not up:
            return "the link is lost; trying again"
        return self._preparation.trouble or "connected"

    def _warnings(
        self, now: Now, vehicle: Vehicle | None, parameters: Mapping[str, float]
    ) -> tuple[str, ...]:
        if vehicle is None:
            return ()
        since = self._preparation.streaming_since
        streaming = 0.0 if since is None else self._clock.monotonic() - since
        found = [*warnings(now, vehicle, parameters, streaming), *reversed(self._notes)]
        if self._preparation.failure is not None:
            found.insert(0, str(self._preparation.failure).rstrip("."))
        if self._tap.failure:
            found.insert(0, self._tap.failure.rstrip("."))
        return tuple(found)


def _bound_deg(analysis: Analysis | None) -> float:
    """Largest heading error, 95 %, of the compasses that are not rejected."""
    errors = [
        error.p95
        for result in (analysis.compasses if analysis else ())
        if result.verdict.grade is not Grade.REJECTED
        for error in result.verdict.heading_error
    ]
    return max(errors, default=math.inf)


def _degrees(now: Now) -> tuple[float, float, float] | None:
    if now.attitude is None:
        return None
    roll, pitch, yaw = np.degrees(now.attitude).tolist()
    return roll, pitch, yaw % 360.0
