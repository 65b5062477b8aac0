"""Every transport keeps the same promises: the same tests run on each."""

from __future__ import annotations

import os
import pty
import socket
import time
import tty

import pytest
from link_vehicle import free_port

from magcomp.errors import ExitCode, LinkError
from magcomp.link.address import SerialLine, TcpClient, TcpServer, UdpClient, UdpServer
from magcomp.link.clock import SystemClock
from magcomp.link.opening import open_transport
from magcomp.link.serial_port import SerialTransport
from magcomp.link.tcp import TcpTransport
from magcomp.link.transport import TransportClosedError
from magcomp.link.udp import UdpTransport

CLOCK = SystemClock()
EVERY_BYTE = bytes(range(256)) * 3


class Terminal:
    """The far end of a pseudo-terminal, with the manners of a transport."""

    def __init__(self) -> None:
        self.master, slave = pty.openpty()
        tty.setraw(slave)
        self.path = os.ttyname(slave)
        self._slave = slave

    def connected(self) -> None:
        os.close(self._slave)

    def read(self, timeout: float) -> bytes:
        return os.read(self.master, 65536)

    def write(self, data: bytes) -> None:
        os.write(self.master, data)

    def close(self) -> None:
        if self.master >= 0:
            os.close(self.master)
            self.master = -1


def udp_pair(*, listening):
    server = UdpTransport(UdpServer("127.0.0.1", 0), CLOCK)
    client = UdpTransport(UdpClient("127.0.0.1", server.port), CLOCK)
    return (server, client) if listening else (client, server)


def tcp_pair(*, listening):
    port = free_port()
    server = TcpTransport(TcpServer("127.0.0.1", port), CLOCK)
    client = TcpTransport(TcpClient("127.0.0.1", port), CLOCK)
    return (server, client) if listening else (client, server)


def terminal_pair():
    terminal = Terminal()
    ours = SerialTransport(SerialLine(terminal.path), CLOCK)
    terminal.connected()
    return ours, terminal


PAIRS = {
    "udp": lambda: udp_pair(listening=True),
    "udpout": lambda: udp_pair(listening=False),
    "tcp": lambda: tcp_pair(listening=False),
    "tcpin": lambda: tcp_pair(listening=True),
    "serial": terminal_pair,
}
SPEAK_FIRST = ("udpout", "tcp")
STREAMS = ("tcp", "tcpin", "serial")


@pytest.fixture
def pair(request):
    ours, theirs = PAIRS[request.param]()
    # Whoever listens knows nobody until somebody speaks.
    first, second = (ours, theirs) if request.param in SPEAK_FIRST else (theirs, ours)
    first.write(b"hello")
    heard = collect(second, 5)
    second.write(b"hi")
    answered = collect(first, 2)
    yield ours, theirs
    ours.close()
    theirs.close()
    assert (heard, answered) == (b"hello", b"hi")


def collect(transport, size):
    data = b""
    deadline = time.monotonic() + 5
    while len(data) < size and time.monotonic() < deadline:
        data += transport.read(0.5)
    return data


@pytest.mark.parametrize("pair", PAIRS, indirect=True)
class TestEveryTransport:
    def test_gives_bytes_as_they_were_sent(self, pair):
        ours, theirs = pair
        theirs.write(EVERY_BYTE)
        assert collect(ours, len(EVERY_BYTE)) == EVERY_BYTE

    def test_sends_bytes_as_they_were_given(self, pair):
        ours, theirs = pair
        ours.write(EVERY_BYTE)
        assert collect(theirs, len(EVERY_BYTE)) == EVERY_BYTE

    def test_keeps_the_order_of_what_comes(self, pair):
        ours, theirs = pair
        for number in range(100):
            theirs.write(number.to_bytes(2))
        assert collect(ours, 200) == b"".join(number.to_bytes(2) for number in range(100))

    def test_gives_nothing_when_nothing_came_in_time(self, pair):
        ours, _ = pair
        assert ours.read(0.01) == b""

    def test_may_be_closed_twice(self, pair):
        ours, _ = pair
        ours.close()
        ours.close()

    def test_reading_after_close_says_that_it_is_closed(self, pair):
        ours, _ = pair
        ours.close()
        with pytest.raises(TransportClosedError):
            ours.read(0.01)

    def test_writing_after_close_says_that_it_is_closed(self, pair):
        ours, _ = pair
        ours.close()
        with pytest.raises(TransportClosedError):
            ours.write(b"x")


