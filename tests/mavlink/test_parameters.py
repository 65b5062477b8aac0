"""How parameters travel: what is encoded is decoded, each type in its own bytes."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from magcomp.mavlink.header import payload
from magcomp.mavlink.parameters import (
    REAL32,
    Encoding,
    ParamValue,
    as_float,
    decode_param_value,
    decode_values,
    encode_value,
    encoding,
    fits,
    name_and_field,
)

BYTEWISE = mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
CAST = mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
# Where each type's bytes stand in the field, written out: union, first byte first.
LAYOUT = {1: "<Bxxx", 2: "<bxxx", 3: "<Hxx", 4: "<hxx", 5: "<I", 6: "<i"}
RANGES = {
    kind: (-(2 ** (8 * size - 1)), 2 ** (8 * size - 1) - 1) if signed else (0, 2 ** (8 * size) - 1)
    for kind, size, signed in (
        (1, 1, False),
        (2, 1, True),
        (3, 2, False),
        (4, 2, True),
        (5, 4, False),
        (6, 4, True),
    )
}
integers = st.sampled_from(sorted(RANGES)).flatmap(
    lambda kind: st.tuples(st.just(kind), st.integers(*RANGES[kind]))
)


def sent(name: bytes, field: bytes, kind: int, count: int = 9, index: int = 3) -> bytes:
    """Payload of a PARAM_VALUE, laid out by hand."""
    return field + struct.pack("<HH16sB", count, index, name, kind)


@given(integers)
def test_px4_puts_each_integer_in_its_own_bytes(of: tuple[int, int]) -> None:
    kind, value = of
    field = encode_value(value, kind, Encoding.BYTEWISE)
    assert field == struct.pack(LAYOUT[kind], value)
    got = decode_param_value(sent(b"ANY", field, kind), Encoding.BYTEWISE)
    assert got == ParamValue("ANY", float(value), kind, 9, 3)


def test_the_one_byte_of_a_px4_uint8_is_the_first() -> None:
    assert encode_value(200, 1, Encoding.BYTEWISE) == b"\xc8\0\0\0"
    for place, expected in ((0, 200.0), (1, 0.0), (2, 0.0), (3, 0.0)):
        field = bytes(200 if n == place else 0 for n in range(4))
        assert decode_param_value(sent(b"A", field, 1), Encoding.BYTEWISE).value == expected


@given(st.sampled_from([*RANGES, REAL32]), st.floats(width=32, allow_nan=False))
def test_ardupilot_casts_whatever_the_type(kind: int, value: float) -> None:
    field = encode_value(value, kind, Encoding.CAST)
    assert field == struct.pack("<f", value)
    assert decode_param_value(sent(b"A", field, kind), Encoding.CAST).value == value


@given(st.floats(width=32, allow_nan=False))
def test_floats_travel_alike(value: float) -> None:
    fields = {encode_value(value, REAL32, how) for how in Encoding}
    assert fields == {struct.pack("<f", value)}
    for how in Encoding:
        assert decode_param_value(sent(b"A", *fields, REAL32), how).value == value


# Among them the bytes of signalling NaNs of either sign.
some_fields = st.binary(min_size=4, max_size=4) | st.sampled_from(
    [b"\1\0\x80\x7f", b"\1\0\x80\xff"]
)
some_types = st.sampled_from([*RANGES, 7, 8, 9, 10, 0, 255])


@given(st.lists(st.tuples(some_types, some_fields)))
@pytest.mark.parametrize("how", Encoding)
def test_many_at_once_are_each_alone(how: Encoding, of: list[tuple[int, bytes]]) -> None:
    field = np.frombuffer(b"".join(data for _, data in of), dtype="<f4")
    types = np.array([kind for kind, _ in of], dtype=np.uint8)
    together = decode_values(field, types, how)
    alone = [decode_param_value(sent(b"A", data, kind), how).value for kind, data in of]
    np.testing.assert_array_equal(together, np.array(alone))


@given(st.binary(max_size=16), st.binary(min_size=4, max_size=4), st.integers(0, 255))
def test_any_payload_however_short_has_a_meaning(name: bytes, field: bytes, kind: int) -> None:
    whole = sent(name, field, kind)
    for size in range(len(whole)):
        got = decode_param_value(whole[:size], Encoding.BYTEWISE)
        assert got.name == name[: max(size - 8, 0)].partition(b"\0")[0].decode(errors="replace")
    assert name_and_field(whole) == (name.ljust(16, b"\0"), field)


def over_the_wire(name: str, value: float, kind: int) -> Any:
    sender = mavlink.MAVLink(None, 1, 1)
    message = mavlink.MAVLink_param_value_message(name.encode(), value, kind, 9, 3)
    return mavlink.MAVLink(None).decode(bytearray(message.pack(sender)))


@given(st.text("ABC_1", min_size=1, max_size=16), st.floats(width=32, allow_nan=False))
def test_names_and_values_are_those_of_pymavlink(name: str, value: float) -> None:
    message = over_the_wire(name, value, REAL32)
    got = decode_param_value(payload(bytes(message.get_msgbuf())), Encoding.CAST)
    assert (got.name, got.value) == (message.param_id, message.param_value)
    assert (got.type, got.count, got.index) == (REAL32, 9, 3)


@pytest.mark.parametrize("value", [-5_000_000, -8_388_607, 0x7F800001])
def test_an_integer_whose_bytes_are_a_signalling_nan_is_not_changed(value: int) -> None:
    field = encode_value(value, 6, Encoding.BYTEWISE)
    assert decode_param_value(sent(b"A", field, 6), Encoding.BYTEWISE).value == value


@pytest.mark.parametrize(
    ("autopilot", "capabilities", "how"),
    [
        ("ardupilot", 0, Encoding.CAST),
        ("px4", 0, Encoding.BYTEWISE),
        ("ardupilot", BYTEWISE, Encoding.BYTEWISE),
        ("px4", CAST, Encoding.CAST),
        ("ardupilot", CAST, Encoding.CAST),
        ("px4", BYTEWISE, Encoding.BYTEWISE),
        ("ardupilot", BYTEWISE | CAST, Encoding.CAST),
        ("px4", BYTEWISE | CAST, Encoding.BYTEWISE),
        ("ardupilot", 0xFBEF, Encoding.CAST),  # ArduCopter 4.2.1
        ("px4", 0xE8FF, Encoding.BYTEWISE),  # PX4 1.15
        ("px4", 2, Encoding.BYTEWISE),  # PARAM_FLOAT says nothing of integers
    ],
)
def test_the_vehicle_says_how_its_parameters_travel_or_else_its_kind(
    autopilot: str, capabilities: int, how: Encoding
) -> None:
    assert encoding(autopilot, capabilities) is how


@given(integers)
def test_an_integer_fits_within_its_range_only(of: tuple[int, int]) -> None:
    kind, value = of
    low, high = RANGES[kind]
    assert fits(float(value), kind) == (low <= float(value) <= high)
    assert not fits(low - 1.0, kind)
    assert not fits(high + 1.0, kind)
    assert not fits(value + 0.5, kind) or abs(value) >= 2**52


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
@pytest.mark.parametrize("kind", [*RANGES, REAL32])
def test_what_is_not_finite_fits_nowhere(value: float, kind: int) -> None:
    assert not fits(value, kind)


@given(st.binary(min_size=4, max_size=4))
def test_a_field_as_a_float_has_its_bytes_unless_it_is_no_number(field: bytes) -> None:
    value = as_float(field)
    if value == value:
        assert struct.pack("<f", value) == field
