"""MotorFit → parameters: exactly what would be written to this vehicle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from magcomp import __version__
from magcomp.autopilots import ardupilot
from magcomp.model import Analysis, Grade, InForce, MotorFit, ParameterSet, Recording, Verdict


def emit(
    recording: Recording, results: Sequence[tuple[MotorFit, Verdict, InForce]]
) -> Mapping[int, Mapping[str, float]]:
    """Parameters of each compass.

    Parameters
    ----------
    recording
        Tells which parameters this vehicle has, and their values.
    results
        Fit, verdict and what was in force, a compass each, all against one control quantity.

    Returns
    -------
    mapping of compass to parameters
        A whole correction for each compass: motor vector, offsets re-centred for it, soft iron.
        COMPASS_MOTCT is one switch for all, so it stands with every compass, and with it zeros
        for the stored motor vectors of compasses that were not fitted and would come into force.
        A rejected compass gets zeros likewise. Empty where every compass is rejected: then the
        switch is not touched either.
    """
    if all(verdict.grade is Grade.REJECTED for _, verdict, _ in results):
        return {fit.compass: {} for fit, _, _ in results}
    fitted = [fit.compass for fit, _, _ in results]
    return {
        fit.compass: _for_this_vehicle(
            recording,
            _accepted(recording, fit, fitted)
            if verdict.grade is not Grade.REJECTED
            else _neutral(fit, in_force),
            "diagonal" in fit.free,
        )
        for fit, verdict, in_force in results
    }


def emit_anyway(recording: Recording, fits: Sequence[MotorFit]) -> Mapping[int, dict[str, float]]:
    """Parameters of each compass whatever the verdict, for a user who insists."""
    fitted = [fit.compass for fit in fits]
    return {
        fit.compass: _for_this_vehicle(
            recording, _accepted(recording, fit, fitted), "diagonal" in fit.free
        )
        for fit in fits
    }


def _accepted(recording: Recording, fit: MotorFit, fitted: Sequence[int]) -> dict[str, float]:
    scale_name = f"COMPASS_SCALE{ardupilot.suffix(fit.compass)}"
    scale = recording.parameters.last(scale_name, 1.0)
    used = scale if 1 / ardupilot.SCALE_LIMIT <= scale <= ardupilot.SCALE_LIMIT else 1.0
    return {
        **_switch(recording, fit, fitted),
        **ardupilot.correction_parameters(fit.correction, fit.compass, used),
    }


def _switch(recording: Recording, fit: MotorFit, fitted: Sequence[int]) -> dict[str, float]:
    """COMPASS_MOTCT, and zeros for what it would wake up on compasses that were not fitted."""
    name, value = ardupilot.COMPENSATION_SWITCH, float(ardupilot.COMPENSATION_OF[fit.regressor])
    parameters = {name: value}
    if recording.parameters.last(name, 0.0) == value:
        return parameters
    for compass in range(1, ardupilot.COMPASS_COUNT + 1):
        stored = [recording.parameters.last(n, 0.0) for n in ardupilot.vector_names("MOT", compass)]
        if compass not in fitted and any(stored):
            parameters |= ardupilot.vector_parameters("MOT", compass, np.zeros(3))
    return parameters


def _neutral(fit: MotorFit, in_force: InForce) -> dict[str, float]:
    if in_force.regressor == fit.regressor:
        return {}
    return ardupilot.vector_parameters("MOT", fit.compass, np.zeros(3))


def _for_this_vehicle(
    recording: Recording, parameters: dict[str, float], fitted: bool
) -> dict[str, float]:
    """Without the names this firmware does not know, or all of a correction where none is known."""
    known = recording.parameters.names
    if not known:
        return {name: v for name, v in parameters.items() if "_MOT" in name}
    if not any(name.startswith("COMPASS_MOT") for name in known):
        return parameters
    # A soft iron that was fitted belongs to its offsets, even where the log's list is not whole.
    return {n: value for n, value in parameters.items() if n in known or _is_fitted(n, fitted)}


def _is_fitted(name: str, fitted_soft_iron: bool) -> bool:
    return fitted_soft_iron and ("_DIA" in name or "_ODI" in name)


def parameter_set(analysis: Analysis, *, include_rejected: bool = False) -> ParameterSet:
    """The parameters of an analysis, with what a reader of the file should know.

    Parameters
    ----------
    analysis
        From :func:`magcomp.analysis.analyse`.
    include_rejected
        Write rejected fits too; the user insists.
    """
    values: dict[str, float] = {}
    for result in analysis.compasses:
        values.update(result.insisted if include_rejected else result.parameters)
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
