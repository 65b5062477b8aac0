"""Write PX4 logs, byte by byte as the firmware does."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

MAGIC = b"ULog\x01\x12\x35\x01"
SYNC = bytes([0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12])
START_US = 5_000_000

_CODES = {
    "uint8_t": "B",
    "bool": "?",
    "uint16_t": "H",
    "uint32_t": "I",
    "int32_t": "i",
    "uint64_t": "Q",
    "float": "f",
    "double": "d",
}

FORMS: Mapping[str, str] = {
    "sensor_mag": "uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float x;"
    "float y;float z;",
    "vehicle_magnetometer": "uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;"
    "float[3] magnetometer_ga;",
    "sensor_combined": "uint64_t timestamp;float[3] gyro_rad;float[3] magnetometer_ga;",
    "vehicle_attitude": "uint64_t timestamp;uint64_t timestamp_sample;float[4] q;",
    "battery_status": "uint64_t timestamp;float voltage_v;float current_a;",
    "vehicle_thrust_setpoint": "uint64_t timestamp;float[3] xyz;",
    "actuator_controls_0": "uint64_t timestamp;float[8] control;",
    "actuator_motors": "uint64_t timestamp;float[12] control;",
    "actuator_outputs": "uint64_t timestamp;uint32_t noutputs;float[16] output;",
    "esc_report": "uint64_t timestamp;float esc_current;",
    "esc_status": "uint64_t timestamp;esc_report[2] esc;",
    "vehicle_status": "uint64_t timestamp;uint8_t arming_state;uint8_t vehicle_type;",
    "vehicle_global_position": "uint64_t timestamp;double lat;double lon;float alt;",
    "vehicle_gps_position": "uint64_t timestamp;uint64_t time_utc_usec;int32_t lat;int32_t lon;"
    "int32_t alt;uint8_t fix_type;",
}


def message(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body


def code_of(form: str) -> str:
    found = "<"
    for each in form.rstrip(";").split(";"):
        base, _, count = each.split(" ")[0].partition("[")
        found += (count.rstrip("]") or "") + _CODES[base]
    return found


ESC_STATUS, ESC_STATUS_OF_FUNCTIONS = "<QQfQf", "<QQfBQfB"
"""A format inside another, laid out; from 1.13 on with what each output does."""

ESC_REPORT_OF_FUNCTIONS = "uint64_t timestamp;float esc_current;uint8_t actuator_function;"


def parameter(name: str, value: float) -> bytes:
    whole = isinstance(value, int)
    key = f"{'int32_t' if whole else 'float'} {name}".encode()
    return bytes([len(key)]) + key + struct.pack("<i" if whole else "<f", value)


@dataclass
class Writer:
    """A log being written; rows go out in the order in which they are added."""

    release: int = 0x010F02FF
    parameters: dict[str, float] = field(default_factory=dict)
    defaults: dict[str, float] = field(default_factory=dict)
    appended_at: int | None = None
    forms: Mapping[str, str] = field(default_factory=lambda: FORMS)
    _rows: list[bytes] = field(default_factory=list)
    _topics: dict[tuple[str, int], int] = field(default_factory=dict)

    def row(self, name: str, *values: float, instance: int = 0) -> None:
        """A topic's message, its stamp (seconds) first."""
        if (name, instance) not in self._topics:
            self._topics[name, instance] = len(self._topics)
            number = self._topics[name, instance]
            self.raw(message("A", struct.pack("<BH", instance, number) + name.encode()))
        stamped = [round(value * 1e6) + START_US if n == 0 else value for n, value in
                   enumerate(values)]  # fmt: skip
        code = code_of(self.forms[name]) if name != "esc_status" else ESC_STATUS
        if name == "esc_status" and self.forms["esc_report"] == ESC_REPORT_OF_FUNCTIONS:
            code = ESC_STATUS_OF_FUNCTIONS
        body = struct.pack(code, *stamped)
        self.raw(message("D", struct.pack("<H", self._topics[name, instance]) + body))

    def set(self, name: str, value: float) -> None:
        """A parameter that changes now."""
        self.raw(message("P", parameter(name, value)))

    def raw(self, data: bytes) -> None:
        self._rows.append(data)

    def said(self, text: str) -> None:
        self.raw(message("L", b"6" + struct.pack("<Q", START_US) + text.encode()))

    def binary(self) -> bytes:
        flags = bytes(8) + bytes([self.appended_at is not None]) + bytes(7)
        flags += struct.pack("<QQQ", self.appended_at or 0, 0, 0)
        key = b"uint32_t ver_sw_release"
        parts = [MAGIC + struct.pack("<Q", START_US), message("B", flags)]
        parts += [message("F", f"{name}:{form}".encode()) for name, form in self.forms.items()]
        parts.append(message("I", bytes([len(key)]) + key + struct.pack("<I", self.release)))
        parts += [message("P", parameter(*each)) for each in self.parameters.items()]
        parts += [message("Q", b"\x01" + parameter(*each)) for each in self.defaults.items()]
        return b"".join([*parts, *self._rows])


def slot(number: int, device: int, **changed: Sequence[float] | int) -> dict[str, float]:
    """The parameters of a calibration slot."""
    vectors = {"OFF": (0.0,) * 3, "SCALE": (1.0,) * 3, "ODIAG": (0.0,) * 3, "COMP": (0.0,) * 3}
    found: dict[str, float] = {
        f"CAL_MAG{number}_ID": device,
        f"CAL_MAG{number}_ROT": changed.get("ROT", -1),
        f"CAL_MAG{number}_PRIO": changed.get("PRIO", 50),
    }
    for kind, usual in vectors.items():
        for axis, value in zip("XYZ", changed.get(kind, usual), strict=True):
            found[f"CAL_MAG{number}_{axis}{kind}"] = float(value)
    return found


def short_flight(seconds: int = 10) -> Writer:
    """A vehicle with two compasses, in slots 1 and 0, whose field does not move."""
    writer = Writer(
        parameters={
            "MAV_TYPE": 2,
            "MAV_SYS_ID": 3,
            "CAL_MAG_COMP_TYP": 0,
            **slot(0, 222),
            **slot(1, 111, ROT=10),
        }
    )
    for tenth in range(10 * seconds):
        time = tenth / 10
        stamp = round(time * 1e6) + START_US
        for instance, device in enumerate((111, 222)):
            writer.row("sensor_mag", time, stamp, device, 0.2 + 1e-3 * tenth, 0.1, 0.4,
                       instance=instance)  # fmt: skip
        writer.row("vehicle_attitude", time, stamp, 1.0, 0.0, 0.0, 0.0)
        writer.row("battery_status", time, 12.0, 5.0 + tenth % 7)
        writer.row("vehicle_thrust_setpoint", time, 0.0, 0.0, -0.3 - 0.01 * (tenth % 7))
        if tenth % 5 == 0:
            writer.row("vehicle_status", time, 2, 1)
    return writer
