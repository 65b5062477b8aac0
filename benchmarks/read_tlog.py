"""How fast a telemetry log is read, against pymavlink and fasttlogparser, in one run.

    python benchmarks/read_tlog.py [LOG...]

The three read the same messages of the same file, one after the other, again and again; the
medians are compared. magcomp also verifies every frame, drops copies and builds the time axis; the
others only decode. Then a log several times as long shows that time and memory grow with it.

fasttlogparser is a C++ package that magcomp does not need. To compare with it:
    .venv/bin/pip install scikit-build-core pybind11
    .venv/bin/pip install --no-build-isolation fasttlogparser
"""

from __future__ import annotations

import contextlib
import importlib
import os
import struct
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median

from pymavlink import mavutil
from pymavlink.dialects.v20.ardupilotmega import PROTOCOL_MARKER_V2, mavlink_map
from pymavlink.generator.mavcrc import x25crc

from magcomp.mavlink.messages import Message
from magcomp.sources.tlog import read_tlog

MESSAGES = [message.name for message in Message]
FIXTURES = Path(__file__).parents[1] / "sitl_fixtures"
DEFAULT = [FIXTURES / "flight.tlog", FIXTURES / "turntable_five_levels.tlog"]
GROWTH = (1, 4, 16)
ROUNDS = 15
SLOW_ROUNDS = 3
HOUR_US = 3_600_000_000


def with_magcomp(path: Path) -> None:
    read_tlog(path)


def with_pymavlink(path: Path) -> None:
    connection = mavutil.mavlink_connection(str(path))
    while connection.recv_match(type=MESSAGES) is not None:
        pass
    connection.close()


def fasttlogparser_readers() -> dict[str, Callable[[Path], None]]:
    try:
        parse = importlib.import_module("fasttlogparser").parseTLog
    except ImportError:
        print("fasttlogparser is not installed and is left out. To compare with it:")
        print("  .venv/bin/pip install scikit-build-core pybind11")
        print("  .venv/bin/pip install --no-build-isolation fasttlogparser\n")
        return {}

    def with_same_messages(path: Path) -> None:
        parse(str(path), whitelist=MESSAGES)

    def with_all_messages(path: Path) -> None:
        parse(str(path))

    return {
        "fasttlogparser, same messages": with_same_messages,
        "fasttlogparser, all messages": with_all_messages,
    }


def seconds(reader: Callable[[Path], None], path: Path) -> float:
    begin = time.perf_counter()
    with silence():
        reader(path)
    return time.perf_counter() - begin


@contextlib.contextmanager
def silence() -> Iterator[None]:
    """Swallow what C++ code writes to the terminal past Python."""
    sys.stdout.flush()
    kept = os.dup(1)
    with Path(os.devnull).open("w") as nothing:
        os.dup2(nothing.fileno(), 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def compare(path: Path, others: dict[str, Callable[[Path], None]]) -> None:
    readers = {"magcomp": with_magcomp, **others}
    taken: dict[str, list[float]] = {name: [] for name in (*readers, "pymavlink")}
    for number in range(ROUNDS):
        for name, reader in readers.items():
            taken[name].append(seconds(reader, path))
        if number < SLOW_ROUNDS:
            taken["pymavlink"].append(seconds(with_pymavlink, path))
    ours = median(taken["magcomp"])
    print(f"{path}, {path.stat().st_size / 1e6:.2f} MB")
    for name, times in taken.items():
        print(f"  {name:30s} {1e3 * median(times):9.1f} ms   {median(times) / ours:6.1f} x magcomp")


def growth(path: Path) -> None:
    print(f"\n{path.name}, several times as long")
    data = path.read_bytes()
    with tempfile.TemporaryDirectory() as folder:
        for times in GROWTH:
            longer = Path(folder) / f"{times}.tlog"
            longer.write_bytes(flown_again(data, times))
            size = longer.stat().st_size
            taken = median(seconds(with_magcomp, longer) for _ in range(ROUNDS))
            tracemalloc.start()
            read_tlog(longer)
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
            print(
                f"  x {times:<3d} {size / 1e6:7.2f} MB {1e3 * taken:8.1f} ms"
                f" {1e9 * taken / size:7.2f} ns a byte   memory at most {peak / size:.2f} x the log"
            )


def flown_again(data: bytes, times: int) -> bytes:
    """A clean log several times over, an hour apart, with other sequence numbers each time.

    With the same ones the frames would be copies, and left out.
    """
    rounds = []
    for n in range(times):
        at = 0
        while at < len(data):
            (arrival,) = struct.unpack_from(">Q", data, at)
            second = data[at + 8] == PROTOCOL_MARKER_V2
            end = at + 8 + (10 if second else 6) + data[at + 9]
            frame = bytearray(data[at + 8 : end])
            message = int.from_bytes(frame[7:10], "little") if second else frame[5]
            sequence = 4 if second else 2
            frame[sequence] = (frame[sequence] + n) % 256
            crc = x25crc(frame[1:] + bytes([mavlink_map[message].crc_extra])).crc
            rounds.append(struct.pack(">Q", arrival + n * HOUR_US) + frame + struct.pack("<H", crc))
            at = end + 2
    return b"".join(rounds)


def main() -> None:
    logs = [Path(argument) for argument in sys.argv[1:]] or DEFAULT
    others = fasttlogparser_readers()
    for path in logs:
        compare(path, others)
    growth(DEFAULT[0])


if __name__ == "__main__":
    main()
