"""What a row tells of a compass is what its analysis says."""

from __future__ import annotations

import numpy as np
import pytest
import recordings

from magcomp.fleet.row import Log, rows_of


@pytest.mark.parametrize("name", ["sweep_current", "flight_low_rate"])
def test_the_largest_error_is_that_of_all_that_was_flown(name: str) -> None:
    found = recordings.analysis(name)
    rows = rows_of(Log("x.tlog", 1, ""), "", recordings.recording(name), found)
    for row, result in zip(rows, found.compasses, strict=True):
        errors = result.verdict.heading_error
        flown = np.linspace(0.0, result.fit.u_high, 2001)
        told = {"before": row.before_deg, "after": row.after_deg, "p95": row.bound_deg}
        for of, largest in told.items():
            along = np.interp(flown, [e.u for e in errors], [getattr(e, of) for e in errors])
            assert largest == pytest.approx(along.max(), abs=0.01)
