"""What is fitted to a simulated recording is its truth: the whole road, judged from outside."""

from __future__ import annotations

import numpy as np
import pytest

from magcomp import earth, geometry
from magcomp.analysis.analyse import analyse
from magcomp.autopilots import ardupilot
from magcomp.simulate import write_tlog
from magcomp.sources import read

YAWS = np.linspace(-np.pi, np.pi, 72)
TILT = np.radians(20.0)
ATTITUDES = ((0.0, 0.0), (TILT, 0.0), (-TILT, 0.0), (0.0, TILT), (0.0, -TILT))


def heading_error_left(truth, compass, parameters):
    """Largest heading error in degrees over all yaws, level and tilted, at 0 … 50 A."""
    field = earth.expected_field(*truth.home, 1_750_000_000.0)
    calibration = ardupilot.calibration(parameters, compass)
    worst = 0.0
    for current in (0.0, 10.0, 25.0, 50.0):
        for roll, pitch in ATTITUDES:
            level = np.full_like(YAWS, roll), np.full_like(YAWS, pitch)
            body = geometry.body_from_earth(*level, YAWS) @ field.ned
            raw = truth.compasses[compass - 1].raw(body + current * truth.interference)
            corrected = ardupilot.correct(raw, np.full_like(YAWS, current), calibration)
            heading = geometry.heading(corrected, *level, field.declination)
            worst = max(worst, np.abs(geometry.wrap_angle(heading - YAWS)).max())
    return float(np.degrees(worst))


@pytest.mark.parametrize(
    ("program", "seed", "compensation", "promised_deg"),
    [
        pytest.param("turntable_paper", 31, "off", 0.2, marks=pytest.mark.slow),
        pytest.param("flight", 31, "off", 0.4, marks=pytest.mark.slow),
        ("flight", 32, "wrong", 0.4),
    ],
)
def test_a_fit_leaves_no_more_heading_error_than_promised(
    tmp_path, program, seed, compensation, promised_deg
):
    path = tmp_path / "x.tlog"
    truth = write_tlog(path, program=program, seed=seed, compensation=compensation)
    for result in analyse(read(path)).compasses:
        compass = result.fit.compass
        assert heading_error_left(truth, compass, result.parameters) <= promised_deg, compass
