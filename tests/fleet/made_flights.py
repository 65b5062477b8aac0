"""Rows made of formulas: what every flight of an aircraft would say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from magcomp import __version__
from magcomp.fleet.aircraft import aircraft
from magcomp.fleet.answer import Fleet
from magcomp.fleet.flights import Selected, select
from magcomp.fleet.row import Log, Row, State
from magcomp.fleet.run import Known, key
from magcomp.fleet.store import table_of

MOTOR = np.array([-1.4, 0.8, -1.9])
DAY = 86400.0
FIRST = 1.7e9


def log(number: int, prefix: str = "flight") -> Log:
    return Log(f"{prefix}{number:05d}.tlog", 1000 + number, str(number), FIRST + number * DAY)


def row(number: int, motor: object = MOTOR, std: float = 0.02, **changed: object) -> Row:
    """One compass of one flight a day."""
    of = log(number)
    base = Row(
        path=of.path,
        size=of.size,
        stamp=of.stamp,
        modified_s=of.modified_s,
        digest=f"{number:064x}",
        magcomp=__version__,
        state=State.FITTED.value,
        autopilot="ardupilot",
        kind="copter",
        firmware="4.6.3",
        system=1,
        uid="abcd",
        device_ids="97539",
        start_unix_s=of.modified_s,
        duration_s=300.0,
        compass=1,
        device_id=97539,
        verdict="good",
        method="flight",
        regressor="current",
        before_deg=0.5,
        after_deg=0.2,
        bound_deg=0.4,
        u_low=0.0,
        u_high=25.0,
        strength=480.0,
        vertical=430.0,
        correction=(*map(float, np.asarray(motor)), 1.0, 2.0, 3.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0),
        in_force=(*map(float, MOTOR), 1.0, 2.0, 3.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0),
        motor_covariance=(std**2, std**2, std**2, 0.0, 0.0, 0.0),
    )
    return replace(base, **changed)  # type: ignore[arg-type]


def log_of(made: Row) -> Log:
    return Log(made.path, made.size, made.stamp, made.modified_s)


def selected(rows: list[Row]) -> Selected:
    logs = list({made.path: log_of(made) for made in rows}.values())
    known = Known({key(log_of(made)): made.digest for made in rows}, {}, frozenset())
    return select(table_of(rows), logs, known)


def fleet(rows: list[Row]) -> Fleet:
    chosen = selected(rows)
    return Fleet(aircraft(chosen), chosen, len({made.path for made in rows}), len(rows))
