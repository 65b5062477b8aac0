"""What would be written: a whole correction, and nothing that wakes up by accident."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from once import analyse

from magcomp.analysis import Options, parameter_set
from magcomp.model import Grade, ParameterChange, ParameterHistory, Recording
from magcomp.sources import read

SWEEP = Path(__file__).parents[2] / "sitl_fixtures" / "sweep_current.tlog"


@pytest.fixture(scope="module")
def sweep() -> Recording:
    return read(SWEEP)


def with_parameters(recording: Recording, **values: float) -> Recording:
    """The recording with some parameters reported differently from the start."""
    changes = tuple(c for c in recording.parameters.changes if c.name not in values)
    added = tuple(ParameterChange(0.0, name, value) for name, value in values.items())
    return replace(recording, parameters=ParameterHistory(changes + added))


def test_every_value_is_a_float32(sweep):
    for result in analyse(sweep).compasses:
        for value in result.parameters.values():
            assert value == float(np.float32(value))


def test_a_compass_that_was_not_fitted_gets_zeros_for_a_vector_the_switch_would_wake(sweep):
    stale = with_parameters(sweep, COMPASS_MOT3_X=7.0, COMPASS_MOT3_Y=0.0, COMPASS_MOT3_Z=0.0)
    parameters = analyse(stale, Options(compass=1)).compasses[0].parameters
    assert parameters["COMPASS_MOTCT"] == 2.0
    assert [parameters[f"COMPASS_MOT3_{axis}"] for axis in "XYZ"] == [0.0, 0.0, 0.0]
    assert not any(name.startswith("COMPASS_MOT2") for name in parameters)


def test_a_compass_that_was_not_fitted_keeps_the_vector_that_is_in_force_already(sweep):
    running = with_parameters(sweep, COMPASS_MOT3_X=7.0, COMPASS_MOTCT=2.0)
    parameters = analyse(running, Options(compass=1)).compasses[0].parameters
    assert not any(name.startswith("COMPASS_MOT3") for name in parameters)


def test_names_the_vehicle_never_reported_are_not_written(sweep):
    old = replace(
        sweep,
        parameters=ParameterHistory(
            tuple(
                c
                for c in sweep.parameters.changes
                if not any(kind in c.name for kind in ("DIA", "ODI", "SCALE"))
            )
        ),
    )
    names = analyse(old).compasses[0].parameters
    assert "COMPASS_MOT_X" in names
    assert not any("DIA" in name for name in names)


def test_the_scale_in_force_stays_and_the_soft_iron_is_written_for_it(sweep):
    scaled = with_parameters(sweep, COMPASS_SCALE=1.25)
    plain = analyse(sweep).compasses[0].parameters
    parameters = analyse(scaled).compasses[0].parameters
    assert "COMPASS_SCALE" not in parameters
    assert parameters["COMPASS_DIA_X"] == pytest.approx(plain["COMPASS_DIA_X"], rel=1e-6)
    assert parameters["COMPASS_MOT_X"] == pytest.approx(plain["COMPASS_MOT_X"], rel=1e-3)


def test_a_rejected_fit_gives_no_parameters_unless_the_user_insists():
    flight = read(SWEEP.with_name("sweep_current.tlog"))
    rejected = analyse(flight, Options(compass=1, method="flight", end=30.0))
    assert rejected.grade is Grade.REJECTED
    assert parameter_set(rejected).values == {}
    insisted = parameter_set(rejected, include_rejected=True).values
    assert insisted["COMPASS_MOTCT"] == 2.0
    assert "COMPASS_OFS_X" in insisted


def test_the_switch_is_written_last_in_a_file(sweep):
    assert list(parameter_set(analyse(sweep)).values)[-1] == "COMPASS_MOTCT"
