"""What is known of a vehicle before anything is fitted, and what will stand in the way."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from magcomp import autopilots
from magcomp.model import Grade, Recording, Vehicle, Verdict
from magcomp.report import words


@dataclass(frozen=True)
class VehicleCard:
    """A vehicle in words.

    Attributes
    ----------
    title
        Autopilot, kind, firmware, system.
    facts
        Pairs of a name and what is known of it.
    warnings
        Sentences: what will stand in the way.
    """

    title: str
    facts: tuple[tuple[str, str], ...] = ()
    warnings: tuple[str, ...] = ()


def card_of_recording(
    recording: Recording, verdicts: Mapping[int, Verdict] | None = None
) -> VehicleCard:
    """The card of a log.

    Parameters
    ----------
    recording
        As read.
    verdicts
        What the judge thinks of the calibration in force, by compass; None where not judged.
    """
    parameters = recording.parameters.latest
    compasses = sorted(recording.field)
    facts = (
        ("Readings", f"{words.duration(recording.duration_s)}, {_quantities(recording)}"),
        ("Compasses", _compasses(compasses, recording.vehicle)),
        *calibration_facts(recording.vehicle, parameters, compasses),
        *(_in_force(compass, verdict) for compass, verdict in (verdicts or {}).items()),
    )
    warnings = (*_lacking(recording), *parameter_warnings(recording.vehicle, parameters))
    return VehicleCard(words.vehicle(recording.vehicle), facts, warnings)


def calibration_facts(
    vehicle: Vehicle, parameters: Mapping[str, float], compasses: list[int]
) -> Iterator[tuple[str, str]]:
    """The calibration in force, a line a compass."""
    if not parameters:
        return
    autopilot = autopilots.of(vehicle)
    by = autopilot.regressor(parameters)
    switch = parameters.get(autopilot.switch, 0.0)
    yield "Compensation", f"{f'by {by}' if by else 'off'} ({autopilot.switch} {switch:g})"
    for compass in compasses:
        held = autopilot.in_force(parameters, compass).correction
        offset = ", ".join(words.number(float(v), 0) for v in held.offset)
        iron = "no soft iron" if np.allclose(held.soft_iron, np.eye(3)) else "soft iron set"
        yield f"Compass {compass}", f"offsets {offset}; {iron}"


def parameter_warnings(vehicle: Vehicle, parameters: Mapping[str, float]) -> Iterator[str]:
    """What the parameters in force will do to a recording."""
    if not parameters:
        yield "The parameters are not known: only the motor vector can be given."
        return
    autopilot = autopilots.of(vehicle)
    if autopilot.regressor(parameters) is not None:
        yield (
            "Motor compensation is on already: its effect is taken out of the readings before "
            "the fit."
        )
    yield from map(words.sentence, autopilot.warnings(parameters))


def _compasses(compasses: list[int], vehicle: Vehicle) -> str:
    if not compasses:
        return "none"
    ids = ", ".join(map(str, vehicle.device_ids))
    return f"{words.listed(compasses)}{f' (ids {ids})' if ids else ''}"


def _quantities(recording: Recording) -> str:
    found = [
        name
        for name, series in (("current", recording.current), ("throttle", recording.throttle))
        if series is not None and len(series)
    ]
    return f"with {words.listed(found)}" if found else "without current or throttle"


def _in_force(compass: int, verdict: Verdict) -> tuple[str, str]:
    worst = max((row.before for row in verdict.heading_error), default=float("nan"))
    word = {Grade.GOOD: "good", Grade.MARGINAL: "doubtful", Grade.REJECTED: "bad"}[verdict.grade]
    return f"Compass {compass} now", f"{word}: heading wrong by up to {words.number(worst, 1)}°"


def _lacking(recording: Recording) -> Iterator[str]:
    if not recording.field:
        yield "There is no compass in this recording, so nothing can be fitted."
    if recording.attitude is None or not len(recording.attitude):
        yield "There is no attitude in this recording, so nothing can be fitted."
    if recording.current is None or not len(recording.current):
        yield "There is no current sensor: the fit uses throttle, which a weak battery blurs."
    if recording.position is None or not len(recording.position):
        yield "There is no position: the earth's field is taken from the readings themselves."
    for compass, series in sorted(recording.field.items()):
        strength = float(np.median(np.linalg.norm(series.value, axis=1)))
        if not 150.0 < strength < 900.0:  # 220 … 670 mGauss anywhere on earth
            yield (
                f"Compass {compass} reads {strength:.0f} mGauss, which no place on earth has: it "
                "is uncalibrated, disturbed or unhealthy."
            )
