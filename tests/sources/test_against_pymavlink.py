"""The columns are what pymavlink reads from the same log, message by message."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink import mavutil
from tlog_writer import REAL, RECORDINGS

from magcomp.mavlink.frames import scan
from magcomp.mavlink.messages import WANTED, Message, crc_extra, decode, layout, text
from magcomp.sources.source import mapped

pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning")


def by_pymavlink(path: Path) -> tuple[int, dict[str, list[Any]]]:
    connection = mavutil.mavlink_connection(str(path))
    total, messages = 0, defaultdict(list)
    while (message := connection.recv_match()) is not None:
        total += message.get_type() != "BAD_DATA"
        messages[message.get_type()].append(message)
    connection.close()
    return total, messages


QUICK = ("flight_low_rate", "sweep_throttle_only", "quad_2013")
EACH = [
    pytest.param(path, marks=() if path.stem in QUICK else pytest.mark.slow)
    for path in (*RECORDINGS, *REAL)
]


@pytest.mark.parametrize("path", EACH, ids=lambda path: path.stem)
def test_every_field_of_every_wanted_message_is_the_same(path: Path) -> None:
    total, expected = by_pymavlink(path)
    with mapped(path) as data:
        found = scan(data, WANTED, crc_extra())
        assert found.verified == total
        for message in Message:
            frames = found.frames[found.frames.message == message]
            table = decode(data, frames, message)
            theirs = expected[message.name]
            assert len(table) == len(theirs)
            for name in layout(message).names or ():
                column = table[name]
                values = [getattr(m, name) for m in theirs]
                if column.dtype.kind == "S":
                    assert text(column) == values
                elif theirs:
                    np.testing.assert_array_equal(column, np.array(values, dtype=column.dtype))
            assert frames.system.tolist() == [m.get_srcSystem() for m in theirs]
            np.testing.assert_allclose(
                frames.arrival / 1e6, [m._timestamp for m in theirs], rtol=0, atol=1e-6
            )
