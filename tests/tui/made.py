"""Work in hand that is made up, so that screens look the same for ever: no fit and no clock."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from magcomp.buffer import BANDS, LEVELS, SECTORS, Coverage
from magcomp.link import LinkStatistics, SerialPort
from magcomp.live.guide import Guidance
from magcomp.live.progress import Bound
from magcomp.live.situation import Situation
from magcomp.live.snapshot import CompassNow, LiveSnapshot
from magcomp.model import (
    Analysis,
    CompassResult,
    Correction,
    FieldResidual,
    Grade,
    HeadingError,
    Lags,
    Level,
    Line,
    MotorFit,
    ParameterChange,
    ParameterHistory,
    ReadReport,
    Recording,
    Series,
    Vehicle,
    Verdict,
    compasses_of,
)
from magcomp.model import Coverage as Covered
from magcomp.report.shift import shift_of
from magcomp.tui.pictures import CompassPicture, Unexplained, error_rows
from magcomp.tui.vehicle_card import card_of_recording
from magcomp.tui.work import Work

QUAD = Vehicle("ardupilot", "copter", 1, 1, "4.6.3", compasses_of((97539, 131874, 263178)))
PORTS = (
    SerialPort("/dev/ttyACM0", "CubeOrange"),
    SerialPort("/dev/ttyUSB0", "FT231X telemetry radio"),
)
INTERFERENCE = np.array([1.5, -2.25, 0.5])
OFFSETS = {1: (12.0, -30.0, 7.0), 2: (-55.0, 20.0, 3.0), 3: (0.0, 4.0, -90.0)}


def parameters() -> dict[str, float]:
    """What the vehicle holds: calibrated, no motor compensation."""
    values = {"COMPASS_MOTCT": 0.0}
    for compass, offsets in OFFSETS.items():
        number = "" if compass == 1 else str(compass)
        for index, axis in enumerate("XYZ"):
            values[f"COMPASS_OFS{number}_{axis}"] = offsets[index]
            values[f"COMPASS_DIA{number}_{axis}"] = 1.0
            values[f"COMPASS_ODI{number}_{axis}"] = 0.0
            values[f"COMPASS_MOT{number}_{axis}"] = 0.0
    return values


def recording(source: str = "made.tlog") -> Recording:
    """Enough for a card: it is never fitted."""
    time = np.linspace(0.0, 190.0, 20)
    one = Series(time, np.ones(20))
    three = Series(time, np.tile([200.0, 0.0, 400.0], (20, 1)))
    changes = tuple(ParameterChange(0.0, name, value) for name, value in parameters().items())
    return Recording(
        source=source,
        vehicle=QUAD,
        start_unix_s=1.7e9,
        duration_s=190.0,
        field={1: three, 2: three, 3: three},
        parameters=ParameterHistory(changes),
        report=ReadReport(1000, 100, 100),
        attitude=three,
        throttle=one,
        current=one,
        position=three,
    )


def result(compass: int, grade: Grade = Grade.GOOD) -> CompassResult:
    """One compass."""
    fit = _fit(compass)
    reasons = {
        Grade.GOOD: ("at 50 A the heading error falls from 20.5° to at most 0.4° (95 %)",),
        Grade.MARGINAL: ("the throttle never rose above 32 %: fly a climb",),
        Grade.REJECTED: ("the current never rose above 8 A: fly a climb",),
    }
    errors = tuple(
        HeadingError(u, 0.1 + 0.41 * u, 0.05 + 0.002 * u, 0.1 + 0.006 * u)
        for u in (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
    )
    verdict = Verdict(
        grade,
        reasons[grade],
        errors,
        FieldResidual(31.0, 2.1, 2.3, 30.5),
        Covered(0.42, 1.0, 28.0, 2.0, 54.0, 180.0),
    )
    return CompassResult(
        fit,
        verdict,
        in_force=_correction(compass, np.zeros(3)),
        parameters=_written(compass, grade),
        left_out=_motor(compass, np.zeros(3)),
    )


def _correction(compass: int, motor: np.ndarray) -> Correction:
    return Correction(np.array(OFFSETS[compass]), np.eye(3), motor)


def _written(compass: int, grade: Grade) -> dict[str, float]:
    if grade is Grade.REJECTED:
        return {}
    number = "" if compass == 1 else str(compass)
    values = _motor(compass, -INTERFERENCE)
    offsets = zip("XYZ", OFFSETS[compass], strict=True)
    values |= {f"COMPASS_OFS{number}_{axis}": float(value) for axis, value in offsets}
    values[f"COMPASS_OFS{number}_Z"] += 0.5
    return {**values, "COMPASS_MOTCT": 2.0}


def _motor(compass: int, vector: np.ndarray) -> dict[str, float]:
    number = "" if compass == 1 else str(compass)
    axes = zip("XYZ", vector, strict=True)
    return {f"COMPASS_MOT{number}_{axis}": float(value) for axis, value in axes}


def _fit(compass: int) -> MotorFit:
    correction = _correction(compass, -INTERFERENCE)
    levels = tuple(
        Level(u, 0.1, correction.centre(u) + np.array([2.0, -2.0, 1.0]), 0.25 * np.eye(3), 90)
        for u in (3.0, 14.0, 25.0, 36.0, 52.0)
    )
    size = float(np.linalg.norm(INTERFERENCE))
    line = Line(
        point=levels[0].centre,
        direction=INTERFERENCE / size,
        positions=np.array([(level.u - 3.0) * size for level in levels]),
        slope=size,
        intercept=0.0,
        slope_std=0.01,
        rms=0.4,
        straightness=0.999,
        chi2=3.0,
        degrees=8,
    )
    return MotorFit(
        compass=compass,
        method="levels",
        why="the vehicle was turned at 5 steady levels of current",
        regressor="current",
        origin="battery current",
        correction=correction,
        covariance=np.diag([1e-4] * 3 + [0.01] * 3 + [1e-6] * 6),
        free=frozenset({"motor", "offset"}),
        lags=Lags(0.06, 0.1),
        lags_std=Lags(0.001, 0.002),
        strength=480.0,
        vertical=430.0,
        noise=1.4,
        levels=levels,
        line=line,
        u_low=2.0,
        u_high=54.0,
        count=1800,
    )


def analysis(*grades: Grade) -> Analysis:
    """One compass a grade; three good ones where none is named."""
    wanted = grades or (Grade.GOOD,) * 3
    return Analysis(
        source="made.tlog",
        duration_s=190.0,
        vehicle=QUAD,
        compasses=tuple(result(number, grade) for number, grade in enumerate(wanted, start=1)),
        notes=("2 damaged messages were left out",),
    )


def pictures(of: Analysis) -> dict[int, CompassPicture]:
    """Pictures as the fit makes them, of residuals that are made up."""
    time = np.linspace(5.0, 185.0, 180)
    wave = np.abs(np.sin(time / 15.0))
    unexplained = Unexplained(time, 5.0 + 50.0 * wave, 1.0 + wave)
    return {
        c.fit.compass: CompassPicture(c, error_rows(c), shift_of(c.fit), unexplained)
        for c in of.compasses
    }


def work(*grades: Grade, live: bool = False) -> Work:
    """A fitted log, or a fitted vehicle."""
    answer = analysis(*grades)
    opened = Work(
        source="udp:0.0.0.0:14550" if live else "flights/made.tlog",
        live=live,
        card=card_of_recording(recording()),
        recording=recording(),
    )
    return opened.with_analysis(answer, pictures(answer))


def snapshot(**changes: object) -> LiveSnapshot:
    """A vehicle in flight, three compasses, two thirds done."""
    counts = np.zeros((LEVELS, BANDS * SECTORS), dtype=np.int64)
    counts[3, 4 * SECTORS : 5 * SECTORS] = 30
    counts[4, 3 * SECTORS : 3 * SECTORS + 7] = 30
    counts[4, 5 * SECTORS : 6 * SECTORS] = 4
    usual = LiveSnapshot(
        address="udp:0.0.0.0:14550",
        vehicle=QUAD,
        connected=True,
        link_text="connected",
        armed=True,
        elapsed_s=83.0,
        recorded_s=83.0,
        armed_until_s=83.0,
        recording_path=Path("recording-20250615T150640Z.tlog"),
        recording_bytes=1_240_000,
        recording=True,
        recording_trouble="",
        link=_statistics(),
        compasses=tuple(compass_now(number) for number in (1, 2, 3)),
        throttle=0.42,
        current=24.0,
        voltage=23.9,
        attitude_deg=(0.0, 0.0, 90.0),
        height_m=12.0,
        coverage=Coverage(counts),
        levels_done=(3,),
        level_seconds=(4.0, 0.0, 0.0, 41.0, 30.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        headings=(*(0.42 + 0.01 * (k % 3) for k in range(10)), *(0.3,) * 3, *(math.nan,) * 11),
        wanted_heading_deg=200.0,
        bound=Bound(24.0, "current", (4.1, 3.0, 2.2, 1.7, 1.3)),
        situation=Situation.FLYING,
        guidance=Guidance("turn slowly to the right", 0.66, missing=("headings", "a sure answer")),
        early=True,
        warnings=("compass 3 is not used for the heading (COMPASS_USE is 0)",),
        analysis=None,
        grade=Grade.GOOD,
        stable_refits=2,
        fit_trouble="",
        ready=True,
        ended=False,
    )
    return replace(usual, **changes)


def compass_now(number: int, **changes: object) -> CompassNow:
    """A compass that looks north-east, with motors running: 24 A push it."""
    field = np.array([150.0, -150.0, 430.0]) + 24.0 * INTERFERENCE
    usual = CompassNow(
        number=number,
        field=(float(field[0]), float(field[1]), float(field[2])),
        strength=478.0 + number,
        heading_deg=47.0,
        heading_corrected_deg=45.0,
        healthy=number != 3,
        grade=Grade.GOOD,
    )
    return replace(usual, **changes)


def _statistics() -> LinkStatistics:
    return LinkStatistics(
        up=True,
        bytes_received=1_000_000,
        frames=20_000,
        skipped=0,
        refused=0,
        signed=0,
        lost=200,
        loss=0.01,
        round_trip_s=0.02,
        rates={"RAW_IMU": 50.0, "SCALED_IMU2": 50.0, "SCALED_IMU3": 50.0},
        gaps=(),
    )
