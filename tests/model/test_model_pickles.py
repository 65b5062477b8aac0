"""What goes on the road can be sent to another process and is the same there."""

from __future__ import annotations

import math
import pickle
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np
import pytest
from report_analyses import flown

from magcomp.align.control import controls, reported
from magcomp.align.readings import readings
from magcomp.align.sample import sample
from magcomp.model import Lags


def assert_equal(one: Any, other: Any, where: str = "") -> None:
    """Both are of one type and equal all the way down; NaN equals NaN."""
    assert type(one) is type(other), where
    if isinstance(one, np.ndarray):
        assert one.dtype == other.dtype, where
        np.testing.assert_array_equal(one, other, err_msg=where)
    elif isinstance(one, Enum):
        assert one is other, where
    elif is_dataclass(one):
        for field in fields(one):
            name = f"{where}.{field.name}"
            assert_equal(getattr(one, field.name), getattr(other, field.name), name)
    elif isinstance(one, Mapping):
        assert list(one) == list(other), where
        for key in one:
            assert_equal(one[key], other[key], f"{where}[{key!r}]")
    elif isinstance(one, list | tuple):
        assert len(one) == len(other), where
        for index, (left, right) in enumerate(zip(one, other, strict=True)):
            assert_equal(left, right, f"{where}[{index}]")
    elif isinstance(one, float) and math.isnan(one):
        assert math.isnan(other), where
    else:
        assert one == other, where


def made(what: str) -> Any:
    case = flown()
    result = case.analysis.compasses[0]
    match what:
        case "Recording":
            return case.recording
        case "Samples":
            found = controls(case.recording)
            return sample(readings(case.recording, 1), found[0], reported(found), Lags(0.06, 0.1))
        case "MotorFit":
            return result.fit
        case "Verdict":
            return result.verdict
        case "CompassResult":
            return result
        case _:
            return case.analysis


@pytest.mark.parametrize(
    "what", ["Recording", "Samples", "MotorFit", "Verdict", "CompassResult", "Analysis"]
)
def test_it_comes_back_equal(what: str) -> None:
    original = made(what)
    assert type(original).__name__ == what
    copy = pickle.loads(pickle.dumps(original))  # noqa: S301
    assert_equal(copy, original, what)


def test_a_history_still_answers_after_the_journey() -> None:
    history = flown().recording.parameters
    copy = pickle.loads(pickle.dumps(history))  # noqa: S301
    assert copy == history
    assert copy.names == history.names
    for name in history.names:
        assert copy.at(name, 10.0, 0.0) == history.at(name, 10.0, 0.0)
