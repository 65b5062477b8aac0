"""An analysis as one JSON object: the form that scripts rely on.

Keys are added, never renamed; docs/schema/ names them all. A number that does not exist is null;
NaN and infinity never appear.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from magcomp import __version__
from magcomp.align import on_lift_alone
from magcomp.judge.judge import error_at
from magcomp.model import (
    Analysis,
    CompassResult,
    Coverage,
    FieldResidual,
    Grade,
    HeadingError,
    Lags,
    Line,
    Recording,
    Vehicle,
    Verdict,
    quantity_of,
)


def analysis_object(analysis: Analysis, written: str | None = None) -> dict[str, Any]:
    """What ``magcomp fit --json`` prints.

    Parameters
    ----------
    analysis
        The answer.
    written
        The parameter file it went to, if any.
    """
    return {
        **head(analysis.source, analysis.duration_s, analysis.vehicle),
        "verdict": analysis.grade.value,
        "compasses": [_compass(result) for result in analysis.compasses],
        "notes": list(analysis.notes),
        "only_to_look_at": analysis.only_to_look_at or None,
        "written": written,
    }


def check_object(
    recording: Recording, verdicts: Mapping[int, Verdict], regressor: str
) -> dict[str, Any]:
    """What ``magcomp check --json`` prints."""
    left_out = on_lift_alone(recording)[1]
    return {
        **head(recording.source, recording.duration_s, recording.vehicle),
        "notes": [left_out] if left_out else [],
        "compasses": [
            {
                "compass": compass,
                "regressor": regressor,
                "unit": quantity_of(regressor).unit,
                "heading_error_deg": [
                    {"u": row.u, "in_force": row.before, "p95": row.p95}
                    for row in verdict.heading_error
                ],
                "quoted": _quoted_in_force(verdict),
                "field_residual_mgauss": {"in_force": verdict.residual.before},
                "coverage": _coverage(verdict.coverage),
                "verdict": verdict.grade.value,
                "reasons": list(verdict.reasons),
            }
            for compass, verdict in sorted(verdicts.items())
        ],
    }


def dumps(document: Mapping[str, Any]) -> str:
    """The object as text, ASCII only, with a line feed at its end."""
    return json.dumps(_finite(document), indent=2, allow_nan=False) + "\n"


SCHEMA = 1
"""Of docs/schema/: grows only when a key goes or changes its meaning."""


def head(source: str, duration_s: float, vehicle: Vehicle) -> dict[str, Any]:
    """What every object of a log begins with."""
    return {
        "magcomp": __version__,
        "schema": SCHEMA,
        "source": source,
        "duration_s": round(duration_s, 3),
        "vehicle": {
            "autopilot": vehicle.autopilot,
            "kind": vehicle.kind,
            "system": vehicle.system,
            "component": vehicle.component,
            "firmware": vehicle.firmware,
            "device_ids": list(vehicle.device_ids),
            "compasses": [
                {
                    "slot": compass.slot,
                    "device_id": compass.device_id,
                    "external": compass.external,
                    "used": compass.used,
                }
                for compass in vehicle.compasses
            ],
        },
    }


def _compass(result: CompassResult) -> dict[str, Any]:
    fit, verdict = result.fit, result.verdict
    return {
        "compass": fit.compass,
        "method": fit.method,
        "why": fit.why,
        "regressor": fit.regressor,
        "unit": quantity_of(fit.regressor).unit,
        "origin": fit.origin,
        "interference_mgauss": fit.interference,
        "std_mgauss": fit.interference_std,
        "lag_s": _lags(fit.lags),
        "lag_std_s": _lags(fit.lags_std),
        "line": None if fit.line is None else _line(fit.line),
        "levels": [
            {
                "u": level.u,
                "centre_mgauss": level.centre,
                "std_mgauss": np.sqrt(np.diag(level.covariance)),
                "count": level.count,
            }
            for level in fit.levels
        ],
        "field_residual_mgauss": _residual(verdict.residual),
        "heading_error_deg": [
            {"u": row.u, "before": row.before, "after": row.after, "p95": row.p95}
            for row in verdict.heading_error
        ],
        "quoted": quoted(result),
        "coverage": _coverage(verdict.coverage),
        "free": sorted(fit.free),
        "earth_mgauss": {"strength": fit.strength, "vertical": fit.vertical},
        "noise_mgauss": fit.noise,
        "kept": fit.kept,
        "count": fit.count,
        "motors": [
            {"motor": number, "interference_mgauss": vector, "std_mgauss": std}
            for number, vector, std in fit.by_motor
        ],
        "forms": [
            {
                "form": form.name,
                "numbers": form.count,
                "held_out_mgauss": form.held_out,
                "left_deg": form.left_deg,
                "best": form.is_best,
            }
            for form in result.forms
        ],
        "as_written": None
        if result.as_written is None
        else {
            "regressor": result.as_written.regressor,
            "exponent": result.as_written.exponent,
            "left_deg": result.as_written.left_deg,
        },
        "parameters": dict(result.parameters),
        "verdict": verdict.grade.value,
        "reasons": list(verdict.reasons),
    }


def quoted(result: CompassResult) -> dict[str, float | bool]:
    """The one row of the heading errors that every sentence and card quotes.

    It is the hover's, or the highest control quantity's where only there something is gained, or
    where a vehicle that stood still cannot show what is gained.
    """
    verdict = result.verdict
    row, is_hover = error_at(verdict.heading_error, _hover(verdict)), True
    if row.before <= row.p95:
        top = error_at(verdict.heading_error, verdict.coverage.u_high)
        if result.fit.method == "sweep" or top.before > top.p95:
            row, is_hover = top, False
    return {
        "u": row.u,
        "before": row.before,
        "after": row.after,
        "p95": row.p95,
        "hover": is_hover,
    }


def quoted_row(quoted: Mapping[str, float]) -> HeadingError:
    """The row that :func:`quoted` tells of."""
    return HeadingError(*(quoted[name] for name in ("u", "before", "after", "p95")))


def _hover(verdict: Verdict) -> float:
    """The control quantity in use half of the time, or the middle of what was covered."""
    covered = verdict.coverage
    middle = 0.5 * (covered.u_low + covered.u_high)
    return covered.u_median if math.isfinite(covered.u_median) else middle


def _quoted_in_force(verdict: Verdict) -> dict[str, float | bool] | None:
    """The row that is quoted of a calibration in force; None where there is no row at all.

    It is the hover's, or the worst where only that is more than its doubt and the judge minds.
    """
    rows = verdict.heading_error
    if not rows:
        return None
    row, is_hover = error_at(rows, _hover(verdict)), True
    if verdict.grade is not Grade.GOOD and not _is_told(row):
        worst = max(rows, key=lambda each: each.before)
        if _is_told(worst):
            row, is_hover = worst, False
    return {"u": row.u, "in_force": row.before, "p95": row.p95, "hover": is_hover}


def _is_told(row: HeadingError) -> bool:
    """Whether an error in force is more than the doubt about it."""
    return row.before > row.p95 - row.before


def _lags(lags: Lags) -> dict[str, float]:
    return {"field": lags.field, "regressor": lags.regressor}


def _line(line: Line) -> dict[str, Any]:
    return {
        "point_mgauss": line.point,
        "direction": line.direction,
        "straightness": line.straightness,
        "rms_mgauss": line.rms,
        "positions_mgauss": line.positions,
        "slope_mgauss": line.slope,
        "slope_std_mgauss": line.slope_std,
    }


def _residual(residual: FieldResidual) -> dict[str, float]:
    return {
        "before": residual.before,
        "after": residual.after,
        "held_out": residual.held_out,
        "held_out_before": residual.held_out_before,
    }


def _coverage(coverage: Coverage) -> dict[str, float]:
    return {
        "sphere": coverage.sphere,
        "heading": coverage.heading,
        "tilt_deg": coverage.tilt_deg,
        "u_low": coverage.u_low,
        "u_high": coverage.u_high,
        "seconds": coverage.seconds,
        "u_median": coverage.u_median,
    }


def _finite(value: Any) -> Any:
    """Plain Python values, with None for every number that is not finite."""
    match value:
        case dict():
            return {key: _finite(item) for key, item in value.items()}
        case list() | tuple():
            return [_finite(item) for item in value]
        case np.ndarray():
            return _finite(value.tolist())
        case np.generic():
            return _finite(value.item())
        case float():
            return value if math.isfinite(value) else None
    return value
