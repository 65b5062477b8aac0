"""The vehicle is the same on every kind of link."""

from __future__ import annotations

import contextlib
import queue
import socket
import threading

import pytest
from pymavlink import mavutil

from magcomp.errors import AddressError, LinkError, UsageError
from magcomp.simulate import Vehicle, scenario, serve
from magcomp.simulate.transports import open_transport

WITHIN_S = 120


def free_port(kind):
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextlib.contextmanager
def served(address, **options):
    """A vehicle at an address, in a thread; gives where it is reached."""
    stop, said = threading.Event(), queue.Queue()
    vehicle = Vehicle(scenario("sweep", 1), wait_for_ground=True)

    def live():
        try:
            serve(address, vehicle, stop=stop, announce=said.put, **options)
        except Exception as error:
            said.put(error)

    thread = threading.Thread(target=live)
    thread.start()
    try:
        reached_at = said.get(timeout=WITHIN_S)
        if isinstance(reached_at, Exception):
            raise reached_at
        yield reached_at
    finally:
        stop.set()
        thread.join(WITHIN_S)
    assert not thread.is_alive()


@pytest.fixture(params=["udpout", "udp", "udpin", "tcpin", "tcp", "pty"])
def ground(request):
    """pymavlink, which knows nothing of magcomp, linked to a simulated vehicle."""
    kind = request.param
    with contextlib.ExitStack() as stack:
        if kind == "pty":
            where = stack.enter_context(served("pty", speed=10.0))
            link = mavutil.mavlink_connection(where, source_system=255)
        elif kind in ("udpout", "tcp"):
            port = free_port(socket.SOCK_DGRAM if kind == "udpout" else socket.SOCK_STREAM)
            listening = {"udpout": "udpin", "tcp": "tcpin"}[kind]
            link = mavutil.mavlink_connection(f"{listening}:127.0.0.1:{port}", source_system=255)
            stack.enter_context(served(f"{kind}:127.0.0.1:{port}", speed=10.0))
        else:
            where = stack.enter_context(served(f"{kind}:127.0.0.1:0", speed=10.0))
            link = mavutil.mavlink_connection(where, source_system=255)
        stack.callback(link.close)
        link.mav.heartbeat_send(6, 8, 0, 0, 0)
        assert link.wait_heartbeat(timeout=WITHIN_S) is not None
        yield link


class TestOnEveryTransport:
    def test_it_is_found_by_its_heartbeat(self, ground):
        heartbeat = ground.messages["HEARTBEAT"]
        assert (heartbeat.type, heartbeat.autopilot) == (2, 3)

    def test_it_gives_its_whole_parameter_list(self, ground):
        seen, count = set(), None
        for _ in range(WITHIN_S):  # a datagram that a busy computer drops is asked for again
            ground.mav.param_request_list_send(1, 1)
            while len(seen) != count:
                value = ground.recv_match(type="PARAM_VALUE", blocking=True, timeout=1.0)
                if value is None:
                    break
                seen.add(value.param_index)
                count = value.param_count
            if len(seen) == count:
                break
        assert seen == set(range(count))

    def test_it_echoes_a_set(self, ground):
        ground.mav.param_set_send(1, 1, b"COMPASS_MOT_Z", 1.25, 9)
        echo = ground.recv_match(type="PARAM_VALUE", blocking=True, timeout=WITHIN_S)
        assert (echo.param_id, echo.param_value) == ("COMPASS_MOT_Z", 1.25)

    def test_it_streams_what_is_asked_for(self, ground):
        ground.mav.command_long_send(1, 1, 511, 0, 27, 20000, 0, 0, 0, 0, 0)
        stamps = []
        while len(stamps) < 25:
            imu = ground.recv_match(type="RAW_IMU", blocking=True, timeout=WITHIN_S)
            assert imu is not None
            stamps.append(imu.time_usec)
        assert (stamps[-1] - stamps[0]) / 24 == pytest.approx(20000, rel=0.05)


def test_with_speed_its_clock_runs_faster():
    with served("udp:127.0.0.1:0", speed=20.0) as where:
        link = mavutil.mavlink_connection(where, source_system=255)
        link.mav.heartbeat_send(6, 8, 0, 0, 0)
        link.mav.command_long_send(1, 1, 511, 0, 27, 1e6, 0, 0, 0, 0, 0)
        stamps = [
            link.recv_match(type="RAW_IMU", blocking=True, timeout=WITHIN_S).time_usec
            for _ in range(20)
        ]
        link.close()
    assert stamps[-1] - stamps[0] == pytest.approx(19e6, rel=0.01)


def test_a_second_ground_station_takes_over_a_tcp_vehicle():
    with served("tcpin:127.0.0.1:0", speed=10.0) as where:
        first = mavutil.mavlink_connection(where, source_system=255)
        assert first.recv_match(type="HEARTBEAT", blocking=True, timeout=WITHIN_S)
        first.close()
        second = mavutil.mavlink_connection(where, source_system=255)
        assert second.recv_match(type="HEARTBEAT", blocking=True, timeout=WITHIN_S)
        second.close()


@pytest.mark.parametrize(
    "address", ["", "udp", "udp:127.0.0.1", "udp:127.0.0.1:x", "ftp:h:1", "tcp:h:99999", "pty:1"]
)
def test_an_address_that_is_none_is_refused_with_examples(address):
    with pytest.raises(AddressError, match=r"must look like udpout:127\.0\.0\.1:14550"):
        serve(address, Vehicle(scenario("sweep", 1)))


@pytest.mark.parametrize("scheme", ["udp", "tcpin"])
def test_a_port_in_use_is_one_sentence(scheme):
    kind = socket.SOCK_DGRAM if scheme == "udp" else socket.SOCK_STREAM
    with socket.socket(socket.AF_INET, kind) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(LinkError, match=f"127.0.0.1:{port} must be free"):
            serve(f"{scheme}:127.0.0.1:{port}", Vehicle(scenario("sweep", 1)))


def test_nobody_there_is_one_sentence():
    port = free_port(socket.SOCK_STREAM)
    with pytest.raises(LinkError, match=f"127.0.0.1:{port} must be"):
        serve(f"tcp:127.0.0.1:{port}", Vehicle(scenario("sweep", 1)))


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), float("inf")])
def test_an_impossible_speed_is_refused(speed):
    with pytest.raises(UsageError, match="speed must be greater than 0"):
        serve("udp:127.0.0.1:0", Vehicle(scenario("sweep", 1)), speed=speed)


def test_a_vehicle_that_speaks_to_one_ground_station_hears_no_other():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ground:
        ground.bind(("127.0.0.1", 0))
        port = ground.getsockname()[1]
        with contextlib.closing(open_transport(f"udpout:127.0.0.1:{port}")) as vehicle:
            vehicle.send(b"hello")
            ground.settimeout(WITHIN_S)
            _, where = ground.recvfrom(100)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
                stranger.sendto(b"arm", ("127.0.0.1", where[1]))
            ground.sendto(b"disarm", where)
            assert vehicle.wait(WITHIN_S) == b"disarm"


@pytest.mark.parametrize("address", ["udp:0", "tcpin:0"])
def test_a_listening_vehicle_is_reached_from_this_computer_only_unless_told(address):
    with contextlib.closing(open_transport(address)) as vehicle:
        assert ":127.0.0.1:" in vehicle.reached_at
