"""The expected earth field: the World Magnetic Model's own numbers, and positions refused."""

from __future__ import annotations

import datetime
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pygeomag import GeoMag

from magcomp.earth import EarthField, expected_field
from magcomp.errors import InputError


def unix(year: float) -> float:
    """Unix time of a decimal year, by the calendar's own years."""
    whole = int(year)
    start = datetime.datetime(whole, 1, 1, tzinfo=datetime.UTC).timestamp()
    end = datetime.datetime(whole + 1, 1, 1, tzinfo=datetime.UTC).timestamp()
    return start + (year - whole) * (end - start)


# Test values published with WMM2020 (its technical report): height in km, then X, Y, Z in nT.
PUBLISHED_2020 = [
    (2020.0, 0.0, 80.0, 0.0, 6570.4, -146.3, 54606.0),
    (2020.0, 0.0, 0.0, 120.0, 39624.3, 109.9, -10932.5),
    (2020.0, 0.0, -80.0, 240.0, 5940.6, 15772.1, -52480.8),
    (2020.0, 100.0, 80.0, 0.0, 6261.8, -185.5, 52429.1),
    (2022.5, 0.0, 80.0, 0.0, 6529.9, 1.1, 54713.4),
    (2022.5, 0.0, 0.0, 120.0, 39684.7, -42.2, -10809.5),
]


@pytest.mark.parametrize(("year", "height", "latitude", "longitude", "x", "y", "z"), PUBLISHED_2020)
def test_the_published_test_values_of_the_world_magnetic_model(
    year, height, latitude, longitude, x, y, z
):
    field = expected_field(latitude, longitude, height * 1000.0, unix(year))
    # Published heights are over the ellipsoid and rounded to 0.1 nT; a day of change is 0.2 nT.
    assert np.allclose(field.ned * 100.0, [x, y, z], atol=1.0)


@pytest.mark.parametrize(
    ("year", "model"),
    [
        (2010.5, "WMM_2010"),
        (2014.99, "WMM_2010"),
        (2015.01, "WMM_2015v2"),
        (2022.0, "WMM_2020"),
        (2025.01, "WMM_2025"),
        (2029.9, "WMM_2025"),
    ],
)
def test_each_date_uses_the_model_of_its_five_years(year, model):
    expected = GeoMag(coefficients_file=f"wmm/{model}.COF").calculate(47.4, 8.5, 0.488, year)
    field = expected_field(47.4, 8.5, 488.0, unix(year))
    assert field.strength == pytest.approx(expected.f / 100.0, rel=1e-6)
    assert math.degrees(field.dip) == pytest.approx(expected.i, abs=1e-4)
    assert math.degrees(field.declination) == pytest.approx(expected.d, abs=1e-4)


@pytest.mark.parametrize(("year", "nearest"), [(1999.0, 2010.0), (2050.0, 2029.999)])
def test_a_date_outside_all_models_gets_the_nearest_one(year, nearest):
    far = expected_field(47.4, 8.5, 488.0, unix(year))
    near = expected_field(47.4, 8.5, 488.0, unix(nearest))
    assert np.allclose(far.ned, near.ned, atol=0.05)


def test_an_unknown_date_still_gives_a_field_of_these_years():
    field = expected_field(47.4, 8.5, 488.0, math.nan)
    assert np.allclose(field.ned, expected_field(47.4, 8.5, 488.0, unix(2025.0)).ned)


@given(st.floats(-89.0, 89.0), st.floats(-180.0, 180.0), st.floats(2010.0, 2030.0))
def test_every_place_and_year_has_a_field_of_the_earths_size(latitude, longitude, year):
    field = expected_field(latitude, longitude, 0.0, unix(year))
    assert 200.0 < field.strength < 720.0
    assert np.linalg.norm(field.ned) == pytest.approx(field.strength)
    assert math.hypot(field.horizontal, field.vertical) == pytest.approx(field.strength)
    assert math.atan2(field.ned[1], field.ned[0]) == pytest.approx(field.declination)


def test_the_field_points_down_in_the_north_and_up_in_the_south():
    assert expected_field(60.0, 10.0, 0.0, unix(2024.0)).vertical > 0
    assert expected_field(-60.0, 10.0, 0.0, unix(2024.0)).vertical < 0


def test_components_of_a_known_field():
    field = EarthField(strength=500.0, dip=math.radians(60.0), declination=math.radians(90.0))
    assert field.horizontal == pytest.approx(250.0)
    assert np.allclose(field.ned, [0.0, 250.0, 500.0 * math.sin(math.radians(60.0))])


@pytest.mark.parametrize(
    ("latitude", "longitude"),
    [(90.1, 0.0), (-91.0, 0.0), (0.0, 361.0), (math.nan, 0.0), (0.0, math.nan), (math.inf, 0.0)],
)
def test_a_position_that_is_not_on_the_earth_is_refused_with_what_was_received(latitude, longitude):
    with pytest.raises(InputError, match="position must be a latitude within ±90°") as caught:
        expected_field(latitude, longitude, 0.0, unix(2024.0))
    assert f"{latitude}, {longitude}" in str(caught.value)


@pytest.mark.parametrize("altitude", [math.nan, math.inf])
def test_an_altitude_that_is_no_number_is_refused(altitude):
    with pytest.raises(InputError, match="altitude"):
        expected_field(47.4, 8.5, altitude, unix(2024.0))


@pytest.mark.parametrize("when", [1e18, -1e18, math.inf])
def test_a_time_no_calendar_holds_gets_a_model_all_the_same(when):
    assert 400.0 < expected_field(47.4, 8.5, 488.0, when).strength < 550.0
