"""Recordings of the simulated vehicle with motors alike, as the firmware's own simulation has them.

Where motors differ in how they disturb, no vector per ampere is exact and the promise has no
exact truth to be held against; benchmarks/coverage.py looks at those.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import truth
from pymavlink.dialects.v20 import ardupilotmega as dialect

from magcomp.simulate import Frame, Vehicle, record, scenario
from magcomp.simulate.ground import DEFAULT_RATES

UNIX_S = 1.7e9

LOW_RATES = {
    message: 1.0
    for message, hertz in DEFAULT_RATES.items()
    if message != dialect.MAVLINK_MSG_ID_SIMSTATE and hertz >= 1.0
}
"""What a telemetry radio leaves of the rates asked for."""


@dataclass(frozen=True)
class Case:
    """One recording to be made, and what is promised of it."""

    name: str
    program: str
    seed: int
    promised_deg: float
    options: Mapping[str, object] = field(default_factory=dict)
    rates: Mapping[int, float] = field(default_factory=lambda: DEFAULT_RATES)

    def make(self, path: Path) -> truth.Truth:
        """Write the recording; the vehicle as it really was."""
        drawn = scenario(self.program, self.seed, **self.options)
        alike = np.tile(drawn.truth.interference, (len(drawn.truth.motors), 1))
        drawn = replace(drawn, truth=replace(drawn.truth, motors=alike))
        vehicle = Vehicle(drawn, start_unix_s=UNIX_S)
        path.write_bytes(b"".join(_stamped(record(vehicle, rates=self.rates))))
        return truth.of_document(drawn.truth.as_json(), UNIX_S)


def _stamped(frames: Iterable[Frame]) -> Iterable[bytes]:
    for frame in frames:
        yield struct.pack(">Q", round((UNIX_S + frame.time) * 1e6)) + frame.data


CASES = (
    Case("turntable", "turntable_paper", 1, 0.2),
    Case("another turntable", "turntable_paper", 2, 0.2),
    Case("flight", "flight", 3, 0.4),
    Case("flight with a wrong compensation", "flight", 4, 0.4, {"compensation": "wrong"}),
    Case("flight of 1 Hz telemetry", "flight", 5, 0.6, {}, LOW_RATES),
    Case("uncalibrated flight", "flight", 6, 1.0, {"calibrated": False}),
    Case("another uncalibrated flight", "flight", 7, 1.0, {"calibrated": False}),
)

SWEEP = Case("sweep", "sweep", 8, 0.2)
