"""A fit motor by motor against one by the battery's current, on simulated vehicles.

Each seed is another vehicle, flown briskly. Heading errors are those at the largest current flown,
every motor drawing its share, over all yaws, level and tilted 20°, against the truth; vectors are
those of the motors, as a share of the truth, and within what is stated of them where they lie
within 1.96 standard errors as the judge leaves them.

Where nobody asks for a fit motor by motor, it is taken only where unseen data are for it: "by
choice" is what comes out then where the firmware could apply either.

    python benchmarks/motors.py [--seeds 100] [--first 1] [--spread 0.0] [--program brisk]
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from coverage import exact_correction, true_error

from magcomp.align import (
    controls,
    currents_of_motors,
    expected_earth,
    readings,
    reported,
    thinned,
    to_undo,
)
from magcomp.fit import Problem, best_form, fit
from magcomp.judge import judge
from magcomp.judge.forms import forms
from magcomp.model import CURRENT, MOTORS, THROTTLE, FloatArray, MotorFit, Recording
from magcomp.simulate import write_tlog
from magcomp.sources import read

COMPASS = 1


def fits_of(recording: Recording) -> tuple[MotorFit, MotorFit, bool]:
    """By the current, and motor by motor with the covariance that is stated of it.

    And whether unseen data are for the second.
    """
    found = controls(recording)
    new = thinned(readings(recording, COMPASS))
    in_force, earth = to_undo(recording, found), expected_earth(recording)
    by_current = [form for form in found if form.kind == CURRENT]
    problems = (
        best_form([Problem(new, form, in_force, earth) for form in forms])
        for forms in (by_current, currents_of_motors(recording))
    )
    one, each = ((problem, fit(problem)) for problem in problems)
    judged, _ = judge(*each)
    tried = forms(*one, each[0].control, reported(found).get(THROTTLE))
    for_motors = any(form.is_best and form.name == MOTORS for form in tried)
    return one[1], replace(each[1], covariance=judged.covariance), for_motors


def line(name: str, values: Sequence[float] | FloatArray) -> str:
    quantiles = np.quantile(np.asarray(values), (0.5, 0.9, 1.0))
    return f"{name:<34}" + "".join(f"{value:9.2f}" for value in quantiles)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--spread", type=float, default=0.0)
    parser.add_argument("--program", default="brisk")
    arguments = parser.parse_args()
    errors, chosen, apart, inside = [], [], [], []
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "simulated.tlog"
        for seed in range(arguments.first, arguments.first + arguments.seeds):
            truth = write_tlog(
                log, program=arguments.program, seed=seed, motor_spread=arguments.spread
            )
            recording = read(log)
            one, each, for_motors = fits_of(recording)
            chosen.append(for_motors)
            earth, exact = expected_earth(recording), exact_correction(truth, COMPASS)
            errors.append(
                [true_error(truth, exact, f.correction, earth, one.u_high) for f in (one, each)]
            )
            off = -each.correction.motor.T - truth.motors
            apart.append(np.linalg.norm(off, axis=1) / np.linalg.norm(truth.motors, axis=1))
            among = np.r_[0:3, 12 : len(each.covariance)]
            std = np.sqrt(np.diag(each.covariance)[among])
            inside.append(np.abs(off.reshape(-1)) <= 1.96 * std)
    by_one, by_each = np.array(errors).T
    by_choice = np.where(chosen, by_each, by_one)
    print(f"{arguments.seeds} vehicles, motors unequal by {arguments.spread:g}")
    print(f"{'':<34}{'median':>9}{'90 %':>9}{'most':>9}")
    print(line("by the current, degrees at the top", by_one))
    print(line("motor by motor", by_each))
    print(line("worse by", by_each - by_one))
    print(f"unseen data are for motors: {sum(chosen)} of {len(chosen)}")
    print(line("by choice, worse by", by_choice - by_one))
    print(line("vectors of the motors, % off", 100.0 * np.concatenate(apart)))
    print(f"within the stated 95 %: {np.mean(inside):.1%}")


if __name__ == "__main__":
    main()
