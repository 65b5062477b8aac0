"""What the emitted parameters leave of heading error, against the truth beside each recording.

For every NAME.tlog and NAME.BIN with a NAME.json (sitl_fixtures/ by default): the largest heading
error at any current 0 … 50 A, over all yaws, level and tilted 20°, of each compass, and the 95 %
bound that magcomp itself states. Sweeps: the error of the interference vector; where only the
throttle was recorded, against the vector times the 120 A that full throttle drew (recordings
README).

    python benchmarks/accuracy.py [FOLDER]
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from magcomp.analysis import analyse
from magcomp.autopilots import ardupilot
from magcomp.cli.truth import KnownTruth
from magcomp.model import CURRENT, CompassResult, Recording
from magcomp.sources import read

FIXTURES = Path(__file__).resolve().parent.parent / "sitl_fixtures"
AMPERES = np.arange(0.0, 51.0, 5.0)
AMPERES_AT_FULL_THROTTLE = 120.0


def heading_error(log: Path, result: CompassResult, recording: Recording) -> str:
    bound = max(row.p95 for row in result.verdict.heading_error if row.u <= AMPERES[-1])
    if result.fit.regressor != CURRENT:
        # The truth is told by the ampere, and what is written multiplies another quantity.
        return f"not told (bound {bound:.2f}°)"
    truth = KnownTruth(log.with_suffix(".json"))
    values = {**recording.parameters.latest, **result.parameters}
    written = ardupilot.ArduPilot().in_force(values, result.fit.compass).correction
    errors = [
        truth.heading_error_deg(written, result.fit.compass, float(a), recording.start_unix_s)
        for a in AMPERES
    ]
    return f"{max(errors):.2f}° (bound {bound:.2f}°)"


def vector_error(log: Path, result: CompassResult) -> str:
    document = json.loads(log.with_suffix(".json").read_text(encoding="utf-8"))
    scale = 1.0 if result.fit.regressor == CURRENT else AMPERES_AT_FULL_THROTTLE
    exact = np.array(document["mot_mgauss_per_amp"]) * scale
    names = ardupilot.vector_names("MOT", result.fit.compass)
    found = -np.array([result.parameters[name] for name in names])
    return f"{np.linalg.norm(found - exact) / np.linalg.norm(exact):.2%}"


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else FIXTURES
    print(f"{'recording':<28}{'method':<8}{'by':<9} compass 1, 2, 3")
    logs = (path for path in folder.iterdir() if path.suffix in {".tlog", ".BIN"})
    for log in sorted(logs):
        if not log.with_suffix(".json").exists():
            continue
        recording = read(log)
        results = analyse(recording).compasses
        cells = [
            "rejected"
            if not result.parameters
            else vector_error(log, result)
            if result.fit.method == "sweep"
            else heading_error(log, result, recording)
            for result in results
        ]
        fit = results[0].fit
        print(f"{log.name:<28}{fit.method:<8}{fit.regressor:<9} {', '.join(cells)}")


if __name__ == "__main__":
    main()
