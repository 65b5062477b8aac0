"""A ground station's side of one MAVLink link. No input or output happens here.

Bytes and times go in; frames, events, statistics and messages to send come out.

Rules
-----
1. Only these are ever sent on its own account: HEARTBEAT each second, TIMESYNC, questions
   for identity (PARAM_REQUEST_READ, MAV_CMD_REQUEST_MESSAGE), and stream rates where
   they were asked for. Never a PARAM_SET.
2. The first autopilot heard is the vehicle, unless another was chosen. A second one within
   the settling time makes the link ambiguous, and only who chooses gets on.
3. A frame is the vehicle's when system *and* component are its own, and it comes from where the
   vehicle's first heartbeat came from. Only an autopilot's component is a vehicle (see
   magcomp.mavlink.heartbeat), or the one that was chosen. Who speaks in the vehicle's name from
   elsewhere is a stranger, and is listened to only when the vehicle has been silent for six
   seconds: it may have come back on another port. Then it is asked anew who it is.
4. Three seconds without a frame of the vehicle are a gap, dated from the last one.
5. A vehicle whose clock runs back by more than two seconds, three messages in a row, rebooted.
6. A vehicle that talks, but has sent none of its streams for four seconds, has forgotten them, as
   after a reboot whose silence was too short to notice: it is asked for everything anew.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.link.events import (
    GapEnded,
    GapStarted,
    LinkEvent,
    StrangerHeard,
    VehicleFound,
    VehicleRebooted,
)
from magcomp.link.framing import GROUND_STATION_SYSTEM, Frame, Framer, Message
from magcomp.link.identity import Identification, read_heartbeat
from magcomp.link.quality import Gap, LinkStatistics, RateMeter, SequenceCounter
from magcomp.link.streams import StreamControl, StreamReport
from magcomp.link.transport import Peer
from magcomp.link.vehicle_clock import VehicleClock
from magcomp.mavlink.heartbeat import Identity, is_vehicle
from magcomp.model import Vehicle

HEARTBEAT_S = 1.0
SILENCE_S = 3.0
SETTLING_S = 1.5
"""Other vehicles send heartbeats each second: by then they would have been heard."""

MOVED_S = 6.0
"""Longer than a writer trusts a vehicle that sends no heartbeat (magcomp.writing.exchange)."""

FORGOTTEN_S = 4.0
_FOREIGN_NAMES = 50
_GAPS = 1000


@dataclass(frozen=True)
class Received:
    """A frame that arrived, whether it is the vehicle's, and whether it only says so."""

    frame: Frame
    from_vehicle: bool
    from_stranger: bool = False


