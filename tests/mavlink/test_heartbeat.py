"""Who a heartbeat is from: every type, every component, live and in a file."""

from __future__ import annotations

import pytest
from link_vehicle import FakeVehicle
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.errors import ChooseVehicleError, LogError
from magcomp.link.state import LinkState
from magcomp.mavlink.heartbeat import Identity, identify, is_armed, is_vehicle, vehicles
from magcomp.mavlink.records import record
from magcomp.sources.assemble import recording_from_bytes
from magcomp.sources.vehicles import Choice

STAMP_US = 1_700_000_000_000_000
ARDUPILOT, PX4 = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_AUTOPILOT_PX4
QUADROTOR = mavlink.MAV_TYPE_QUADROTOR
TYPES = {
    number: entry.name.removeprefix("MAV_TYPE_")
    for number, entry in mavlink.enums["MAV_TYPE"].items()
    if not entry.name.endswith("ENUM_END")
}
KINDS = {
    "copter": """QUADROTOR COAXIAL HELICOPTER HEXAROTOR OCTOROTOR TRICOPTER DODECAROTOR DECAROTOR
        GENERIC_MULTIROTOR""",
    "plane": """FIXED_WING VTOL_DUOROTOR VTOL_QUADROTOR VTOL_TILTROTOR VTOL_RESERVED2 VTOL_RESERVED3
        VTOL_RESERVED4 VTOL_RESERVED5 VTOL_GYRODYNE""",
    "rover": "GROUND_ROVER",
    "boat": "SURFACE_BOAT",
    "sub": "SUBMARINE",
    "unknown": """GENERIC AIRSHIP FREE_BALLOON ROCKET FLAPPING_WING KITE PARAFOIL SPACECRAFT_ORBITER
        GROUND_QUADRUPED""",
}
KIND_OF = {name: kind for kind, names in KINDS.items() for name in names.split()}
COMPONENTS = [
    number
    for number, entry in mavlink.enums["MAV_COMPONENT"].items()
    if not entry.name.endswith("ENUM_END")
]


def in_a_file(heartbeats: bytes, **choice: int) -> Identity | None:
    """The vehicle a log of one frame is of."""
    try:
        vehicle = recording_from_bytes(
            record(STAMP_US, heartbeats), "x.tlog", Choice(**choice)
        ).vehicle
    except (LogError, ChooseVehicleError):
        return None
    return Identity(vehicle.system, vehicle.component, vehicle.autopilot, vehicle.kind)


def live(heartbeat: bytes, **choice: int) -> Identity | None:
    """The vehicle a link with one frame is to."""
    state = LinkState(**choice)
    state.receive(heartbeat, 0.0)
    vehicle = state.vehicle
    if vehicle is None:
        return None
    return Identity(vehicle.system, vehicle.component, vehicle.autopilot, vehicle.kind)


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
@pytest.mark.parametrize("mav_type", TYPES, ids=TYPES.get)
def test_only_what_moves_by_itself_is_a_vehicle(mav_type: int, autopilot: int) -> None:
    kind = KIND_OF.get(TYPES[mav_type])
    name = {ARDUPILOT: "ardupilot", PX4: "px4"}[autopilot]
    expected = None if kind is None else Identity(3, 1, name, kind)
    heartbeat = FakeVehicle(3, 1, autopilot=autopilot, kind=mav_type).heartbeat()
    assert identify(3, 1, mav_type, autopilot) == expected
    assert in_a_file(heartbeat) == expected
    assert live(heartbeat) == expected


@pytest.mark.parametrize("autopilot", sorted(set(range(20)) - {ARDUPILOT, PX4}))
def test_other_autopilots_are_not_known(autopilot: int) -> None:
    heartbeat = FakeVehicle(autopilot=autopilot).heartbeat()
    assert in_a_file(heartbeat) is live(heartbeat) is None


@pytest.mark.parametrize("component", COMPONENTS)
def test_only_an_autopilots_component_is_a_vehicle_unless_another_is_chosen(
    component: int,
) -> None:
    heartbeat = FakeVehicle(1, component).heartbeat()
    expected = Identity(1, component, "ardupilot", "copter")
    usual = expected if component == 1 else None
    assert in_a_file(heartbeat) == live(heartbeat) == usual
    assert in_a_file(heartbeat, component=component) == expected
    assert live(heartbeat, component=component) == expected
    other = component % 255 + 1
    assert in_a_file(heartbeat, component=other) is live(heartbeat, component=other) is None


@pytest.mark.parametrize("mav_type", [18, 26, 30], ids=TYPES.get)
@pytest.mark.parametrize("component", [1, 100, 154, 191])
def test_a_payload_beside_the_vehicle_is_never_taken_for_it(mav_type: int, component: int) -> None:
    payload = FakeVehicle(1, component, kind=mav_type).heartbeat()
    vehicle = FakeVehicle(1, 1).heartbeat()
    expected = Identity(1, 1, "ardupilot", "copter")
    data = record(STAMP_US, payload) + record(STAMP_US + 1, vehicle) + record(STAMP_US + 2, payload)
    found = recording_from_bytes(data, "x.tlog").vehicle
    assert (found.system, found.component, found.kind) == (1, 1, "copter")
    assert live(payload + vehicle + payload) == expected


def test_a_component_can_be_chosen_beside_the_usual_one() -> None:
    both = [FakeVehicle(1, 1).heartbeat(), FakeVehicle(1, 50, autopilot=PX4).heartbeat()]
    data = b"".join(record(STAMP_US + n, frame) for n, frame in enumerate(both))
    for component, autopilot in ((1, "ardupilot"), (50, "px4")):
        found = recording_from_bytes(data, "x.tlog", Choice(component=component)).vehicle
        assert (found.component, found.autopilot) == (component, autopilot)
        chosen = live(b"".join(both), component=component)
        assert chosen == Identity(1, component, autopilot, "copter")


def test_a_log_of_a_companion_alone_names_the_option_that_takes_it() -> None:
    data = record(STAMP_US, FakeVehicle(1, 191).heartbeat())
    with pytest.raises(LogError, match="--component 191"):
        recording_from_bytes(data, "x.tlog")
    with pytest.raises(ChooseVehicleError, match="holds component 191; instead received 7"):
        recording_from_bytes(data, "x.tlog", Choice(component=7))


def test_a_link_remembers_who_only_said_it_was_an_autopilot() -> None:
    state = LinkState()
    state.receive(FakeVehicle(1, 191).heartbeat(), 0.0)
    assert [(i.system, i.component) for i in state.companions] == [(1, 191)]
    assert state.heartbeats == ()


def test_the_last_thing_a_component_said_it_was_counts() -> None:
    said = [FakeVehicle(kind=kind).heartbeat() for kind in (0, 1, QUADROTOR, 6)]
    data = b"".join(record(STAMP_US + n, frame) for n, frame in enumerate(said))
    assert recording_from_bytes(data, "x.tlog").vehicle.kind == "copter"


def test_vehicles_come_in_order_and_only_those_asked_for() -> None:
    found = [Identity(s, c, "px4", "copter") for s, c in ((9, 1), (2, 1), (2, 30), (5, 1))]
    assert [i.system for i in vehicles(found, None, None)] == [2, 5, 9]
    assert vehicles(found, 5, None) == (found[3],)
    assert vehicles(found, 2, 30) == (found[2],)
    assert vehicles(found, 9, 30) == ()
    assert not is_vehicle(found[2], None)


@pytest.mark.parametrize("mode", range(256))
def test_armed_is_one_bit_of_the_mode(mode: int) -> None:
    assert is_armed(mode) == bool(mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
