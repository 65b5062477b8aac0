"""Pictures of the flight itself: what of it was used, and what its compass does to a mission."""

from __future__ import annotations

import numpy as np

from magcomp.model import CompassResult, FloatArray
from magcomp.report import as_json, words
from magcomp.report.evidence import CompassPlots
from magcomp.report.figure import (
    AFTER,
    BEFORE,
    GRID,
    MUTED,
    Figure,
    Quantity,
    Trace,
    axis,
    flat,
    line,
    rounded,
)
from magcomp.report.mission import SIDE_M, Mission, mission

_TOP = 1.05
"""Where the strip ends, over the largest load."""


def strip(plots: CompassPlots) -> Figure:
    """The recording at a glance, and which parts of it were used."""
    of = plots.strip
    time = rounded(of.time, 1)
    data: list[Trace] = [
        _area(time, np.where(of.used, 0.0, _TOP), "left out", GRID),
        _area(time, np.where(of.used, of.load, 0.0), "used", AFTER),
        line(time, rounded(of.load, 2), "", MUTED, showlegend=False, hoverinfo="skip")
        | {"line": {"color": MUTED, "width": 1}},
    ]
    disarmed = of.disarmed & ~of.used
    others = of.seconds(~of.used & ~of.disarmed)
    left = [f"{of.seconds(disarmed):.0f} s disarmed"] if disarmed.any() else []
    if others >= 0.5:
        left.append(f"{others:.0f} s outside the time asked for, in gaps or around changes")
    return Figure(
        "strip",
        "What was used",
        f"The load of the motors through the recording: the fit rests on "
        f"{of.seconds(of.used):.0f} of its {of.duration_s:.0f} s"
        + (f"; left out were {words.listed(left)}." if left else ", all that there is."),
        data,
        flat(
            axis("time (s)", range=[0, round(of.duration_s, 1)]),
            axis("load", range=[0, _TOP], tickvals=[0, 1], ticktext=["none", "most"]),
        ),
        height=170,
        wide=True,
    )


def _area(time: list[float], load: FloatArray, name: str, colour: str) -> Trace:
    shape = {"color": colour, "width": 1, "shape": "hvh"}
    return line(time, rounded(load, 2), name, colour, hoverinfo="skip") | {
        "line": shape,
        "fill": "tozeroy",
        "fillcolor": colour,
    }


def missions(result: CompassResult, plots: CompassPlots, quantity: Quantity) -> Figure:
    """A mission of 50 m legs with the compass as it is, and as wrong as the fit may leave it."""
    quoted = as_json.quoted(result)
    now = mission(plots.level_errors)
    fitted = mission(np.full_like(plots.level_errors, np.radians(quoted["p95"])))
    data = [
        line(*_track(now.planned), "planned", MUTED, dash="dot", hoverinfo="skip"),
        _flown(now, "correction in force", BEFORE, "square"),
        _flown(fitted, "with the fit, at worst", AFTER, "circle"),
    ]
    return Figure(
        "mission",
        f"A mission of {SIDE_M:.0f} m legs",
        f"What a position controller makes of this compass in still air at "
        f"{quantity.text(quoted['u'])}: {_drift(now)} with the correction in force, "
        f"{_drift(fitted)} with the fit at its 95 % bound; reckoned, not flown.",
        data,
        flat(axis("east (m)"), axis("north (m)", scaleanchor="x", scaleratio=1)),
        height=380,
    )


def _track(points: FloatArray) -> tuple[list[float], list[float]]:
    east, north = rounded(points.T, 1)
    return east, north


def _flown(of: Mission, name: str, colour: str, symbol: str) -> Trace:
    east, north = _track(of.path)
    marker = {"symbol": symbol, "size": 6, "color": colour, "maxdisplayed": 12}
    return line(east, north, name, colour, mode="lines+markers") | {
        "marker": marker,
        "hovertemplate": "%{x:.0f} m east, %{y:.0f} m north",
    }


def _drift(of: Mission) -> str:
    if not of.arrives:
        return "it never finds a corner"
    stray = of.stray_m
    return f"it strays {stray:.{0 if stray >= 9.95 else 1}f} m from its line"
