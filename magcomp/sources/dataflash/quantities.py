"""The quantities of a Recording from the columns of a dataflash log, in the model's units."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from magcomp.model import FloatArray, ParameterChange, Series
from magcomp.sources.dataflash.clock import Times
from magcomp.sources.dataflash.table import Table, Tables

_COLUMNS = """
    MAG MAG2 MAG3 BAT BAT2 CURR CUR2 CTUN THR RCOU RCO2 RCO3
    ESC ESC1 ESC2 ESC3 ESC4 ESC5 ESC6 ESC7 ESC8
    ATT XKF1 XKF4 XKF6 NKF1 NKF4 NKF6 AHR2 IMU GPS POS ORGN
    PARM VER MSG EV ARM STAT
"""
MESSAGES = frozenset(_COLUMNS.split())
"""All that a Recording is made of."""

_SIMULATION_PREFIX = "SIM_"
_COMPASSES = ("MAG", "MAG2", "MAG3")
_OFFSETS = (("OfsX", "OfsY", "OfsZ"),)
_MOTORS = (("MOX", "MOY", "MOZ"), ("MOfsX", "MOfsY", "MOfsZ"))
_INSTANCES = ("I", "Instance", "Inst")
_BATTERIES = (("BAT", 0), ("CURR", 0), ("BAT2", 1), ("CUR2", 1))
_ESCS = ("ESC", *(f"ESC{number}" for number in range(1, 9)))
_OUTPUTS = (("RCOU", 0), ("RCO2", 14), ("RCO3", 18))
_OUTPUT_NAMES = ("C", "Chan", "Ch")
_MOST_OUTPUTS = 32
_FEWEST_OUTPUTS = 16
_FIX_3D = 3
_ARMED, _DISARMED = 10, 11
_CENTI = 1e-2
_MOST_OF_A_BATTERY = 1e4
_SATELLITE_EPOCH_S = 315964800
_SATELLITE_LEAP_S = 18
_WEEK_S = 604800


class Readings(NamedTuple):
    """One compass's rows: its field and, where told, what was applied; mGauss, shape (n, 3)."""

    field: Series
    offset: FloatArray | None
    motor: FloatArray | None


class Log(NamedTuple):
    """The messages of a log and their times."""

    tables: Tables
    times: Times

    def get(self, name: str) -> tuple[FloatArray, Table] | None:
        """Times and columns of a message; None where it did not come."""
        return (self.times[name], self.tables[name]) if name in self.tables else None


def compasses(log: Log) -> dict[int, Readings]:
    """Each compass by number: rows of healthy readings; (0, 0, 0) means that none was read."""
    found = {}
    for number, name in enumerate(_COMPASSES, start=1):
        if name not in log.tables:
            continue
        time, table = log.times[name], log.tables[name]
        value = table.matrix("MagX", "MagY", "MagZ")
        # Damaged fractions may be as large as a number can be.
        with np.errstate(over="ignore"):
            square = np.einsum("ij,ij->i", value, value)
        # NaN fails both.
        sound = (square > 0.0) & (square < np.inf)
        if "Health" in table.names:
            sound &= table.numbers("Health") != 0
        offset, motor = (
            next((table.matrix(*names) for names in forms if set(names) <= table.names), None)
            for forms in (_OFFSETS, _MOTORS)
        )
        for each, rows in _instances(table, number - 1):
            kept = _in_order(time, rows & sound)
            if len(kept):
                found[each + 1] = Readings(
                    Series(time[kept], value[kept]),
                    None if offset is None else offset[kept],
                    None if motor is None else motor[kept],
                )
    return {number: found[number] for number in range(1, len(_COMPASSES) + 1) if number in found}


def _instances(table: Table, otherwise: int) -> list[tuple[int, NDArray[np.bool_]]]:
    """Rows of each instance by its number; all rows where the message does not number them."""
    column = table.first_of(*_INSTANCES)
    if column is None:
        return [(otherwise, np.ones(len(table), dtype=bool))]
    which = table.numbers(column)
    return [(int(each), which == each) for each in np.unique(which[np.isfinite(which)])]


def batteries(log: Log) -> tuple[dict[int, Series], dict[int, Series]]:
    """Amperes and volts of each battery by number; rows that are no number are left out."""
    current: dict[int, Series] = {}
    voltage: dict[int, Series] = {}
    for name, number in _BATTERIES:
        found = log.get(name)
        if found is None:
            continue
        time, table = found
        instances = _instances(table, number)
        for column, into in (("Curr", current), ("Volt", voltage)):
            if column not in table.names:
                continue
            value = table.numbers(column) * (1.0 if table.is_float(column) else _CENTI)
            # NaN fails.
            sound = np.abs(value) < _MOST_OF_A_BATTERY
            for each, rows in instances:
                series = _series(time, value, rows & sound) if each not in into else None
                if series is not None:
                    into[each] = series
    return current, voltage


