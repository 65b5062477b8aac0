"""From a log's bytes to a Recording: the part shared by files and the live buffer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from magcomp import autopilots
from magcomp.errors import NoLogError
from magcomp.mavlink.checksum import ByteArray, OffsetArray
from magcomp.mavlink.frames import Frames, Scan, scan
from magcomp.mavlink.heartbeat import Identity
from magcomp.mavlink.messages import WANTED, Message, Table, crc_extra, decode
from magcomp.model import FloatArray, ParameterHistory, ReadReport, Recording, Series, Vehicle
from magcomp.sources import quantities
from magcomp.sources.clock import (
    MICROSECOND_WRAP,
    MILLISECOND_WRAP,
    NO_STAMP,
    SECOND,
    Stamps,
    time_axis,
)
from magcomp.sources.quantities import Messages, Timed
from magcomp.sources.repeats import repeated
from magcomp.sources.source import is_text, let_go
from magcomp.sources.vehicles import ONLY_ONE, Choice, choose, require_one_clock

Buffer = bytes | bytearray | memoryview | ByteArray

# Stamped in milliseconds as they are sent.
_LEADING = (
    Message.ATTITUDE,
    Message.SCALED_IMU,
    Message.SCALED_IMU2,
    Message.SCALED_IMU3,
    Message.SYSTEM_TIME,
)
# The position's time is that of the fix; microseconds wrap after 71 minutes, and in some firmware
# are not those since boot.
_FOLLOWING = (
    Message.RAW_IMU,
    Message.SERVO_OUTPUT_RAW,
    Message.ACTUATOR_OUTPUT_STATUS,
    Message.GLOBAL_POSITION_INT,
)
_MICROSECONDS = (Message.RAW_IMU, Message.SERVO_OUTPUT_RAW, Message.ACTUATOR_OUTPUT_STATUS)

_LATEST_STAMP = 1 << 53

# A recorder whose clock says that it is earlier than 2001 does not know the date.
_EARLIEST_UNIX_S = 1.0e9

_LOOK = 1024


@dataclass(frozen=True, eq=False)
class Decoded:
    """One vehicle's messages on one time axis.

    Attributes
    ----------
    who
        The vehicle.
    messages
        Time and columns by message id; a message that did not come has no entry.
    start_unix_s
        Unix time of time zero; NaN where unknown.
    duration_s
        Time of the last used message.
    report
        What became of the bytes.
    """

    who: Identity
    messages: Messages
    start_unix_s: float
    duration_s: float
    report: ReadReport


def recording_from_bytes(
    data: Buffer,
    source: str,
    choice: Choice = ONLY_ONE,
    progress: Callable[[float], None] | None = None,
    *,
    live: bool = False,
) -> Recording:
    """Read a telemetry log that is already in memory.

    Parameters
    ----------
    data
        Records of eight bytes of time and one MAVLink frame, as a .tlog holds them.
    source
        Name of the log or address of the link, for people.
    choice
        The vehicle asked for, where there are several.
    progress
        Called with the read fraction, 0 to 1.
    live
        Whether the bytes are what a link received so far, and no file.

    Returns
    -------
    Recording
        SIM_* parameters are left out: in a simulation they are the truth.

    Raises
    ------
    LogError
        There is no MAVLink frame, or no autopilot's heartbeat.
    ChooseVehicleError
        There are several vehicles and none is chosen, or the chosen one is not there.
    """
    decoded = decode_vehicle(data, source, choice, WANTED, progress)
    return _recording(decoded, source, "live" if live else "tlog")


def decode_vehicle(
    data: Buffer,
    source: str,
    choice: Choice,
    wanted: frozenset[int],
    progress: Callable[[float], None] | None = None,
) -> Decoded:
    """Decode the wanted messages of one vehicle and give them a time.

    Messages beyond those a Recording needs get a time but do not touch that of the others.
    """
    octets = np.frombuffer(data, dtype=np.uint8)
    found = scan(octets, wanted, crc_extra(), progress)
    if not found.verified:
        raise NoLogError(
            f"Log {source} must hold MAVLink frames; instead received {_look(octets)}."
        )
    heartbeats = found.frames[found.frames.message == Message.HEARTBEAT]
    who = choose(source, heartbeats, decode(octets, heartbeats, Message.HEARTBEAT), choice)
    mine = (found.frames.system == who.system) & (found.frames.component == who.component)
    frames = found.frames if mine.all() else found.frames[mine]
    rows = _rows(frames)
    tables = {message: decode(octets, frames[rows[message]], message) for message in rows}
    let_go(octets)
    stamp = _stamps(len(frames), rows, tables)
    copies = repeated(frames, stamp, rows)
    if copies.any():
        tables = {message: tables[message][~copies[rows[message]]] for message in rows}
        frames, stamp = frames[~copies], stamp[~copies]
        rows = _rows(frames)
    if Message.ATTITUDE in rows:
        require_one_clock(source, stamp[rows[Message.ATTITUDE]])
    axis = _axis(frames, stamp, rows)
    core = np.ones(len(frames), dtype=bool)
    for message in rows.keys() - WANTED:
        core[rows[message]] = False
    first = int(np.argmin(np.where(core, axis, np.inf)))
    zero = axis[first]
    messages = {m: _in_order(axis[rows[m]] - zero, tables[m]) for m in rows if len(rows[m])}
    start = float(frames.arrival[first]) / SECOND
    return Decoded(
        who=who,
        messages=messages,
        start_unix_s=start if start > _EARLIEST_UNIX_S else quantities.unix_offset(messages),
        duration_s=float(axis[core].max() - zero),
        report=_report(octets, found, who, int(core.sum()), int(copies.sum())),
    )


def _recording(decoded: Decoded, source: str, kind: str) -> Recording:
    messages, who = decoded.messages, decoded.who
    changes = quantities.parameters(messages, who.autopilot, simulation=False)
    parameters = ParameterHistory(tuple(changes), quantities.holds_whole_list(messages))
    heartbeats = messages[Message.HEARTBEAT]
    attitude = quantities.attitude(messages)
    autopilot = autopilots.named(who.autopilot)
    fields, raw = autopilot.from_telemetry(quantities.field(messages), parameters.latest)
    return Recording(
        source=source,
        vehicle=Vehicle(
            autopilot=who.autopilot,
            kind=who.kind,
            system=who.system,
            component=who.component,
            firmware=quantities.firmware(messages),
            compasses=autopilot.compasses(parameters.latest),
            board=quantities.board(messages),
            capabilities=quantities.capabilities(messages),
            uid=quantities.uid(messages),
        ),
        start_unix_s=decoded.start_unix_s,
        duration_s=decoded.duration_s,
        field=fields,
        parameters=parameters,
        report=decoded.report,
        attitude=attitude,
        attitude_source="" if attitude is None else Message.ATTITUDE.name,
        gyro=quantities.gyro(messages),
        accel=quantities.accel(messages),
        throttle=quantities.throttle(messages),
        current=quantities.current(messages),
        voltage=quantities.voltage(messages),
        outputs=quantities.outputs(messages),
        position=quantities.position(messages),
        armed=Series(heartbeats.time, quantities.armed(heartbeats.table)),
        format=kind,
        other_currents=quantities.other_currents(messages),
        esc_currents=quantities.esc_currents(messages),
        raw_compasses=raw,
        forward=quantities.forward(messages),
    )


def _rows(frames: Frames) -> dict[int, NDArray[np.intp]]:
    """Which frames carry each message, in the order of the stream."""
    present = np.flatnonzero(np.bincount(frames.message))
    return {int(m): np.flatnonzero(frames.message == m) for m in present}


def _stamp(message: int, table: Table) -> OffsetArray:
    """The vehicle's time of each row in microseconds, or ``NO_STAMP``, shape (n,)."""
    micro = message in _MICROSECONDS
    sent = table["time_usec"] if micro else table["time_boot_ms"].astype(np.uint64) * 1000
    # No clock has run for three centuries, and one that is always 0 has not been set.
    believed = (sent < _LATEST_STAMP) & sent.any()
    return np.where(believed, sent.astype(np.int64), NO_STAMP)


