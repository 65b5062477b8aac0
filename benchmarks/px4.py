"""What PX4's emitted parameters leave of heading error, against the truth beside each recording.

For every NAME.ulg with a NAME.json in the folder: each compass by its device, and the largest
heading error from no current to the top flown, over all yaws, level and tilted:

    before   with what was in force
    fit      with what was fitted, if the firmware had no dead zones
    after    with the emitted parameters behind the firmware's dead zones, restarted or not
    p95      the bound that magcomp itself states
    ideal    what an estimator that reaches the Cramér-Rao bound leaves: the median, and the value
             that 95 % of its fits do not exceed

The bound knows what the recording was made with: the noise of the sensor, an attitude without
error, a calibration in force that is an ordinary one, lags and current.

    python benchmarks/px4.py [FOLDER]
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from ideal import Sizes, covariance, drawn

from magcomp.analysis import analyse, parameter_set
from magcomp.model import CURRENT, Correction, FloatArray, Recording
from magcomp.sources import read

TESTS = Path(__file__).resolve().parent.parent / "tests"
MGAUSS = 1000.0
DRAWS = 200
NOISE = Sizes(noise=4.0, drift=0.0, drift_s=1.0, level=0.0, wander=0.0, wander_s=1.0, lean=0.0)


def correcting(
    correction: Correction, sensor: Any, per_power: float
) -> Callable[[FloatArray, float], FloatArray]:
    """A correction in magcomp's own form as it would correct what the sensor says, gauss."""

    def correct(sensed: FloatArray, power: float) -> FloatArray:
        body = MGAUSS * sensed @ sensor.rotation.T
        return np.asarray(correction.apply(body, np.full(len(body), per_power * power)) / MGAUSS)

    return correct


def exact_correction(sensor: Any, per_power: float) -> Correction:
    """The truth in magcomp's own form."""
    turned = sensor.rotation @ sensor.soft_iron
    return Correction(
        -MGAUSS * sensor.rotation @ sensor.offset,
        turned @ sensor.rotation.T,
        MGAUSS / per_power * turned @ sensor.motor,
    )


def ideal(
    px4_truth: ModuleType, truth: Any, sensor: Any, recording: Recording, per_power: float
) -> tuple[float, float]:
    """Median and 95 % of what an estimator at the bound leaves, degrees."""
    exact = exact_correction(sensor, per_power)
    spread = covariance(recording, exact, MGAUSS * truth.earth, NOISE, calibrated=True)
    rng = np.random.default_rng(0)
    each = [
        px4_truth.left_deg(truth, sensor, correcting(drawn(exact, spread, rng), sensor, per_power))
        for _ in range(DRAWS)
    ]
    return float(np.median(each)), float(np.quantile(each, 0.95))


def main() -> None:
    # The firmware's formula, written down once more for the tests.
    sys.path.insert(0, str(TESTS))
    px4_truth = importlib.import_module("px4_truth")

    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else px4_truth.RECORDINGS
    head = f"{'recording':<34}{'device':>7}  {'verdict':<9}{'by':<9}"
    print(f"{head}{'before':>8}{'fit':>7}{'after':>7}{'p95':>7}{'ideal, 95 %':>16}")
    for log in sorted(folder.glob("*.ulg")):
        recording = read(log)
        analysis = analyse(recording)
        truth = px4_truth.of_document(log.with_suffix(".json"))
        stored = recording.parameters.latest
        emitted = parameter_set(analysis, include_rejected=True).values
        slots = {compass.device_id: compass.slot for compass in recording.vehicle.compasses}
        results = {result.fit.compass: result for result in analysis.compasses}
        for sensor in truth.sensors:
            result = results[slots[sensor.device]]
            by_current = result.fit.regressor == CURRENT
            per_power = MGAUSS if by_current else 1.0
            control = recording.current if by_current else recording.throttle
            seen = replace(
                recording,
                field={1: recording.field[result.fit.compass]},
                current=control,
            )
            before = px4_truth.heading_error_deg(truth, sensor, stored, {})
            fitted = px4_truth.left_deg(
                truth, sensor, correcting(result.fit.correction, sensor, per_power)
            )
            after = px4_truth.heading_error_deg(truth, sensor, stored, emitted)
            top = per_power * truth.top
            bound = max(row.p95 for row in result.verdict.heading_error if row.u <= top)
            middle, most = ideal(px4_truth, truth, sensor, seen, per_power)
            print(
                f"{log.stem:<34}{sensor.device:>7}  {result.verdict.grade.value:<9}"
                f"{result.fit.regressor:<9}{before:>7.2f}°{fitted:>6.2f}°{after:>6.2f}°"
                f"{bound:>6.2f}°{middle:>8.2f}°{most:>6.2f}°",
                flush=True,
            )


if __name__ == "__main__":
    main()
