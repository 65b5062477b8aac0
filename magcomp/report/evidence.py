"""The readings behind a result, thinned and frozen, for whoever draws them.

Nothing is fitted here: the readings are aligned as the fit aligned them and the fitted
correction is applied to them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from magcomp.align import (
    controls,
    currents_of_motors,
    on_lift_alone,
    readings,
    sample,
    to_undo,
)
from magcomp.errors import MissingDataError
from magcomp.fit import departures, residuals
from magcomp.geometry import heading
from magcomp.judge.evidence import used_lags
from magcomp.judge.heading_error import level_errors, multiplied_in_force, present_by
from magcomp.model import (
    CompassResult,
    Control,
    FloatArray,
    InForce,
    IntArray,
    MotorFit,
    Recording,
    Samples,
)
from magcomp.report import as_json
from magcomp.report.strip import Strip, strip

MOST_POINTS = 1500
"""Readings a picture is drawn from; more only make it slower."""

SPHERE_BANDS, SPHERE_SECTORS = 6, 12
"""Equal-area cells the judge counts its coverage of the sphere in."""

TURN_SECTORS, CONTROL_BANDS = 24, 8


@dataclass(frozen=True, eq=False)
class CompassPlots:
    """One compass, ready to be drawn.

    Attributes
    ----------
    compass
        1, 2 or 3.
    time, u
        Seconds and control quantity of the thinned readings, shape (n,).
    raw
        Sensor field, the autopilot's correction undone, mGauss, shape (n, 3).
    parts
        Names of the residual columns: strength and vertical part, or the three body axes
        where the vehicle stood still.
    before, after
        Field left unexplained with the correction in force and with the fit, mGauss, shape
        (n, k), k the number of ``parts``.
    strength_before, strength_after
        Length of the corrected field, mGauss, shape (n,).
    unexplained_before, unexplained_after
        Lengths of the residual rows of all readings, mGauss, shape (m,), m ≥ n.
    sphere
        Readings in each equal-area cell of the sphere of field directions in body axes, shape
        (6 bands of z from −1 to 1, 12 sectors of azimuth from −π to π).
    turn
        Readings in each cell of control quantity and magnetic heading, shape (8, 24).
    turn_edges
        Edges of the bands of control quantity, shape (9,).
    reported_count
        Field messages in the recording, repeats included.
    count
        New readings, m.
    rate_hz
        Median rate of new readings; NaN for fewer than two.
    longest_gap_s
        Longest time without a reading.
    level_errors
        Heading error of the correction in force over a level turn at the control quantity that is
        quoted, radians, at true headings 0°, 10° … 350°, shape (36,).
    strip
        Which parts of the recording were used.
    """

    compass: int
    time: FloatArray
    u: FloatArray
    raw: FloatArray
    parts: tuple[str, ...]
    before: FloatArray
    after: FloatArray
    strength_before: FloatArray
    strength_after: FloatArray
    unexplained_before: FloatArray
    unexplained_after: FloatArray
    sphere: IntArray
    turn: IntArray
    turn_edges: FloatArray
    reported_count: int
    count: int
    rate_hz: float
    longest_gap_s: float
    level_errors: FloatArray
    strip: Strip


def compass_plots(
    recording: Recording,
    result: CompassResult,
    *,
    start: float = -np.inf,
    end: float = np.inf,
    most: int = MOST_POINTS,
) -> CompassPlots:
    """Gather what the pictures of one compass need.

    Parameters
    ----------
    recording
        What the result was fitted on.
    result
        One compass of its analysis.
    start, end
        The part of the recording that was analysed, seconds.
    most
        Readings to keep for drawing.

    Raises
    ------
    MissingDataError
        Where the recording is not the one the result was fitted on.
    """
    fit = result.fit
    samples, present, in_force = _samples(recording, fit, start, end)
    quoted = np.array([as_json.quoted(result)["u"]])
    multiplied = multiplied_in_force(quoted, present.regressor, fit, in_force, samples)
    corrected = fit.correction.apply(samples.raw, samples.u)
    parts, before, after = _unexplained(fit, samples, corrected)
    keep = _thinned(len(samples), most)
    steps = np.diff(samples.time)
    turn, edges = _turn(samples, corrected)
    return CompassPlots(
        compass=fit.compass,
        time=samples.time[keep],
        u=samples.total[keep],
        raw=samples.raw[keep],
        parts=parts,
        before=before[keep],
        after=after[keep],
        strength_before=np.linalg.norm(samples.present[keep], axis=1),
        strength_after=np.linalg.norm(corrected[keep], axis=1),
        unexplained_before=np.linalg.norm(before, axis=1),
        unexplained_after=np.linalg.norm(after, axis=1),
        sphere=_sphere(corrected),
        turn=turn,
        turn_edges=edges,
        reported_count=len(recording.field[fit.compass]),
        count=len(samples),
        rate_hz=float(1.0 / np.median(steps)) if len(steps) else np.nan,
        longest_gap_s=float(steps.max()) if len(steps) else np.nan,
        level_errors=level_errors(
            fit,
            present_by(present, in_force, samples),
            float(quoted[0]),
            float(multiplied[0]),
        ),
        strip=strip(recording, samples.time),
    )


def _samples(
    recording: Recording, fit: MotorFit, start: float, end: float
) -> tuple[Samples, InForce, Mapping[str, Control]]:
    """The readings as the fit saw them, what was in force at their end, and what it multiplies."""
    recording, _ = on_lift_alone(recording)
    found = controls(recording)
    forms = currents_of_motors(recording) if fit.numbers else found
    control = _control(forms, fit, recording.source)
    in_force = {**to_undo(recording, found), control.kind: control}
    new = readings(recording, fit.compass, start=start, end=end)
    return sample(new, control, in_force, used_lags(fit)), new.in_force[-1], in_force


def _control(found: tuple[Control, ...], fit: MotorFit, source: str) -> Control:
    """The form of the control quantity that the fit chose."""
    for control in found:
        if control.kind == fit.regressor and control.origin == fit.origin:
            return control
    raise MissingDataError(
        f"{source} must hold the {fit.regressor} ({fit.origin}) that compass {fit.compass} was "
        "fitted with; instead it holds none"
    )


def _unexplained(
    fit: MotorFit, samples: Samples, corrected: FloatArray
) -> tuple[tuple[str, ...], FloatArray, FloatArray]:
    """What the judge calls unexplained, before and after, row by row."""
    if fit.method == "sweep":
        return (
            ("x", "y", "z"),
            samples.present - np.median(samples.present, axis=0),
            corrected - np.median(corrected, axis=0),
        )
    middle = np.median(departures(samples.present, samples.down, 0.0, 0.0), axis=0)
    return (
        ("strength", "vertical part"),
        departures(samples.present, samples.down, float(middle[0]), float(middle[1])),
        residuals(samples, fit.correction, fit.strength, fit.vertical),
    )


def _thinned(count: int, most: int) -> IntArray:
    """Rows spread evenly over all of them."""
    if count <= most:
        return np.arange(count, dtype=np.intp)
    rows: IntArray = np.linspace(0, count - 1, most).astype(np.intp)
    return rows


def _sphere(corrected: FloatArray) -> IntArray:
    unit = corrected / np.maximum(np.linalg.norm(corrected, axis=1, keepdims=True), 1e-9)
    azimuth = np.arctan2(unit[:, 1], unit[:, 0])
    counts, _, _ = np.histogram2d(
        unit[:, 2],
        azimuth,
        bins=(SPHERE_BANDS, SPHERE_SECTORS),
        range=((-1.0, 1.0), (-np.pi, np.pi)),
    )
    return np.asarray(counts, dtype=np.intp)


def _turn(samples: Samples, corrected: FloatArray) -> tuple[IntArray, FloatArray]:
    yaw = heading(corrected, samples.attitude[:, 0], samples.attitude[:, 1])
    low, high = float(samples.total.min()), float(samples.total.max())
    edges = np.linspace(low, high if high > low else low + 1.0, CONTROL_BANDS + 1)
    counts, _, _ = np.histogram2d(
        samples.total,
        np.mod(yaw, 2 * np.pi),
        bins=(edges, np.linspace(0.0, 2 * np.pi, TURN_SECTORS + 1)),
    )
    return np.asarray(counts, dtype=np.intp), edges
