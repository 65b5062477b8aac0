"""One compass of one log as one row: what is kept of an analysis for good."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from typing import Any

from magcomp import __version__
from magcomp.judge.judge import error_at
from magcomp.model import Analysis, CompassResult, Correction, Recording
from magcomp.model.fit import CORRECTION_SIZE, HeadingError, MotorFit, Verdict, pack

MOTOR_COVARIANCE_SIZE = 6


class State(StrEnum):
    """What became of a log."""

    FITTED = "fitted"
    COPY = "copy"
    UNUSABLE = "unusable"
    LOST = "lost"


def _nothing(count: int) -> tuple[float, ...]:
    return (math.nan,) * count


@dataclass(frozen=True)
class Log:
    """A log as it was found, not opened.

    Attributes
    ----------
    path
        File or address.
    size
        Bytes; -1 where the place does not say.
    stamp
        Changes with the content: time of the last change, or what an object store gives instead.
    modified_s
        Unix time of the last change; NaN where unknown.
    """

    path: str
    size: int
    stamp: str
    modified_s: float = math.nan


@dataclass(frozen=True)
class Row:
    """One compass of one log, or a log that gave none.

    Attributes
    ----------
    path, size, stamp, modified_s
        As in :class:`Log`.
    digest
        SHA-256 of the content; empty where it could not be read.
    magcomp
        Version that made the row.
    state, why
        A :class:`State`; the reason of one that is unusable or lost. A copy has the digest of
        the log whose rows stand for it, and nothing else.
    autopilot, kind, firmware, system, uid, device_ids
        Of the vehicle; device ids in the order of their slots, separated by blanks.
    start_unix_s, duration_s
        Of the recording; NaN where unknown.
    compass, device_id
        Slot, 0 where there is none, and the id of what stands in it, 0 where unknown.
    verdict, reasons
        The judge's grade, and its reasons, a line each.
    method, regressor, kept
        Of the fit.
    before_deg, after_deg, bound_deg
        Largest heading error in the range covered: in force, fitted, and the 95 % bound.
    u_low, u_high, seconds, count
        What the data cover.
    strength, vertical
        Earth field as found, mGauss.
    held_out_before, held_out
        Unexplained field on unseen data, mGauss.
    correction, in_force
        The 12 numbers of :func:`magcomp.model.fit.pack`, fitted and in force.
    motor_covariance
        Of the fitted motor vector: xx, yy, zz, xy, xz, yz.
    parameters
        What would be written, a JSON object.
    notes
        Of the analysis, a line each.
    """

    path: str
    size: int
    stamp: str
    modified_s: float
    digest: str
    magcomp: str
    state: str
    why: str = ""
    autopilot: str = ""
    kind: str = ""
    firmware: str = ""
    system: int = 0
    uid: str = ""
    device_ids: str = ""
    start_unix_s: float = math.nan
    duration_s: float = math.nan
    compass: int = 0
    device_id: int = 0
    verdict: str = ""
    reasons: str = ""
    method: str = ""
    regressor: str = ""
    kept: bool = False
    before_deg: float = math.nan
    after_deg: float = math.nan
    bound_deg: float = math.nan
    u_low: float = math.nan
    u_high: float = math.nan
    seconds: float = math.nan
    count: int = 0
    strength: float = math.nan
    vertical: float = math.nan
    held_out_before: float = math.nan
    held_out: float = math.nan
    correction: tuple[float, ...] = field(default=_nothing(CORRECTION_SIZE))
    in_force: tuple[float, ...] = field(default=_nothing(CORRECTION_SIZE))
    motor_covariance: tuple[float, ...] = field(default=_nothing(MOTOR_COVARIANCE_SIZE))
    parameters: str = "{}"
    notes: str = ""


COLUMNS = tuple(each.name for each in fields(Row))

VECTORS = {
    "correction": CORRECTION_SIZE,
    "in_force": CORRECTION_SIZE,
    "motor_covariance": MOTOR_COVARIANCE_SIZE,
}
"""Columns that hold several numbers, and how many."""


def rows_of(log: Log, digest: str, recording: Recording, analysis: Analysis) -> tuple[Row, ...]:
    """The rows of a log that could be fitted, one a compass."""
    return tuple(_row(log, digest, recording, analysis, each) for each in analysis.compasses)


def without_fit(
    log: Log, digest: str, why: str, *, state: State = State.UNUSABLE, of: Recording | None = None
) -> tuple[Row, ...]:
    """The one row of a log that gave no fit.

    Parameters
    ----------
    log, digest
        The log.
    why
        The reason, for people.
    state
        Whether the log could not be used, or was lost with its worker.
    of
        What could be read of it, if anything.
    """
    return (Row(**_head(log, digest, of), state=state.value, why=why),)


def _head(log: Log, digest: str, recording: Recording | None) -> dict[str, Any]:
    head: dict[str, Any] = {
        "path": log.path,
        "size": log.size,
        "stamp": log.stamp,
        "modified_s": log.modified_s,
        "digest": digest,
        "magcomp": __version__,
    }
    if recording is None:
        return head
    vehicle = recording.vehicle
    return {
        **head,
        "autopilot": vehicle.autopilot,
        "kind": vehicle.kind,
        "firmware": vehicle.firmware,
        "system": vehicle.system,
        "uid": vehicle.uid,
        "device_ids": " ".join(map(str, vehicle.device_ids)),
        "start_unix_s": recording.start_unix_s,
        "duration_s": recording.duration_s,
    }


def _row(
    log: Log, digest: str, recording: Recording, analysis: Analysis, result: CompassResult
) -> Row:
    fit, verdict = result.fit, result.verdict
    ids = {each.slot: each.device_id for each in recording.vehicle.compasses}
    errors = _flown(fit, verdict)
    covariance = fit.shared_covariance
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return Row(
        **_head(log, digest, recording),
        state=State.FITTED.value,
        compass=fit.compass,
        device_id=ids.get(fit.compass, 0),
        verdict=verdict.grade.value,
        reasons="\n".join(verdict.reasons),
        method=fit.method,
        regressor=fit.regressor,
        kept=fit.kept,
        before_deg=_largest(e.before for e in errors),
        after_deg=_largest(e.after for e in errors),
        bound_deg=_largest(e.p95 for e in errors),
        u_low=float(fit.u_low),
        u_high=float(fit.u_high),
        seconds=float(verdict.coverage.seconds),
        count=int(fit.count),
        strength=float(fit.strength),
        vertical=float(fit.vertical),
        held_out_before=float(verdict.residual.held_out_before),
        held_out=float(verdict.residual.held_out),
        correction=_of_one_part(fit.correction),
        in_force=_of_one_part(result.in_force),
        motor_covariance=tuple(float(covariance[pair]) for pair in pairs),
        parameters=json.dumps(dict(result.parameters)),
        notes="\n".join(analysis.notes),
    )


def _flown(fit: MotorFit, verdict: Verdict) -> list[HeadingError]:
    """The heading errors up to the top of what was flown, which lies between two of the table."""
    errors = verdict.heading_error
    if not errors:
        return []
    return [*(each for each in errors if each.u <= fit.u_high), error_at(errors, fit.u_high)]


def _of_one_part(correction: Correction) -> tuple[float, ...]:
    """The 12 parameters; of a correction motor by motor with the mean of its vectors."""
    return tuple(pack(replace(correction, motor=correction.vector)).tolist())


def _largest(values: Iterable[float]) -> float:
    finite = [float(value) for value in values if math.isfinite(value)]
    return max(finite, default=math.nan)
