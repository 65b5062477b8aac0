"""Watches a live link: what happens on it, how the vehicle is moved, and what a screen shows.

The vehicle is looked at by its own clock, as its frames arrive: a replay, or a simulation, may be
faster than ours, and what is found must not depend on how fast it is played.
"""

from __future__ import annotations

import contextlib
import math
import threading
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from magcomp.errors import unforeseen
from magcomp.link import (
    Connection,
    GapEnded,
    LinkEvent,
    Replay,
    SinkFailed,
    StrangerHeard,
    VehicleRebooted,
)
from magcomp.link.clock import Clock
from magcomp.live.guide import (
    Guidance,
    View,
    guide,
    level_seconds,
    levels_done,
    wanted_heading,
)
from magcomp.live.latest import Now
from magcomp.live.prepare import Preparation
from magcomp.live.progress import Early, Enough, HeadingRing, HoverBound, largest_bound
from magcomp.live.refit import Refit
from magcomp.live.situation import Look, Manoeuvre, SituationWatch
from magcomp.live.snapshot import LiveSnapshot, compasses_now, slow_streams, warnings
from magcomp.live.tap import Tap
from magcomp.mavlink.header import message_id, source
from magcomp.mavlink.messages import Message
from magcomp.model import CURRENT, THROTTLE, Vehicle

LOOK_S = 0.2
_GAP_TOLD_S = 20.0
"""How long a pilot is told of a gap that is over."""
_NOTHING = Now(0, None, {}, (), None, None, None, None, None, None, False)


