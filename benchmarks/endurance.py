"""What stays in a program that listens for long: memory after 10⁶ messages, what 50 links leave.

python benchmarks/endurance.py [MESSAGES] [CYCLES]
"""

from __future__ import annotations

import gc
import sys
import tempfile
import threading
import tracemalloc
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.buffer import Buffer
from magcomp.link import Recorder, connect
from magcomp.link.address import UdpServer
from magcomp.link.state import LinkState
from magcomp.live.latest import Latest
from magcomp.live.session import LiveSession
from magcomp.live.tap import Tap
from magcomp.simulate import Vehicle, run, scenario
from magcomp.simulate.transports import open_transport

LIMIT = 1 << 20
STEP_US = 2_000


def spoken(number: int) -> Any:
    """A message of a vehicle that says a lot, much of it new each time."""
    match number % 10:
        case 0:
            return mavlink.MAVLink_heartbeat_message(2, 3, 128, 0, 4, 3)
        case 1:
            return mavlink.MAVLink_statustext_message(6, f"line {number}".encode())
        case 2:
            name = f"COMPASS_OFS_{'XYZ'[number // 10 % 3]}".encode()
            return mavlink.MAVLink_param_value_message(name, number * 1e-3, 9, 3, 65535)
        case 3 | 4 | 5:
            return mavlink.MAVLink_attitude_message(number * 2, 0.1, 0.2, number * 1e-3, 0, 0, 0)
        case _:
            return mavlink.MAVLink_raw_imu_message(number, 1, 2, -1000, 3, 4, 5, 200, 50, -400)


def listen(messages: int) -> None:
    """Feed a link's state, the buffer, the newest values and a file; print what they hold."""
    codec = mavlink.MAVLink(None, 1, 1)
    state, buffer, latest = LinkState(), Buffer("x", limit=LIMIT), Latest()
    tracemalloc.start()
    with tempfile.TemporaryDirectory() as folder:
        tap = Tap(buffer, latest, Recorder(Path(folder) / "a.tlog"))
        for number in range(messages):
            raw = bytes(spoken(number).pack(codec))
            codec.seq = (codec.seq + 1) % 256
            now = number * STEP_US * 1e-6
            for received in state.receive(raw, now):
                tap.add(number * STEP_US, received.frame.raw)
            if number % 10 == 0:
                state.due(now)
                state.take_events()
            if (number + 1) % max(messages // 10, 1) == 0:
                held, _ = tracemalloc.get_traced_memory()
                print(
                    f"{number + 1:>9} messages: {held / 1e6:6.2f} MB held, buffer "
                    f"{buffer.size / 1e6:.2f} MB (asked: {LIMIT / 1e6:.2f} and a quarter more), "
                    f"file {tap.size / 1e6:.0f} MB",
                    flush=True,
                )
        tap.close()
    tracemalloc.stop()


def descriptors() -> int:
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


def cycle(cycles: int) -> None:
    """Connect and disconnect; print what is left of descriptors and threads."""
    vehicle, stop = Vehicle(scenario("parked", 1)), threading.Event()
    with connect(UdpServer("127.0.0.1", 0)) as probe:
        port = probe._transport.port  # type: ignore[attr-defined]
    transport = open_transport(f"udpout:127.0.0.1:{port}")
    thread = threading.Thread(target=run, args=(vehicle, transport, stop), kwargs={"speed": 5.0})
    thread.start()
    try:
        for number in range(cycles + 1):
            with LiveSession.open(f"udp:127.0.0.1:{port}", refit_share=0.0) as session:
                session.connection.wait_vehicle(20.0)
            gc.collect()
            if number == 0:
                before = descriptors(), threading.active_count()
        after = descriptors(), threading.active_count()
        print(
            f"{cycles} connections: descriptors {before[0]} → {after[0]}, threads {before[1]} → "
            f"{after[1]}"
        )
    finally:
        stop.set()
        thread.join()
        transport.close()


def main() -> None:
    cycle(int(sys.argv[2]) if len(sys.argv) > 2 else 50)
    listen(int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000)


if __name__ == "__main__":
    main()
