"""The client that writes real vehicles writes the simulated one, whatever goes wrong."""

from __future__ import annotations

import pytest

from magcomp.model import ParameterSet, compasses_of
from magcomp.model import Vehicle as Identity
from magcomp.simulate import Faults, FaultyLink, LocalConnection, Vehicle, scenario
from magcomp.writing import writer
from magcomp.writing.events import Standing
from magcomp.writing.exchange import Timing
from magcomp.writing.plan import plan

NAMES = [
    f"COMPASS_{kind}{compass}_{axis}"
    for compass in ("", "2", "3")
    for kind in ("OFS", "DIA", "ODI", "MOT")
    for axis in "XYZ"
]
IDENTITY = Identity("ardupilot", "copter", 1, 1, "4.6.3", compasses_of((97539, 131874, 263178)))


def parked():
    return Vehicle(scenario("parked", 1, compensation="wrong"))


def wanted_of(vehicle):
    """Another calibration for all three compasses, by throttle instead of current."""
    new = {name: vehicle.parameters[name] + 0.0625 for name in NAMES}
    return ParameterSet({**new, "COMPASS_MOTCT": 1.0}, IDENTITY)


def written(vehicle, faults, folder):
    """Write through a bad link; what the writer says, and how many messages that took."""
    wanted = wanted_of(vehicle)
    calm = LocalConnection(vehicle)
    current = writer.read_current(calm, IDENTITY, wanted, clock=calm.clock)
    link = FaultyLink(vehicle, faults)
    connection = LocalConnection(link, calm.clock())
    outcome = writer.write(
        plan(current, wanted, IDENTITY),
        connection,
        backup=folder / "backup.param",
        clock=connection.clock,
    )
    return outcome, link.counted, connection.clock() - calm.clock()


def held(vehicle):
    return {name: vehicle.parameters[name] for name in (*NAMES, "COMPASS_MOTCT")}


def test_without_faults_writing_adds_less_than_two_seconds_to_the_waits_for_storage(tmp_path):
    vehicle = parked()
    new = dict(wanted_of(vehicle).values)
    outcome, _, seconds = written(vehicle, Faults(), tmp_path)
    assert outcome.standing is Standing.NEW
    assert held(vehicle) == pytest.approx(new, rel=1e-6)
    assert seconds < 3 * Timing().storing + 2.0


@pytest.mark.parametrize(
    "faults",
    [
        Faults(loss=0.3, latency_s=0.2),
        Faults(duplication=0.3, reordering=0.3),
        Faults(corruption=0.2, latency_s=0.05),
    ],
)
def test_a_bad_link_only_takes_longer(tmp_path, faults):
    vehicle = parked()
    new = dict(wanted_of(vehicle).values)
    outcome, _, _ = written(vehicle, faults, tmp_path)
    assert outcome.standing is Standing.NEW
    assert held(vehicle) == pytest.approx(new, rel=1e-6)


@pytest.mark.parametrize("fault", ["dead_at", "reboot_at"])
def test_wherever_the_link_dies_or_the_vehicle_reboots_no_half_calibration_is_in_force(
    tmp_path, fault
):
    _, messages, _ = written(parked(), Faults(), tmp_path)
    assert messages > 100
    for number in range(1, messages + 1, 23):
        vehicle = parked()
        old, new = held(vehicle), dict(wanted_of(vehicle).values)
        folder = tmp_path / str(number)
        folder.mkdir()
        written(vehicle, Faults(**{fault: number}), folder)
        now = held(vehicle)
        consistent = now == pytest.approx(old) or now == pytest.approx(new)
        assert consistent or now["COMPASS_MOTCT"] == 0.0, number
