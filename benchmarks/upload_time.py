"""How long a write of three compasses' 37 parameters takes, verified, over a good and a bad link.

    python benchmarks/upload_time.py

The simulated vehicle lives in real time behind UDP. On the bad link a third of the frames is
lost each way and each frame takes 200 ms.
"""

from __future__ import annotations

import contextlib
import socket
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from magcomp.link import connect
from magcomp.live.latest import Latest
from magcomp.live.upload import make_plan, write_plan
from magcomp.model import ParameterSet
from magcomp.simulate import Faults, Vehicle, scenario, serve

_VALUES = {"MOT": -1.5, "OFS": 40.0, "DIA": 1.0625, "ODI": 0.015625}
WANTED = ParameterSet(
    {
        **{
            f"COMPASS_{kind}{compass}_{axis}": value
            for compass in ("", "2", "3")
            for kind, value in _VALUES.items()
            for axis in "XYZ"
        },
        "COMPASS_MOTCT": 2.0,
    }
)


def main() -> None:
    """Measure and print."""
    for name, faults in (
        ("no loss", None),
        ("30 % lost each way, 200 ms", Faults(loss=0.3, latency_s=0.2)),
    ):
        for attempt in (1, 2, 3):
            print(f"{name}, attempt {attempt}: {measured(faults)}", flush=True)


def measured(faults: Faults | None) -> str:
    """Connect, compare, write and verify once."""
    with tempfile.TemporaryDirectory() as directory, vehicle(faults) as (address, held):
        latest, begun = Latest(), time.monotonic()
        with connect(address, system=1, sinks=[latest]) as link:
            found = link.wait_vehicle(60.0)
            met = time.monotonic()
            plan = make_plan(link, found, WANTED, any_vehicle=True)
            planned = time.monotonic()
            outcome = write_plan(plan, link, latest, backup=Path(directory) / "old.param")
            written = time.monotonic()
        good = outcome.good and all(held.parameters[n] == v for n, v in WANTED.values.items())
        return (
            f"found {met - begun:.2f} s, compared {planned - met:.2f} s, written and verified "
            f"{written - planned:.2f} s, {len(plan.changes)} parameters, "
            f"{'all as wanted' if good else 'NOT as wanted'}"
        )


@contextlib.contextmanager
def vehicle(faults: Faults | None) -> Iterator[tuple[str, Vehicle]]:
    """A disarmed vehicle in real time."""
    one = Vehicle(scenario("sweep", 4))
    one.advance(one.duration_s + 5.0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    stop = threading.Event()
    thread = threading.Thread(
        target=serve,
        args=(f"udpout:127.0.0.1:{port}", one),
        kwargs={"faults": faults, "stop": stop},
    )
    thread.start()
    try:
        yield f"udp:127.0.0.1:{port}", one
    finally:
        stop.set()
        thread.join()


if __name__ == "__main__":
    main()
