"""Which vehicle wrote a dataflash log: its own words in VER and MSG."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from magcomp.mavlink.version import number_in_words
from magcomp.sources.dataflash.table import Tables

_KINDS = {
    "copter": "copter",
    "plane": "plane",
    "rover": "rover",
    "sub": "sub",
    "blimp": "unknown",
    "tracker": "unknown",
}
# "ArduCopter V4.6.3 (92b0cd78)", "APM:Copter V3.4-dev (bdddfae5)", "APMrover2 V2.50"
_BANNER = re.compile(
    r"(?:Ardu|APM:?|Antenna|)(copter|plane|rover|sub|blimp|tracker)2? V(\d+\.\d+(?:\.\d+)?[\w.-]*)",
    re.IGNORECASE,
)
# "CubeOrange 0037003A 30325116 38393532": the serial number in words, each with its bytes reversed.
_BOARD = re.compile(r"([A-Za-z][\w+-]*)((?: [0-9A-F]{8}){3})")
_FRAME = re.compile(r"Frame: (.+)")
_BOAT_CLASS = 2.0


@dataclass(frozen=True)
class Identity:
    """A vehicle as far as its log tells.

    Attributes
    ----------
    kind
        As in :class:`magcomp.model.Vehicle`.
    firmware, board, uid
        As in :class:`magcomp.model.Vehicle`; empty where not told.
    frame
        Such as ``"HEXA/X"``; empty where not told.
    """

    kind: str = "unknown"
    firmware: str = ""
    board: str = ""
    uid: str = ""
    frame: str = ""


def identify(tables: Tables, preface: str, values: Mapping[str, float]) -> Identity:
    """Read who wrote a log from its messages, else from the lines before its format table."""
    found = Identity()
    for line in _words(tables, preface):
        if banner := _BANNER.search(line):
            found = replace(found, kind=_KINDS[banner[1].lower()], firmware=banner[2])
        elif board := _BOARD.fullmatch(line):
            found = replace(found, board=board[1], uid=number_in_words(board[2]))
        elif frame := _FRAME.match(line):
            found = replace(found, frame=frame[1])
    found = replace(found, firmware=_version(tables) or found.firmware)
    if found.kind == "rover" and values.get("FRAME_CLASS") == _BOAT_CLASS:
        return replace(found, kind="boat")
    if found.kind == "unknown":
        return replace(found, kind=_kind_of(tables))
    return found


def _words(tables: Tables, preface: str) -> Iterable[str]:
    yield from preface.splitlines()
    if "VER" in tables and "FWS" in tables["VER"].names:
        yield from tables["VER"].texts("FWS")
    if "MSG" in tables:
        yield from tables["MSG"].texts("Message")


def _version(tables: Tables) -> str:
    if "VER" not in tables or not {"Maj", "Min", "Pat"} <= tables["VER"].names:
        return ""
    last = tables["VER"].matrix("Maj", "Min", "Pat")[-1]
    return ".".join(f"{number:.0f}" for number in last) if np.isfinite(last).all() else ""


def _kind_of(tables: Tables) -> str:
    """By the columns of CTUN, where no line names the firmware."""
    names = tables["CTUN"].names if "CTUN" in tables else frozenset()
    if names & {"NavRoll", "NavPitch"}:
        return "plane"
    return "copter" if names & {"ThO", "ThH", "NavThr", "WPAlt"} else "unknown"