def _stamps(n: int, rows: dict[int, NDArray[np.intp]], tables: dict[int, Table]) -> OffsetArray:
    """The vehicle's time of each frame in microseconds, or ``NO_STAMP``, shape (n,)."""
    result = np.full(n, NO_STAMP, dtype=np.int64)
    for message in rows.keys() & {*_LEADING, *_FOLLOWING}:
        result[rows[message]] = _stamp(message, tables[message])
    return result


def _axis(frames: Frames, stamp: OffsetArray, rows: dict[int, NDArray[np.intp]]) -> FloatArray:
    """Time of each frame in seconds from an arbitrary zero, shape (n,)."""
    groups = []
    for message in (*_LEADING, *_FOLLOWING):
        if message in rows:
            stamped = rows[message][stamp[rows[message]] != NO_STAMP]
            wrap = MICROSECOND_WRAP if message in _MICROSECONDS else MILLISECOND_WRAP
            at_sending = message != Message.GLOBAL_POSITION_INT
            groups.append(Stamps(stamped, stamp[stamped], wrap, at_sending))
    leading = sum(message in rows for message in _LEADING)
    return time_axis(frames.arrival, _place(frames), groups[:leading], groups[leading:])


def _place(frames: Frames) -> OffsetArray:
    """Place of each frame in the stream, in bytes of the messages a Recording is made of.

    Not the place in the file: a live buffer leaves out what no fit needs, and must give the same
    times as its own .tlog.
    """
    counts = np.isin(frames.message, tuple(WANTED))
    place: OffsetArray = np.cumsum(np.where(counts, frames.length.astype(np.int64) + 1, 0))
    return place


def _in_order(time: FloatArray, table: Table) -> Timed:
    if (np.diff(time) >= 0).all():
        return Timed(time, table)
    order = np.argsort(time, kind="stable")
    return Timed(time[order], table[order])


def _report(octets: ByteArray, found: Scan, who: Identity, used: int, copies: int) -> ReadReport:
    return ReadReport(
        size=len(octets),
        frames=found.total,
        used=used,
        bad_checksum=found.bad_checksum,
        skipped=found.skipped,
        duplicates=copies,
        others=tuple(pair for pair in found.talkers if pair != (who.system, who.component)),
    )


def _look(octets: ByteArray) -> str:
    """What bytes that are no log look like, for the user."""
    if not len(octets):
        return "an empty file"
    kind = "text" if is_text(bytes(octets[:_LOOK])) else "data"
    return f"{len(octets)} bytes of {kind} without one sound frame"
