"""What is fuzzed: bytes in, nothing out but magcomp's own errors."""

from __future__ import annotations

import atexit
import contextlib
import os
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from magcomp.analysis import Options, analyse
from magcomp.analysis.analyse import check
from magcomp.buffer import Buffer
from magcomp.errors import MagcompError
from magcomp.link.diagnosis import why_ambiguous, why_no_vehicle
from magcomp.link.state import LinkState
from magcomp.link.streams import DEFAULT_RATES
from magcomp.link.transport import Peer
from magcomp.live.latest import Latest
from magcomp.live.tap import Tap
from magcomp.mavlink.records import records
from magcomp.report import as_json
from magcomp.report.as_html import html
from magcomp.sources import read
from magcomp.writing.files import format_parameters, parse_parameters, read_parameter_file
from magcomp.writing.journal import read_journal

Target = Callable[[bytes], None]

if Path("/dev/shm").is_dir():
    tempfile.tempdir = "/dev/shm"  # a disk would cost more than what is tried
_FOLDER = Path(tempfile.mkdtemp(prefix="fuzz"))
atexit.register(shutil.rmtree, _FOLDER, ignore_errors=True)


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


_STEPS_S = (0.001, 0.05, 0.4, 7.0)
_PIECES = (29, 97, 280, 1000, 4000)
_PEERS: Sequence[Peer] = (None, ("127.0.0.1", 1), ("127.0.0.1", 2))
_KEY = bytes(range(32))


def link(data: bytes) -> None:
    """A whole link hears what comes in, in pieces, from several peers, and loses its line.

    The last eight bytes say how: who is wanted, with which key, in which pieces and when.
    """
    who, key, streams, size, step, peers, loss, _ = data[-8:].ljust(8, b"\0")
    state = LinkState(
        system=(None, None, 1, 2)[who % 4],
        component=(None, None, None, 1, 191)[who % 5],
        key=_KEY if key % 8 == 7 else None,
    )
    tap = Tap(Buffer("fuzz", limit=20_000), Latest(), None)
    stream = b"".join(frame for _, frame in records(data)) or data
    now, cut = 0.0, _PIECES[size % len(_PIECES)]
    for turn, start in enumerate(range(0, len(stream), cut)):
        peer = _PEERS[turn % (1 + peers % len(_PEERS))]
        for received in state.receive(stream[start : start + cut], now, peer):
            if not received.from_stranger:
                tap.add(int(now * 1e6), received.frame.raw)
        for message in state.due(now):
            state.pack(message, int(now * 1e6))
        if turn % 16 == streams % 32:
            state.request_streams(DEFAULT_RATES, now)
        if turn % 16 == loss % 32:
            state.closed(now, "lost")
            state.reopened(now)
        now += _STEPS_S[step % len(_STEPS_S)]
    _tell(state, tap, now)


def _tell(state: LinkState, tap: Tap, now: float) -> None:
    """Ask a link all that a person may see of it."""
    state.take_events()
    known = state.statistics(now)
    about = state.heartbeats, state.companions, state.foreign
    why_no_vehicle("fuzz", 1.0, known, *about)
    why_ambiguous("fuzz", state.heartbeats or state.companions, twins=False)
    if (vehicle := state.vehicle) is not None:
        tap.latest.now(vehicle)
        tap.latest.parameters(vehicle)
        tap.seconds(vehicle)


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

FRAMED = frozenset({"telemetry", "link", "analysis"})
"""Targets that take telemetry: most of their inputs are sound frames of hostile values."""
