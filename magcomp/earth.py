"""What the earth's field should be at a place and a date, from the World Magnetic Model."""

from __future__ import annotations

import datetime
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from magcomp.errors import InputError

_MGAUSS_PER_NANOTESLA = 0.01
_FIRST_MODEL_YEAR = 2010.0
_MODEL_SPAN_YEARS = 5.0
_LAST_MODEL_YEAR = 2030.0
_FIRST_MODEL_UNIX_S = 1_262_304_000.0
_LAST_MODEL_UNIX_S = 1_893_456_000.0


@dataclass(frozen=True)
class EarthField:
    """The earth's field at one place and date.

    Attributes
    ----------
    strength
        Total intensity, mGauss.
    dip
        Angle below the horizon, radians; positive in the northern hemisphere.
    declination
        Radians, east positive.
    """

    strength: float
    dip: float
    declination: float

    @property
    def horizontal(self) -> float:
        """Horizontal intensity, mGauss: what a heading is made of."""
        return float(self.strength * np.cos(self.dip))

    @property
    def vertical(self) -> float:
        """Downward component, mGauss."""
        return float(self.strength * np.sin(self.dip))

    @property
    def ned(self) -> NDArray[np.float64]:
        """North, east and down components, mGauss, shape (3,)."""
        return np.array(
            [
                self.horizontal * np.cos(self.declination),
                self.horizontal * np.sin(self.declination),
                self.vertical,
            ]
        )


def expected_field(
    latitude_deg: float, longitude_deg: float, altitude_m: float, unix_s: float
) -> EarthField:
    """Expected field at a position and a time.

    Parameters
    ----------
    latitude_deg, longitude_deg
        Geodetic position in degrees.
    altitude_m
        Height above sea level in metres.
    unix_s
        Seconds since 1970. Dates outside the models (2010 … 2030) use the nearest one.

    Raises
    ------
    InputError
        For a position that is not on the earth, or an altitude that is not a number.

    Examples
    --------
    >>> earth = expected_field(47.4, 8.5, 500.0, 1_700_000_000.0)
    >>> round(earth.strength), round(float(np.degrees(earth.dip)))
    (483, 63)
    """
    if not (abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 360.0):
        raise InputError(
            "A position must be a latitude within ±90° and a longitude within ±180°; "
            f"instead received {latitude_deg}, {longitude_deg}"
        )
    if not np.isfinite(altitude_m):
        raise InputError(f"An altitude must be a number of metres; instead received {altitude_m}")
    # Imported here because the model's tables cost more than the rest of `import magcomp`.
    from pygeomag import GeoMag  # noqa: PLC0415

    year = _decimal_year(unix_s)
    epoch = min(max(year, _FIRST_MODEL_YEAR), _LAST_MODEL_YEAR - 1e-3)
    base = int(epoch // _MODEL_SPAN_YEARS * _MODEL_SPAN_YEARS)
    coefficients = f"wmm/WMM_{base}{'v2' if base == 2015 else ''}.COF"
    result = GeoMag(coefficients_file=coefficients).calculate(
        glat=latitude_deg,
        glon=longitude_deg,
        alt=altitude_m / 1000.0,
        time=epoch,
        allow_date_outside_lifespan=True,
        raise_in_warning_zone=False,
    )
    return EarthField(
        strength=result.f * _MGAUSS_PER_NANOTESLA,
        dip=float(np.radians(result.i)),
        declination=float(np.radians(result.d)),
    )


def _decimal_year(unix_s: float) -> float:
    if not np.isfinite(unix_s):
        return _LAST_MODEL_YEAR - _MODEL_SPAN_YEARS
    # A log's 64-bit clock can say years that no calendar holds; the models' years are enough.
    within = min(max(unix_s, _FIRST_MODEL_UNIX_S), _LAST_MODEL_UNIX_S)
    moment = datetime.datetime.fromtimestamp(within, datetime.UTC)
    start = datetime.datetime(moment.year, 1, 1, tzinfo=datetime.UTC)
    end = datetime.datetime(moment.year + 1, 1, 1, tzinfo=datetime.UTC)
    return moment.year + (moment - start) / (end - start)