class Watch:
    """Hears of the link in the thread that calls ``run``, and of the vehicle as its tap's listener.

    Parameters
    ----------
    connection, tap, preparation
        What is watched.
    clock
        The computer's clocks.
    refit
        How the fitting stands.
    hurry
        Has everything fitted at once; tells whether anybody fits.
    """

    def __init__(
        self,
        connection: Connection,
        tap: Tap,
        preparation: Preparation,
        clock: Clock,
        refit: Callable[[], Refit],
        hurry: Callable[[], bool],
    ) -> None:
        self._connection = connection
        self._tap = tap
        self._preparation = preparation
        self._clock = clock
        self._refit = refit
        self._hurry = hurry
        self._was_armed = False
        self._armed_until_s = 0.0
        self._early = Early()
        self._wanted = 0
        self._opened = clock.monotonic()
        self._situation = SituationWatch()
        self._ring = HeadingRing()
        self._hover = HoverBound()
        self._enough = Enough()
        self._notes: list[str] = []
        self._slow = ""
        self._gap = (-math.inf, "")
        self._looked_s = -math.inf
        tap.listen(self)

    @property
    def manoeuvre(self) -> Manoeuvre | None:
        """What the user says that is being done; may be set at any time."""
        return self._situation.manoeuvre

    @manoeuvre.setter
    def manoeuvre(self, said: Manoeuvre | None) -> None:
        self._situation.manoeuvre = said

    def run(self, stop: threading.Event) -> None:
        """Hear of the link until stopped."""
        while not stop.wait(LOOK_S):
            with self._told():
                for event in self._connection.take_events():
                    self._take(event)

    def add(self, unix_us: int, frame: bytes) -> None:  # noqa: ARG002 - a FrameSink
        """Look at the vehicle with its heartbeats, and with attitudes ``LOOK_S`` apart."""
        message = message_id(frame)
        if message not in (Message.HEARTBEAT, Message.ATTITUDE):
            return
        vehicle = self._connection.vehicle
        if vehicle is None or source(frame) != (vehicle.system, vehicle.component):
            return
        seconds = self._tap.seconds(vehicle)
        if message == Message.HEARTBEAT or seconds >= self._looked_s + LOOK_S:
            self._looked_s = seconds
            with self._told():
                self._look(vehicle, seconds)

    @contextlib.contextmanager
    def _told(self) -> Iterator[None]:
        """Tell what goes wrong in one look; the next one follows."""
        try:
            yield
        except Exception as error:
            self._note(unforeseen(error))

    def _look(self, vehicle: Vehicle, seconds: float) -> None:
        now = self._tap.latest.now(vehicle)
        self._situation.update(Look(seconds, now.armed, now.attitude, now.height_m, now.accel))
        self._ring.look(now.armed, now.attitude, now.throttle)
        loads = {CURRENT: now.current, THROTTLE: now.throttle}
        self._hover.look(now.armed, loads, self._refit().analysis, seconds)
        if now.armed:
            self._armed_until_s = seconds
        self._look_for_landing(now.armed)

    def _look_for_landing(self, armed: bool | None) -> None:
        """Whoever has landed waits for the answer: fit the whole flight at once."""
        if self._was_armed and armed is False:
            wanted = self._refit().hurried + 1
            self._wanted = wanted if self._hurry() else 0
        if armed is not None:
            self._was_armed = armed

    @property
    def elapsed_s(self) -> float:
        """Seconds since the session was opened; of the log, where one is replayed."""
        if isinstance(self._connection.address, Replay):
            return self._tap.latest.span_s
        return self._clock.monotonic() - self._opened

    def snapshot(self) -> LiveSnapshot:
        """Everything a screen shows, now. Costs well under a millisecond."""
        vehicle = self._connection.vehicle
        latest = self._tap.latest
        now = _NOTHING if vehicle is None else latest.now(vehicle)
        parameters = {} if vehicle is None else latest.parameters(vehicle)
        link, refit = self._connection.statistics(), self._refit()
        view = self._view(now, vehicle)
        guidance = self._guidance(vehicle, view)
        return LiveSnapshot(
            address=str(self._connection.address),
            vehicle=vehicle,
            connected=link.up,
            link_text=self._link_text(vehicle, link.up),
            armed=now.armed,
            elapsed_s=self.elapsed_s,
            recorded_s=self._tap.seconds(vehicle),
            armed_until_s=self._armed_until_s,
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
            headings=self._ring.best,
            wanted_heading_deg=_wanted_deg(view),
            bound=self._hover.bound,
            situation=view.situation,
            guidance=guidance,
            early=self._early.look(guidance, view.seconds, refit.analysis),
            warnings=self._warnings(now, vehicle, parameters),
            analysis=refit.analysis,
            grade=view.grade,
            stable_refits=refit.stable,
            fit_trouble=refit.trouble,
            ready=self._preparation.over.is_set(),
            ended=self._connection.ended,
        )

    def _take(self, event: LinkEvent) -> None:
        match event:
            case GapEnded(duration=duration):
                self._gap = (self._clock.monotonic(), f"the link was gone for {duration:.0f} s")
            case VehicleRebooted():
                self._note("the vehicle rebooted")
            case StrangerHeard(where=where):
                self._note(f"somebody else at {where} speaks in the vehicle's name; it is ignored")
            case SinkFailed(error=error):
                self._note(f"what arrives cannot be taken any more: {error}")

    def _note(self, text: str) -> None:
        if text not in self._notes[-1:]:
            self._notes = [*self._notes[-4:], text]

    def _view(self, now: Now, vehicle: Vehicle | None) -> View:
        refit = self._refit()
        whose = (None, None) if vehicle is None else (vehicle.system, vehicle.component)
        return View(
            situation=self._situation.situation,
            armed=now.armed,
            throttle=now.throttle,
            attitude=now.attitude,
            height_m=now.height_m,
            coverage=self._tap.buffer.coverage(*whose),
            seconds=self._tap.seconds(vehicle),
            grade=None if refit.analysis is None else refit.analysis.grade,
            stable_refits=refit.stable,
            bound_deg=largest_bound(refit.analysis),
            was_enough=self._enough.reached(self._situation.situation),
            answered=refit.hurried >= self._wanted,
        )

    def _guidance(self, vehicle: Vehicle | None, view: View) -> Guidance:
        if vehicle is None:
            return Guidance("waiting for the vehicle's heartbeat", 0.0)
        if not self._preparation.over.is_set():
            return Guidance("reading the vehicle's calibration", 0.0)
        return self._enough.look(view.situation, guide(view))

    def _link_text(self, vehicle: Vehicle | None, up: bool) -> str:
        if vehicle is None:
            return self._preparation.trouble or "waiting for a heartbeat"
        if not up:
            return "the link is lost; trying again"
        return "connected"

    def _warnings(
        self, now: Now, vehicle: Vehicle | None, parameters: Mapping[str, float]
    ) -> tuple[str, ...]:
        if vehicle is None:
            return ()
        preparation = self._preparation
        since = None if preparation.failure is not None else preparation.streaming_since
        streaming = 0.0 if since is None else self._clock.monotonic() - since
        asked, received = self._connection.requested_rates, self._connection.statistics().rates
        slow = next(slow_streams(asked, received, streaming), "")
        # The numbers it was first told with: a text that changes all the time is none.
        self._slow = slow and (self._slow or slow)
        found = [
            *warnings(now, vehicle, parameters, streaming),
            *filter(None, [self._slow]),
            *reversed(self._notes),
        ]
        ended, gap = self._gap
        if self._clock.monotonic() - ended < _GAP_TOLD_S:
            found.append(gap)
        if preparation.over.is_set() and preparation.trouble:
            found.insert(0, preparation.trouble.rstrip("."))
        if self._tap.failure:
            found.insert(0, self._tap.failure.rstrip("."))
        return tuple(found)


def _wanted_deg(view: View) -> float | None:
    wanted = wanted_heading(view)
    return None if wanted is None else math.degrees(wanted)


def _degrees(now: Now) -> tuple[float, float, float] | None:
    if now.attitude is None:
        return None
    roll, pitch, yaw = np.degrees(now.attitude).tolist()
    return roll, pitch, yaw % 360.0