def esc_currents(log: Log) -> dict[int, Series]:
    """Current of each speed controller, A, by its output, counted from 0."""
    found: dict[int, Series] = {}
    for place, name in enumerate(_ESCS):
        got = log.get(name)
        if got is None or "Curr" not in got[1].names:
            continue
        time, table = got
        value = table.numbers("Curr") * (1.0 if table.is_float("Curr") else _CENTI)
        sound = np.abs(value) < _MOST_OF_A_BATTERY
        for number, rows in _instances(table, max(place - 1, 0)):
            series = _series(time, value, rows & sound)
            if series is not None and series.value.any():
                found.setdefault(number, series)
    return dict(sorted(found.items()))


def throttle(log: Log, kind: str) -> Series | None:
    """Thrust demand 0 … 1: a fraction in ThO, per mille or per cent in ThrOut."""
    for name in ("CTUN", "THR"):
        found = log.get(name)
        column = found[1].first_of("ThO", "ThrOut") if found is not None else None
        if found is None or column is None:
            continue
        time, table = found
        value = table.numbers(column)
        if kind in ("plane", "rover", "boat"):
            value = value * _CENTI
        elif column == "ThrOut":
            value = value * 1e-3
        rows = np.isfinite(value) & (value >= -1.0) & (value <= 1.05)
        return _series(time, np.clip(value, 0.0, 1.0) if kind == "copter" else value, rows)
    return None


def outputs(log: Log) -> Series | None:
    """Servo outputs in microseconds, shape (n, 16) or wider; 0 where not driven."""
    first = log.get("RCOU")
    if first is None:
        return None
    time = first[0]
    kept = _in_order(time, np.ones(len(time), dtype=bool))
    if not len(kept):
        return None
    most = _MOST_OUTPUTS if any(name in log.tables for name, _ in _OUTPUTS[1:]) else _FEWEST_OUTPUTS
    value = np.zeros((len(kept), most))
    for name, before in _OUTPUTS:
        found = log.get(name)
        if found is None:
            continue
        own = _in_order(found[0], np.ones(len(found[0]), dtype=bool))
        if not len(own):
            continue
        at = own if name == "RCOU" else own[_latest(found[0][own], time[kept])]
        for channel in range(before, most):
            column = found[1].first_of(*(f"{prefix}{channel + 1}" for prefix in _OUTPUT_NAMES))
            if column is not None:
                value[:, channel] = found[1].numbers(column)[at]
    # NaN fails both.
    value[~((value >= 0) & (value <= 1e4))] = 0
    driven = np.flatnonzero(value.any(axis=0))
    width = max(_FEWEST_OUTPUTS, int(driven[-1]) + 1 if len(driven) else 0)
    return Series(time[kept], value[:, :width])


def attitudes(log: Log) -> dict[str, Series]:
    """Roll, pitch, yaw in radians by the message that tells them, the best one first."""
    found: dict[str, Series] = {}
    sources: list[tuple[str, NDArray[np.bool_] | None]] = [("ATT", None)]
    for filter_name in ("XKF", "NKF"):
        sources.extend(_cores(log, filter_name))
    sources.append(("AHR2", None))
    for name, rows in sources:
        got = log.get(name)
        if got is None or not {"Roll", "Pitch", "Yaw"} <= got[1].names:
            continue
        time, table = got
        value = np.deg2rad(table.matrix("Roll", "Pitch", "Yaw"))
        sound = np.asarray(np.isfinite(value).all(axis=1))
        if rows is not None:
            sound &= rows
        series = _series(time, value, sound)
        if series is not None:
            found[name] = series
    return found


def _cores(log: Log, filter_name: str) -> list[tuple[str, NDArray[np.bool_] | None]]:
    """The estimator's rows of the core that was in use at the time."""
    first = log.get(f"{filter_name}1")
    if first is None:
        return []
    time, table = first
    primary = log.get(f"{filter_name}4")
    told = primary is not None and "PI" in primary[1].names
    if "C" not in table.names:
        # Two cores have names of their own; the one in use for longest is taken.
        second = f"{filter_name}6"
        if told and primary is not None and np.nanmedian(_finite(primary[1].numbers("PI"))) == 1:
            return [(second, None), (f"{filter_name}1", None)]
        return [(f"{filter_name}1", None)]
    core = table.numbers("C")
    in_use = np.zeros(len(table))
    if told and primary is not None:
        order = _in_order(primary[0], np.isfinite(primary[1].numbers("PI")))
        if len(order):
            in_use = primary[1].numbers("PI")[order][_latest(primary[0][order], time)]
    rows: NDArray[np.bool_] = core == in_use
    return [(f"{filter_name}1", rows if rows.any() else core == _finite(core).min())]


