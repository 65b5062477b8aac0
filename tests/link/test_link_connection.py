"""A connection over real transports: finds the vehicle, keeps it, and says why where it cannot."""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import pty
import select
import socket
import threading
import time
import tty

import pytest
from link_vehicle import DEVICE_IDS, FakeVehicle, free_port, serving
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from test_link_replay import FIXTURE

from magcomp.errors import ExitCode, LinkError, LinkTimeoutError, OutputError
from magcomp.link import Recorder, connect
from magcomp.link.address import Replay, SerialLine, TcpClient, TcpServer, UdpClient, UdpServer
from magcomp.link.clock import SystemClock
from magcomp.link.connection import Connection
from magcomp.link.events import GapEnded, GapStarted, SinkFailed
from magcomp.link.opening import open_transport
from magcomp.link.replay import records
from magcomp.link.streams import DEFAULT_RATES, affordable
from magcomp.link.tcp import TcpTransport
from magcomp.link.transport import TransportClosedError
from magcomp.link.udp import UdpTransport

CLOCK = SystemClock()
PATIENCE_S = 60.0


class Sink:
    def __init__(self) -> None:
        self.records: list[tuple[int, bytes]] = []

    def add(self, unix_us: int, frame: bytes) -> None:
        self.records.append((unix_us, frame))


class Terminal:
    """The vehicle's end of a pseudo-terminal."""

    clock = CLOCK

    def __init__(self) -> None:
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        self.path = os.ttyname(slave)
        self._slave = slave
        os.set_blocking(self._master, False)

    def read(self, timeout: float) -> bytes:
        select.select([self._master], [], [], timeout)
        try:
            return os.read(self._master, 65536)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> None:
        with contextlib.suppress(BlockingIOError):
            os.write(self._master, data)

    def close(self) -> None:
        os.close(self._master)
        os.close(self._slave)


def until(link, condition):
    """Read the link until ``condition`` holds; gives the messages that came."""
    messages = []
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "it never came to be"
        message = link.receive(0.1)
        if message is not None:
            messages.append(message)
    return messages


def over_udp(vehicle):
    port = free_port(socket.SOCK_DGRAM)
    far_end = UdpTransport(UdpClient("127.0.0.1", port), CLOCK)
    return UdpServer("127.0.0.1", port), serving(vehicle, far_end)


def over_tcp(vehicle):
    port = free_port()
    return TcpClient("127.0.0.1", port), serving(
        vehicle, TcpTransport(TcpServer("127.0.0.1", port), CLOCK)
    )


def over_serial(vehicle):
    terminal = Terminal()
    return SerialLine(terminal.path), serving(vehicle, terminal)


@pytest.mark.parametrize("way", [over_udp, over_tcp, over_serial])
class TestEveryWay:
    def test_the_vehicle_is_found_and_identified(self, way):
        address, living = way(FakeVehicle())
        with living, connect(address, system=1) as link:
            vehicle = link.wait_vehicle(PATIENCE_S)
            assert vehicle.firmware == "4.6.3"
            assert vehicle.device_ids == tuple(DEVICE_IDS.values())

    def test_a_question_gets_its_answer(self, way):
        address, living = way(FakeVehicle())
        with living, connect(address, system=1) as link:
            link.wait_vehicle(PATIENCE_S)
            link.discard()
            link.send(mavlink.MAVLink_param_request_read_message(1, 1, b"COMPASS_DEV_ID2", -1))
            answer = None
            while answer is None or answer.get_type() != "PARAM_VALUE":
                answer = link.receive(PATIENCE_S)
            assert (answer.param_id, answer.param_value) == ("COMPASS_DEV_ID2", 131874.0)

    def test_streams_are_requested_and_given_back(self, way):
        vehicle = FakeVehicle()
        before = {mavlink.MAVLINK_MSG_ID_ATTITUDE: 100_000}
        vehicle.interval_us = dict(before)
        address, living = way(vehicle)
        with living:
            with connect(address, system=1) as link:
                link.wait_vehicle(PATIENCE_S)
                assert link.request_streams({"ATTITUDE": 50.0}, PATIENCE_S).complete
                assert vehicle.interval_us == {mavlink.MAVLINK_MSG_ID_ATTITUDE: 20_000}
            assert vehicle.interval_us == before

    def test_every_frame_that_arrives_reaches_the_sinks_in_order(self, way):
        address, living = way(FakeVehicle())
        sink = Sink()
        with living, connect(address, system=1, sinks=[sink]) as link:
            link.wait_vehicle(PATIENCE_S)
            until(link, lambda: len(sink.records) > 100)
            assert link.statistics().lost == 0
            numbers = [frame[4] for _, frame in tuple(sink.records)]
        assert all((b - a) % 256 == 1 for a, b in itertools.pairwise(numbers))
        stamps = [stamp for stamp, _ in sink.records]
        assert stamps == sorted(stamps)


