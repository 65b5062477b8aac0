"""The readings behind a result are those the judge saw."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from report_analyses import Case, flown, refused, still

from magcomp.errors import MissingDataError
from magcomp.fit import spread
from magcomp.report.evidence import CompassPlots, compass_plots
from magcomp.report.figures_cloud import eye_beside

CASES = [still, flown, refused]


def plots_of(made: Case) -> CompassPlots:
    options = made.options
    return compass_plots(
        made.recording, made.analysis.compasses[0], start=options.start, end=options.end
    )


@pytest.mark.parametrize("make", CASES)
def test_what_is_unexplained_is_what_the_judge_says(make) -> None:
    made = make()
    plots = plots_of(made)
    residual = made.analysis.compasses[0].verdict.residual
    assert spread(plots.unexplained_before[:, None]) == pytest.approx(residual.before)
    assert spread(plots.unexplained_after[:, None]) == pytest.approx(residual.after)


@pytest.mark.parametrize("make", CASES)
def test_the_filled_cells_of_the_sphere_are_the_coverage(make) -> None:
    made = make()
    coverage = made.analysis.compasses[0].verdict.coverage
    assert np.mean(plots_of(made).sphere > 0) == pytest.approx(coverage.sphere)


@pytest.mark.parametrize("make", CASES)
def test_every_reading_is_counted_in_both_maps(make) -> None:
    plots = plots_of(make())
    assert plots.sphere.sum() == plots.turn.sum() == plots.count


def test_only_the_part_that_was_analysed_is_shown() -> None:
    assert plots_of(refused()).time.min() >= 240.0


def test_readings_are_thinned_evenly_from_first_to_last() -> None:
    made = flown()
    result = made.analysis.compasses[0]
    many = compass_plots(made.recording, result)
    few = compass_plots(made.recording, result, most=100)
    assert len(few.time) == len(few.raw) == len(few.before) == len(few.strength_after) == 100
    assert few.count == many.count > len(many.time) > 100
    assert (few.time[0], few.time[-1]) == (many.time[0], many.time[-1])


def test_few_readings_are_all_kept() -> None:
    plots = plots_of(still())
    assert len(plots.time) == plots.count < 1500


def test_a_recording_without_the_control_quantity_is_refused() -> None:
    made = flown()
    other = replace(made.recording, current=None, outputs=None)
    with pytest.raises(MissingDataError, match="must hold the current"):
        compass_plots(other, made.analysis.compasses[0])


def test_the_level_errors_in_force_are_within_those_of_all_attitudes() -> None:
    made = flown()
    result = made.analysis.compasses[0]
    plots = compass_plots(made.recording, result)
    quoted = made.document["compasses"][0]["quoted"]
    largest = float(np.degrees(np.abs(plots.level_errors).max()))
    assert 0.3 * quoted["before"] < largest <= quoted["before"]


@pytest.mark.parametrize(
    "direction", [(-1.1, -1.9, -0.4), (1.0, 0.0, 0.0), (0.0, 1.0, 0.5), (1.0, -1.0, 2.0)]
)
def test_the_line_of_centres_is_looked_at_from_its_side(direction) -> None:
    eye = eye_beside(np.array(direction))
    # The picture's second axis runs against the vehicle's.
    assert eye[0] * direction[0] - eye[1] * direction[1] == pytest.approx(0.0)
    assert eye @ (1.8, -1.8, 0.8) > 0.0


def test_a_line_that_stands_upright_is_seen_from_anywhere() -> None:
    assert eye_beside(np.array([0.01, 0.0, 3.0])) == pytest.approx([1.8, -1.8, 0.8])
