"""One time axis for the messages of a dataflash log.

The autopilot stamps each message with the time since it started. Where firmware before 3.2 gives
some messages no time, theirs is that of their place between stamped ones; where none has a time,
the order of the rows is all there is.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from magcomp.model import FloatArray
from magcomp.sources.dataflash.table import Table, Tables

Times = Mapping[str, FloatArray]
"""Seconds of each row by the message's name, in the order of the log."""

_MICRO, _MILLI = "TimeUS", "TimeMS"
_LATEST_S = 1e9
_DISORDER_S = 1.0
_LEAP_S = 600.0
_FAR_S = 10.0
_NEIGHBOURS = 4
_ROUND_S = 0.1
# Of old firmware: GPS.TimeMS is that of the satellites, and T the autopilot's.
_SATELLITES, _BOARD = "GPS", "T"
_NO_TIME = (
    "the log holds no times: the order of its rows stands for them, ten rounds a second, so no "
    "delay and no rate is known"
)
_MOST_NAMED = 3
_UNTIMED = ("PARM", "MSG", "VER", "ORGN")


def time_axis(tables: Tables) -> tuple[Times, tuple[str, ...]]:
    """Times from the first message, and what a user should know of them.

    Returns
    -------
    times
        Rows whose time cannot be told are NaN.
    notes
        A sentence each, without its full stop.
    """
    stamps = {name: _stamps(name, table) for name, table in tables.items()}
    stamped = {name: stamp for name, stamp in stamps.items() if stamp is not None}
    notes: tuple[str, ...] = ()
    if not any(np.isfinite(stamp).any() for stamp in stamped.values()):
        notes = (_NO_TIME,)
        stamped = _rounds(tables)
        if not stamped:
            return {name: np.zeros(len(table)) for name, table in tables.items()}, notes
    if not all(map(_is_steady, stamped.values())) or len(stamped) < len(tables):
        times, restarts = _mended(tables, stamped)
        return times, (*notes, *map(_restarted, restarts))
    zero = min(float(stamp[0]) for stamp in stamped.values())
    return {name: stamp - zero for name, stamp in stamped.items()}, notes


def _restarted(at_s: float) -> str:
    return (
        f"the autopilot's clock starts again at {at_s:.0f} s: what follows is another flight, "
        "joined without the pause between them"
    )


def last_time(times: Times) -> float:
    """Time of the last measurement; of the last message where nothing was measured."""
    last = {name: float(np.nanmax(time, initial=0.0)) for name, time in times.items() if len(time)}
    measured = [time for name, time in last.items() if name not in _UNTIMED]
    return max(measured or last.values(), default=0.0)


def _stamps(name: str, table: Table) -> FloatArray | None:
    if _MICRO in table.names:
        seconds = table.numbers(_MICRO) * 1e-6
    elif name == _SATELLITES:
        if _BOARD not in table.names:
            return None
        seconds = table.numbers(_BOARD) * 1e-3
    elif _MILLI in table.names:
        seconds = table.numbers(_MILLI) * 1e-3
    else:
        return None
    believed = (seconds >= 0.0) & (seconds < _LATEST_S)
    return seconds if believed.all() else np.where(believed, seconds, np.nan)


def _is_steady(stamp: FloatArray) -> bool:
    step = np.diff(stamp)
    # NaN fails both.
    return bool(((step >= -_DISORDER_S) & (step < _LEAP_S)).all() and np.isfinite(stamp).all())


def _rounds(tables: Tables) -> dict[str, FloatArray]:
    """Rows of the most frequent message that is logged in rounds, a tenth of a second apart."""
    names = [name for name in tables if name not in _UNTIMED]
    if not names:
        return {}
    leading = max(names, key=lambda name: (len(tables[name]), name))
    rounds = np.arange(len(tables[leading]), dtype=np.float64)
    return {leading: _ROUND_S * rounds}


def _mended(tables: Tables, stamped: Times) -> tuple[Times, list[float]]:
    """Times of all rows where some have none, or the clock jumps; when it starts again."""
    place = np.concatenate([tables[name].place for name in stamped])
    time = np.concatenate(list(stamped.values()))
    order = np.argsort(place, kind="stable")
    place, time = place[order], time[order]
    finite = np.isfinite(time)
    place, time = place[finite], time[finite]
    good = ~_strays(time)
    place, time = place[good], time[good]
    step = np.diff(time)
    # The clock starts again with the autopilot, and no log says how long it was off.
    back = step < -_DISORDER_S
    unrolled: FloatArray = time + np.append(0.0, np.cumsum(np.where(back, -step, 0.0)))
    zero = float(unrolled.min())
    restarts = (unrolled[1:][back][:_MOST_NAMED] - zero).tolist()
    result = {}
    for name, table in tables.items():
        own = stamped.get(name)
        at = np.searchsorted(place, table.place)
        if own is None:
            result[name] = np.interp(table.place, place, unrolled - zero)
            continue
        at = np.minimum(at, len(place) - 1)
        result[name] = np.where(place[at] == table.place, unrolled[at] - zero, np.nan)
    return result, restarts


def _strays(time: FloatArray) -> NDArray[np.bool_]:
    """Which times fit to neither neighbourhood: damaged stamps, not a clock that starts again."""
    stray = np.zeros(len(time), dtype=bool)
    jumps = np.flatnonzero(np.abs(np.diff(time)) > _FAR_S)
    if len(time) <= 2 * _NEIGHBOURS or not len(jumps):
        return stray
    beside = jumps[:, np.newaxis] + np.arange(1 - _NEIGHBOURS, _NEIGHBOURS + 1)
    at = np.unique(np.clip(beside, 0, len(time) - 1))
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(time, _NEIGHBOURS, mode="edge"), _NEIGHBOURS
    )
    before = np.median(windows[at], axis=1)
    after = np.median(windows[at + _NEIGHBOURS + 1], axis=1)
    far = np.minimum(np.abs(time[at] - before), np.abs(time[at] - after))
    stray[at] = (far > _LEAP_S) | ((far > _FAR_S) & (np.abs(after - before) < _DISORDER_S))
    return stray
