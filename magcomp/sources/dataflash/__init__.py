"""Read ArduPilot's own logs: binary (.BIN) and text (.log), of firmware 3.0 and later."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from magcomp import autopilots
from magcomp.errors import LogError, MagcompError
from magcomp.model import (
    Applied,
    FloatArray,
    ParameterHistory,
    ReadReport,
    Recording,
    Series,
    Vehicle,
)
from magcomp.sources.dataflash import binary, quantities, text
from magcomp.sources.dataflash.clock import last_time, time_axis
from magcomp.sources.dataflash.identity import Identity, identify
from magcomp.sources.dataflash.quantities import MESSAGES, Log, Readings
from magcomp.sources.dataflash.table import Unpacked
from magcomp.sources.source import mapped

_AUTOPILOT = "ardupilot"
_ADDRESS = (1, 1)
_LEAST_LIST = 200
_TEXT_TABLE = re.compile(rb"^FMT, ?\d+, ?\d+, ?\w+,", re.MULTILINE)


def recognises(head: bytes) -> bool:
    """Tell from first bytes whether a file is a binary dataflash log."""
    return head.startswith(b"\xa3\x95")


def recognises_text(head: bytes) -> bool:
    """Tell from first bytes whether a file is a dataflash log in text.

    An older firmware puts a few lines of its own before the table of formats.
    """
    return _TEXT_TABLE.search(head) is not None


def read_dataflash(path: str | Path) -> Recording:
    """Read what a vehicle logged about its compasses, motors, attitude and parameters.

    Parameters
    ----------
    path
        A dataflash log, binary or in text.

    Returns
    -------
    Recording
        What the log does not hold is None or empty; SIM_* parameters are left out.

    Raises
    ------
    LogError
        The file cannot be read, or holds nothing but a table of formats.
    """
    with mapped(path) as data:
        is_text = not recognises(bytes(data[:2]))
        unpacked = (text if is_text else binary).unpack(data, MESSAGES)
        size = len(data)
    if not unpacked.tables:
        raise LogError(_nothing(str(path), unpacked, size))
    return _recording(str(path), unpacked, size)


def _nothing(source: str, unpacked: Unpacked, size: int) -> str:
    """What a log without any wanted message holds, for the user."""
    others = sorted(set(unpacked.counts) - {"FMT", "FMTU", "UNIT", "MULT"})
    holds = f"only {', '.join(others[:8])}" if others else "its table of formats alone"
    return (
        f"Log {source} must hold a flight's messages; instead its {size} bytes hold {holds}: "
        "copy the log again from the vehicle, or record another flight."
    )


def _recording(source: str, unpacked: Unpacked, size: int) -> Recording:
    times, notes = time_axis(unpacked.tables)
    log = Log(unpacked.tables, times)
    changes = quantities.parameters(log)
    parameters = ParameterHistory(tuple(changes), _is_whole(unpacked, len(changes)))
    values = parameters.latest
    who = identify(unpacked.tables, unpacked.preface, values)
    readings = quantities.compasses(log)
    current, voltage = quantities.batteries(log)
    attitudes = quantities.attitudes(log)
    attitude = next(iter(attitudes), "")
    gyro, accel = quantities.inertial(log)
    duration = last_time(times)
    return Recording(
        source=source,
        vehicle=_vehicle(who, values),
        start_unix_s=quantities.unix_start(log),
        duration_s=duration,
        field={number: each.field for number, each in readings.items()},
        parameters=parameters,
        report=ReadReport(
            size=size,
            frames=unpacked.records,
            used=sum(map(len, unpacked.tables.values())),
            skipped=unpacked.skipped,
            notes=notes,
        ),
        attitude=attitudes.get(attitude),
        gyro=gyro,
        accel=accel,
        throttle=quantities.throttle(log, who.kind),
        current=current.get(0),
        voltage=voltage.get(0),
        outputs=quantities.outputs(log),
        position=quantities.position(log),
        armed=quantities.armed(log, duration),
        format="dataflash",
        other_currents={number: each for number, each in current.items() if number},
        applied=_applied(readings, parameters),
        attitude_source=attitude,
        esc_currents=quantities.esc_currents(log),
        other_attitudes={name: each for name, each in attitudes.items() if name != attitude},
    )


def _is_whole(unpacked: Unpacked, count: int) -> bool:
    """Whether every parameter is here: the firmware writes all of them before anything else."""
    table = unpacked.tables.get("PARM")
    return (
        table is not None
        and count >= _LEAST_LIST
        and unpacked.first_gap > int(table.place[_LEAST_LIST - 1])
    )


def _vehicle(who: Identity, values: Mapping[str, float]) -> Vehicle:
    system, component = _ADDRESS
    return Vehicle(
        autopilot=_AUTOPILOT,
        kind=who.kind,
        system=system,
        component=component,
        firmware=who.firmware,
        compasses=autopilots.named(_AUTOPILOT).compasses(values),
        board=who.board,
        uid=who.uid,
        frame=who.frame,
    )


def _applied(readings: Mapping[int, Readings], parameters: ParameterHistory) -> dict[int, Applied]:
    """What the log says was applied, with the fractions that its whole numbers lack."""
    found = {}
    moments = (-np.inf, *autopilots.named(_AUTOPILOT).changes(parameters))[:_LEAST_LIST]
    for number, each in readings.items():
        if each.offset is None or each.motor is None:
            continue
        if not (np.isfinite(each.offset).all() and np.isfinite(each.motor).all()):
            continue
        time = each.field.time
        offset = _with_fractions(each.offset, time, _offsets(parameters, number, moments))
        motor = each.motor + 0.5 * np.sign(each.motor)
        found[number] = Applied(Series(time, offset), Series(time, motor))
    return found


def _offsets(
    parameters: ParameterHistory, number: int, moments: Sequence[float]
) -> Iterator[tuple[float, FloatArray]]:
    """Offsets of a compass by its parameters, and when each came into force."""
    autopilot = autopilots.named(_AUTOPILOT)
    for moment in moments:
        try:
            in_force = autopilot.in_force_at(parameters, number, moment)
        except MagcompError:
            continue
        yield moment, in_force.correction.offset


def _with_fractions(
    whole: FloatArray, time: FloatArray, told: Iterable[tuple[float, FloatArray]]
) -> FloatArray:
    """Offsets of each reading: a parameter's where the log has it cut to whole mGauss."""
    exact = whole + 0.5 * np.sign(whole)
    for moment, offset in told:
        first = int(np.searchsorted(time, moment))
        rows = exact[first:]
        np.copyto(rows, offset, where=np.trunc(offset) == whole[first:])
    return exact
