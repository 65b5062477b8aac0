"""Connection strings: what users type is understood, and nothing is guessed."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from serial.tools import list_ports, list_ports_common

from magcomp.errors import AddressError, ExitCode
from magcomp.link.address import (
    Replay,
    SerialLine,
    TcpClient,
    TcpServer,
    UdpClient,
    UdpServer,
    parse_address,
    serial_ports,
)


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("udp:0.0.0.0:14550", UdpServer("0.0.0.0", 14550)),
        ("udpin:127.0.0.1:14551", UdpServer("127.0.0.1", 14551)),
        ("UDPOUT:localhost:14550", UdpClient("localhost", 14550)),
        ("tcp:192.168.4.1:5760", TcpClient("192.168.4.1", 5760)),
        ("tcpin:0.0.0.0:5760", TcpServer("0.0.0.0", 5760)),
        ("udp:14550", UdpServer("127.0.0.1", 14550)),
        ("udpin::14550", UdpServer("127.0.0.1", 14550)),
        ("127.0.0.1:14550", UdpServer("127.0.0.1", 14550)),
        ("0.0.0.0:14550", UdpServer("0.0.0.0", 14550)),
        ("[::1]:14550", UdpServer("::1", 14550)),
        (":14550", UdpServer("127.0.0.1", 14550)),
        ("tcpin:5760", TcpServer("127.0.0.1", 5760)),
        ("udp:[::1]:14550", UdpServer("::1", 14550)),
        ("/dev/ttyACM0", SerialLine("/dev/ttyACM0", 115200)),
        ("/dev/ttyUSB0,57600", SerialLine("/dev/ttyUSB0", 57600)),
        ("/dev/cu.usbmodem01", SerialLine("/dev/cu.usbmodem01", 115200)),
        (
            "/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0,921600",
            SerialLine("/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0", 921600),
        ),
        ("COM7", SerialLine("COM7", 115200)),
        ("com12,57600", SerialLine("com12", 57600)),
        (r"\\.\COM12", SerialLine(r"\\.\COM12", 115200)),
        ("flight.tlog", Replay(Path("flight.tlog"))),
        ("logs/a, b.TLOG,20x", Replay(Path("logs/a, b.TLOG"), 20.0)),
        ("  tcp:127.0.0.1:5760 ", TcpClient("127.0.0.1", 5760)),
    ],
)
def test_what_users_type_for_mavproxy_and_pymavlink_is_understood(text, address):
    assert parse_address(text) == address


@pytest.mark.parametrize(
    "text",
    [
        "",
        "14550",
        "localhost:14550",
        "127.0.0.1:0",
        "::1:14550",
        "[127.0.0.1]:14550",
        "udpout:14550",
        "tcp::5760",
        "udp:",
        "udp::",
        "udp:0",
        "udp:127.0.0.1",
        "udp:127.0.0.1:",
        "udp:127.0.0.1:0",
        "udp:127.0.0.1:70000",
        "udp:127.0.0.1:-1",
        "udp:127.0.0.1:１４",
        "tcp:::1:5760",
        "http://127.0.0.1:80",
        "ttyACM0",
        "/dev/ttyUSB0,fast",
        "/dev/ttyUSB0,",
        "/dev/ttyUSB0,0",
        "COM",
        "COM7:57600",
        "flight.tlog,fast",
        "flight.tlog,0x",
        "flight.BIN",
        "flight",
    ],
)
def test_anything_else_is_refused_with_the_text_and_an_example(text):
    with pytest.raises(AddressError) as refusal:
        parse_address(text)
    message = str(refusal.value)
    assert repr(text) in message or "replay speed" in message
    assert message.endswith(".")
    assert refusal.value.exit_code is ExitCode.USAGE


def test_a_refusal_of_something_unknown_shows_one_example_of_each_kind():
    with pytest.raises(AddressError, match=r"udp:.*udpout:.*tcp:.*/dev/tty.*COM7.*\.tlog"):
        parse_address("somewhere:14550")


def test_a_misspelt_kind_of_address_is_guessed_but_not_taken():
    with pytest.raises(AddressError, match=r"'upd:14550'\. Did you mean 'udp:14550'\?$"):
        parse_address("upd:14550")


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        (":14550", "listen for UDP from this computer only, and answer who speaks"),
        ("0.0.0.0:14550", "listen for UDP from the whole network, and answer who speaks"),
        ("udp:[::1]:14550", "from this"),
        ("udp:192.168.4.2:14550", "listen for UDP at 192.168.4.2"),
        ("tcpin:vehicle:5760", "listen for one TCP connection at vehicle"),
        ("udpout:10.0.0.1:14550", "speak first, by UDP"),
        ("tcp:10.0.0.1:5760", "connect by TCP"),
    ],
)
def test_an_address_says_what_it_means(text, meaning):
    assert meaning in parse_address(text).meaning


def test_the_baud_option_holds_where_the_address_says_none():
    assert parse_address("/dev/ttyUSB0", baud=57600) == SerialLine("/dev/ttyUSB0", 57600)
    assert parse_address("/dev/ttyUSB0,9600", baud=57600) == SerialLine("/dev/ttyUSB0", 9600)


@pytest.mark.parametrize("text", ["udp:0.0.0.0:14550", "flight.tlog"])
def test_a_baud_rate_without_a_serial_port_is_refused(text):
    with pytest.raises(AddressError, match="serial port"):
        parse_address(text, baud=57600)


def test_the_speed_option_holds_where_the_address_says_none():
    assert parse_address("a.tlog", speed=math.inf) == Replay(Path("a.tlog"), math.inf)
    with pytest.raises(AddressError, match="above 0"):
        parse_address("a.tlog", speed=0)


ADDRESSES = st.one_of(
    st.builds(
        lambda kind, host, port: kind(host, port),
        st.sampled_from([UdpServer, UdpClient, TcpClient, TcpServer]),
        st.sampled_from(["127.0.0.1", "example.org", "::1", "fe80::1"]),
        st.integers(1, 65535),
    ),
    st.builds(SerialLine, st.sampled_from(["/dev/ttyACM0", "COM3"]), st.integers(300, 3_000_000)),
    st.builds(Replay, st.just(Path("x/y.tlog")), st.sampled_from([1.0, 2.0, 0.5, 100.0])),
)


@given(ADDRESSES)
def test_an_address_written_out_is_read_back_as_itself(address):
    assert parse_address(str(address)) == address


@given(st.text() | st.from_regex(r"(udp|udpin|udpout|tcp|tcpin|COM|/dev/)[:,\w./\[\]-]*"))
def test_any_text_is_an_address_or_an_address_error(text):
    try:
        address = parse_address(text)
    except AddressError:
        return
    assert parse_address(str(address)) == address


def test_serial_ports_are_listed_with_what_is_plugged_in(monkeypatch):
    usb = list_ports_common.ListPortInfo("/dev/ttyACM0")
    usb.vid, usb.manufacturer, usb.product = 0x2DAE, "CubePilot", "CubeOrange"
    bare = list_ports_common.ListPortInfo("/dev/ttyS0")
    monkeypatch.setattr(list_ports, "comports", lambda: [bare, usb])
    ports = serial_ports()
    assert [port.device for port in ports] == ["/dev/ttyACM0", "/dev/ttyS0"]
    assert ports[0].description == "CubePilot CubeOrange"
    assert ports[1].description == ""
