"""MotorFit → parameters: exactly what would be written to this vehicle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from magcomp import __version__
from magcomp.autopilot import ardupilot
from magcomp.model import Analysis, Grade, InForce, MotorFit, ParameterSet, Recording, Verdict


def emit(
    recording: Recording, results: Sequence[tuple[MotorFit, Verdict, InForce]]
) -> Mapping[int, Mapping[str, float]]:
    """Parameters of each compass.

    Parameters
    ----------
    recording
        Tells which parameters this vehicle has.
    results
        Fit, verdict and what was in force, a compass each, all against one control quantity.

    Returns
    -------
    mapping of compass to parameters
        A whole correction for each compass: motor vector, offsets re-centred for it, soft iron.
        COMPASS_MOTCT stands with every compass, because it is one switch for all. A rejected
        compass whose stored motor vector would come into force with the switch gets zeros.
        Empty where every compass is rejected: then the switch is not touched either.
    """
    if all(verdict.grade is Grade.REJECTED for _, verdict, _ in results):
        return {fit.compass: {} for fit, _, _ in results}
    return {
        fit.compass: _for_this_vehicle(
            recording,
            _accepted(recording, fit)
            if verdict.grade is not Grade.REJECTED
            else _neutral(fit, in_force),
        )
        for fit, verdict, in_force in results
    }


def _accepted(recording: Recording, fit: MotorFit) -> dict[str, float]:
    scale_name = f"COMPASS_SCALE{ardupilot.suffix(fit.compass)}"
    scale = recording.parameters.last(scale_name, 1.0)
    used = scale if 1 / ardupilot.SCALE_LIMIT <= scale <= ardupilot.SCALE_LIMIT else 1.0
    switch = ardupilot.COMPENSATION_OF[fit.regressor]
    return {
        ardupilot.COMPENSATION_SWITCH: float(switch),
        **ardupilot.correction_parameters(fit.correction, fit.compass, used),
    }


def _neutral(fit: MotorFit, in_force: InForce) -> dict[str, float]:
    if in_force.regressor == fit.regressor:
        return {}
    return ardupilot.vector_parameters("MOT", fit.compass, np.zeros(3))


def _for_this_vehicle(recording: Recording, parameters: dict[str, float]) -> dict[str, float]:
    """Without the names this firmware does not know, or all of a correction where none is known."""
    known = recording.parameters.names
    if not known:
        return {name: v for name, v in parameters.items() if "_MOT" in name}
    if not any(name.startswith("COMPASS_MOT") for name in known):
        return parameters
    return {name: value for name, value in parameters.items() if name in known}


def parameter_set(analysis: Analysis, *, include_rejected: bool = False) -> ParameterSet:
    """The parameters of an analysis, with what a reader of the file should know.

    Parameters
    ----------
    analysis
        From :func:`magcomp.session.analyse`.
    include_rejected
        Write rejected fits too; the user insists.
    """
    values: dict[str, float] = {}
    for result in analysis.compasses:
        values.update(result.parameters)
        if include_rejected and result.verdict.grade is Grade.REJECTED:
            switch = ardupilot.COMPENSATION_OF[result.fit.regressor]
            values[ardupilot.COMPENSATION_SWITCH] = float(switch)
            values.update(
                ardupilot.correction_parameters(result.fit.correction, result.fit.compass, 1.0)
            )
    ordered = {name: values[name] for name in sorted(values, key=_order)}
    return ParameterSet(ordered, analysis.vehicle, tuple(_comments(analysis)))


def _order(name: str) -> tuple[bool, str]:
    """The switch last, as it should be written."""
    return name == ardupilot.COMPENSATION_SWITCH, name


def _comments(analysis: Analysis) -> list[str]:
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
        )
        lines.extend(f"  {reason}" for reason in result.verdict.reasons)
    return lines
