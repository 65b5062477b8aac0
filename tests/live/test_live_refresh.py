"""A refresh copes with what a link does to a recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from magcomp.analysis import analyse
from magcomp.errors import MissingDataError
from magcomp.live.refit import Refitter
from magcomp.live.refresh import refresh
from magcomp.mavlink.records import records
from magcomp.sources.assemble import recording_from_bytes
from magcomp.sources.vehicles import Choice

LOG = Path(__file__).parents[2] / "sitl_fixtures" / "flight_low_rate.tlog"


def recording_without(*gaps):
    """The log as a live link with gaps would have heard it; seconds from its first frame."""
    raw = LOG.read_bytes()
    first = next(records(raw))[0]
    kept = (
        stamp.to_bytes(8) + frame
        for stamp, frame in records(raw)
        if not any(begin < (stamp - first) * 1e-6 < end for begin, end in gaps)
    )
    return recording_from_bytes(b"".join(kept), "x", Choice(None, None), live=True)


@pytest.fixture(scope="module")
def whole():
    return analyse(recording_without())


@pytest.mark.parametrize("seed", range(4))
def test_gaps_of_the_link_cost_no_refresh(whole, seed):
    begins = np.random.default_rng(seed).uniform(0.0, 150.0, 3)
    fits = refresh(recording_without(*((begin, begin + 4.0) for begin in begins)), whole)
    assert set(fits) == {result.fit.compass for result in whole.compasses}


def test_an_error_nobody_foresaw_is_told_and_the_fitting_goes_on():
    calls = []

    def fails():
        calls.append(None)
        raise IndexError("index 3 is out of bounds")

    refitter = Refitter(fails, None, share=1.0)
    try:
        while len(calls) < 2:
            refitter._thread.join(0.05)
        assert refitter.state.trouble == (
            "this should not have happened: IndexError: index 3 is out of bounds"
        )
    finally:
        refitter.close()


def test_a_fit_that_is_waited_for_is_made_at_once_and_counted():
    def empty():
        raise MissingDataError("There must be a flight; instead there is none.")

    # So small a share of the processor that the second attempt would be hours away.
    refitter = Refitter(empty, None, share=1e-9)
    try:
        while refitter.state.full < 1:
            refitter._thread.join(0.01)
        assert refitter.state.hurried == 0
        refitter.hurry()
        while refitter.state.hurried < 1:
            refitter._thread.join(0.01)
        assert refitter.state.full == 2
    finally:
        refitter.close()
