"""Fit a log from Python, and look at what came out.

python examples/fit_a_log.py sitl_fixtures/flight.tlog
"""

from __future__ import annotations

import sys

import numpy as np

from magcomp.analysis import Options, analyse, parameter_set
from magcomp.sources import read


def main(path: str) -> None:
    """Print the interference, the verdict and the parameters."""
    np.set_printoptions(precision=3, suppress=True)
    analysis = analyse(read(path), Options(method="auto"))
    for result in analysis.compasses:
        fit, verdict = result.fit, result.verdict
        print(f"compass {fit.compass}: {verdict.grade.value}, {verdict.reasons[0]}")
        print(f"  the motors add {fit.interference} ± {fit.interference_std} mGauss")
        for row in verdict.heading_error:
            print(f"  at {row.u:5.1f}: {row.before:5.1f}° before, at most {row.p95:.1f}° after")
    for name, value in parameter_set(analysis).values.items():
        print(f"{name} {value:g}")


if __name__ == "__main__":
    main(*sys.argv[1:2] or ["sitl_fixtures/flight.tlog"])
