"""Who speaks in the vehicle's name from another address is not listened to, nor written to."""

from __future__ import annotations

import threading
import time

import pytest
from link_vehicle import UNIX_US, FakeVehicle
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.errors import LinkError
from magcomp.link import Connection, StrangerHeard, connect
from magcomp.link.address import UdpClient, UdpServer
from magcomp.link.clock import SystemClock
from magcomp.link.state import MOVED_S, SETTLING_S, LinkState
from magcomp.link.udp import UdpTransport
from magcomp.mavlink.header import message_id

HERE, THERE = ("10.0.0.1", 14550), ("10.0.0.2", 40000)


def value(vehicle, number):
    return vehicle.pack(mavlink.MAVLink_param_value_message(b"COMPASS_OFS_X", number, 9, 1, 0))


def settled(**options):
    state, vehicle = LinkState(unix_us=UNIX_US, **options), FakeVehicle()
    state.receive(vehicle.tick(0.0), 0.0, HERE)
    for step in range(4):
        state.receive(vehicle.tick(step + 1.0), step + 1.0, HERE)
    assert state.settled(4.0)
    return state, vehicle


def test_a_stranger_confirms_nothing_and_is_told_of_once():
    state, vehicle = settled()
    state.take_events()
    for _ in range(3):
        (taken,) = state.receive(value(FakeVehicle(), 7.0), 4.1, THERE)
        assert (taken.from_vehicle, taken.from_stranger) == (False, True)
    assert state.take_events() == [StrangerHeard(4.1, "10.0.0.2:40000")]
    (taken,) = state.receive(value(vehicle, 1.0), 4.2, HERE)
    assert taken.from_vehicle


def test_a_stranger_can_neither_arm_nor_reboot_nor_end_a_gap():
    state, _ = settled()
    stranger = FakeVehicle(autopilot=12)
    state.due(4.0 + 4.0)
    assert state.in_gap
    state.receive(stranger.tick(8.0), 8.0, THERE)
    state.receive(stranger.pack(mavlink.MAVLink_system_time_message(0, 5)), 8.0, THERE)
    assert state.in_gap
    assert state.vehicle.autopilot == "ardupilot"
    assert state.peer == HERE


def test_a_vehicle_that_comes_back_on_another_port_is_asked_anew_who_it_is():
    state, vehicle = settled()
    later = 4.0 + MOVED_S + 0.5
    (taken,) = state.receive(value(vehicle, 1.0), later, THERE)
    assert taken.from_vehicle
    assert state.peer == THERE
    asked = {message.get_type() for message in state.due(later)}
    assert "PARAM_REQUEST_READ" in asked
    (taken,) = state.receive(value(vehicle, 1.0), later + 0.1, HERE)
    assert taken.from_stranger


def test_twins_at_two_addresses_are_ambiguous_while_it_is_not_settled():
    state = LinkState(unix_us=UNIX_US)
    state.receive(FakeVehicle().tick(0.0), 0.0, HERE)
    state.receive(FakeVehicle().tick(0.0), SETTLING_S / 2, THERE)
    assert state.ambiguous()
    assert state.has_twin


def test_what_two_peers_send_in_halves_does_not_run_together():
    state, vehicle = settled()
    ours, theirs = value(vehicle, 1.0), value(FakeVehicle(9), 2.0)
    assert state.receive(ours[:7], 5.0, HERE) == []
    assert state.receive(theirs[:5], 5.0, THERE) == []
    assert [each.from_vehicle for each in state.receive(ours[7:], 5.1, HERE)] == [True]
    assert len(state.receive(theirs[5:], 5.1, THERE)) == 1


class Two:
    """A port at which the vehicle speaks, and a stranger in its name."""

    def __init__(self):
        self.clock = SystemClock()
        self.peer = None
        self.vehicle, self.stranger = FakeVehicle(), FakeVehicle()
        self.kept_to = []
        self.turns = 0

    def read(self, _):
        self.turns += 1
        self.peer = HERE if self.turns % 2 else THERE
        if self.peer == HERE:
            return self.vehicle.tick(self.clock.monotonic())
        return value(self.stranger, 7.0)

    def write(self, data):
        self.vehicle.hear(data)

    def keep_to(self, peer):
        self.kept_to.append(peer)

    def close(self):
        pass


class Sink:
    def __init__(self):
        self.frames = []

    def add(self, _, frame):
        self.frames.append(frame)


def test_a_stranger_is_neither_recorded_nor_spoken_to():
    transport, sink = Two(), Sink()
    with Connection(UdpServer("127.0.0.1", 1), lambda: transport, system=1, sinks=[sink]) as link:
        link.wait_vehicle(60.0)
        until = transport.turns + 20
        while transport.turns < until:
            link.receive(0.01)
    assert set(transport.kept_to) == {HERE}
    assert sink.frames
    assert not any(message_id(frame) == mavlink.MAVLINK_MSG_ID_PARAM_VALUE for frame in sink.frames)


def talk(client, vehicle, stop, wrote):
    while not stop.wait(0.02):
        client.write(vehicle.tick(time.monotonic()))
        heard = client.read(0.0)
        if heard:
            wrote.append(heard)
            client.write(vehicle.hear(heard))


@pytest.mark.parametrize("system", [None, 1])
def test_of_two_twins_on_a_port_none_is_taken_or_only_one_is_written(system):
    """Without a choice the link is refused; with one, only the first is ever written to."""
    clock = SystemClock()
    with connect(UdpServer("127.0.0.1", 0), system=system) as link:
        port = link._transport.port
        stop, heard, threads = threading.Event(), ([], []), []
        clients = [UdpTransport(UdpClient("127.0.0.1", port), clock) for _ in heard]
        try:
            for client, wrote in zip(clients, heard, strict=True):
                thread = threading.Thread(
                    target=talk, args=(client, FakeVehicle(), stop, wrote), daemon=True
                )
                threads.append(thread)
                thread.start()
            if system is None:
                with pytest.raises(LinkError, match="two at different addresses say that they are"):
                    link.wait_vehicle(10.0)
                return
            link.wait_vehicle(10.0)
            for wrote in heard:
                wrote.clear()
            for _ in range(5):
                link.send(mavlink.MAVLink_param_set_message(1, 1, b"COMPASS_OFS_X", 1.0, 9))
            deadline = time.monotonic() + 10.0
            while not any(b"COMPASS_OFS_X" in each for wrote in heard for each in wrote):
                assert time.monotonic() < deadline
                time.sleep(0.02)
            assert [any(b"COMPASS_OFS_X" in each for each in wrote) for wrote in heard].count(
                True
            ) == 1
        finally:
            stop.set()
            for thread in threads:
                thread.join()
            for client in clients:
                client.close()
