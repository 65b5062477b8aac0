"""How fast logs are read, against what else reads them, in one run.

    python benchmarks/read.py [LOG...]

All read the same messages of the same file, one after the other, again and again; the medians of
the processor's time are compared, so that a busy machine does not decide. magcomp makes a Recording
of them, with parameters, time axis and quantities; the others only decode. Then logs several times
as long show that time and memory grow with them.

    .tlog   against pymavlink and, where installed, fasttlogparser
    .BIN    against pymavlink's DFReader
    .ulg    against pyulog, told which topics to take

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
from pyulog import ULog

from magcomp.mavlink.messages import Message
from magcomp.sources import read
from magcomp.sources.dataflash.quantities import MESSAGES as DATAFLASH_MESSAGES
from magcomp.sources.ulog import TOPICS

TLOG_MESSAGES = [message.name for message in Message]
FIXTURES = Path(__file__).parents[1] / "sitl_fixtures"
REAL = FIXTURES.parent.parent / "shared" / "real"
DEFAULT = [
    FIXTURES / "flight.tlog",
    FIXTURES / "turntable_five_levels.tlog",
    FIXTURES / "flight.BIN",
    *REAL.glob("quad_cube_4.5.7.BIN"),
    *REAL.glob("px4_quad.ulg"),
]
GROWTH = (1, 4, 24)
ROUNDS = 15
SLOW_ROUNDS = 3
HOUR_US = 3_600_000_000
FLIGHT_US = 300_000_000


def with_magcomp(path: Path) -> None:
    read(path)


def with_pyulog(path: Path) -> None:
    ULog(str(path), list(TOPICS), disable_str_exceptions=True)


def with_pymavlink(path: Path) -> None:
    wanted = TLOG_MESSAGES if path.suffix == ".tlog" else list(DATAFLASH_MESSAGES)
    connection = mavutil.mavlink_connection(str(path))
    while connection.recv_match(type=wanted) is not None:
        pass
    if path.suffix == ".tlog":
        connection.close()
    else:
        connection.data_map.close()
        connection.filehandle.close()


def fasttlogparser_readers() -> dict[str, Callable[[Path], None]]:
    try:
        parse = importlib.import_module("fasttlogparser").parseTLog
    except ImportError:
        print("fasttlogparser is not installed and is left out. To compare with it:")
        print("  .venv/bin/pip install scikit-build-core pybind11")
        print("  .venv/bin/pip install --no-build-isolation fasttlogparser\n")
        return {}

    def with_same_messages(path: Path) -> None:
        parse(str(path), whitelist=TLOG_MESSAGES)

    def with_all_messages(path: Path) -> None:
        parse(str(path))

    return {
        "fasttlogparser, same messages": with_same_messages,
        "fasttlogparser, all messages": with_all_messages,
    }


def seconds(reader: Callable[[Path], None], path: Path) -> float:
    begin = time.process_time()
    with silence():
        reader(path)
    return time.process_time() - begin


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
    peer, with_peer = ("pyulog", with_pyulog) if _is_ulog(path) else ("pymavlink", with_pymavlink)
    taken: dict[str, list[float]] = {name: [] for name in (*readers, peer)}
    for number in range(ROUNDS):
        for name, reader in readers.items():
            taken[name].append(seconds(reader, path))
        if number < SLOW_ROUNDS:
            taken[peer].append(seconds(with_peer, path))
    ours = median(taken["magcomp"])
    print(f"{path}, {path.stat().st_size / 1e6:.2f} MB")
    for name, times in taken.items():
        print(f"  {name:30s} {1e3 * median(times):9.1f} ms   {median(times) / ours:6.1f} x magcomp")


def _is_ulog(path: Path) -> bool:
    return path.suffix == ".ulg"


def growth(path: Path, again: Callable[[bytes, int], bytes]) -> None:
    print(f"\n{path.name}, several times as long")
    data = path.read_bytes()
    with tempfile.TemporaryDirectory() as folder:
        for times in GROWTH:
            longer = Path(folder) / f"{times}{path.suffix}"
            longer.write_bytes(again(data, times))
            size = longer.stat().st_size
            taken = median(seconds(with_magcomp, longer) for _ in range(ROUNDS))
            tracemalloc.start()
            read(longer)
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
            print(
                f"  x {times:<3d} {size / 1e6:7.2f} MB {1e3 * taken:8.1f} ms"
                f" {1e9 * taken / size:7.2f} ns a byte   memory at most {peak / size:.2f} x the log"
            )
        slow = seconds(with_pymavlink, longer)
        print(f"  x {times:<3d} by pymavlink {slow:6.1f} s   {slow / taken:6.1f} x magcomp")


def tlog_again(data: bytes, times: int) -> bytes:
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


def dataflash_again(data: bytes, times: int) -> bytes:
    """A clean log of less than 5 min several times over, its formats and parameters once."""
    records = []
    kinds: dict[int, tuple[int, str, bytes]] = {128: (89, "FMT", b"")}
    at = 0
    while at < len(data):
        number = data[at + 2]
        size, name, letters = kinds[number]
        record = data[at : at + size]
        if name == "FMT":
            told = record[5:9].rstrip(b"\0").decode()
            kinds[record[3]] = (record[4], told, record[9:25].rstrip(b"\0"))
        records.append((name, letters, record))
        at += size
    rounds = [data]
    for n in range(1, times):
        for name, letters, record in records:
            if name not in ("FMT", "FMTU", "PARM") and letters.startswith(b"Q"):
                (stamp,) = struct.unpack_from("<Q", record, 3)
                rounds.append(record[:3] + struct.pack("<Q", stamp + n * FLIGHT_US) + record[11:])
    return b"".join(rounds)


def main() -> None:
    logs = [Path(argument) for argument in sys.argv[1:]] or DEFAULT
    others = fasttlogparser_readers()
    for path in logs:
        compare(path, others if path.suffix == ".tlog" else {})
    growth(FIXTURES / "flight.tlog", tlog_again)
    growth(FIXTURES / "flight.BIN", dataflash_again)


if __name__ == "__main__":
    main()