class LinkState:
    """Everything a link knows.

    Parameters
    ----------
    system, component
        The vehicle to speak to; None takes the only system there is, and the component that
        autopilots have.
    key
        Signing key, 32 bytes; None where frames are not signed.
    unix_us
        Calendar time of the start, for signatures.
    source_system
        The number this ground station gives itself.
    """

    def __init__(
        self,
        *,
        system: int | None = None,
        component: int | None = None,
        key: bytes | None = None,
        unix_us: int = 0,
        source_system: int = GROUND_STATION_SYSTEM,
    ) -> None:
        self._framer = Framer(key, unix_us, source_system)
        self._source_system = source_system
        self._wanted_system = system
        self._wanted_component = component
        self._heartbeats: dict[tuple[int, int], Identity] = {}
        self._companions: dict[tuple[int, int], Identity] = {}
        self._foreign: dict[str, int] = {}
        self._vehicle: tuple[int, int] | None = None
        self.peer: Peer = None
        self._peer_known = False
        self._twin = False
        self._strangers: set[Peer] = set()
        self._found_at = math.inf
        self._known: Vehicle | None = None
        self._identification: Identification | None = None
        self._streams: StreamControl | None = None
        self._streaming_at = math.inf
        self._sequence = SequenceCounter()
        self._meter = RateMeter()
        self._last_heard = -math.inf
        self._gaps: deque[Gap] = deque(maxlen=_GAPS)
        self._clock = VehicleClock()
        self._next_heartbeat = -math.inf
        self._events: list[LinkEvent] = []

    # ---------------------------------------------------------------- what is known

    @property
    def vehicle(self) -> Vehicle | None:
        """The vehicle as far as known; None before its first heartbeat."""
        if self._known is not None or self._identification is None:
            return self._known
        return self._identification.vehicle

    @property
    def heartbeats(self) -> tuple[Identity, ...]:
        """Every autopilot heard, in order of system and component."""
        return tuple(self._heartbeats[source] for source in sorted(self._heartbeats))

    @property
    def companions(self) -> tuple[Identity, ...]:
        """Who says that it is an autopilot, from another component than the one spoken to."""
        return tuple(self._companions[source] for source in sorted(self._companions))

    @property
    def foreign(self) -> Mapping[str, int]:
        """Message names that came from no autopilot, and how often."""
        return self._foreign

    @property
    def stream_report(self) -> StreamReport | None:
        """How the rates asked for were answered; None where none were."""
        return self._streams.report if self._streams else None

    def settled(self, now: float) -> bool:
        """Tell whether a second vehicle would have been heard by now."""
        if self._vehicle is None:
            return False
        return self._wanted_system is not None or now >= self._found_at + SETTLING_S

    def ambiguous(self) -> bool:
        """Tell whether several vehicles are there and none was chosen."""
        return self._wanted_system is None and (len(self._heartbeats) > 1 or self._twin)

    @property
    def has_twin(self) -> bool:
        """Somebody else spoke in the vehicle's name before it was clear who it is."""
        return self._twin

    def identified(self, now: float) -> bool:
        """Tell whether the vehicle's identity is known, or asking further is hopeless."""
        return self._identification is not None and self._identification.complete(now)

    @property
    def in_gap(self) -> bool:
        """The vehicle is not heard at present."""
        return bool(self._gaps) and self._gaps[-1].end == math.inf

    def silent_for(self, now: float) -> float:
        """Seconds since the vehicle was last heard."""
        return now - self._last_heard

    def statistics(self, now: float, *, reopened: int = 0, unsent: int = 0) -> LinkStatistics:
        """The link as it stands."""
        counts = self._framer.counts
        return LinkStatistics(
            up=self._vehicle is not None and not self.in_gap,
            bytes_received=counts.received,
            frames=counts.frames,
            skipped=counts.skipped,
            refused=counts.refused,
            signed=counts.signed,
            lost=self._sequence.lost,
            loss=self._meter.loss(now),
            round_trip_s=self._clock.round_trip_s,
            rates=self._meter.rates(now),
            gaps=tuple(self._gaps),
            reopened=reopened,
            unsent=unsent,
        )

    def take_events(self) -> list[LinkEvent]:
        """What happened since the last call."""
        events, self._events = self._events, []
        return events

    # ---------------------------------------------------------------- what goes in

    def receive(self, data: bytes, now: float, peer: Peer = None) -> list[Received]:
        """Take bytes as they arrived from a peer; gives the frames they complete."""
        return [self._take(frame, now, peer) for frame in self._framer.receive(data, now, peer)]

    def reopened(self, now: float) -> None:
        """The transport was opened again: what comes next continues nothing."""
        self._framer.reset()
        self._sequence.restart()
        self.peer, self._peer_known = None, False
        self._next_heartbeat = now
        self._ask_again()

    def closed(self, now: float, reason: str) -> None:
        """The transport was lost: the gap begins at the last frame heard."""
        if self._vehicle is not None and not self.in_gap:
            self._open_gap(now, reason)

    def request_streams(self, rates: Mapping[str, float], now: float) -> None:
        """Want message rates, in Hz by name, now and after each reboot.

        Raises
        ------
        UsageError
            A name magcomp does not stream, or a rate that is not above 0.
        """
        if self._vehicle is not None:
            self._streams = self._streams or StreamControl(self._vehicle, self._source_system)
            self._streams.request(rates, self._meter.rates(now))

    def restore_streams(self) -> None:
        """Give the vehicle its previous rates back."""
        if self._streams is not None:
            self._streams.restore()

    # ---------------------------------------------------------------- what goes out

    def due(self, now: float) -> list[Message]:
        """Messages to send now; call at least every tenth of a second."""
        if self._vehicle is not None and not self.in_gap and self.silent_for(now) > SILENCE_S:
            self._open_gap(now, "silence")
        out: list[Message] = []
        if now >= self._next_heartbeat:
            self._next_heartbeat = now + HEARTBEAT_S
            out.append(_heartbeat())
        if self._vehicle is None or self.ambiguous():
            return out
        self._announce(now)
        if not self.in_gap:
            out += self._questions(now)
        return out

    def pack(self, message: Message, unix_us: int) -> bytes:
        """Put a message into the next frame of this ground station."""
        return self._framer.pack(message, unix_us)

    # ---------------------------------------------------------------- inside

    def _questions(self, now: float) -> list[Message]:
        out: list[Message] = []
        if self._identification is not None:
            out += self._identification.due(now)
        if self._streams is not None:
            if self._streams.wanted and now - self._streaming_at > FORGOTTEN_S:
                self._streaming_at = now
                self._ask_again()
            out += self._streams.due(now)
        return out + self._clock.due(now)

    def _take(self, frame: Frame, now: float, peer: Peer) -> Received:
        message = frame.message
        if frame.source == self._vehicle and not self._is_from_there(peer, now):
            return Received(frame, from_vehicle=False, from_stranger=True)
        if message.get_type() == "HEARTBEAT":
            self._take_heartbeat(message, now, peer)
        if frame.source != self._vehicle:
            if frame.source not in self._heartbeats:
                self._count_foreign(message.get_type())
            return Received(frame, from_vehicle=False)
        self._close_gap(now)
        lost = self._sequence.heard(frame.sequence)
        self._meter.heard(message.get_type(), lost, now)
        self._last_heard = now
        if self._clock.heard(message, now):
            self._sequence.restart()
            self._events.append(VehicleRebooted(now))
            self._ask_again()
        if self._identification is not None:
            self._identification.heard(message)
        if self._streams is not None:
            self._streams.heard(message)
            if message.get_type() in self._streams.wanted:
                self._streaming_at = now
        return Received(frame, from_vehicle=not self.ambiguous())

    def _is_from_there(self, peer: Peer, now: float) -> bool:
        """Whether a frame in the vehicle's name is the vehicle's; warn of each stranger once."""
        if self._peer_known and peer == self.peer:
            return True
        if not self._peer_known or self.silent_for(now) > MOVED_S:
            self.peer, self._peer_known = peer, True
            self._sequence.restart()
            self._ask_again()
            return True
        self._twin = self._twin or not self.settled(now)
        if peer not in self._strangers and len(self._strangers) < _FOREIGN_NAMES:
            self._strangers.add(peer)
            self._events.append(StrangerHeard(now, _named(peer)))
        return False

    def _take_heartbeat(self, message: Message, now: float, peer: Peer) -> None:
        heartbeat = read_heartbeat(message)
        if heartbeat is None:
            return
        source = (heartbeat.system, heartbeat.component)
        if not is_vehicle(heartbeat, self._wanted_component):
            if len(self._companions) < _FOREIGN_NAMES:
                self._companions[source] = heartbeat
            return
        if self.settled(now) and source != self._vehicle:
            return  # a vehicle that joins later is not ours and does not make the link ambiguous
        self._heartbeats[source] = heartbeat
        if self._vehicle is None and self._wanted_system in (None, heartbeat.system):
            self._vehicle = source
            self.peer, self._peer_known = peer, True
            self._found_at = now
            self._last_heard = now
            self._identification = Identification(heartbeat)

    def _count_foreign(self, name: str) -> None:
        if name in self._foreign or len(self._foreign) < _FOREIGN_NAMES:
            self._foreign[name] = self._foreign.get(name, 0) + 1

    def _announce(self, now: float) -> None:
        if self._identification is None or not (self.settled(now) and self.identified(now)):
            return
        found = self._identification.vehicle
        unanswered = self._known is not None and not found.device_ids
        if found != self._known and not unanswered:
            self._known = found
            self._events.append(VehicleFound(now, found))

    def _ask_again(self) -> None:
        """Take nothing for granted: another vehicle may be there, or this one has forgotten."""
        if self._vehicle is not None:
            self._identification = Identification(self._heartbeats[self._vehicle])
        if self._streams is not None:
            self._streams.repeat()

    def _open_gap(self, now: float, reason: str) -> None:
        start = min(self._last_heard, now)
        self._gaps.append(Gap(start))
        self._events.append(GapStarted(start, reason))

    def _close_gap(self, now: float) -> None:
        if self.in_gap:
            gap = Gap(self._gaps[-1].start, now)
            self._gaps[-1] = gap
            self._sequence.restart()
            self._events.append(GapEnded(now, gap.duration))


def _named(peer: Peer) -> str:
    return ":".join(map(str, peer[:2])) if peer else "elsewhere"


def _heartbeat() -> Message:
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_GCS,
        mavlink.MAV_AUTOPILOT_INVALID,
        0,
        0,
        mavlink.MAV_STATE_ACTIVE,
        3,
    )
