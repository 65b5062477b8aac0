"""Whether what was written acts: what a PX4 shows of it, on a simulated one."""

from __future__ import annotations

import pytest

from magcomp.mavlink.version import unique_id
from magcomp.model import ParameterSet, compasses_of
from magcomp.model import Vehicle as Identity
from magcomp.simulate import LocalConnection, Vehicle, scenario
from magcomp.simulate.habits import own_number
from magcomp.simulate.parameters import DEVICE_IDS as COPTER_IDS
from magcomp.simulate.px4.sensors import DEVICE_IDS
from magcomp.writing.in_force import in_force_sentence
from magcomp.writing.plan import plan
from magcomp.writing.rows import as_float32
from magcomp.writing.writer import read_current, write


def identity(key, version, devices):
    return Identity(
        key, "copter", 1, 1, version, compasses_of(devices), uid=unique_id(own_number(1), 0)
    )


PX4 = identity("px4", "1.15.2", DEVICE_IDS)
COPTER = identity("ardupilot", "4.6.3", COPTER_IDS)
ALL = [f"CAL_MAG{n}_XOFF" for n in range(3)]


@pytest.fixture
def parked():
    return Vehicle(scenario("parked", 1), autopilot="px4")


def planned(link, vehicle, moved, by, whose=PX4):
    """A plan that moves parameters."""
    wanted = {name: as_float32(vehicle.parameters[name] + by) for name in moved}
    wanted_set = ParameterSet(wanted, whose)
    current = read_current(link, whose, wanted_set, clock=link.clock)
    return plan(current, wanted_set, whose)


def test_what_was_written_is_seen_to_act(parked, tmp_path):
    link = LocalConnection(parked)
    todo = planned(link, parked, ALL, 0.03)
    assert write(todo, link, backup=tmp_path / "b.param", clock=link.clock).good
    said = in_force_sentence(link, todo, link.clock)
    assert said.startswith("PX4 corrects its compass by what was written: within ")
    assert said.endswith(" would be 30 off") or "would be 3" in said


@pytest.mark.parametrize(
    ("moved", "by", "saying"),
    [
        (ALL, 0.03, "PX4 still corrects its compass by what it held before: restart"),
        # It may use one of the other two, which would look the same.
        (ALL[:1], 0.006, "what PX4 has in force cannot be seen: without current"),
    ],
)
def test_what_is_held_but_does_not_act_needs_a_restart(parked, moved, by, saying):
    """As after values set in the air: held, read back, and not in force."""
    link = LocalConnection(parked)
    todo = planned(link, parked, moved, by)
    parked.arm()
    for name, value in todo.new.items():
        parked.firmware.hold(name, value)
    link.receive(2.0)
    parked.advance(link.clock() + 3.0)
    parked.disarm()
    later = LocalConnection(parked, link.clock() + 4.0)
    assert in_force_sentence(later, todo, later.clock).startswith(saying)


def test_what_makes_no_difference_at_rest_is_not_claimed_to_be_seen(parked, tmp_path):
    link = LocalConnection(parked)
    todo = planned(link, parked, [f"CAL_MAG{n}_XCOMP" for n in range(3)], 0.5)
    assert write(todo, link, backup=tmp_path / "b.param", clock=link.clock).good
    assert "too little difference to be seen" in in_force_sentence(link, todo, link.clock)


def test_a_compass_whose_values_were_left_says_nothing_of_one_whose_were_not(parked, tmp_path):
    """While it is wrong, what is seen is of the one; put right, it may be of any of them."""
    link, said = LocalConnection(parked), []
    for by in (0.03, -0.03):
        todo = planned(link, parked, ALL[:1], by)
        backup = tmp_path / f"{by}.param"
        assert write(todo, link, backup=backup, clock=link.clock).good
        said.append(in_force_sentence(link, todo, link.clock))
    assert said[0].startswith("PX4 corrects its compass by what was written: within ")
    assert said[1].startswith("PX4 corrects its compass as written, within ")
    assert said[1].endswith("only in a compass that it may not use")


def test_the_streams_are_given_back(parked, tmp_path):
    link = LocalConnection(parked)
    todo = planned(link, parked, ALL, 0.03)
    in_force_sentence(link, todo, link.clock)
    until, names = link.clock() + 3.0, set()
    while link.clock() < until:
        message = link.receive(0.2)
        names.add(None if message is None else message.get_type())
    assert "ATTITUDE" in names
    assert not names & {"SCALED_IMU", "HIGHRES_IMU"}


def test_of_a_firmware_whose_readings_say_it_nothing_is_asked():
    vehicle = Vehicle(scenario("parked", 1))
    link = LocalConnection(vehicle)
    todo = planned(link, vehicle, ["COMPASS_OFS_X"], 30.0, COPTER)
    assert in_force_sentence(link, todo, link.clock) == ""
