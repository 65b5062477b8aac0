"""How often the 95 % bound of the heading error holds, on simulated vehicles.

Each seed is another vehicle at another place: soft iron, offsets, motor wiring, noise. The bound
is compared with the true largest heading error, computed from the emitted parameters.

    python benchmarks/coverage.py [--seeds 10] [--programs flight,turntable,sweep]
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
from pathlib import Path

import numpy as np

from magcomp.analysis import analyse
from magcomp.earth import EarthField, expected_field
from magcomp.geometry import body_from_earth
from magcomp.judge import largest_shift
from magcomp.judge.heading_error import attitudes
from magcomp.model import CURRENT, CompassResult, Correction, symmetric
from magcomp.simulate import Truth, write_tlog
from magcomp.sources import read


def true_error(
    truth: Truth, exact: Correction, fitted: Correction, earth: EarthField, u: float
) -> float:
    """Largest heading error a correction leaves at a current that all motors share, degrees."""
    roll, pitch, yaw = attitudes()
    field = body_from_earth(roll, pitch, yaw) @ earth.ned
    disturbed = field + u * np.asarray(truth.interference)
    raw = disturbed @ np.linalg.inv(exact.soft_iron).T - exact.offset
    corrected = fitted.apply(raw, np.full(len(raw), u))
    return largest_shift(corrected, field, roll, pitch)


def exact_correction(truth: Truth, compass: int) -> Correction:
    """What the simulated sensor needs, from its truth in the form of sitl_fixtures/*.json."""
    values = truth.as_json()["compass"][compass - 1]
    soft_iron = symmetric(np.array([*values["dia"], *values["odi"]]))
    return Correction(np.array(values["ofs"]), soft_iron, np.zeros(3))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--programs", default="flight,turntable,sweep")
    arguments = parser.parse_args()
    ratios: dict[str, list[float]] = {}
    print(f"{'programme':<20}{'seed':>5}{'true °':>9}{'bound °':>9}")
    with tempfile.TemporaryDirectory() as folder:
        for program, calibrated in itertools.product(arguments.programs.split(","), (None, False)):
            if calibrated is False and program != "flight":
                continue
            for seed in range(1, arguments.seeds + 1):
                path = Path(folder) / "simulated.tlog"
                truth = write_tlog(path, program=program, seed=seed, calibrated=calibrated)
                recording = read(path)
                earth = expected_field(*truth.home, recording.start_unix_s)
                name = program if calibrated is None else f"{program} uncalibrated"
                results = analyse(recording).compasses
                ratios.setdefault(name, []).extend(_judge(name, seed, truth, results, earth))
    print()
    for name, found in (*ratios.items(), ("all", list(itertools.chain(*ratios.values())))):
        held = np.mean(np.array(found) <= 1.0)
        print(
            f"{name}: the 95 % bound held in {held:.1%} of {len(found)} cases; true / bound: "
            f"median {np.median(found):.2f}, 95 % {np.quantile(found, 0.95):.2f}, "
            f"largest {max(found):.2f}"
        )


def _judge(
    name: str, seed: int, truth: Truth, results: tuple[CompassResult, ...], earth: EarthField
) -> list[float]:
    ratios = []
    for result in results:
        if result.fit.regressor != CURRENT:
            continue
        exact = exact_correction(truth, result.fit.compass)
        for row in result.verdict.heading_error:
            found = true_error(truth, exact, result.fit.correction, earth, row.u)
            ratios.append(found / row.p95 if row.p95 > 0 else float(found > 1e-6))
            if row.u == 50.0:
                print(f"{name:<20}{seed:>5}{found:>9.2f}{row.p95:>9.2f}")
    return ratios


if __name__ == "__main__":
    main()
