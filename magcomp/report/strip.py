"""A recording at a glance: its load in time, and which part of it a fit rests on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magcomp.model import BoolArray, FloatArray, Recording, Series

PARTS = 512
"""Equal parts of a recording that are told apart."""

_STEPS = 3.0
"""Readings this many usual steps apart still belong together."""


@dataclass(frozen=True, eq=False)
class Strip:
    """A recording in equal parts.

    Attributes
    ----------
    time
        Middle of each part, seconds, shape (n,).
    load
        Largest throttle or current in each, as a share of the largest of all, shape (n,); zeros
        where none is known.
    used, disarmed
        Whether the fit rests on a part, and whether the vehicle was disarmed in it, shape (n,).
    duration_s
        How long the recording is.
    """

    time: FloatArray
    load: FloatArray
    used: BoolArray
    disarmed: BoolArray
    duration_s: float

    def seconds(self, which: BoolArray) -> float:
        """How long the parts are together."""
        return self.duration_s * float(np.mean(which))


def strip(recording: Recording, readings: FloatArray) -> Strip:
    """Which parts of a recording a fit rests on.

    Parameters
    ----------
    recording
        What was fitted.
    readings
        Times of the readings that the fit used, seconds, ascending, shape (m,).
    """
    duration = recording.duration_s
    time = (np.arange(PARTS) + 0.5) * duration / PARTS
    return Strip(
        time=time,
        load=np.array(loads(recording) or np.zeros(PARTS)),
        used=_near(time, readings, duration / PARTS),
        disarmed=_disarmed(time, recording.armed),
        duration_s=duration,
    )


def loads(recording: Recording) -> tuple[float, ...]:
    """Largest load in each of many equal parts of a recording; empty where none is known."""
    known = (s for s in (recording.current, recording.throttle) if s is not None and len(s))
    series = next(known, None)
    if series is None or recording.duration_s <= 0.0:
        return ()
    part = np.clip((series.time / recording.duration_s * PARTS).astype(int), 0, None)
    most = np.zeros(PARTS)
    np.maximum.at(most, np.minimum(part, PARTS - 1), np.nan_to_num(series.value))
    return tuple((most / max(float(most.max()), 1e-9)).round(3).tolist())


def _near(time: FloatArray, readings: FloatArray, width: float) -> BoolArray:
    """Whether a reading is no further than its usual neighbours are."""
    if len(readings) < 2:
        return np.zeros(len(time), dtype=bool)
    reach = max(width, _STEPS * float(np.median(np.diff(readings)))) / 2.0
    after = np.clip(np.searchsorted(readings, time), 1, len(readings) - 1)
    away = np.minimum(np.abs(time - readings[after]), np.abs(time - readings[after - 1]))
    return np.asarray(away <= reach)


def _disarmed(time: FloatArray, armed: Series | None) -> BoolArray:
    if armed is None or not len(armed):
        return np.zeros(len(time), dtype=bool)
    at = np.clip(np.searchsorted(armed.time, time, "right") - 1, 0, None)
    return np.asarray(armed.value[at] <= 0.5)