@pytest.mark.parametrize("pair", STREAMS, indirect=True)
def test_a_stream_whose_other_end_leaves_says_so(pair):
    ours, theirs = pair
    theirs.close()
    with pytest.raises(TransportClosedError) as gone:
        collect(ours, 1)
    assert gone.value.exit_code is ExitCode.LINK


def test_udp_outlives_a_peer_that_leaves_and_answers_the_next():
    ours, theirs = udp_pair(listening=True)
    theirs.write(b"first")
    assert collect(ours, 5) == b"first"
    theirs.close()
    ours.write(b"into the void")
    ours.read(0.01)
    successor = UdpTransport(UdpClient("127.0.0.1", ours.port), CLOCK)
    successor.write(b"next")
    assert collect(ours, 4) == b"next"
    ours.write(b"welcome")
    assert collect(successor, 7) == b"welcome"
    ours.close()
    successor.close()


def test_udp_answers_every_peer_that_spoke():
    ours, first = udp_pair(listening=True)
    second = UdpTransport(UdpClient("127.0.0.1", ours.port), CLOCK)
    first.write(b"1")
    second.write(b"2")
    assert sorted(collect(ours, 2)) == sorted(b"12")
    ours.write(b"both")
    assert collect(first, 4) == collect(second, 4) == b"both"
    for transport in (ours, first, second):
        transport.close()


def test_udp_speaking_first_waits_for_a_vehicle_that_is_not_there_yet():
    port = free_port(socket.SOCK_DGRAM)
    ours = UdpTransport(UdpClient("127.0.0.1", port), CLOCK)
    ours.write(b"anyone?")
    assert ours.read(0.05) == b""
    ours.write(b"anyone?")
    vehicle = UdpTransport(UdpServer("127.0.0.1", port), CLOCK)
    ours.write(b"now?")
    assert collect(vehicle, 4) == b"now?"
    ours.close()
    vehicle.close()


@pytest.mark.parametrize("kind", [UdpServer, TcpServer])
def test_what_is_written_before_anybody_spoke_is_lost_without_harm(kind):
    ours = open_transport(kind("127.0.0.1", free_port()), CLOCK)
    ours.write(b"nobody hears this")
    assert ours.read(0.01) == b""
    ours.close()


@pytest.mark.parametrize("kind", [UdpServer, TcpServer])
def test_a_port_in_use_is_refused_in_one_sentence(kind):
    type_ = socket.SOCK_DGRAM if kind is UdpServer else socket.SOCK_STREAM
    address = kind("127.0.0.1", free_port(type_))
    first = open_transport(address, CLOCK)
    with pytest.raises(LinkError, match=r"its port is in use") as refusal:
        open_transport(address, CLOCK)
    assert str(address) in str(refusal.value)
    assert refusal.value.exit_code is ExitCode.LINK
    first.close()


def test_a_tcp_port_where_nothing_listens_is_refused():
    with pytest.raises(LinkError, match="nothing listens there"):
        open_transport(TcpClient("127.0.0.1", free_port()), CLOCK)


@pytest.mark.parametrize("kind", [UdpServer, UdpClient, TcpClient, TcpServer])
def test_a_host_that_does_not_exist_is_named(kind):
    with pytest.raises(LinkError, match=r"'no-such-host\.invalid' cannot be found"):
        open_transport(kind("no-such-host.invalid", 14550), CLOCK)


@pytest.mark.parametrize("kind", [UdpServer, TcpServer])
def test_listening_on_another_computers_address_is_refused(kind):
    with pytest.raises(LinkError, match=r"does not have that address"):
        open_transport(kind("192.0.2.1", 14550), CLOCK)


def test_a_serial_port_that_is_not_there_is_refused():
    with pytest.raises(LinkError, match=r"/dev/ttyACM99 .* no such serial port"):
        open_transport(SerialLine("/dev/ttyACM99"), CLOCK)


def test_a_file_that_is_no_serial_port_is_refused():
    with pytest.raises(LinkError, match=r"/dev/null .* not a serial port"):
        open_transport(SerialLine("/dev/null"), CLOCK)


def test_a_serial_port_another_program_has_is_refused():
    ours, terminal = terminal_pair()
    with pytest.raises(LinkError, match="another program is using it"):
        SerialTransport(SerialLine(terminal.path), CLOCK)
    ours.close()
    terminal.close()
