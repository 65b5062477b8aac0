"""Recordings whose numbers are anything at all are answered or refused in words."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import EXACT, Flown

from magcomp.analysis import analyse, check
from magcomp.autopilots import ardupilot
from magcomp.errors import MagcompError, MissingDataError
from magcomp.model import Recording, Series

NAMES = ("current", "throttle", "attitude", "outputs", "position", "gyro", "armed", "field")
WILD = (0.0, 1e38, -1e38, 1e-38, 1e6, -1.0)


@cache
def flown() -> Recording:
    in_force = {"COMPASS_MOTCT": 2.0, **ardupilot.correction_parameters(EXACT, 1, 1.0)}
    return Flown(seconds=30.0, in_force=in_force).recording()


def of(recording: Recording, name: str) -> Series | None:
    return recording.field[1] if name == "field" else getattr(recording, name)


def with_series(recording: Recording, name: str, series: Series) -> Recording:
    return replace(recording, **{name: {1: series} if name == "field" else series})


@st.composite
def wild(draw: st.DrawFn) -> Recording:
    recording = flown()
    for _ in range(draw(st.integers(1, 3))):
        name = draw(st.sampled_from(NAMES))
        series = of(recording, name)
        if series is None or not len(series):
            continue
        value = np.array(series.value, dtype=float)
        rows = np.random.default_rng(draw(st.integers(0, 99))).random(len(value))
        struck = rows < draw(st.sampled_from([0.02, 0.5, 1.0]))
        number = draw(st.sampled_from(WILD))
        value[struck] = value[struck] * number if draw(st.booleans()) else number
        keep = slice(draw(st.integers(0, 3)) * len(value) // 4, None)
        recording = with_series(recording, name, Series(series.time[keep], value[keep]))
    return recording


def must_be_answered(recording: Recording) -> None:
    for work in (analyse, check):
        with suppress(MagcompError):
            work(recording)


@settings(max_examples=4, derandomize=True)
@given(wild())
def test_some_wild_numbers_end_in_words(recording: Recording) -> None:
    must_be_answered(recording)


@pytest.mark.slow
@settings(max_examples=1000)
@given(wild())
def test_all_wild_numbers_end_in_words(recording: Recording) -> None:
    must_be_answered(recording)


def test_a_compass_that_reads_zero_without_a_position_is_named() -> None:
    recording = flown()
    nothing = Series(recording.field[1].time, np.zeros_like(recording.field[1].value))
    dead = replace(with_series(recording, "field", nothing), position=None)
    with pytest.raises(MissingDataError, match="compass 1 reads zero throughout"):
        analyse(dead)


def test_a_current_that_is_told_with_the_wrong_sign_throughout_is_answered_without_a_warning() -> (
    None
):
    recording = flown()
    assert recording.current is not None
    backwards = Series(recording.current.time, -np.abs(recording.current.value))
    must_be_answered(with_series(recording, "current", backwards))
