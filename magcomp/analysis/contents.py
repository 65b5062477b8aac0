"""Recording → Contents: what was recorded, how often, and what a fit lacks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from magcomp import autopilots
from magcomp.align import has_position, on_lift_alone
from magcomp.align.readings import is_new
from magcomp.analysis.missing import HOW_TO_HOVER, hovers
from magcomp.errors import InputError
from magcomp.fit import LEAST_READINGS
from magcomp.model import CURRENT, THROTTLE, Compass, Recording, Series

SLOW_HZ = 0.8
"""Fewer readings than this of a compass a second leave turns of a minute with too few."""


@dataclass(frozen=True)
class Quantity:
    """One time series.

    Attributes
    ----------
    name
        In words, such as ``"battery 0"``.
    unit
        Of ``low`` and ``high``; empty where the series has no one range.
    count
        Values in it.
    rate_hz
        One over the usual time from value to value; NaN where there are fewer than two.
    low, high
        Its range; NaN where it has no one range.
    used
        Whether a fit takes it as it is; otherwise it stands by.
    """

    name: str
    unit: str
    count: int
    rate_hz: float
    low: float = float("nan")
    high: float = float("nan")
    used: bool = True


@dataclass(frozen=True)
class CompassContents:
    """What was recorded of one compass.

    Attributes
    ----------
    number
        1, 2 or 3.
    described
        What the parameters tell of it; None where they tell nothing.
    rows
        Values in the recording.
    readings
        Those that are new; the others repeat the one before.
    rate_hz
        Of new readings.
    strength
        Their mean strength, mGauss.
    applied_told
        Whether the log tells with each reading what was applied to it.
    left_out
        Why it cannot be fitted; empty where it can.
    """

    number: int
    described: Compass | None
    rows: int
    readings: int
    rate_hz: float
    strength: float
    applied_told: bool
    left_out: str = ""


@dataclass(frozen=True)
class Missing:
    """Something that a fit lacks.

    Attributes
    ----------
    what
        In words, such as ``"the attitude"``.
    how
        What to do for the next recording, a clause without its full stop.
    prevents
        Whether no fit is possible without it; otherwise the fit is only worse.
    """

    what: str
    how: str
    prevents: bool


@dataclass(frozen=True)
class Contents:
    """What a recording holds.

    Attributes
    ----------
    compasses
        In the order of their numbers.
    quantities
        Everything else that has a time series.
    armed_s
        Seconds armed; None where the recording does not say.
    parameters
        Names reported.
    missing
        What a fit lacks, the worst first.
    """

    compasses: tuple[CompassContents, ...]
    quantities: tuple[Quantity, ...]
    armed_s: float | None
    parameters: int
    missing: tuple[Missing, ...]

    @property
    def can_be_fitted(self) -> bool:
        """Whether nothing is missing that a fit cannot do without."""
        return not any(each.prevents for each in self.missing)


def contents(recording: Recording) -> Contents:
    """Look at what a recording holds; nothing is fitted.

    Parameters
    ----------
    recording
        From any source.
    """
    compasses = tuple(_compasses(recording))
    missing = sorted(_missing(recording, compasses), key=lambda each: not each.prevents)
    return Contents(
        compasses=compasses,
        quantities=tuple(_quantities(recording)),
        armed_s=None if recording.armed is None else _armed_s(recording.armed),
        parameters=len(recording.parameters.names),
        missing=tuple(missing),
    )


def _compasses(recording: Recording) -> Iterator[CompassContents]:
    described = {compass.slot: compass for compass in recording.vehicle.compasses}
    left_out = autopilots.of(recording).left_out(recording.parameters)
    for number, reported in sorted(recording.field.items()):
        new = is_new(reported.value)
        yield CompassContents(
            number=number,
            described=described.get(number),
            rows=len(reported),
            readings=int(np.count_nonzero(new)),
            rate_hz=_rate(reported.time[new]),
            strength=float(np.linalg.norm(reported.value[new], axis=1).mean()),
            applied_told=number in recording.applied,
            left_out=str(left_out.get(number, "")),
        )


def _rate(time: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    return 1.0 / step if step > 0.0 else float("nan")


def _quantities(recording: Recording) -> Iterator[Quantity]:
    if recording.current is not None:
        yield _ranged(f"battery {recording.battery}", "A", recording.current)
    for number, current in sorted(recording.other_currents.items()):
        yield _ranged(f"battery {number}", "A", current, used=False)
    if recording.esc_current is not None:
        yield _ranged("speed controllers", "A", recording.esc_current, used=False)
    if recording.throttle is not None:
        percent = Series(recording.throttle.time, 100.0 * recording.throttle.value)
        yield _ranged("throttle", "%", percent)
    others: list[tuple[str, Series | None, bool]] = [
        (f"attitude {recording.attitude_source}".strip(), recording.attitude, True),
        *((f"attitude {name}", each, False) for name, each in recording.other_attitudes.items()),
        ("motor outputs", recording.outputs, True),
        ("gyro", recording.gyro, True),
        ("accelerometer", recording.accel, True),
        ("position", recording.position, True),
        ("hover or forward flight", recording.forward, True),
    ]
    for name, series, used in others:
        if series is not None:
            yield Quantity(name, "", len(series), _rate(series.time), used=used)


def _ranged(name: str, unit: str, series: Series, *, used: bool = True) -> Quantity:
    low, high = float(series.value.min()), float(series.value.max())
    return Quantity(name, unit, len(series), _rate(series.time), low, high, used)


def _armed_s(armed: Series) -> float:
    return float(np.sum(np.diff(armed.time) * armed.value[:-1])) if len(armed) > 1 else 0.0


def _missing(recording: Recording, found: tuple[CompassContents, ...]) -> Iterator[Missing]:
    autopilot = autopilots.of(recording)
    try:
        autopilot.require_fittable(recording)
    except InputError as error:
        yield Missing("a firmware that can be served", str(error), prevents=True)
    how = {
        name: autopilot.how_to_record(name, recording.format)
        for name in (
            "compass",
            "more readings",
            "control",
            "current",
            "attitude",
            "parameters",
            "position",
        )
    }
    if not found:
        yield Missing("readings of a compass", how["compass"], prevents=True)
    elif all(compass.left_out for compass in found):
        yield Missing("a compass that can be fitted", found[0].left_out, prevents=True)
    elif all(compass.readings < LEAST_READINGS for compass in found):
        what = f"{LEAST_READINGS} new readings of a compass"
        yield Missing(what, how["more readings"], prevents=True)
    elif all(compass.rate_hz < SLOW_HZ for compass in found):
        yield Missing("a reading of a compass each second", how["more readings"], prevents=False)
    hover, left_out = on_lift_alone(recording)
    if left_out and not hovers(hover):
        yield Missing("a hover", HOW_TO_HOVER, prevents=True)
    yield from _missing_controls(recording, how)
    if recording.attitude is None or len(recording.attitude) < 2:
        yield Missing("the attitude", how["attitude"], prevents=True)
    if not recording.parameters.names:
        yield Missing("the parameters", how["parameters"], prevents=False)
    if not has_position(recording):
        yield Missing("a position", how["position"], prevents=False)


def _missing_controls(recording: Recording, how: Mapping[str, str]) -> Iterator[Missing]:
    autopilot, kind = autopilots.of(recording), recording.vehicle.kind
    can = autopilot.multiplied(recording.vehicle)
    both = {CURRENT: recording.current, THROTTLE: recording.throttle}
    told = [each for kind, each in both.items() if kind in can and each is not None]
    if recording.current is None and recording.throttle is None:
        yield Missing("a battery current and a throttle", how["control"], prevents=True)
    elif not told:
        what = f"a {' or '.join(can)}, which is all that {autopilot.title} multiplies in a {kind}"
        yield Missing(what, how["current"], prevents=True)
    elif not any(len(each) > 1 and np.ptp(each.value) > 0.0 for each in told):
        yield Missing(
            "a current or a throttle that changes", "arm, and use the motors", prevents=True
        )
    elif recording.current is None:
        yield Missing("a battery current", how["current"], prevents=False)
