"""The log formats magcomp reads, and what else is given in their place.

A file is what its first bytes say, whatever its name.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from magcomp.mavlink import stream
from magcomp.model import Recording
from magcomp.sources import dataflash, tlog, ulog
from magcomp.sources.source import is_text
from magcomp.sources.vehicles import Choice

Progress = Callable[[float], None]

HEAD = 1 << 12
"""First bytes of a file that say what it is."""


@dataclass(frozen=True)
class Format:
    """A kind of log that magcomp reads.

    Attributes
    ----------
    name
        As in ``Recording.format``.
    title
        For people, with its suffix.
    recognises
        Tells from the first ``HEAD`` bytes, or all there are, whether a file is of this kind.
    read
        Reads a file, where there are several vehicles the one chosen.
    signed
        Whether its beginning is a signature, which nothing in ``OTHERS`` has too.
    """

    name: str
    title: str
    recognises: Callable[[bytes], bool]
    read: Callable[[Path, Choice, Progress | None], Recording]
    signed: bool = True


@dataclass(frozen=True)
class Other:
    """A kind of file that is no log magcomp can read.

    Attributes
    ----------
    title
        What it is, for people.
    advice
        What to do instead.
    recognises
        Tells from the first bytes.
    is_log
        Whether it is a log all the same.
    """

    title: str
    advice: str
    recognises: Callable[[bytes], bool]
    is_log: bool = False


def of_one_vehicle(
    read: Callable[[Path], Recording],
) -> Callable[[Path, Choice, Progress | None], Recording]:
    """Make a reader of logs that only ever hold one vehicle one of the table's."""

    def read_any(path: Path, choice: Choice, progress: Progress | None) -> Recording:  # noqa: ARG001
        return read(path)

    return read_any


def format_of(head: bytes) -> Format | None:
    """The format of a file that begins with these bytes; None where it is none of ours."""
    return next((each for each in FORMATS if each.recognises(head)), None)


def other_of(head: bytes) -> Other | None:
    """What a file is instead of a log that can be read; None where nobody knows it."""
    if any(each.signed and each.recognises(head) for each in FORMATS):
        return None
    return next((each for each in OTHERS if each.recognises(head)), None)


def is_log(head: bytes) -> bool:
    """Tell whether a file is a log, be it one that cannot be read yet."""
    other = other_of(head)
    return other.is_log if other is not None else format_of(head) is not None


# ---------------------------------------------------------------- text

# Mission Planner's and MAVProxy's NAME,VALUE and NAME VALUE, QGroundControl's five columns.
_PARAMETER = re.compile(rb"(?:\d+\t\d+\t)?[A-Z][A-Z0-9_]{1,15}[ \t]*[,=\s][ \t]*[-+.\dxA-Fa-f]")
_MOST = 0.8


def _lines(head: bytes) -> list[bytes]:
    """Whole lines that are no comments."""
    lines = head.splitlines()
    whole = lines[:-1] if len(head) == HEAD else lines
    return [line.strip() for line in whole if line.strip() and not line.startswith((b"#", b"//"))]


def _is_parameters(head: bytes) -> bool:
    lines = _lines(head) if is_text(head) else []
    return sum(_PARAMETER.match(line) is not None for line in lines) > _MOST * len(lines)


def _is_table(head: bytes) -> bool:
    """Most lines have as many separators."""
    lines = _lines(head) if is_text(head) else []
    columns = Counter((line.count(b","), line.count(b";"), line.count(b"\t")) for line in lines)
    del columns[0, 0, 0]
    return max(columns.values(), default=0) > _MOST * len(lines)


def _is_web_page(head: bytes) -> bool:
    start = head.lstrip(b"\xef\xbb\xbf \t\r\n")[:64].lower()
    return start.startswith((b"<!doctype html", b"<html", b"<head", b"<!--"))


def _begins(*beginnings: bytes) -> Callable[[bytes], bool]:
    return lambda head: head.startswith(beginnings)


# ---------------------------------------------------------------- the tables

FORMATS: tuple[Format, ...] = (
    Format(
        "dataflash",
        "a dataflash log (.BIN)",
        dataflash.recognises,
        of_one_vehicle(dataflash.read_dataflash),
    ),
    Format(
        "dataflash",
        "a dataflash log in text (.log)",
        dataflash.recognises_text,
        of_one_vehicle(dataflash.read_dataflash),
    ),
    Format("ulog", "a PX4 log (.ulg)", ulog.recognises, of_one_vehicle(ulog.read_ulog)),
    Format("tlog", "a telemetry log (.tlog)", tlog.recognises, tlog.read_chosen, signed=False),
)
"""Every format that is read, in the order in which they are asked."""

OTHERS: tuple[Other, ...] = (
    Other("an empty file", "copy it again from where it came", lambda head: not head),
    Other(
        "raw MAVLink without times (.rlog)",
        "give the .tlog that the ground station wrote beside it",
        stream.is_unstamped,
        is_log=True,
    ),
    Other(
        "an archive that magcomp does not open (.7z, .rar, .xz, .bz2, .zst)",
        "unpack it and give the log",
        _begins(
            b"7z\xbc\xaf\x27\x1c", b"Rar!\x1a\x07", b"\xfd7zXZ\x00", b"BZh", b"\x28\xb5\x2f\xfd"
        ),
    ),
    Other(
        "a Git-LFS pointer, which only stands for the log",
        "fetch the log with git lfs pull",
        _begins(b"version https://git-lfs.github.com/spec/"),
    ),
    Other(
        "a web page, as a failed download leaves",
        "download the log itself",
        _is_web_page,
    ),
    Other(
        "a parameter file (.param)",
        "give the log of a flight; magcomp upload takes parameter files",
        _is_parameters,
    ),
    Other("a text table (.csv)", "give the log that it was made from", _is_table),
    Other(
        "a text that is no log", "give the log as the vehicle or ground station wrote it", is_text
    ),
)
"""What is often given in the place of a log, in the order in which they are asked."""
