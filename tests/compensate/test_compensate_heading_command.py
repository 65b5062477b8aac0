"""``magcomp heading``: raw, corrected and fused heading of a log, and the error of each."""

import json
from dataclasses import replace

import numpy as np
import pytest
from logs_made_of_logs import COMPASSES as GYRO
from logs_made_of_logs import CURRENT, SWEEP, THROTTLE, frames, write
from once import analyse
from truth import FIXTURES
from unequal import VECTORS, Unequal

from magcomp import autopilots
from magcomp.analysis import Options
from magcomp.cli.app import run
from magcomp.compensate import Tuning, track
from magcomp.errors import MissingDataError
from magcomp.experiments.motion import accuracy
from magcomp.geometry import wrap_angle
from magcomp.sources import read
from magcomp.sources.truth import read_truth

FLIGHT = str(FIXTURES / "flight.tlog")

pytestmark = pytest.mark.usefixtures("fits_once")


def document(capsys, *arguments):
    assert run(["heading", *arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.fixture(scope="module")
def parameters(tmp_path_factory):
    """The parameter file of the flight's own fit."""
    path = tmp_path_factory.mktemp("fitted") / "compass.param"
    assert run(["fit", FLIGHT, "--compass", "1", "-o", str(path)]) == 0
    return str(path)


@pytest.mark.parametrize(
    ("name", "fused_rms"),
    [
        ("flight", 1.0),
        pytest.param("flight_wrong_mot", 1.0, marks=pytest.mark.slow),
        ("flight_uncalibrated", 1.0),
        pytest.param("mission_uncompensated", 1.5, marks=pytest.mark.slow),
        ("mission_compensated", 1.0),
        ("turntable_five_levels", 1.5),
    ],
)
def test_correcting_and_fusing_bring_the_heading_to_the_truth(name, fused_rms, capsys):
    error = document(capsys, str(FIXTURES / f"{name}.tlog"), "--compass", "1")["error_deg"]
    assert error["fused"]["rms"] < fused_rms
    assert error["fused"]["max"] < 3.0
    if name != "mission_compensated":
        assert error["corrected"]["rms"] < 0.2 * error["raw"]["rms"]


def test_headings_are_degrees_of_a_full_turn_at_times_that_never_go_back(capsys):
    for heading in document(capsys, FLIGHT)["headings"].values():
        time = np.array(heading["time_s"])
        known = np.array([value for value in heading["deg"] if value is not None])
        assert len(time) == len(heading["deg"])
        assert (np.diff(time) >= 0).all()
        assert ((known >= 0) & (known <= 360)).all()


def test_a_parameter_file_corrects_as_the_fit_it_came_from(parameters, capsys):
    fitted = document(capsys, FLIGHT)
    loaded = document(capsys, FLIGHT, "--parameters", parameters)
    assert loaded["correction"] == {"from": parameters, "regressor": "current"}
    assert loaded["error_deg"]["corrected"]["rms"] == pytest.approx(
        fitted["error_deg"]["corrected"]["rms"], abs=0.05
    )


def test_a_correction_in_force_leaves_the_reported_heading_as_it_is(capsys):
    error = document(capsys, FLIGHT, "--in-force")["error_deg"]
    assert error["corrected"]["rms"] == pytest.approx(error["raw"]["rms"], abs=0.1)


def test_a_gap_in_the_telemetry_costs_its_readings_and_nothing_else(tmp_path, capsys):
    began = next(frames(SWEEP)).arrival_us
    log = write(
        tmp_path / "gap.tlog",
        (
            frame
            for frame in frames(SWEEP)
            if frame.message not in CURRENT | THROTTLE or not 40e6 < frame.arrival_us - began < 58e6
        ),
    )
    found = document(capsys, str(log))["headings"]
    time = np.array(found["raw"]["time_s"])
    assert len(found["raw"]["deg"]) == len(time) == len(found["corrected"]["deg"])
    assert np.diff(time).max() > 15.0


def test_a_gyro_that_is_hardly_told_gives_no_fused_heading(tmp_path, capsys):
    slow = (f for k, f in enumerate(frames(SWEEP)) if f.message not in GYRO or k % 400 == 0)
    log = write(tmp_path / "slow.tlog", slow)
    assert run(["heading", str(log), "--in-force"]) in (0, 2)
    assert "should not have happened" not in capsys.readouterr().err


def test_a_file_name_cannot_colour_the_terminal(tmp_path, capsys):
    log = tmp_path / "a\x1b[31mb.tlog"
    log.write_bytes(SWEEP.read_bytes())
    assert run(["heading", str(log), "--in-force"]) == 0
    assert "a?[31mb.tlog" in capsys.readouterr().out


def test_the_text_tells_the_error_and_the_plot_draws_it(capsys):
    assert run(["heading", FLIGHT, "--plot"]) == 0
    text = capsys.readouterr().out
    assert "error against the simulation's truth" in text
    assert "largest" in text
    assert "\x1b" not in text
    assert text.count("┌") == 2


def test_both_sources_of_a_correction_at_once_are_refused(parameters, capsys):
    assert run(["heading", FLIGHT, "--in-force", "--parameters", parameters]) == 2
    assert "instead received both" in capsys.readouterr().err


def test_a_parameter_file_without_a_compass_is_refused(tmp_path, capsys):
    path = tmp_path / "other.param"
    path.write_text("WPNAV_SPEED,500\n")
    assert run(["heading", FLIGHT, "--parameters", str(path)]) == 2
    assert "must hold COMPASS_ parameters" in capsys.readouterr().err


def test_a_log_without_the_control_quantity_of_the_correction_says_so(parameters, capsys):
    log = str(FIXTURES / "sweep_throttle_only.tlog")
    assert run(["heading", log, "--parameters", parameters]) == 2
    assert "must hold the current" in capsys.readouterr().err


def test_the_autopilots_attitude_is_a_better_plumb_line_than_the_accelerometer():
    log = FIXTURES / "mission_compensated.tlog"
    recording, truth = read(log), read_truth(log)
    fit = analyse(recording, Options(compass=1)).compasses[0].fit
    rms = {}
    for gravity in ("attitude", "accelerometer"):
        fused = track(recording, 1, fit.correction, fit.regressor, gravity=gravity).fused
        rms[gravity] = accuracy(truth, fused.time, fused.value).rms
    assert rms["attitude"] < 0.6 * rms["accelerometer"]
    assert rms["accelerometer"] < 3.0


def test_the_fusion_is_calmer_than_the_compass_alone():
    log = FIXTURES / "mission_compensated.tlog"
    recording, truth = read(log), read_truth(log)
    fit = analyse(recording, Options(compass=1)).compasses[0].fit
    made = track(recording, 1, fit.correction, fit.regressor, tuning=Tuning())
    alone = accuracy(truth, made.time, made.corrected)
    fused = accuracy(truth, made.fused.time, made.fused.value)
    assert fused.rms < 0.5 * alone.rms


# --- motor by motor --------------------------------------------------------------------------

VEHICLE = Unequal(seed=1, seconds=70.0, exponent=1.5)
LAW = {
    f"COMPASS_PMOT{motor}_{axis}": -40.0 / 25.0**1.5 * value
    for motor, vector in enumerate(VECTORS, start=1)
    for axis, value in zip("XYZ", vector.tolist(), strict=True)
}
"""A motor draws 40 A · (duty · volts / 25) to the power of 1.5, so this is exactly right."""
IN_FORCE = {"COMPASS_PMOT_EN": 1.0, "COMPASS_PMOT_EXP": 1.5, **LAW}


def off_deg(time, found):
    """From the true heading, degrees, root mean square."""
    true = VEHICLE.attitude_at(time)[:, 2]
    return float(np.degrees(np.sqrt(np.mean(wrap_angle(found - true) ** 2))))


def test_a_correction_motor_by_motor_in_force_leaves_the_reported_heading_as_it_is():
    recording = replace(VEHICLE, per_motor=IN_FORCE).recording()
    force = autopilots.of(recording).in_force(recording.parameters.latest, 1)
    made = track(recording, 1, force.correction, force.regressor, exponent=force.exponent)
    apart = np.degrees(wrap_angle(made.corrected - made.reported))
    assert np.sqrt(np.mean(apart**2)) < 0.5
    straight = track(recording, 1, force.correction, force.regressor)
    other = np.degrees(wrap_angle(straight.corrected - straight.reported))
    assert np.sqrt(np.mean(other**2)) > 2.0
    with pytest.raises(MissingDataError, match="SERVO_OUTPUT_RAW"):
        track(replace(recording, voltage=None), 1, force.correction, force.regressor)


def test_a_fit_motor_by_motor_corrects_by_every_motors_current():
    recording = VEHICLE.recording()
    by_motor, by_one = (
        analyse(recording, Options(regressor=kind)).compasses[0].fit
        for kind in ("motors", "current")
    )
    found = track(recording, 1, by_motor.correction, "motors", origin=by_motor.origin)
    plain = track(recording, 1, by_one.correction, "current")
    assert off_deg(found.time, found.corrected) < 0.5 * off_deg(plain.time, plain.corrected)
    assert off_deg(found.time, found.corrected) < 1.5
