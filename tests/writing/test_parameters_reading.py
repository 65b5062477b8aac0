"""Reading parameters over a link that loses, repeats and reorders."""

from __future__ import annotations

from typing import Any

import pytest
from fake_autopilot import OLD, QUAD, FakeAutopilot, FakeLink, Network, VirtualClock
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.errors import LinkTimeoutError
from magcomp.mavlink.parameters import Encoding, ParamValue
from magcomp.writing.messages import (
    BootTime,
    Heard,
    Heartbeat,
    ParamRefused,
    Peer,
    ReadAll,
    SetValue,
    decode,
    encode,
)
from magcomp.writing.reader import ParameterReader, ReadProgress
from magcomp.writing.writer import fetch


def linked(network: Network | None = None) -> tuple[FakeAutopilot, FakeLink, VirtualClock]:
    autopilot, clock = FakeAutopilot(OLD), VirtualClock()
    return autopilot, FakeLink(autopilot, clock, network), clock


def listed(autopilot: FakeAutopilot) -> dict[str, float]:
    return {name: autopilot.values[name] for name in autopilot.listed()}


def test_the_whole_list_comes_in_order_and_progress_is_told() -> None:
    autopilot, link, clock = linked()
    told: list[ReadProgress] = []
    assert fetch(link, QUAD, clock=clock, on_event=told.append) == listed(autopilot)
    count = len(autopilot.listed())
    assert told[-1] == ReadProgress(count, count)
    assert [event.done for event in told] == sorted(event.done for event in told)


@pytest.mark.parametrize("seed", range(6))
def test_the_whole_list_survives_thirty_per_cent_loss_each_way(seed: int) -> None:
    network = Network(0.3, 0.1, latency=0.2, jitter=0.3, seed=seed)
    autopilot, link, clock = linked(network)
    autopilot.values.update({f"MORE_{n:04d}": float(n) for n in range(1000)})
    assert fetch(link, QUAD, clock=clock) == listed(autopilot)


def test_parameters_that_show_on_the_way_are_read_too() -> None:
    autopilot, link, clock = linked(Network(loss=0.3, latency=0.05))

    def enable(number: int) -> None:
        if number == 30:
            autopilot.values["COMPASS_PMOT_EN"] = 1.0

    link.before_message = enable
    values = fetch(link, QUAD, clock=clock)
    assert values == listed(autopilot)
    assert "COMPASS_PMOT1_X" in values


def test_a_list_that_never_stops_changing_is_given_up() -> None:
    reader, now = ParameterReader(now=0.0), 0.0
    while not reader.finished and now < 100.0:
        reader.poll(now)
        reader.handle(ParamValue("A", 1.0, count=2, index=0), now)
        reader.handle(ParamValue("A", 1.0, count=3, index=0), now)
        now += 1.0
    assert reader.failure == "the vehicle's parameter list keeps changing"


def test_an_echo_renews_a_value_and_fills_no_place() -> None:
    reader = ParameterReader(now=0.0)
    assert reader.poll(0.0)[1] == [ReadAll()]
    reader.handle(ParamValue("A", 1.0, count=2, index=0), 0.1)
    reader.handle(ParamValue("A", 5.0, count=2), 0.2)
    reader.handle(ParamValue("B", 7.0, count=2), 0.2)
    assert not reader.finished
    reader.handle(ParamValue("B", 2.0, count=2, index=1), 0.3)
    assert reader.finished
    assert reader.values == {"A": 5.0, "B": 2.0}


@pytest.mark.parametrize("seed", range(6))
def test_named_parameters_are_read_and_unknown_ones_are_missing(seed: int) -> None:
    _, link, clock = linked(Network(loss=0.3, latency=0.1, seed=seed))
    values = fetch(link, QUAD, [*OLD, "COMPASS_MOT4_X"], clock=clock)
    assert values == OLD


def test_on_a_good_link_an_unknown_name_costs_seconds_not_minutes() -> None:
    _, link, clock = linked()
    begin = clock.now
    assert fetch(link, QUAD, [*OLD, "COMPASS_MOT4_X"], clock=clock) == OLD
    assert clock.now - begin < 6.0


def test_a_vehicle_that_says_so_makes_a_name_missing_at_once() -> None:
    autopilot, link, clock = linked()
    autopilot.reports_errors = True
    begin = clock.now
    assert fetch(link, QUAD, [*OLD, "COMPASS_MOT4_X"], clock=clock) == OLD
    assert clock.now - begin < 0.5


def test_hidden_parameters_can_be_read_by_name() -> None:
    _, link, clock = linked()
    assert fetch(link, QUAD, ["COMPASS_PMOT1_X"], clock=clock) == {"COMPASS_PMOT1_X": 0.0}


