"""What each fuzzer starts from: small pieces of the fixtures, and what is made like them."""

from __future__ import annotations

import gzip
import io
import itertools
import json
import struct
import zipfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from magcomp.mavlink import header
from magcomp.mavlink.records import record, records
from magcomp.sources.dataflash.quantities import MESSAGES
from magcomp.sources.ulog import TOPICS

FIXTURES = Path(__file__).parents[2] / "sitl_fixtures"
CORPUS = Path(__file__).parent / "corpus"
"""Inputs that once failed, a folder a target."""

_SMALL = 40_000
_STILL = 60_000


def _head(name: str, size: int = _SMALL) -> bytes:
    return (FIXTURES / name).read_bytes()[:size]


def _ulog() -> bytes:
    return gzip.decompress((FIXTURES / "px4_flight.ulg.gz").read_bytes())


def _few_frames(name: str, each: int, start: int = 0, size: int = 400_000) -> bytes:
    """The first few records of each kind of message, in their order."""
    seen: Counter[int] = Counter()
    made = []
    for stamp, frame in records((FIXTURES / name).read_bytes()[start : start + size]):
        kind = header.message_id(frame)
        seen[kind] += 1
        if seen[kind] <= each:
            made.append(record(stamp, frame))
    return b"".join(made)


_FORMAT = 128
_FORMAT_SIZE = 89


def _messages(data: bytes) -> Iterator[tuple[str, bytes]]:
    """The messages of a sound dataflash log, each format under the name it defines."""
    names, sizes, at = {_FORMAT: "FMT"}, {_FORMAT: _FORMAT_SIZE}, 0
    while at + 3 <= len(data) and data[at + 2] in sizes:
        kind = data[at + 2]
        message = data[at : at + sizes[kind]]
        at += sizes[kind]
        if kind == _FORMAT:
            names[message[3]] = message[5:9].rstrip(b"\0").decode()
            sizes[message[3]] = message[4]
            yield names[message[3]], message
        else:
            yield names[kind], message


def _few_messages(wanted: frozenset[str], each: int) -> bytes:
    """The formats and first few of some messages of a dataflash log."""
    seen: Counter[str] = Counter()
    made = []
    for name, message in _messages((FIXTURES / "flight.BIN").read_bytes()):
        seen[name] += 1
        if (name in wanted or name == "FMT") and seen[name] <= 1 + each:
            made.append(message)
    return b"".join(made)


def _few_topics(wanted: tuple[str, ...], each: int) -> bytes:
    """The definitions, a few parameters and the first few data of some topics of a PX4 log."""
    data = _ulog()
    made, at, seen, numbers = [data[:16]], 16, Counter[bytes](), set[bytes]()
    while at + 3 <= len(data):
        size, kind = struct.unpack_from("<HB", data, at)
        body = data[at + 3 : at + 3 + size]
        message = data[at : at + 3 + size]
        at += 3 + size
        name = body.partition(b":")[0] if kind == ord("F") else body[3:]
        if kind in b"FA" and name.decode() not in wanted:
            continue
        if kind == ord("A"):
            numbers.add(body[1:3])
        key = bytes([kind]) + (body[:2] if kind == ord("D") else b"")
        seen[key] += 1
        if kind in b"BFA" or (
            seen[key] <= each and (kind in b"PIL" or (kind == ord("D") and body[:2] in numbers))
        ):
            made.append(message)
    return b"".join(made)


def _zipped() -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("flight.tlog", _head("flight.tlog", 1000))
    return made.getvalue()


_TEXT_LOG = b"""FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns
FMT, 129, 23, PARM, Nf, Name,Value
FMT, 130, 21, MAG, IhhhhhhBI, TimeMS,MagX,MagY,MagZ,OfsX,OfsY,OfsZ,Health,S
FMT, 131, 17, ATT, IccccCC, TimeMS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw
FMT, 132, 19, CURR, IhIhhhf, TimeMS,ThrOut,ThrInt,Volt,Curr,Vcc,CurrTot
PARM, COMPASS_OFS_X, 12.5
PARM, COMPASS_MOTCT, 0
ATT, 100, 0.1, 0.2, 0.1, 0.2, 90.0, 91.0
MAG, 100, 120, -40, 380, 3, 4, 5, 1, 100
CURR, 100, 500, 0, 1200, 2345, 5000, 1.5
ATT, 200, 0.1, 0.2, 0.1, 0.2, 90.0, 92.0
MAG, 200, 121, -41, 381, 3, 4, 5, 1, 200
"""

_PARAMETERS = (
    b"# made for vehicle autopilot=ardupilot kind=copter system=1 device_ids=97539,131874\n"
    b"COMPASS_MOTCT,2\nCOMPASS_MOT_X,1.137\nCOMPASS_OFS_X,-133.9\n",
    b"1\t1\tCOMPASS_OFS_X\t-133.9\t9\n1\t1\tCOMPASS_MOTCT\t2\t2\n",
    b"COMPASS_OFS_X    -133.9\nCOMPASS_USE 1 @READONLY\nCOMPASS_DEV_ID=0x17D03\n",
)


def _journal() -> bytes:
    events: list[dict[str, object]] = [
        {"event": "begin", "version": 1, "backup": "b.param", "values": {"COMPASS_MOTCT": 0.0}},
        {"event": "stage", "stage": "write"},
        {"event": "write", "name": "COMPASS_MOTCT", "value": 2.0},
        {"event": "end", "ok": True},
    ]
    return "".join(json.dumps(each) + "\n" for each in events).encode()


def seeds(target: str) -> list[bytes]:
    """The inputs that a target's mutations start from.

    Parameters
    ----------
    target
        A key of :data:`targets.TARGETS`.
    """
    made = {
        "telemetry": lambda: [
            _head("flight.tlog"),
            _few_frames("flight.tlog", 2, 300_000),
            _few_frames("flight.tlog", 8),
            _few_frames("sweep_current.tlog", 3),
        ],
        "dataflash": lambda: [
            _head("flight.BIN"),
            _few_messages(MESSAGES, 4),
            _few_messages(frozenset({"MAG", "BAT", "ATT", "PARM"}), 8),
            _few_messages(frozenset({"MAG", "RCOU", "XKF1", "IMU", "VER", "MSG"}), 3),
        ],
        "text": lambda: [_TEXT_LOG],
        "ulog": lambda: [
            _ulog()[:60_000],
            _few_topics(TOPICS, 6),
            _few_topics(("sensor_mag", "vehicle_attitude", "battery_status"), 4),
            _few_topics(("vehicle_magnetometer", "actuator_motors", "vehicle_attitude"), 4),
        ],
        "archive": lambda: [_zipped(), gzip.compress(_head("flight.tlog", 1000))],
        "parameters": lambda: list(_PARAMETERS),
        "journal": lambda: [_journal()],
        "link": lambda: [
            _head("flight.tlog", 8000),
            _few_frames("flight.tlog", 3),
            _few_frames("sweep_current.tlog", 6),
        ],
        "analysis": lambda: [
            (FIXTURES / "sweep_current.tlog").read_bytes()[:_STILL],
            (FIXTURES / "flight.tlog").read_bytes()[180_000:260_000],
        ],
    }[target]()
    found = sorted((CORPUS / target).glob("*"))
    return [*made, *itertools.chain(each.read_bytes() for each in found)]
