"""What each fuzzer starts from: small pieces of the fixtures, and what is made like them."""

from __future__ import annotations

import gzip
import io
import itertools
import json
import zipfile
from pathlib import Path

FIXTURES = Path(__file__).parents[2] / "sitl_fixtures"
CORPUS = Path(__file__).parent / "corpus"
"""Inputs that once failed, a folder a target."""

_SMALL = 40_000
_STILL = 60_000


def _head(name: str, size: int = _SMALL) -> bytes:
    return (FIXTURES / name).read_bytes()[:size]


def _ulog() -> bytes:
    return gzip.decompress((FIXTURES / "px4_flight.ulg.gz").read_bytes())


def _zipped() -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("flight.tlog", _head("flight.tlog", 4000))
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
        "telemetry": lambda: [_head("flight.tlog"), _head("sweep_current.tlog", 6000)],
        "dataflash": lambda: [_head("flight.BIN")],
        "text": lambda: [_TEXT_LOG],
        "ulog": lambda: [_ulog()[:60_000], _ulog()[:9000]],
        "archive": lambda: [_zipped(), gzip.compress(_head("flight.tlog", 4000))],
        "parameters": lambda: list(_PARAMETERS),
        "journal": lambda: [_journal()],
        "link": lambda: [_head("flight.tlog", 8000)],
        "analysis": lambda: [
            (FIXTURES / "sweep_current.tlog").read_bytes()[:_STILL],
            (FIXTURES / "flight.tlog").read_bytes()[180_000:260_000],
        ],
    }[target]()
    found = sorted((CORPUS / target).glob("*"))
    return [*made, *itertools.chain(each.read_bytes() for each in found)]
