"""A guided sweep of the simulated vehicle fits to its truth."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from sweep_bench import LIMITS, RATES, Bench

from magcomp.analysis import Options, analyse
from magcomp.simulate.ground import Asker
from magcomp.sources import read
from magcomp.sweeping.steps import TOLD_APART

UNIX_S = 1.75e9


@pytest.fixture(scope="module", params=["ardupilot", "px4"])
def swept(request):
    """A whole sweep, as it comes over a link."""
    bench = Bench(rates=RATES[request.param], autopilot=request.param)
    bench.vehicle.receive(Asker().parameter_list(), bench.now)
    return bench, bench.sweep()


def fitted(bench, folder, regressor):
    path = folder / "sweep.tlog"
    path.write_bytes(
        b"".join(
            struct.pack(">Q", round((UNIX_S + frame.time) * 1e6)) + frame.data
            for frame in bench.cable.frames
        )
    )
    return analyse(read(path), Options(method="sweep", regressor=regressor))


@pytest.fixture(scope="module")
def analysis(swept, tmp_path_factory):
    return fitted(swept[0], tmp_path_factory.mktemp("sweep"), "current")


def test_it_is_complete_and_no_motor_overran(swept):
    bench, outcome = swept
    assert outcome.reason is None
    assert bench.cable.longest_s == pytest.approx(LIMITS.hold_s, abs=0.05)
    assert bench.vehicle.spinning == ()
    assert not bench.vehicle.armed


def test_the_fit_is_within_2_per_cent_of_the_truth(swept, analysis):
    truth = swept[0].vehicle.truth.interference
    assert len(analysis.compasses) == 3
    for result in analysis.compasses:
        assert result.fit.method == "sweep"
        error = np.linalg.norm(-result.fit.correction.vector - truth)
        assert error < 0.02 * np.linalg.norm(truth)


def test_a_vector_a_motor_is_within_2_per_cent_where_the_motors_are_to_be_told_apart(tmp_path):
    bench = Bench(rates=RATES["ardupilot"], most=0.7, each=TOLD_APART)
    bench.vehicle.receive(Asker().parameter_list(), bench.now)
    assert bench.sweep().reason is None
    truth = bench.vehicle.truth.motors
    for result in fitted(bench, tmp_path, "motors").compasses:
        errors = np.linalg.norm(-result.fit.correction.motor.T - truth, axis=1)
        assert np.all(errors < 0.02 * np.linalg.norm(truth, axis=1))
