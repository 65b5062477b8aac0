"""The paper's claims, from the table.json that ``magcomp reproduce`` writes."""

import json
import re
from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest
from browser_checks import assert_clean, axe_findings, clipped_labels, show
from chromium import chromium_page, find_chromium
from json_schema import must_be
from truth import FIXTURES

from magcomp.cli.app import run
from magcomp.experiments.motion import heading_errors, true_motion
from magcomp.experiments.paper import CONTROLS, TABLE_1
from magcomp.experiments.turntable import SECTORS, Row, turntable
from magcomp.geometry import wrap_angle
from magcomp.model import Series
from magcomp.simulate import write_tlog
from magcomp.sources import read
from magcomp.sources.truth import Truth, read_truth

KINDS = ("simulated", "recorded")
PROMISED_DEG = 0.5
RECORDED = FIXTURES / "turntable_paper.tlog"


@cache
def recorded(compass):
    return turntable(read(RECORDED), read_truth(RECORDED), compass)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The directory that ``magcomp reproduce -o`` has filled."""
    directory = tmp_path_factory.mktemp("reproduction") / "made"
    assert run(["reproduce", "-o", str(directory), "--recordings", str(FIXTURES)]) == 0
    return directory


@pytest.fixture(scope="module")
def table(written):
    return json.loads((written / "table.json").read_text())


@pytest.mark.slow
def test_the_table_is_as_the_schema_says(table):
    must_be("reproduction", table)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_row_for_each_of_the_papers_control_quantities(table, kind):
    assert [row["control"] for row in table[kind]] == list(CONTROLS)
    for row in table[kind]:
        assert set(row) == {field.name for field in fields(Row)}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_currents_are_about_the_papers(table, kind):
    for row, paper in zip(table[kind], TABLE_1, strict=True):
        assert row["current_a"] == pytest.approx(paper.current_a, abs=2.0)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_ellipsoid_alone_grows_wrong_with_the_control_quantity(table, kind):
    rest, middle, full = (row["ellipsoid_deg"] for row in table[kind])
    assert rest < 0.5
    assert middle > rest + 2.0
    assert full > middle + 2.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("method", ["paper_deg", "magcomp_deg"])
def test_following_the_centre_along_its_line_stays_flat(table, kind, method):
    values = [row[method] for row in table[kind]]
    assert max(values) - min(values) < 0.4
    assert max(values) < 0.1 * table[kind][-1]["ellipsoid_deg"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_magcomp_stays_at_or_under_half_a_degree_at_every_control_quantity(table, kind):
    assert all(row["magcomp_deg"] <= PROMISED_DEG for row in table[kind])


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_nothing_helps_as_little_as_no_correction(table, kind):
    for row in table[kind]:
        assert row["uncorrected_deg"] > max(row["ellipsoid_deg"], row["paper_deg"])


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_in_flight_compensation_brings_the_heading_within_the_papers_3_degrees(table, kind):
    flown = table["flights"][kind]
    assert flown["uncompensated"]["largest_deg"] > 10.0
    assert flown["compensated"]["largest_deg"] < 3.0
    assert flown["fused"]["largest_deg"] < 3.0
    assert flown["paths_apart_m"] > 1.0


@pytest.mark.slow
def test_the_page_needs_nothing_from_elsewhere(written):
    page = (written / "index.html").read_text()
    assert len(page) < 5_000_000
    assert not re.search(r"<(?:script|link|img|iframe)[^>]+(?:src|href)=", page)
    for kind in KINDS:
        for number in range(3, 10):
            assert f'id="fig{number}-{kind}"' in page


@pytest.mark.slow
@pytest.mark.skipif(find_chromium() is None, reason="no Chromium on this machine")
def test_the_page_stands_up_in_a_browser(written, tmp_path):
    page = written / "index.html"
    with chromium_page(tmp_path) as browser:
        for width in (1280, 390):
            show(browser, page, width)
            assert_clean(browser, page)
            assert clipped_labels(browser) == []
            assert browser.evaluate("document.documentElement.scrollWidth") <= width
            assert axe_findings(browser) == []


@pytest.mark.slow
def test_the_pages_numbers_are_those_of_the_table(written, table):
    page = (written / "index.html").read_text()
    shown = re.findall(r'<data value="([^"]+)" data-key="(\w+)\.(\d)\.(\w+)"', page)
    assert len(shown) > 40
    for value, kind, row, key in shown:
        assert float(value) == table[kind][int(row)][key]


@pytest.mark.slow
def test_an_existing_table_is_not_overwritten(written, capsys):
    before = (written / "table.json").read_bytes()
    assert run(["reproduce", "-o", str(written)]) == 2
    assert "--force" in capsys.readouterr().err
    assert (written / "table.json").read_bytes() == before


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3, 4])
def test_the_claims_do_not_depend_on_the_vehicle(seed, tmp_path):
    log = tmp_path / "turntable.tlog"
    write_tlog(log, program="turntable_paper", seed=seed)
    rows = turntable(read(log), read_truth(log)).rows
    assert [row.ellipsoid_deg for row in rows] == sorted(row.ellipsoid_deg for row in rows)
    assert all(row.magcomp_deg <= PROMISED_DEG for row in rows)


@pytest.mark.parametrize("compass", [1, pytest.param(2, marks=pytest.mark.slow), 3])
def test_the_recorded_claims_hold_for_every_compass(compass):
    assert all(row.magcomp_deg <= PROMISED_DEG for row in recorded(compass).rows)


def test_no_correction_sees_the_turns_it_is_measured_on():
    recording, truth = read(RECORDED), read_truth(RECORDED)
    spoilt = {
        compass: Series(series.time, spoil_last_turns(series))
        for compass, series in recording.field.items()
    }
    clean = recorded(1).corrections
    other = turntable(replace(recording, field=spoilt), truth)
    assert other.corrections.fit.correction.vector == pytest.approx(clean.fit.correction.vector)
    assert other.corrections.feet == pytest.approx(clean.feet)


def spoil_last_turns(series):
    """The field of turntable_paper with its three measured turns turned upside down."""
    value = series.value.copy()
    for start, end in ((84.0, 101.0), (161.5, 179.0), (238.5, 255.5)):
        value[(series.time > start) & (series.time < end)] *= -1.0
    return value


def test_residuals_cover_the_whole_turn():
    for turn in recorded(1).turns:
        for residual in turn.residual_deg.values():
            assert residual.shape == (SECTORS,)
            assert np.isfinite(residual).all()


def test_the_fields_lag_is_found_whatever_the_calibration():
    lags = [recorded(compass).lag_s for compass in (1, 2, 3)]
    assert np.ptp(lags) < 0.005
    assert 0.05 < np.mean(lags) < 0.15


def turning_truth():
    time = np.arange(0.0, 20.0, 0.1)
    yaw = wrap_angle(0.9 * time)
    attitude = np.column_stack([0.0 * time, np.where(time < 10.0, 0.0, 1.4), yaw])
    return Truth(Series(time, attitude), Series(time, np.zeros((200, 2))), {})


def test_the_true_attitude_between_two_moments_goes_the_short_way_through_south():
    between = np.array([3.44, 3.45, 3.52])
    assert wrap_angle(true_motion(turning_truth(), between).yaw - 0.9 * between) == pytest.approx(
        0.0, abs=1e-9
    )


def test_headings_are_compared_only_while_the_vehicle_is_upright_and_the_truth_known():
    time = np.array([-1.0, 1.0, 2.0, 12.0, 30.0])
    heading = wrap_angle(0.9 * time + np.array([0.0, 0.1, np.nan, 0.0, 0.0]))
    kept, error = heading_errors(turning_truth(), time, heading)
    assert kept == pytest.approx([1.0])
    assert error == pytest.approx([0.1])