@pytest.mark.parametrize("baud", [9600, 57_600, 115_200])
def test_a_slow_serial_line_is_asked_for_no_more_than_it_carries(baud):
    """A byte takes ten bits on the line; USB, which takes no notice of a baud rate, says 115200."""
    terminal = Terminal()
    address = SerialLine(terminal.path, baud)
    with serving(FakeVehicle(), terminal), connect(address, system=1) as link:
        link.wait_vehicle(PATIENCE_S)
        link.request_streams(DEFAULT_RATES, PATIENCE_S)
        asked = link.requested_rates
    whole = baud >= 115_200
    assert asked == pytest.approx(DEFAULT_RATES if whole else affordable(DEFAULT_RATES, baud / 10))
    assert (sum(asked.values()) == sum(DEFAULT_RATES.values())) is whole


def test_a_px4_is_asked_for_the_message_of_its_first_compass():
    address, living = over_udp(FakeVehicle(autopilot=mavlink.MAV_AUTOPILOT_PX4))
    with living, connect(address, system=1) as link:
        until(link, lambda: link.vehicle is not None)
        link.request_streams({"RAW_IMU": 10.0, "ATTITUDE": 20.0}, PATIENCE_S)
        assert link.requested_rates == {"SCALED_IMU": 10.0, "ATTITUDE": 20.0}


class TestComingBack:
    def test_a_tcp_vehicle_that_closes_and_returns_is_gone_on_with(self, tmp_path):
        port = free_port()
        vehicle = FakeVehicle()
        address = TcpServer("127.0.0.1", port)
        with Recorder(tmp_path / "a.tlog") as recorder:
            first = serving(vehicle, TcpTransport(address, CLOCK))
            with first:
                link = connect(TcpClient("127.0.0.1", port), system=1, sinks=[recorder])
                link.wait_vehicle(PATIENCE_S)
            events = []

            def seen(kind):
                events.extend(link.take_events())
                return any(isinstance(event, kind) for event in events)

            until(link, lambda: seen(GapStarted))
            assert not link.statistics().up
            before = recorder.frames
            with serving(vehicle, TcpTransport(address, CLOCK)):
                until(link, lambda: seen(GapEnded))
                until(link, lambda: recorder.frames > before + 10)
                statistics = link.statistics()
                link.close()
        assert statistics.up
        assert len(statistics.gaps) == 1
        assert math.isfinite(statistics.gaps[0].duration)
        assert statistics.reopened >= 1

    def test_a_cable_pulled_and_plugged_in_again_is_gone_on_with(self, tmp_path):
        port_name = tmp_path / "ttyACM0"
        vehicle = FakeVehicle()
        terminal = Terminal()
        port_name.symlink_to(terminal.path)
        address = SerialLine(str(port_name))
        with serving(vehicle, terminal):
            link = connect(address, system=1)
            link.wait_vehicle(PATIENCE_S)
            os.close(terminal._slave)
            terminal._slave = os.dup(0)
        port_name.unlink()
        until(link, lambda: not link.statistics().up)
        terminal = Terminal()
        port_name.symlink_to(terminal.path)
        with serving(vehicle, terminal):
            until(link, lambda: link.statistics().up)
            assert len(link.statistics().gaps) == 1
            link.close()

    def test_a_stream_that_says_nothing_for_ten_seconds_is_opened_again(self):
        class HastyClock:
            """Twenty seconds in one."""

            def monotonic(self):
                return 20 * time.monotonic()

            def unix_us(self):
                return CLOCK.unix_us()

        port = free_port()
        with socket.create_server(("127.0.0.1", port)) as dead:
            vehicle = FakeVehicle()
            with connect(TcpClient("127.0.0.1", port), system=1, clock=HastyClock()) as link:
                first, _ = dead.accept()
                first.sendall(vehicle.heartbeat() + vehicle.attitude())
                second, _ = dead.accept()  # comes although the first was never closed
                second.sendall(vehicle.heartbeat() + vehicle.attitude())
                until(link, lambda: link.statistics().reopened >= 1)
                assert link.statistics().gaps
            first.close()
            second.close()

    def test_sending_while_the_link_is_down_is_lost_like_on_the_air(self):
        port = free_port()
        with serving(FakeVehicle(), TcpTransport(TcpServer("127.0.0.1", port), CLOCK)):
            link = connect(TcpClient("127.0.0.1", port), system=1)
            link.wait_vehicle(PATIENCE_S)
        until(link, lambda: not link.statistics().up)

        def sent_into_the_void():
            link.send(mavlink.MAVLink_timesync_message(0, 1))
            return link.statistics().unsent > 0

        until(link, sent_into_the_void)
        link.close()


