"""MotorFit → parameters: exactly what would be written to this vehicle."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

from magcomp import __version__, autopilots
from magcomp.autopilots import Autopilot, Kind, Leeway
from magcomp.fit import likely_beside
from magcomp.judge import turning
from magcomp.model import (
    Analysis,
    CompassResult,
    Correction,
    Grade,
    MotorFit,
    ParameterSet,
    Recording,
)


@dataclass(frozen=True)
class Emission:
    """What may be written of one compass.

    Attributes
    ----------
    accepted
        Its whole correction, the switch, and zeros for the stored motor vectors of compasses that
        were not fitted and would come into force with the switch.
    left_out
        What it needs where it gets no correction though another compass does: the switch is one
        for all, so its stored vector must not come into force with it.
    """

    accepted: Mapping[str, float]
    left_out: Mapping[str, float]


def emit(recording: Recording, fits: Sequence[MotorFit]) -> Mapping[int, Emission]:
    """Parameters of each compass, whatever the verdict.

    Parameters
    ----------
    recording
        Tells which parameters this vehicle has, and their values.
    fits
        One a compass, all against one control quantity.
    """
    autopilot = autopilots.of(recording)
    values = recording.parameters.latest
    fitted = [fit.compass for fit in fits]
    changed = not all(fit.kept for fit in fits)
    regressor = fits[0].regressor
    switch = autopilot.switch_parameters(regressor, fitted, values, battery=recording.battery)
    return {
        fit.compass: Emission(
            accepted={
                **(switch if changed else {}),
                **_of_correction(autopilot, fit, values, in_force=not changed),
            },
            left_out=autopilot.neutral_parameters(fit.compass, fit.regressor, values),
        )
        for fit in fits
    }


def what_applies(recording: Recording, kind: str) -> Callable[[MotorFit], Correction] | None:
    """What the vehicle will apply once the parameters of a fit are written to it.

    Parameters
    ----------
    recording
        Of the vehicle.
    kind
        The control quantity that is fitted.

    Returns
    -------
    callable
        None where that is the fit itself.
    """
    autopilot, values = autopilots.of(recording), recording.parameters.latest
    if autopilot.takes_over_all or kind not in autopilot.multiplied(recording.vehicle):
        return None

    def applied(fit: MotorFit) -> Correction:
        made = _of_correction(autopilot, fit, values, in_force=False)
        switch = autopilot.switch_parameters(
            kind, (fit.compass,), values, battery=recording.battery
        )
        return autopilot.in_force({**values, **switch, **made}, fit.compass).correction

    return applied


def _of_correction(
    autopilot: Autopilot,
    fit: MotorFit,
    values: Mapping[str, float],
    *,
    in_force: bool,
) -> dict[str, float]:
    """A correction's parameters; those of one that stays keep their stored values to the bit."""
    present = autopilot.in_force(values, fit.compass).correction
    made = autopilot.correction_parameters(
        fit.correction,
        fit.compass,
        values,
        regressor=fit.regressor,
        soft_iron_fitted="diagonal" in fit.free and not fit.kept,
        leeway=Leeway(likely_beside(fit, present), turning(fit)),
    )
    if not fit.kept:
        return made
    return {
        name: values[name]
        if name in values and (in_force or _alike(value, values[name]))
        else value
        for name, value in made.items()
    }


def _alike(first: float, second: float) -> bool:
    return math.isclose(first, second, rel_tol=1e-5, abs_tol=1e-5)


def parameter_set(
    analysis: Analysis,
    *,
    include_rejected: bool = False,
    compasses: Collection[int] | None = None,
) -> ParameterSet:
    """The parameters of an analysis, with what a reader of the file should know.

    Parameters
    ----------
    analysis
        From :func:`magcomp.analysis.analyse`.
    include_rejected
        Write rejected fits too; the user insists.
    compasses
        Those whose fits the user accepts; all by default. One that is left out is never brought
        into force by the switch that serves the others.

    Returns
    -------
    ParameterSet
        Empty where no fit is accepted: then the switch is not touched either.
    """
    accepted = [
        result
        for result in analysis.compasses
        if (include_rejected or result.verdict.grade is not Grade.REJECTED)
        and (compasses is None or result.fit.compass in compasses)
    ]
    values: dict[str, float] = {}
    for result in analysis.compasses:
        if result in accepted:
            values.update(result.insisted if include_rejected else result.parameters)
        elif accepted:
            values.update(result.left_out)
    ordered = {name: values[name] for name in sorted(values, key=_order)}
    comments = tuple(_comments(analysis, accepted))
    return ParameterSet(ordered, analysis.vehicle, comments)


def _order(name: str) -> tuple[bool, str]:
    """The switch last, as it should be written."""
    found = autopilots.parse(name)
    return found is not None and found.kind is Kind.SWITCH, name


def _comments(analysis: Analysis, accepted: Sequence[CompassResult]) -> list[str]:
    vehicle = analysis.vehicle
    lines = [
        f"magcomp {__version__}: compass-motor compensation",
        f"source: {analysis.source}, {analysis.duration_s:.0f} s",
        f"vehicle: {vehicle.autopilot} {vehicle.kind} {vehicle.firmware}, system {vehicle.system}, "
        f"compass device ids {', '.join(map(str, vehicle.device_ids)) or 'unknown'}",
    ]
    for result in analysis.compasses:
        lines.append(
            f"compass {result.fit.compass}: {result.verdict.grade.value}, {result.fit.method} "
            f"against {result.fit.regressor}"
            + ("" if result in accepted or not accepted else "; left out")
        )
        lines.extend(f"  {reason}" for reason in result.verdict.reasons)
    return lines