def test_no_names_are_read_at_once() -> None:
    _, link, clock = linked()
    assert fetch(link, QUAD, [], clock=clock) == {}


@pytest.mark.parametrize("names", [None, ["COMPASS_MOTCT"]])
def test_a_dead_link_is_one_sentence(names: list[str] | None) -> None:
    _, link, clock = linked()
    link.dead = True
    with pytest.raises(LinkTimeoutError, match=r"system 1 .* nothing was heard for 10 s"):
        fetch(link, QUAD, names, clock=clock)


def test_a_vehicle_without_parameters_is_one_sentence() -> None:
    autopilot, link, clock = linked()
    autopilot.answer = lambda *_: []
    with pytest.raises(LinkTimeoutError, match="does not send its parameter list"):
        fetch(link, QUAD, clock=clock)
    begun = clock()
    with pytest.raises(
        LinkTimeoutError,
        match=r"no parameter request \(with SYSID_ENFORCE on.*--source-system; .*--signing-key",
    ):
        fetch(link, QUAD, ["COMPASS_MOTCT"], clock=clock)
    assert clock() - begun < 10.0


names = st.sampled_from(["A", "B", "C"])
incoming = st.one_of(
    st.builds(
        ParamValue,
        names | st.text(),
        st.floats(),
        st.integers(0, 255),
        st.integers(0, 4),
        st.integers(0, 4) | st.just(65535),
    ),
    st.builds(ParamRefused, names, st.text()),
    st.just(Heard()),
    st.just(Heartbeat(True)),
    st.builds(BootTime, st.floats(0, 10)),
)


@given(
    st.sampled_from([None, ["A", "B"], []]),
    st.lists(st.tuples(incoming | st.none(), st.floats(0, 3)), max_size=80),
)
def test_arbitrary_messages_are_taken_and_nothing_is_written(
    wanted: list[str] | None, steps: list[tuple[Any, float]]
) -> None:
    now = 0.0
    reader = ParameterReader(wanted, now=now)
    for message, wait in steps:
        now += wait
        if message is not None:
            reader.handle(message, now)
        _, outgoing = reader.poll(now)
        assert not any(isinstance(sent, SetValue) for sent in outgoing)
    if reader.failure:
        assert reader.finished


ARDUPILOT, PX4 = Peer(1, 1), Peer(1, 1, encoding=Encoding.BYTEWISE)


def over_the_wire(message: Any, system: int = 1, component: int = 1) -> Any:
    sender = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
    return mavlink.MAVLink(None).parse_buffer(message.pack(sender))[0]


@given(st.integers(-(2**22), 0x7F800000))
def test_px4_carries_integers_as_bytes(value: int) -> None:
    sent = over_the_wire(encode(SetValue("CAL_MAG0_ID", float(value), 6), PX4))
    echo = mavlink.MAVLink_param_value_message(b"CAL_MAG0_ID", sent.param_value, 6, 9, 65535)
    assert decode(over_the_wire(echo), PX4) == ParamValue("CAL_MAG0_ID", float(value), 6, 9)


def test_a_name_of_sixteen_characters_survives_the_wire() -> None:
    sent = over_the_wire(encode(SetValue("ABCDEFGHIJKLMNOP", 0.1), ARDUPILOT))
    assert (sent.param_id, sent.target_system, sent.target_component) == ("ABCDEFGHIJKLMNOP", 1, 1)


@pytest.mark.parametrize(
    ("message", "meaning"),
    [
        (mavlink.MAVLink_heartbeat_message(2, 3, 209, 0, 4, 3), Heartbeat(True)),
        (mavlink.MAVLink_heartbeat_message(2, 3, 81, 0, 4, 3), Heartbeat(False)),
        (mavlink.MAVLink_attitude_message(1500, 0, 0, 0, 0, 0, 0), BootTime(1.5)),
        (mavlink.MAVLink_vfr_hud_message(0, 0, 0, 0, 0, 0), Heard()),
        (mavlink.MAVLink_statustext_message(6, b"EKF3 IMU0 is using GPS"), Heard()),
        (
            mavlink.MAVLink_statustext_message(4, b"Param write denied (SYSID_SW_TYPE)"),
            ParamRefused("SYSID_SW_TYPE", "it is read-only"),
        ),
    ],
)
def test_what_the_vehicle_says_is_understood(message: Any, meaning: object) -> None:
    assert decode(over_the_wire(message), ARDUPILOT) == meaning
    assert decode(over_the_wire(message, component=190), ARDUPILOT) is None
    assert decode(over_the_wire(message, system=2), ARDUPILOT) is None
