"""Parameters of an aircraft: what all flights agree on, in the newest flight's calibration."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from made_flights import fleet, row
from recordings import analysis, recording

from magcomp.analysis import parameter_set
from magcomp.fleet.findings import Holds
from magcomp.fleet.history import CompassHistory
from magcomp.fleet.pooled import Pooled
from magcomp.fleet.pooled_parameters import pooled_set, with_motor, write_all
from magcomp.writing.files import read_parameter_file

SWEEP = "sweep_current"


def history(compass: int, motor: np.ndarray, *, agree: bool = True) -> CompassHistory:
    pooled = Pooled(motor, 1e-4 * np.eye(3), 0.01, 5)
    return CompassHistory(
        compass, 0, (), "current", pooled, (), (), 0.0, Holds.YES, (), agree=agree
    )


def test_the_middle_of_the_range_stays_as_it_was() -> None:
    fit = analysis(SWEEP).compasses[0].fit
    moved = with_motor(fit, fit.correction.vector + np.array([0.5, -0.2, 0.1]))
    raw = np.array([[200.0, -100.0, 400.0], [-50.0, 300.0, 20.0]])
    middle = np.full(2, (fit.u_low + fit.u_high) / 2)
    np.testing.assert_allclose(
        moved.correction.apply(raw, middle), fit.correction.apply(raw, middle), atol=1e-9
    )


def test_the_pooled_vector_is_what_is_written() -> None:
    of = analysis(SWEEP)
    motor = of.compasses[0].fit.correction.vector + np.array([0.25, 0.0, -0.25])
    made = pooled_set(recording(SWEEP), of, [history(1, motor)])
    alone = parameter_set(of)
    assert list(made.values) == list(alone.values)
    vector = [made.values[name] for name in sorted(made.values) if name.startswith("COMPASS_MOT_")]
    np.testing.assert_allclose(vector, motor, rtol=1e-5)
    others = {name for name in made.values if "2" in name or "3" in name}
    assert all(made.values[name] == alone.values[name] for name in others)
    assert any("5 flights together" in line for line in made.comments)


def test_flights_that_do_not_agree_leave_the_newest_as_it_is() -> None:
    of = analysis(SWEEP)
    made = pooled_set(recording(SWEEP), of, [history(1, np.zeros(3), agree=False)])
    assert made.values == parameter_set(of).values


def test_an_aircraft_gets_a_file_of_a_plain_name_or_a_reason(tmp_path: Path) -> None:
    log = recording(SWEEP).source
    trusted = fleet([row(0, uid="../../evil\x1b", path=log)]).aircraft
    rejected = fleet([row(1, verdict="rejected")]).aircraft
    (written, refused) = write_all(trusted + rejected, tmp_path, force=False)
    assert written.path == tmp_path / "evil.param"
    assert read_parameter_file(written.path).values == parameter_set(analysis(SWEEP)).values
    assert refused.path is None
    assert "must have a flight whose fit is to be trusted" in refused.why
