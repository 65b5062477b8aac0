"""How much of one core a live session takes: three compasses at 50 Hz, refits while it runs.

    python benchmarks/live_cpu.py [SECONDS]

The simulated vehicle is another process, in real time, and is not counted. Afterwards the
file is compared with the buffer, sample by sample.
"""

from __future__ import annotations

import contextlib
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

# isort: off
import magcomp.cli  # noqa: F401 - before numpy, whose threads it limits as the program does
import numpy as np

# isort: on
from magcomp.live.refit import DEFAULT_SHARE
from magcomp.live.session import LiveSession
from magcomp.sources.tlog import read_tlog

_BOUND = 0.15
_STRETCH_S = 20.0
_SNAPSHOTS_HZ = 5.0


def main(seconds: float = 120.0) -> int:
    """Measure, print, and tell whether the bound was kept."""
    with tempfile.TemporaryDirectory() as directory, vehicle() as address:
        path = Path(directory) / "live.tlog"
        print(f"streaming only:          {100 * share_of(address, 20.0, None):5.1f} % of one core")
        with LiveSession.open(address, record=path, system=1) as session:
            session.wait_ready()
            begun, cpu = time.monotonic(), time.process_time()
            worst = measured(session, seconds)
            mean = (time.process_time() - cpu) / (time.monotonic() - begun)
            session.stop_recording()
            live, rates = session.recording(), session.connection.statistics()
        logged = read_tlog(path)
    for compass, series in live.field.items():
        np.testing.assert_array_equal(series.value, logged.field[compass].value)
        np.testing.assert_array_equal(series.time, logged.field[compass].time)
    samples = ", ".join(str(len(series)) for series in logged.field.values())
    print(f"field samples in file = in buffer: {samples}; lost on the way: {rates.lost}")
    print(
        f"mean {100 * mean:.1f} %, worst stretch {100 * worst:.1f} %, bound {100 * _BOUND:.0f} % "
        f"(refits may take {100 * DEFAULT_SHARE:.0f} %)"
    )
    return 0 if mean < _BOUND and rates.lost == 0 else 1


def measured(session: LiveSession, seconds: float) -> float:
    """Processor share of stretches of twenty seconds, printed; gives the largest."""
    worst, end = 0.0, time.monotonic() + seconds
    while time.monotonic() < end:
        before = session.refit
        share = used(session, _STRETCH_S)
        refit = session.refit
        worst = max(worst, share)
        print(
            f"with refits, at {session.elapsed_s:4.0f} s:  {100 * share:5.1f} %   "
            f"{refit.refreshed - before.refreshed} refreshes of {refit.refresh_cost_s:.2f} s CPU, "
            f"{refit.full - before.full} full of {refit.full_cost_s:.2f} s, "
            f"grade {session.snapshot().grade}"
        )
    return worst


def used(session: LiveSession, seconds: float) -> float:
    """Share of one core this process takes while somebody looks at it."""
    begun, cpu = time.monotonic(), time.process_time()
    while time.monotonic() - begun < seconds:
        session.snapshot()
        time.sleep(1.0 / _SNAPSHOTS_HZ)
    return (time.process_time() - cpu) / (time.monotonic() - begun)


def share_of(address: str, seconds: float, record: Path | None) -> float:
    """Share of one core without any refit."""
    with LiveSession.open(address, record=record, system=1, refit_share=0.0) as session:
        session.wait_ready()
        return used(session, seconds)


@contextlib.contextmanager
def vehicle() -> Iterator[str]:
    """A simulated vehicle in a process of its own."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "magcomp", "simulate", f"udpout:127.0.0.1:{port}"]
    child = subprocess.Popen(
        [*command, "--program", "turntable"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    try:
        yield f"udp:127.0.0.1:{port}"
    finally:
        child.terminate()
        child.wait()


if __name__ == "__main__":
    sys.exit(main(*map(float, sys.argv[1:2])))
