"""How the time of a fit grows with the length of the log: the same flight once, twice, four times.

Run as ``python benchmarks/fit_time.py [LOG]``. The recording is laid end to end with itself, so
that every piece needs the same work; reading is not counted.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from magcomp.analysis import analyse
from magcomp.model import Recording, Series
from magcomp.sources import read

DEFAULT_LOG = Path(__file__).parents[1] / "sitl_fixtures" / "flight.tlog"
TIMES = (1, 2, 4, 8)
REPEATS = 3
_PAUSE_S = 5.0


def laid_end_to_end(recording: Recording, times: int) -> Recording:
    """The recording ``times`` times over, a pause between."""
    period = recording.duration_s + _PAUSE_S

    def repeated(series: Series | None) -> Series | None:
        return None if series is None else _repeated(series, times, period)

    return replace(
        recording,
        duration_s=times * period - _PAUSE_S,
        field={k: _repeated(series, times, period) for k, series in recording.field.items()},
        attitude=repeated(recording.attitude),
        gyro=repeated(recording.gyro),
        accel=repeated(recording.accel),
        throttle=repeated(recording.throttle),
        current=repeated(recording.current),
        voltage=repeated(recording.voltage),
        outputs=repeated(recording.outputs),
        position=repeated(recording.position),
        armed=repeated(recording.armed),
    )


def _repeated(series: Series, times: int, period: float) -> Series:
    shifts = np.repeat(np.arange(times) * period, len(series))
    value = np.concatenate([series.value] * times)
    return Series(np.tile(series.time, times) + shifts, value)


def cpu_seconds(recording: Recording) -> float:
    """Least processor time of a few analyses."""
    spent = []
    for _ in range(REPEATS):
        begin = time.process_time()
        analyse(recording)
        spent.append(time.process_time() - begin)
    return min(spent)


def main() -> None:
    log = Path(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT_LOG
    recording = read(log)
    print(f"{log.name}: {recording.duration_s:.0f} s, {len(recording.field)} compasses")
    print("  length   processor s   per length, of the first")
    first = 0.0
    for times in TIMES:
        spent = cpu_seconds(laid_end_to_end(recording, times))
        first = first or spent
        print(f"  ×{times:<7d}{spent:10.2f}{spent / times / first:20.2f}")


if __name__ == "__main__":
    main()