class TestWhyNot:
    def silent(self, address, timeout=0.2, **options):
        with (
            connect(address, **options) as link,
            pytest.raises(LinkTimeoutError) as refusal,
        ):
            link.wait_vehicle(timeout)
        assert refusal.value.exit_code is ExitCode.TIMEOUT
        assert str(address) in str(refusal.value)
        return str(refusal.value)

    def test_nothing_arrived(self):
        message = self.silent(UdpServer("127.0.0.1", free_port(socket.SOCK_DGRAM)))
        assert "nothing arrived at all" in message

    def test_bytes_without_frames_are_a_wrong_baud_rate(self):
        terminal = Terminal()
        noise = bytes(byte for byte in range(256) if byte not in (0xFD, 0xFE))
        with connect(SerialLine(terminal.path, 57600)) as link:
            terminal.write(noise)
            until(link, lambda: link.statistics().bytes_received == len(noise))
            with pytest.raises(LinkTimeoutError) as refusal:
                link.wait_vehicle(0.0)
        terminal.close()
        assert "254 bytes arrived but no MAVLink frames" in str(refusal.value)
        assert "the baud rate 57600 is probably wrong" in str(refusal.value)

    def test_bytes_without_frames_on_a_network_are_another_language(self):
        port = free_port(socket.SOCK_DGRAM)
        stranger = UdpTransport(UdpClient("127.0.0.1", port), CLOCK)
        with connect(UdpServer("127.0.0.1", port)) as link:
            stranger.write(b"GET / HTTP/1.1")
            with pytest.raises(LinkTimeoutError, match="does not speak MAVLink"):
                link.wait_vehicle(0.3)
        stranger.close()

    def test_frames_of_another_kind_are_named(self):
        identity = {"autopilot": mavlink.MAV_AUTOPILOT_INVALID, "kind": mavlink.MAV_TYPE_GCS}
        radio = FakeVehicle(heartbeat_s=0.0, **identity)
        address, living = over_udp(radio)
        with living:
            message = self.silent(address, timeout=0.5)
        assert "none from an ArduPilot or PX4 autopilot" in message
        assert "HEARTBEAT" in message

    def test_another_system_than_the_one_asked_for_is_named(self):
        address, living = over_udp(FakeVehicle(system=7, heartbeat_s=0.0))
        with living:
            message = self.silent(address, timeout=0.5, system=3)
        assert "system 3 must be on the link; instead heard system 7" in message

    def test_frames_without_the_key_are_said_to_be_unsigned(self):
        address, living = over_udp(FakeVehicle())
        with living:
            message = self.silent(address, timeout=0.5, key=bytes(32))
        assert "none is signed with the key given" in message

    def test_two_vehicles_are_both_named(self):
        port = free_port(socket.SOCK_DGRAM)
        first, second = (UdpTransport(UdpClient("127.0.0.1", port), CLOCK) for _ in range(2))
        with (
            connect(UdpServer("127.0.0.1", port)) as link,
            serving(FakeVehicle(system=1), first),
            serving(FakeVehicle(system=2), second),
            pytest.raises(LinkError, match=r"systems 1 .* and 2 .*--system") as refusal,
        ):
            link.wait_vehicle(PATIENCE_S)
        assert refusal.value.exit_code is ExitCode.LINK


