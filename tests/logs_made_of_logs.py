"""Logs for tests, made of the recordings in sitl_fixtures/ by leaving out or changing frames."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as dialect
from pymavlink.generator.mavcrc import x25crc

FIXTURES = Path(__file__).parents[1] / "sitl_fixtures"
SWEEP = FIXTURES / "sweep_current.tlog"
FLIGHT = FIXTURES / "flight.tlog"

COMPASSES = {
    dialect.MAVLINK_MSG_ID_RAW_IMU,
    dialect.MAVLINK_MSG_ID_SCALED_IMU,
    dialect.MAVLINK_MSG_ID_SCALED_IMU2,
    dialect.MAVLINK_MSG_ID_SCALED_IMU3,
}
CURRENT = {dialect.MAVLINK_MSG_ID_SYS_STATUS, dialect.MAVLINK_MSG_ID_BATTERY_STATUS}
THROTTLE = {dialect.MAVLINK_MSG_ID_VFR_HUD, dialect.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW}
ATTITUDE = {dialect.MAVLINK_MSG_ID_ATTITUDE, dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION}
PARAMETERS = {dialect.MAVLINK_MSG_ID_PARAM_VALUE}
POSITION = {dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, dialect.MAVLINK_MSG_ID_GPS_RAW_INT}
HEARTBEAT = dialect.MAVLINK_MSG_ID_HEARTBEAT


@dataclass(frozen=True)
class Frame:
    """One MAVLink 2 frame of a log, its payload with its trailing noughts."""

    arrival_us: int
    sequence: int
    system: int
    component: int
    message: int
    payload: bytes

    def packed(self) -> bytes:
        """The frame as it stands in a log, checksum made anew."""
        payload = self.payload.rstrip(b"\0") or b"\0"
        head = struct.pack(
            "<BBBBBB", len(payload), 0, 0, self.sequence, self.system, self.component
        )
        covered = head + self.message.to_bytes(3, "little") + payload
        extra = bytes([dialect.mavlink_map[self.message].crc_extra])
        checksum = x25crc(covered + extra).crc.to_bytes(2, "little")
        return struct.pack(">Q", self.arrival_us) + b"\xfd" + covered + checksum


def frames(path: Path) -> Iterator[Frame]:
    """Every frame of a sound log of MAVLink 2 frames without signatures."""
    data = path.read_bytes()
    at = 0
    while at < len(data):
        (arrival,) = struct.unpack_from(">Q", data, at)
        magic, length, flags, _, sequence, system, component = data[at + 8 : at + 15]
        assert (magic, flags) == (0xFD, 0)
        message = int.from_bytes(data[at + 15 : at + 18], "little")
        yield Frame(arrival, sequence, system, component, message, data[at + 18 : at + 18 + length])
        at += 20 + length


def write(path: Path, of: Iterable[Frame]) -> Path:
    """Write a log."""
    path.write_bytes(b"".join(frame.packed() for frame in of))
    return path


def without(path: Path, messages: set[int], source: Path = SWEEP) -> Path:
    """Write a log that lacks some messages."""
    return write(path, (frame for frame in frames(source) if frame.message not in messages))


def changed(path: Path, change: Callable[[Frame], Frame], source: Path = SWEEP) -> Path:
    """Write a log in which some frames are others."""
    return write(path, map(change, frames(source)))


def of_kind(path: Path, kind: int) -> Path:
    """Write a log whose vehicle says it is a plane, a rover, …"""

    def heartbeat(frame: Frame) -> Frame:
        if frame.message != HEARTBEAT:
            return frame
        payload = bytearray(frame.payload.ljust(9, b"\0"))
        payload[4] = kind
        return replace(frame, payload=bytes(payload))

    return changed(path, heartbeat)


def of_autopilot(path: Path, autopilot: int) -> Path:
    """Write a log whose vehicle says it has another autopilot."""

    def heartbeat(frame: Frame) -> Frame:
        if frame.message != HEARTBEAT or frame.system != 1:
            return frame
        payload = bytearray(frame.payload.ljust(9, b"\0"))
        payload[5] = autopilot
        return replace(frame, payload=bytes(payload))

    return changed(path, heartbeat)


def with_parameters(path: Path, names: Iterable[str], value: float) -> Path:
    """Write a log at whose end parameters have another value."""
    all_frames = list(frames(SWEEP))
    added = [
        replace(
            all_frames[-1],
            message=dialect.MAVLINK_MSG_ID_PARAM_VALUE,
            payload=struct.pack("<fHH16sB", value, 1000, 65535, name.encode(), 9),
        )
        for name in names
    ]
    return write(path, [*all_frames, *added])


def with_nan(path: Path, *names: str) -> Path:
    """Write a log at whose end parameters are no numbers."""
    return with_parameters(path, names, math.nan)


def with_second_vehicle(path: Path, system: int) -> Path:
    """Write a log of two vehicles that fly the same."""

    def both() -> Iterator[Frame]:
        for frame in frames(SWEEP):
            yield frame
            if frame.system == 1:
                yield replace(frame, system=system)

    return write(path, both())


def with_weak_current(path: Path) -> Path:
    """Write a log without throttle whose current hardly rises: no fit of it can be trusted."""
    place = {dialect.MAVLINK_MSG_ID_BATTERY_STATUS: 30, dialect.MAVLINK_MSG_ID_SYS_STATUS: 16}

    def weak(frame: Frame) -> Frame:
        at = place.get(frame.message)
        if at is None:
            return frame
        payload = bytearray(frame.payload.ljust(at + 2, b"\0"))
        (centiamps,) = struct.unpack_from("<h", payload, at)
        struct.pack_into("<h", payload, at, centiamps // 40)
        return replace(frame, payload=bytes(payload))

    kept = (frame for frame in frames(SWEEP) if frame.message not in THROTTLE)
    return write(path, map(weak, kept))


def with_shaken_compass_2(path: Path) -> Path:
    """Write a log whose second compass is disturbed by something else than the motors."""
    random = np.random.default_rng(2)

    def shaken(frame: Frame) -> Frame:
        if frame.message != dialect.MAVLINK_MSG_ID_SCALED_IMU2:
            return frame
        payload = bytearray(frame.payload.ljust(22, b"\0"))
        field = np.frombuffer(payload, "<i2", 3, 16) + random.normal(0.0, 150.0, 3)
        payload[16:22] = field.astype("<i2").tobytes()
        return replace(frame, payload=bytes(payload))

    return changed(path, shaken)
