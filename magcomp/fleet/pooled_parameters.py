"""Parameters of an aircraft: its newest fit, with the motor vector that all flights agree on."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from magcomp.analysis import analyse, parameter_set
from magcomp.analysis.emit import emit
from magcomp.errors import MagcompError, MissingDataError
from magcomp.fleet.aircraft import Aircraft
from magcomp.fleet.flights import Flight
from magcomp.fleet.history import CompassHistory
from magcomp.fleet.pooled import Pooled
from magcomp.fleet.task import local_file
from magcomp.model import Analysis, CompassResult, Grade, MotorFit, ParameterSet, Recording
from magcomp.model.recording import FloatArray
from magcomp.sources import read
from magcomp.writing.files import write_parameter_file

_NOT_IN_A_NAME = re.compile(r"[^A-Za-z0-9_.-]+")
_LONGEST_NAME = 80


@dataclass(frozen=True)
class Written:
    """What became of the file of one aircraft.

    Attributes
    ----------
    aircraft
        Its name.
    path
        The file; None where none is written.
    why
        Why none is written.
    """

    aircraft: str
    path: Path | None
    why: str = ""


def write_all(aircraft: Iterable[Aircraft], folder: Path, *, force: bool) -> Iterator[Written]:
    """Write a parameter file for each aircraft whose newest flights give one, and tell of each.

    Parameters
    ----------
    aircraft
        Of the fleet.
    folder
        Where to.
    force
        Whether files that are there may be replaced.
    """
    names: set[str] = set()
    for each in aircraft:
        path = folder / f"{_file_name(each, names)}.param"
        try:
            write_parameter_file(path, parameters_of(each), force=force)
        except MagcompError as error:
            yield Written(each.name, None, str(error))
        else:
            yield Written(each.name, path)


def _file_name(each: Aircraft, taken: set[str]) -> str:
    base = _NOT_IN_A_NAME.sub("_", each.name).strip("._-")[-_LONGEST_NAME:] or "aircraft"
    name, number = base, 1
    while name.casefold() in taken:
        number += 1
        name = f"{base}-{number}"
    taken.add(name.casefold())
    return name


def parameters_of(each: Aircraft) -> ParameterSet:
    """The parameters that follow from all flights of an aircraft.

    Raises
    ------
    MissingDataError
        Where no flight of it has a fit to be trusted.
    LogError
        Where the newest such flight cannot be read any more.
    """
    newest = _newest(each)
    if newest is None:
        raise MissingDataError(f"{each.name} must have a flight whose fit is to be trusted")
    with local_file(newest.path) as path:
        recording = read(path)
    return pooled_set(recording, analyse(recording), each.compasses)


def _newest(each: Aircraft) -> Flight | None:
    trusted = [
        flight
        for compass in each.compasses
        for flight in compass.flights
        if flight.verdict != Grade.REJECTED
    ]
    return max(trusted, key=lambda flight: (flight.when, flight.path), default=None)


def pooled_set(
    recording: Recording, analysis: Analysis, histories: Iterable[CompassHistory]
) -> ParameterSet:
    """An analysis's parameters with the motor vectors of several flights.

    Parameters
    ----------
    recording, analysis
        The newest flight that is to be trusted.
    histories
        Of its aircraft's compasses.
    """
    pooled = {
        one.compass: (one.pooled, one.regressor)
        for one in histories
        if one.pooled is not None and one.agree
    }
    if analysis.only_to_look_at:
        raise MissingDataError(
            f"{analysis.source} must give parameters; instead {analysis.only_to_look_at}"
        )
    used = {
        result.fit.compass: pooled[result.fit.compass][0]
        for result in analysis.compasses
        if result.fit.compass in pooled
        and pooled[result.fit.compass][1] == result.fit.regressor
        # What is kept is what the flight cannot tell from better: there is nothing to improve.
        and not result.fit.kept
        and result.verdict.grade is not Grade.REJECTED
    }
    results = _with_motors(recording, analysis.compasses, used)
    chosen = parameter_set(replace(analysis, compasses=results))
    said = tuple(
        f"compass {compass}: motor vector of {one.count} flights together, which scatter by "
        f"{one.scatter:.3f} mGauss per unit"
        for compass, one in sorted(used.items())
    )
    return replace(chosen, comments=(*chosen.comments, *said))


def _with_motors(
    recording: Recording, results: Iterable[CompassResult], pooled: Mapping[int, Pooled]
) -> tuple[CompassResult, ...]:
    changed = [
        replace(each, fit=with_motor(each.fit, pooled[each.fit.compass].motor))
        if each.fit.compass in pooled
        else each
        for each in results
    ]
    emitted = emit(recording, [each.fit for each in changed])
    accepted = any(each.verdict.grade is not Grade.REJECTED for each in changed)
    return tuple(
        replace(
            each,
            parameters=(
                (emitted[each.fit.compass].left_out if accepted else {})
                if each.verdict.grade is Grade.REJECTED
                else emitted[each.fit.compass].accepted
            ),
            insisted=emitted[each.fit.compass].accepted,
            left_out=emitted[each.fit.compass].left_out if accepted else {},
        )
        for each in changed
    )


def with_motor(fit: MotorFit, motor: FloatArray) -> MotorFit:
    """A fit with another motor vector, its offsets moved so that nothing changes in the middle.

    Parameters
    ----------
    fit
        Of one flight.
    motor
        mGauss per unit, shape (3,).

    Notes
    -----
    D·(raw + offset) + M·u stays the same at the middle of the range covered, where the flight knows
    the offsets best: offset' = offset + D⁻¹·(M − M')·u.
    """
    correction = fit.correction
    middle = (fit.u_low + fit.u_high) / 2
    moved = np.linalg.solve(correction.soft_iron, correction.vector - motor) * middle
    return replace(
        fit, correction=replace(correction, offset=correction.offset + moved, motor=motor)
    )
