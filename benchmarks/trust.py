"""How far a "good" can be trusted: simulated flights with the errors that real aircraft have.

The simulated vehicle's own attitude and compasses are exact but for noise. Here they get what real
ones have besides, in the amount of --scale: a constant tilt of the attitude, one that wanders
(first-order Gauss-Markov), one that follows acceleration (lean), and offsets that drift. The
truth stays what the vehicle was drawn with, and nothing of it is seen by the fit.

    python benchmarks/trust.py [--seeds 6] [--first 1] [--scale 1.0] [--programs flight,mission]

Columns: compasses by verdict; *holds* the share of rows of the table up to the largest
current flown, whose error is within the stated 95 % bound, over accepted fits; *bound/error* its
median; *wrong* goods that leave more than 2 degrees; *worse* accepted fits that raise the largest
error; *error* the median and the 90 % quantile of the largest error over accepted fits, degrees;
*ideal* the median, over accepted fits, of the error at the top current over what an estimator that
reaches the Cramér-Rao bound leaves there (the median of draws; ideal.py).
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from coverage import exact_correction, true_error
from ideal import Sizes, covariance, drawn

from magcomp.align.low_pass import low_pass
from magcomp.analysis import analyse
from magcomp.autopilots import ardupilot
from magcomp.earth import expected_field
from magcomp.model import CURRENT, FloatArray, Grade, Recording, Series
from magcomp.simulate import write_tlog
from magcomp.sources import read

LIMIT_DEG = 2.0
DRAWS = 60
LEVEL_DEG, WANDER_DEG, WANDER_S = 0.5, 0.4, 30.0
LEAN, LEAN_S = 0.03, 4.0
DRIFT_MGAUSS, DRIFT_S = 3.0, 120.0


@dataclass(frozen=True)
class Row:
    """One compass: its verdict, and pairs of stated bound and true error up to the top current."""

    grade: Grade
    pairs: tuple[tuple[float, float], ...]
    largest: float
    before: float
    beyond_ideal: float


def gauss_markov(
    time: FloatArray, size: float, constant: float, columns: int, rng: np.random.Generator
) -> FloatArray:
    """A process of that size and time at the given times, shape (n, columns)."""
    made = np.empty((len(time), columns))
    made[0] = rng.normal(size=columns)
    for row, apart in enumerate(np.diff(time), start=1):
        kept = np.exp(-max(apart, 0.0) / constant)
        made[row] = kept * made[row - 1] + np.sqrt(1.0 - kept**2) * rng.normal(size=columns)
    return size * made


def with_real_errors(recording: Recording, scale: float, rng: np.random.Generator) -> Recording:
    """The recording as worse sensors would have made it."""
    attitude = recording.attitude
    if attitude is None:
        return recording
    value = attitude.value.copy()
    step = float(np.median(np.diff(attitude.time)))
    lean = low_pass(value[:, :2] - np.median(value[:, :2], axis=0), step / (LEAN_S + step))
    value[:, :2] += scale * (
        np.radians(LEVEL_DEG) * rng.normal(size=2)
        + gauss_markov(attitude.time, np.radians(WANDER_DEG), WANDER_S, 2, rng)
        + LEAN * rng.normal(size=2) * lean
    )
    values = recording.parameters.latest
    field = {}
    for compass, series in recording.field.items():
        soft_iron = ardupilot.ArduPilot().in_force(values, compass).correction.soft_iron
        drift = scale * gauss_markov(series.time, DRIFT_MGAUSS, DRIFT_S, 3, rng)
        field[compass] = Series(series.time, series.value + drift @ soft_iron.T)
    return replace(recording, attitude=Series(attitude.time, value), field=field)


def rows_of(
    folder: Path, program: str, seed: int, scale: float, *, calibrated: bool
) -> Iterator[Row]:
    path = folder / "simulated.tlog"
    truth = write_tlog(path, program=program, seed=seed, calibrated=calibrated)
    simulated = read(path)
    recording = with_real_errors(simulated, scale, np.random.default_rng(seed))
    earth = expected_field(*truth.home, recording.start_unix_s)
    rng = np.random.default_rng([seed, 1])
    sizes = _sizes(truth.noise, scale)
    for result in analyse(recording).compasses:
        if result.fit.regressor != CURRENT:
            continue
        exact = exact_correction(truth, result.fit.compass)
        flown = [row for row in result.verdict.heading_error if row.u <= result.fit.u_high]
        errors, before = (
            [true_error(truth, exact, correction, earth, row.u) for row in flown]
            for correction in (result.fit.correction, result.in_force)
        )
        pairs = tuple(zip((row.p95 for row in flown), errors, strict=True))
        whole = replace(exact, motor=-np.asarray(truth.interference).reshape(3, 1))
        spread = covariance(simulated, whole, earth.ned, sizes, calibrated=calibrated)
        guesses = [drawn(whole, spread, rng) for _ in range(DRAWS)]
        ideal = np.median([true_error(truth, exact, g, earth, flown[-1].u) for g in guesses])
        beyond = errors[-1] / max(float(ideal), 1e-3)
        yield Row(result.verdict.grade, pairs, max(errors), max(before), beyond)


def _sizes(noise: float, scale: float) -> Sizes:
    """Of what :func:`with_real_errors` puts on top."""
    return Sizes(
        noise=noise,
        drift=scale * DRIFT_MGAUSS,
        drift_s=DRIFT_S,
        level=scale * float(np.radians(LEVEL_DEG)),
        wander=scale * float(np.radians(WANDER_DEG)),
        wander_s=WANDER_S,
        lean=scale * LEAN,
    )


def line(name: str, rows: list[Row]) -> str:
    grades = [sum(row.grade is grade for row in rows) for grade in Grade]
    taken = [row for row in rows if row.grade is not Grade.REJECTED]
    pairs = [pair for row in taken for pair in row.pairs]
    if not pairs:
        return f"{name:<22}{len(rows):>4}" + "".join(f"{count:>5}" for count in grades)
    holds = np.mean([error <= bound for bound, error in pairs])
    ratio = np.median([bound / max(error, 0.02) for bound, error in pairs])
    wrong = sum(row.grade is Grade.GOOD and row.largest > LIMIT_DEG for row in rows)
    worse = sum(row.largest > row.before + 0.2 for row in taken)
    largest = [row.largest for row in taken]
    return (
        f"{name:<22}{len(rows):>4}"
        + "".join(f"{count:>5}" for count in grades)
        + f"{holds:>8.1%}{ratio:>7.2f}{wrong:>4}/{grades[0]:<3}{worse:>3}/{len(taken):<3}"
        + f"{np.median(largest):>6.2f}{np.quantile(largest, 0.9):>6.2f}"
        + f"{np.median([row.beyond_ideal for row in taken]):>7.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--scale", type=float, default=1.0)
    parser.add_argument("--programs", default="flight,mission")
    arguments = parser.parse_args()
    print(
        f"{'kind':<22}{'n':>4} good marg  rej   holds  b./e.   wrong  worse  error °     ideal"
        f"   (scale {arguments.scale:g})"
    )
    everything: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        for program, calibrated in itertools.product(arguments.programs.split(","), (True, False)):
            rows: list[Row] = []
            for seed in range(arguments.first, arguments.first + arguments.seeds):
                rows += rows_of(Path(folder), program, seed, arguments.scale, calibrated=calibrated)
            everything += rows
            name = program if calibrated else f"{program} uncalibrated"
            print(line(name, rows), flush=True)
    print(line("all", everything))


if __name__ == "__main__":
    main()