def _finite(value: FloatArray) -> FloatArray:
    return np.where(np.isfinite(value), value, 0.0) if len(value) else np.zeros(1)


def inertial(log: Log) -> tuple[Series | None, Series | None]:
    """Body rates in rad/s and specific force in m/s² of the first IMU."""
    found = log.get("IMU")
    if found is None:
        return None, None
    time, table = found
    instance = table.first_of("I")
    rows = np.full(len(table), True) if instance is None else table.numbers(instance) == 0
    series = []
    for names in (("GyrX", "GyrY", "GyrZ"), ("AccX", "AccY", "AccZ")):
        value = table.matrix(*names)
        series.append(_series(time, value, rows & np.isfinite(value).all(axis=1)))
    return series[0], series[1]


def position(log: Log) -> Series | None:
    """Latitude, longitude in degrees, altitude in m: the estimate, a fix, or the origin."""
    for name in ("POS", "GPS", "ORGN"):
        found = log.get(name)
        if found is None or not {"Lat", "Lng", "Alt"} <= found[1].names:
            continue
        time, table = found
        value = table.matrix("Lat", "Lng", "Alt")
        rows = np.isfinite(value).all(axis=1) & (value[:, :2] != 0).all(axis=1)
        rows &= (np.abs(value[:, 0]) <= 90) & (np.abs(value[:, 1]) <= 180)
        if "Status" in table.names:
            rows &= table.numbers("Status") >= _FIX_3D
        series = _series(time, value, rows)
        if series is not None:
            return series
    return None


def armed(log: Log, end: float) -> Series | None:
    """1 armed, 0 disarmed: as it changed, from the beginning to the end of the log."""
    changes = _arming(log)
    if changes is None:
        return None
    time, state = changes
    return Series(
        np.concatenate([[0.0], time, [max(end, time[-1])]]),
        np.concatenate([[1.0 - state[0]], state, state[-1:]]),
    )


def _arming(log: Log) -> tuple[FloatArray, FloatArray] | None:
    for name, column in (("ARM", "ArmState"), ("STAT", "Armed"), ("EV", "Id")):
        found = log.get(name)
        if found is None or column not in found[1].names:
            continue
        time, value = found[0], found[1].numbers(column)
        rows = np.isin(value, (_DISARMED, _ARMED) if name == "EV" else (0, 1))
        kept = _in_order(time, rows)
        if len(kept):
            state = value[kept] == (_ARMED if name == "EV" else 1)
            return time[kept], state.astype(np.float64)
    return None


def parameters(log: Log) -> list[ParameterChange]:
    """Every value logged, in order of time; not finite ones stay: they are refused by name."""
    found = log.get("PARM")
    if found is None or not {"Name", "Value"} <= found[1].names:
        return []
    time, table = found
    time = np.where(np.isfinite(time), time, 0.0)
    rows = zip(time.tolist(), table.texts("Name"), table.numbers("Value").tolist(), strict=True)
    # tuple.__new__ spares a Python call for each of a log's thousand parameters.
    return [
        tuple.__new__(ParameterChange, row)
        for row in rows
        if row[1] and not row[1].startswith(_SIMULATION_PREFIX)
    ]


def unix_start(log: Log) -> float:
    """Unix time of time zero by the satellites' calendar; NaN where there is none."""
    found = log.get("GPS")
    if found is None:
        return float("nan")
    time, table = found
    week = table.first_of("GWk", "Week")
    milliseconds = table.first_of("GMS", "TimeMS", "Time")
    if week is None or milliseconds is None:
        return float("nan")
    weeks, of_week = table.numbers(week), table.numbers(milliseconds) / 1000
    known = np.isfinite(time) & (weeks > 1000) & (weeks < 10000) & (of_week > 0)
    if "Status" in table.names:
        known &= table.numbers("Status") >= _FIX_3D
    if not known.any():
        return float("nan")
    unix = _SATELLITE_EPOCH_S - _SATELLITE_LEAP_S + weeks * _WEEK_S + of_week - time
    return float(np.median(unix[known]))


def _series(time: FloatArray, value: FloatArray, rows: NDArray[Any]) -> Series | None:
    kept = _in_order(time, rows)
    return Series(time[kept], value[kept]) if len(kept) else None


def _in_order(time: FloatArray, rows: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Indices of some rows whose time is known, in order of time."""
    kept = np.flatnonzero(rows & np.isfinite(time))
    chosen = time[kept]
    if (np.diff(chosen) >= 0).all():
        return kept
    return kept[np.argsort(chosen, kind="stable")]


def _latest(known: FloatArray, time: FloatArray) -> NDArray[np.intp]:
    """Index of the last known time up to each time."""
    return np.maximum(np.searchsorted(known, time, side="right") - 1, 0)