class TestSigned:
    def test_a_signed_vehicle_is_spoken_to_with_its_key(self):
        key = bytes(range(32))
        vehicle = FakeVehicle(key=key)
        vehicle._mav.signing.timestamp = (time.time_ns() // 10_000) - 142_007_040_000_000
        address, living = over_udp(vehicle)
        with living, connect(address, system=1, key=key) as link:
            assert link.wait_vehicle(PATIENCE_S).firmware == "4.6.3"
            assert link.statistics().refused == 0
        assert vehicle.heard
        assert all(message.get_signed() for message in vehicle.heard)


class TestEnding:
    def test_a_closed_connection_says_so(self):
        link = connect(UdpServer("127.0.0.1", free_port(socket.SOCK_DGRAM)))
        link.close()
        link.close()
        for use in (
            lambda: link.send(mavlink.MAVLink_timesync_message(0, 1)),
            lambda: link.receive(1.0),
        ):
            with pytest.raises(LinkError, match="is closed"):
                use()

    def test_the_port_is_free_afterwards(self):
        address = UdpServer("127.0.0.1", free_port(socket.SOCK_DGRAM))
        for _ in range(3):
            connect(address).close()

    def test_no_thread_is_left(self):
        connect(UdpServer("127.0.0.1", free_port(socket.SOCK_DGRAM))).close()
        assert not [t for t in threading.enumerate() if t.name == "magcomp-link"]

    def test_streams_cannot_be_asked_of_nobody(self):
        with (
            connect(UdpServer("127.0.0.1", free_port(socket.SOCK_DGRAM))) as link,
            pytest.raises(LinkTimeoutError, match="nothing arrived"),
        ):
            link.request_streams()


class TestSinks:
    def test_a_full_disk_stops_the_recorder_and_not_the_link(self):
        class FullDisk:
            def add(self, unix_us, frame):
                raise OutputError("a.tlog cannot be written: No space left on device.")

        address, living = over_udp(FakeVehicle())
        sink = Sink()
        with living, connect(address, system=1, sinks=[FullDisk(), sink]) as link:
            link.wait_vehicle(PATIENCE_S)
            until(link, lambda: len(sink.records) > 20)
            failed = [e for e in link.take_events() if isinstance(e, SinkFailed)]
        assert len(failed) == 1
        assert "No space left" in str(failed[0].error)

    def test_a_fault_in_the_thread_reaches_the_caller(self):
        class Broken:
            def add(self, unix_us, frame):
                raise ZeroDivisionError

        address, living = over_udp(FakeVehicle())
        with living:
            link = connect(address, sinks=[Broken()])
            with pytest.raises(LinkError, match="failed") as failure:
                link.wait_vehicle(PATIENCE_S)
            assert isinstance(failure.value.__cause__, ZeroDivisionError)
            link.close()


class TestReplayed:
    def test_a_log_is_a_vehicle_that_cannot_be_asked(self, tmp_path):
        path = tmp_path / "again.tlog"
        with (
            Recorder(path) as recorder,
            connect(Replay(FIXTURE, math.inf), sinks=[recorder]) as link,
        ):
            vehicle = link.wait_vehicle(PATIENCE_S)
            until(link, lambda: link.ended)
            assert vehicle.device_ids == tuple(DEVICE_IDS.values())
            assert link.statistics().unsent == 0
        original = list(records(FIXTURE.read_bytes()))
        assert list(records(path.read_bytes())) == original


def test_a_dead_transport_is_told_from_a_silent_one():
    transport = open_transport(TcpServer("127.0.0.1", free_port()), CLOCK)
    transport.close()
    with pytest.raises(TransportClosedError):
        transport.read(0.1)


class StalledTransport:
    """A line that takes nothing until it is let go."""

    peer = None

    def __init__(self):
        self.clock = SystemClock()
        self.stalled, self.go_on = threading.Event(), threading.Event()

    def read(self, timeout):
        return b""

    def write(self, data):
        self.stalled.set()
        self.go_on.wait(60.0)

    def keep_to(self, peer):
        pass

    def close(self):
        self.go_on.set()


def test_a_line_that_takes_nothing_does_not_keep_the_screen_waiting():
    transport = StalledTransport()
    connection = Connection(UdpServer("127.0.0.1", 1), lambda: transport)
    try:
        assert transport.stalled.wait(60.0)
        asked = threading.Thread(target=connection.statistics, daemon=True)
        asked.start()
        asked.join(30.0)
        assert not asked.is_alive()
        assert not transport.go_on.is_set()
    finally:
        transport.go_on.set()
        connection.close()


def test_a_disk_that_takes_nothing_does_not_keep_the_screen_waiting():
    stalled, go_on = threading.Event(), threading.Event()

    class Sink:
        def add(self, unix_us, frame):
            stalled.set()
            go_on.wait(60.0)

    vehicle = FakeVehicle()
    with connect(UdpServer("127.0.0.1", 0), sinks=[Sink()]) as connection:
        client = UdpTransport(UdpClient("127.0.0.1", connection._transport.port), SystemClock())
        try:
            client.write(vehicle.heartbeat())
            assert stalled.wait(60.0)
            asked = threading.Thread(target=connection.statistics, daemon=True)
            asked.start()
            asked.join(30.0)
            assert not asked.is_alive()
        finally:
            go_on.set()
            client.close()
