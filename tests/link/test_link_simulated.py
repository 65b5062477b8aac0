"""The link against the simulated ArduCopter, which was written from the other end."""

from __future__ import annotations

import contextlib
import threading

import numpy as np
import pytest
from link_vehicle import free_port

from magcomp.buffer import Buffer
from magcomp.link import Recorder, connect
from magcomp.link.address import UdpServer, parse_address
from magcomp.simulate import Faults, Vehicle, scenario, serve
from magcomp.sources import read_tlog

KEY = bytes(range(32))
DEVICE_IDS = (97539, 131874, 263178)
PATIENCE_S = 60.0


@contextlib.contextmanager
def simulated(address, vehicle=None, **options):
    """A simulated vehicle in a thread; gives the address a ground station needs."""
    ready, stop, reached = threading.Event(), threading.Event(), []

    def announce(where):
        reached.append(where)
        ready.set()

    vehicle = vehicle or Vehicle(scenario("flight", 4))
    live = threading.Thread(
        target=serve,
        args=(address, vehicle),
        kwargs={"announce": announce, "stop": stop, **options},
    )
    live.start()
    assert ready.wait(PATIENCE_S)
    try:
        yield reached[0]
    finally:
        stop.set()
        live.join()


def fly(link, seconds):
    """Receive until the vehicle's own clock has gone on by ``seconds``."""
    began = None
    while True:
        message = link.receive(PATIENCE_S)
        assert message is not None
        if message.get_type() == "ATTITUDE":
            began = message.time_boot_ms if began is None else began
            if message.time_boot_ms >= began + seconds * 1000:
                return


@pytest.mark.parametrize("kind", ["udp", "tcpin", "pty"])
def test_over_every_transport_it_is_found_and_streams_what_a_fit_needs(kind):
    address = kind if kind == "pty" else f"{kind}:127.0.0.1:{free_port()}"
    with simulated(address, speed=5.0) as reached:
        where = parse_address(reached if kind == "pty" else reached.replace("tcpin:", "tcp:"))
        with connect(where, system=1) as link:
            assert link.wait_vehicle(PATIENCE_S).device_ids == DEVICE_IDS
            assert link.request_streams(timeout=PATIENCE_S).complete
            fly(link, 5.0)
            assert {"RAW_IMU", "SCALED_IMU2", "SCALED_IMU3", "ATTITUDE", "VFR_HUD"} <= set(
                link.statistics().rates
            )


def test_no_sample_is_lost_between_the_air_the_file_and_the_buffer(tmp_path):
    path, buffer = tmp_path / "flight.tlog", Buffer("live")
    address = UdpServer("127.0.0.1", free_port())
    with (
        Recorder(path) as recorder,
        connect(address, system=1, sinks=[recorder, buffer]) as link,
        simulated(f"udpout:127.0.0.1:{address.port}", speed=5.0),
    ):
        link.wait_vehicle(PATIENCE_S)
        link.request_streams(timeout=PATIENCE_S)
        fly(link, 15.0)
        assert link.statistics().lost == 0
    live, logged = buffer.snapshot(), read_tlog(path)
    assert len(logged.field[1]) >= 15 * 50
    for compass in (1, 2, 3):
        np.testing.assert_array_equal(live.field[compass].time, logged.field[compass].time)
        np.testing.assert_array_equal(live.field[compass].value, logged.field[compass].value)
    np.testing.assert_array_equal(live.attitude.value, logged.attitude.value)
    assert live.parameters == logged.parameters


def test_a_third_of_all_frames_may_be_lost_each_way():
    address = UdpServer("127.0.0.1", free_port())
    with (
        connect(address, system=1) as link,
        simulated(f"udpout:127.0.0.1:{address.port}", faults=Faults(loss=0.3)),
    ):
        link.wait_vehicle(PATIENCE_S)
        assert link.request_streams({"ATTITUDE": 50.0}, PATIENCE_S).complete
        fly(link, 2.0)
        while link.vehicle.device_ids != DEVICE_IDS:  # asked for until it is answered
            assert link.receive(PATIENCE_S) is not None
        assert 0.15 < link.statistics().loss < 0.45


def test_a_signed_vehicle_is_understood_with_its_key_only():
    address = UdpServer("127.0.0.1", free_port())
    signed = Vehicle(scenario("flight", 4), signing_key=KEY)
    with (
        connect(address, system=1, key=KEY) as link,
        simulated(f"udpout:127.0.0.1:{address.port}", signed),
    ):
        vehicle = link.wait_vehicle(PATIENCE_S)
        statistics = link.statistics()
    assert vehicle.device_ids == DEVICE_IDS
    assert statistics.signed == statistics.frames > 0
