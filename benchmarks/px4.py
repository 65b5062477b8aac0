"""What PX4's emitted parameters leave of heading error, against the truth beside each recording.

For every NAME.ulg with a NAME.json in the folder: each compass by its device, the largest heading
error from no current to the top flown, over all yaws, level and tilted, after the firmware's own
dead zones, whether it restarts or not; and the 95 % bound that magcomp itself states.

    python benchmarks/px4.py [FOLDER]
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

from magcomp.analysis import analyse, parameter_set
from magcomp.sources import read

TESTS = Path(__file__).resolve().parent.parent / "tests"


def main() -> None:
    # The firmware's formula, written down once more for the tests.
    sys.path.insert(0, str(TESTS))
    px4_truth = importlib.import_module("px4_truth")

    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else px4_truth.RECORDINGS
    head = f"{'recording':<34}{'device':>7}  {'verdict':<9}{'by':<9}"
    print(f"{head}{'before':>8}{'after':>8}{'p95':>7}")
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
            before = px4_truth.heading_error_deg(truth, sensor, stored, {})
            after = px4_truth.heading_error_deg(truth, sensor, stored, emitted)
            bound = max(row.p95 for row in result.verdict.heading_error if row.u <= truth.top)
            print(
                f"{log.stem:<34}{sensor.device:>7}  {result.verdict.grade.value:<9}"
                f"{result.fit.regressor:<9}{before:>7.2f}°{after:>7.2f}°{bound:>6.2f}°"
            )


if __name__ == "__main__":
    main()
