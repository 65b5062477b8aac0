"""What is fuzzed: bytes in, nothing out but magcomp's own errors."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from magcomp.analysis import Options, analyse
from magcomp.analysis.analyse import check
from magcomp.errors import MagcompError
from magcomp.link.framing import Framer
from magcomp.mavlink.records import records
from magcomp.report import as_json
from magcomp.report.as_html import html
from magcomp.sources import read
from magcomp.writing.files import format_parameters, parse_parameters, read_parameter_file
from magcomp.writing.journal import read_journal

Target = Callable[[bytes], None]

_FOLDER = Path(
    tempfile.mkdtemp(prefix="fuzz", dir="/dev/shm" if Path("/dev/shm").is_dir() else None)
)


def _written(data: bytes, name: str) -> Path:
    path = _FOLDER / f"{os.getpid()}-{name}"
    path.write_bytes(data)
    return path


def log(data: bytes) -> None:
    """Read a log of any format."""
    read(_written(data, "log"))


def parameters(data: bytes) -> None:
    """Read a parameter file, and what is written of it again."""
    found = read_parameter_file(_written(data, "file.param"))
    for suffix in (".param", ".parm", ".params"):
        again = parse_parameters(format_parameters(found, suffix), "again")
        if dict(again.values) != dict(found.values):
            raise AssertionError(f"{suffix} changes values")


def journal(data: bytes) -> None:
    """Read a write's journal."""
    read_journal(_written(data, "x.journal"))


def link(data: bytes) -> None:
    """Hear what comes in, in pieces."""
    framer = Framer()
    stream = b"".join(frame for _, frame in records(data)) or data
    for start in range(0, len(stream), 97):
        framer.receive(stream[start : start + 97], start / 1e4)


def analysis(data: bytes) -> None:
    """The whole road: read, fit, judge, report."""
    recording = read(_written(data, "whole"))
    # One compass: the others only take as long again.
    options = Options(compass=min(recording.field, default=1))
    with contextlib.suppress(MagcompError):
        check(recording, options)
    found = analyse(recording, options)
    as_json.dumps(as_json.analysis_object(found))
    html(recording, found)


TARGETS: Mapping[str, Target] = {
    "telemetry": log,
    "dataflash": log,
    "text": log,
    "ulog": log,
    "archive": log,
    "parameters": parameters,
    "journal": journal,
    "link": link,
    "analysis": analysis,
}
"""By name; all but ``link`` may refuse what they are given by a MagcompError."""

FRAMED = frozenset({"telemetry", "analysis"})
"""Targets that take telemetry: half of their inputs are sound frames of hostile values."""
