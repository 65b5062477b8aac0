"""A fleet's table has room for one vector: an aircraft corrected motor by motor gets the mean."""

from __future__ import annotations

from unequal import VECTORS, Unequal

from magcomp.analysis.analyse import analyse
from magcomp.fleet.row import Log, rows_of
from magcomp.model import CORRECTION_SIZE


def test_an_aircraft_corrected_motor_by_motor_has_a_row_as_any_other():
    vectors = {
        f"COMPASS_PMOT{m}_{axis}": -0.1 * value
        for m, vector in enumerate(VECTORS, start=1)
        for axis, value in zip("XYZ", vector.tolist(), strict=True)
    }
    on = {"COMPASS_PMOT_EN": 1.0, "COMPASS_PMOT_EXP": 1.0, **vectors}
    recording = Unequal(seed=1, seconds=50.0, per_motor=on).recording()
    found = analyse(recording)
    (row,) = rows_of(Log("x.tlog", 1, "", 0.0), "", recording, found)
    assert len(row.in_force) == len(row.correction) == CORRECTION_SIZE
