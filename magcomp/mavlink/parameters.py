"""How a parameter's value travels in the float field of PARAM_VALUE and PARAM_SET.

ArduPilot casts every value to float32. PX4 puts an integer's own bytes, little-endian, where
the float's are; a narrow one comes first and zeros fill the rest. An autopilot says which in
AUTOPILOT_VERSION; where it says neither or was not heard, its kind decides.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from magcomp import autopilots
from magcomp.mavlink.messages import Message, decode_payload, text
from magcomp.model import as_floats

REAL32 = 9
"""MAV_PARAM_TYPE_REAL32."""

NAME_SIZE = 16

NO_INDEX = 65535
"""Index of a PARAM_VALUE that is no part of the list (−1 as uint16)."""

_CAPABLE_OF_BYTES = 1 << 4  # MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
_CAPABLE_OF_CAST = 1 << 17  # MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST

# Integers by MAV_PARAM_TYPE: UINT8, INT8, UINT16, INT16, UINT32, INT32.
_INTEGERS = {n: np.dtype(c) for n, c in enumerate(("<u1", "<i1", "<u2", "<i2", "<u4", "<i4"), 1)}
_FIELD = 4


class Encoding(Enum):
    """How integers travel in a float field."""

    CAST = "cast to float"
    BYTEWISE = "as their own bytes"


@dataclass(frozen=True)
class ParamValue:
    """What a parameter is on the vehicle: part of the list, an answer, or an echo of a write.

    Attributes
    ----------
    name
        Up to 16 characters.
    value
        Decoded.
    type
        MAV_PARAM_TYPE.
    count, index
        Parameters of the vehicle, and this one's place among them.
    """

    name: str
    value: float
    type: int = REAL32
    count: int = 0
    index: int = NO_INDEX


def encoding(autopilot: str, capabilities: int = 0) -> Encoding:
    """How a vehicle's parameters travel.

    Parameters
    ----------
    autopilot
        As in ``Vehicle.autopilot``.
    capabilities
        AUTOPILOT_VERSION.capabilities; 0 where it was not heard.
    """
    says = capabilities & (_CAPABLE_OF_BYTES | _CAPABLE_OF_CAST)
    if says == _CAPABLE_OF_BYTES:
        return Encoding.BYTEWISE
    if says == _CAPABLE_OF_CAST:
        return Encoding.CAST
    bytewise = autopilots.named(autopilot).integers_as_bytes
    return Encoding.BYTEWISE if bytewise else Encoding.CAST


def decode_values(field: NDArray[Any], types: NDArray[Any], how: Encoding) -> NDArray[np.float64]:
    """Values of many float fields.

    Parameters
    ----------
    field
        ``param_value`` as it came, float32, shape (n,).
    types
        ``param_type`` (MAV_PARAM_TYPE), shape (n,).
    how
        As the vehicle encodes.
    """
    values = as_floats(field)
    if how is Encoding.CAST:
        return values
    octets = np.ascontiguousarray(field).view(np.uint8).reshape(-1, _FIELD)
    for number, integer in _INTEGERS.items():
        rows = types == number
        if rows.any():
            own = np.ascontiguousarray(octets[rows, : integer.itemsize])
            values[rows] = own.view(integer)[:, 0]
    return values


def encode_value(value: float, mav_type: int, how: Encoding) -> bytes:
    """Bytes of the float field that carry a value, little-endian, shape (4,).

    The value must fit its type (:func:`fits`).
    """
    integer = _INTEGERS.get(mav_type)
    if how is Encoding.CAST or integer is None:
        return struct.pack("<f", np.float32(value))
    own = int(value).to_bytes(integer.itemsize, "little", signed=integer.kind == "i")
    return own.ljust(_FIELD, b"\0")


def as_float(field: bytes) -> float:
    """The float whose bytes are those of a field, for libraries that send floats only."""
    return float(struct.unpack("<f", field)[0])


def decode_param_value(payload: bytes, how: Encoding) -> ParamValue:
    """Read a PARAM_VALUE's payload, as sent.

    Not from the float that other libraries make of it: on its way through a double an integer whose
    bytes look like a signalling NaN becomes another integer.
    """
    row = decode_payload(payload, Message.PARAM_VALUE)
    return ParamValue(
        name=text(row["param_id"])[0],
        value=float(decode_values(row["param_value"], row["param_type"], how)[0]),
        type=int(row["param_type"][0]),
        count=int(row["param_count"][0]),
        index=int(row["param_index"][0]),
    )


def name_and_field(payload: bytes) -> tuple[bytes, bytes]:
    """The name and the undecoded float field of a PARAM_VALUE, to tell a repeat from a change."""
    row = decode_payload(payload, Message.PARAM_VALUE)
    return row["param_id"].tobytes(), row["param_value"].tobytes()


def fits(value: float, mav_type: int) -> bool:
    """Whether a parameter of a MAV_PARAM_TYPE can hold a value exactly."""
    integer = _INTEGERS.get(mav_type)
    if integer is None:
        return math.isfinite(value)
    limits = np.iinfo(integer)
    return math.isfinite(value) and value == int(value) and limits.min <= value <= limits.max
