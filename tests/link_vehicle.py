"""A small ArduPilot for the tests of the link: answers what it is asked, by the book."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.link.signing import signing_timestamp
from magcomp.link.state import LinkState, Received
from magcomp.link.transport import ReplayEndedError, Transport, TransportClosedError

DEVICE_IDS = {"COMPASS_DEV_ID": 97539, "COMPASS_DEV_ID2": 131874, "COMPASS_DEV_ID3": 263178}
UNIX_US = 1_700_000_000_000_000


class FakeVehicle:
    """Messages in, messages out. ``heard`` holds all it was sent."""

    def __init__(
        self,
        system: int = 1,
        component: int = 1,
        *,
        autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
        kind: int = mavlink.MAV_TYPE_QUADROTOR,
        key: bytes | None = None,
        intervals: bool = True,
        heartbeat_s: float = 1.0,
    ) -> None:
        self.parameters: dict[str, float] = dict(DEVICE_IDS)
        self.interval_us: dict[int, int] = {}
        self.groups: dict[int, int] = {}
        self.heard: list[mavlink.MAVLink_message] = []
        self.boot_time = 0.0
        self._intervals = intervals
        self._identity = (kind, autopilot)
        self._heartbeat_s = heartbeat_s
        self._next_heartbeat = -1.0
        self._mav = mavlink.MAVLink(None, system, component)
        self._mav.robust_parsing = True
        if key is not None:
            self._mav.signing.secret_key = key
            self._mav.signing.sign_outgoing = True
            self._mav.signing.timestamp = signing_timestamp(UNIX_US)

    def pack(self, message: mavlink.MAVLink_message) -> bytes:
        raw: bytes = message.pack(self._mav)
        self._mav.seq = (self._mav.seq + 1) % 256
        return raw

    def skip(self, frames: int) -> None:
        """Lose frames on the way."""
        self._mav.seq = (self._mav.seq + frames) % 256

    def heartbeat(self) -> bytes:
        return self.pack(mavlink.MAVLink_heartbeat_message(*self._identity, 0, 0, 4, 3))

    def attitude(self, now: float = 0.0, yaw: float = 0.0) -> bytes:
        boot_ms = round(max(now - self.boot_time, 0.0) * 1000)
        return self.pack(mavlink.MAVLink_attitude_message(boot_ms, 0.0, 0.0, yaw, 0, 0, 0))

    def tick(self, now: float) -> bytes:
        """What it says by itself at ``now``: a heartbeat when due, and its attitude."""
        out = b""
        if now >= self._next_heartbeat:
            self._next_heartbeat = now + self._heartbeat_s
            out += self.heartbeat()
        return out + self.attitude(now)

    def hear(self, data: bytes) -> bytes:
        """Take bytes; gives the answers."""
        out = b""
        for message in self._mav.parse_buffer(data) or []:
            self.heard.append(message)
            answer = getattr(self, f"_on_{message.get_type().lower()}", None)
            target = getattr(message, "target_system", self._mav.srcSystem)
            if answer is not None and target == self._mav.srcSystem:
                out += b"".join(self.pack(reply) for reply in answer(message))
        return out

    def names_heard(self) -> list[str]:
        return [message.get_type() for message in self.heard]

    def _on_param_request_read(self, message: mavlink.MAVLink_message) -> Iterator[object]:
        if message.param_id in self.parameters:
            value = self.parameters[message.param_id]
            yield mavlink.MAVLink_param_value_message(
                message.param_id.encode(), value, mavlink.MAV_PARAM_TYPE_INT32, 1, 0
            )

    def _on_timesync(self, message: mavlink.MAVLink_message) -> Iterator[object]:
        if message.tc1 == 0:
            yield mavlink.MAVLink_timesync_message(42, message.ts1)

    def _on_request_data_stream(self, message: mavlink.MAVLink_message) -> Iterator[object]:
        rate = message.req_message_rate if message.start_stop else 0
        self.groups[message.req_stream_id] = rate
        return iter(())

    def _on_command_long(self, message: mavlink.MAVLink_message) -> Iterator[object]:
        number, accepted = message.command, mavlink.MAV_RESULT_ACCEPTED
        if number == mavlink.MAV_CMD_REQUEST_MESSAGE and message.param1 == 148:
            nothing = bytes(8)
            yield mavlink.MAVLink_autopilot_version_message(
                0, 0x040603FF, 0, 0, 140 << 16, nothing, nothing, nothing, 0, 0, 0
            )
        elif not self._intervals:
            accepted = mavlink.MAV_RESULT_UNSUPPORTED
        elif number == mavlink.MAV_CMD_GET_MESSAGE_INTERVAL:
            wanted = int(message.param1)
            interval = self.interval_us.get(wanted, -1)
            yield mavlink.MAVLink_message_interval_message(wanted, interval)
        elif number == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            self.interval_us[int(message.param1)] = int(message.param2)
        yield mavlink.MAVLink_command_ack_message(number, accepted, 0, 0, 255, 190)


def play(
    state: LinkState,
    vehicles: list[FakeVehicle],
    start: float,
    seconds: float,
    *,
    lost: Callable[[], bool] = lambda: False,
    step: float = 0.05,
) -> list[Received]:
    """Let vehicles and a link talk from ``start`` on, with simulated time; gives what arrived."""
    out: list[Received] = []

    def deliver(data: bytes, now: float) -> None:
        if data and not lost():
            out.extend(state.receive(data, now))

    for index in range(round(seconds / step)):
        now = start + index * step
        for vehicle in vehicles:
            deliver(vehicle.tick(now), now)
        for message in state.due(now):
            raw = state.pack(message, UNIX_US + round(now * 1e6))
            for vehicle in vehicles:
                if not lost():
                    deliver(vehicle.hear(raw), now)
    return out


@contextlib.contextmanager
def serving(vehicle: FakeVehicle, transport: Transport, *, rate: float = 50.0) -> Iterator[None]:
    """A vehicle that lives at the other end of a real transport, in a thread."""
    stop = threading.Event()

    def live() -> None:
        spoke = -1.0
        with contextlib.suppress(TransportClosedError, ReplayEndedError):
            while not stop.is_set():
                transport.write(vehicle.hear(transport.read(0.2 / rate)))
                if time.monotonic() - spoke >= 1 / rate:
                    spoke = time.monotonic()
                    transport.write(vehicle.tick(spoke))

    thread = threading.Thread(target=live, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
        transport.close()


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
