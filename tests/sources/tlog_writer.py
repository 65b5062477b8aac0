"""Write telemetry logs for tests with pymavlink, which knows nothing of magcomp."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect
from pymavlink.generator.mavcrc import x25crc

ROOT = Path(__file__).parents[2]
RECORDINGS = sorted((ROOT / "sitl_fixtures").glob("*.tlog"))
REAL = [
    Path("/work/shared/real") / name
    for name in ("quad_2013.tlog", "quad_2015.tlog")
    if (Path("/work/shared/real") / name).exists()
]

START_US = 1_700_000_000_000_000
SECOND = 1_000_000
COPTER = dialect.MAV_TYPE_QUADROTOR
ARDUPILOT = dialect.MAV_AUTOPILOT_ARDUPILOTMEGA
PX4 = dialect.MAV_AUTOPILOT_PX4


class Sender:
    """A MAVLink component that turns messages into frames."""

    def __init__(
        self, system: int = 1, component: int = 1, version: int = 2, signed: bool = False
    ) -> None:
        self.link = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        self.version = version
        if signed:
            self.link.signing.secret_key = bytes(range(32))
            self.link.signing.link_id = 1
            self.link.signing.timestamp = 1
            self.link.signing.sign_outgoing = True

    def frame(self, message: Any) -> bytes:
        packed = message.pack(self.link, force_mavlink1=self.version == 1)
        self.link.seq = (self.link.seq + 1) % 256
        return bytes(packed)

    def heartbeat(
        self, kind: int = COPTER, autopilot: int = ARDUPILOT, base_mode: int = 0
    ) -> bytes:
        return self.frame(dialect.MAVLink_heartbeat_message(kind, autopilot, base_mode, 0, 3, 3))

    def attitude(
        self, boot_ms: int, roll: float = 0.1, pitch: float = 0.2, yaw: float = 0.3
    ) -> bytes:
        return self.frame(dialect.MAVLink_attitude_message(boot_ms, roll, pitch, yaw, 0, 0, 0))

    def raw_imu(self, boot_us: int, mag: tuple[int, int, int] = (100, -200, 300)) -> bytes:
        return self.frame(
            dialect.MAVLink_raw_imu_message(boot_us, 10, -20, -1000, 500, -250, 125, *mag)
        )

    def scaled_imu(
        self, boot_ms: int, number: int = 2, mag: tuple[int, int, int] = (1, 2, 3)
    ) -> bytes:
        kind = {
            1: dialect.MAVLink_scaled_imu_message,
            2: dialect.MAVLink_scaled_imu2_message,
            3: dialect.MAVLink_scaled_imu3_message,
        }[number]
        return self.frame(kind(boot_ms, 1, 2, -1000, 4, 5, 6, *mag))

    def throttle(self, percent: int) -> bytes:
        return self.frame(dialect.MAVLink_vfr_hud_message(0.0, 0.0, 0, percent, 100.0, 0.0))

    def system_status(self, centiamps: int, millivolts: int = 12600) -> bytes:
        return self.frame(
            dialect.MAVLink_sys_status_message(
                0, 0, 0, 0, millivolts, centiamps, 0, 0, 0, 0, 0, 0, 0
            )
        )

    def battery(self, centiamps: int, number: int = 0, cells: tuple[int, ...] = (12600,)) -> bytes:
        voltages = (*cells, *[0xFFFF] * (10 - len(cells)))
        return self.frame(
            dialect.MAVLink_battery_status_message(number, 0, 0, 0, voltages, centiamps, 0, 0, 0)
        )

    def servos(self, boot_us: int, *pwm: int, port: int = 0) -> bytes:
        padded = (*pwm, *[0] * (16 - len(pwm)))
        return self.frame(
            dialect.MAVLink_servo_output_raw_message(boot_us, port, *padded[:8], *padded[8:])
        )

    def actuators(self, boot_us: int, *output: float) -> bytes:
        padded = (*output, *[0.0] * (32 - len(output)))
        return self.frame(
            dialect.MAVLink_actuator_output_status_message(boot_us, len(output), padded)
        )

    def controllers(self, *centiamps: int, first: int = 1) -> bytes:
        kind = {
            1: dialect.MAVLink_esc_telemetry_1_to_4_message,
            5: dialect.MAVLink_esc_telemetry_5_to_8_message,
        }[first]
        nothing = [0, 0, 0, 0]
        return self.frame(kind(bytes(4), nothing, list(centiamps), nothing, nothing, nothing))

    def vtol(self, state: int) -> bytes:
        return self.frame(dialect.MAVLink_extended_sys_state_message(state, 0))

    def parameter(self, name: str, value: float, kind: int = 9) -> bytes:
        return self.frame(
            dialect.MAVLink_param_value_message(name.encode(), value, kind, 1000, 65535)
        )

    def text(self, line: str) -> bytes:
        return self.frame(dialect.MAVLink_statustext_message(6, line.encode()))

    def position(self, boot_ms: int, lat: int, lon: int) -> bytes:
        return self.frame(
            dialect.MAVLink_global_position_int_message(boot_ms, lat, lon, 488000, 0, 0, 0, 0, 0)
        )


def record(arrival_us: int, frame: bytes) -> bytes:
    """One record of a telemetry log."""
    return struct.pack(">Q", arrival_us) + frame


def log(frames: Iterable[bytes], arrival: Callable[[int], int] | None = None) -> bytes:
    """A log whose n-th record arrives at START_US + arrival(n); each millisecond by default."""
    after = arrival or (lambda n: n * 1000)
    return b"".join(record(START_US + after(n), frame) for n, frame in enumerate(frames))


def short_flight(sender: Sender, seconds: int = 4) -> list[bytes]:
    """A few seconds of everything a fit needs, 10 Hz."""
    frames = [sender.heartbeat(), sender.parameter("COMPASS_OFS_X", 12.5)]
    for tick in range(seconds * 10):
        ms = 5000 + tick * 100
        frames += [
            sender.attitude(ms, roll=tick / 100),
            sender.servos(ms * 1000, 1100 + tick, 1200, 1300, 1400),
            sender.raw_imu(ms * 1000, mag=(100 + tick, -200, 300)),
            sender.scaled_imu(ms, 2, mag=(7, 8, 9 + tick)),
            sender.throttle(tick % 100),
            sender.battery(tick * 10),
        ]
        if tick % 10 == 9:
            frames += [sender.heartbeat(base_mode=128), sender.system_status(tick * 10)]
    return frames


def flown_again(data: bytes, times: int) -> bytes:
    """A clean log several times over, an hour apart, with other sequence numbers each time."""
    rounds = []
    for n in range(times):
        at = 0
        while at < len(data):
            (arrival,) = struct.unpack_from(">Q", data, at)
            second = data[at + 8] == dialect.PROTOCOL_MARKER_V2
            header = 10 if second else 6
            end = at + 8 + header + data[at + 9]
            frame = bytearray(data[at + 8 : end])
            number = int.from_bytes(frame[7:10], "little") if second else frame[5]
            sequence = 4 if second else 2
            frame[sequence] = (frame[sequence] + n) % 256
            frame += x25crc(
                frame[1:] + bytes([dialect.mavlink_map[number].crc_extra])
            ).crc.to_bytes(2, "little")
            rounds.append(record(arrival + n * 3600 * SECOND, bytes(frame)))
            at = end + 2
    return b"".join(rounds)
