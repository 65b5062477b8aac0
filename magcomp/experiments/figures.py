"""The paper's figures, 3 to 9, of one kind of vehicle."""

from __future__ import annotations

from typing import Any

import numpy as np

from magcomp.experiments.mission import Course, Flight, Flights
from magcomp.experiments.turntable import Turn, Turntable
from magcomp.model import FloatArray
from magcomp.report.figure import (
    AFTER,
    BEFORE,
    GRID,
    INK,
    MUTED,
    Figure,
    Trace,
    axis,
    dots,
    flat,
    line,
    rounded,
)
from magcomp.report.figures_cloud import space, wires

_MOST_POINTS = 400
_FIRST_TURN = 5
_LEVEL_COLOURS = (MUTED, BEFORE, AFTER)
_CURVES = (
    ("uncorrected", "uncorrected", MUTED, "dot", "y"),
    ("ellipsoid only", "ellipsoid", BEFORE, "solid", "y"),
    ("the paper's method", "paper", "@z", "dash", "y2"),
    ("magcomp", "magcomp", AFTER, "solid", "y2"),
)
"""Name, key, colour, dash and panel of each curve of Figs 5 to 7."""

_FINE_DEG = 0.6


def figures(turned: Turntable, flown: Flights) -> tuple[Figure, ...]:
    """Figs 3 to 9."""
    return (
        ellipsoids(turned),
        centres(turned),
        *(residual(turn, _FIRST_TURN + index) for index, turn in enumerate(turned.turns)),
        paths(flown),
        headings(flown),
    )


def ellipsoids(turned: Turntable) -> Figure:
    """Fig. 3: raw readings and their ellipsoid at each control quantity."""
    made = turned.corrections
    data: list[Trace] = []
    for index, (turn, colour) in enumerate(zip(turned.turns, _LEVEL_COLOURS, strict=True)):
        points = made.samples.raw[made.level == index]
        points = points[:: max(1, len(points) // _MOST_POINTS)]
        surface = wires() @ (made.strength * np.linalg.inv(made.shapes[index])).T
        name = f"{turn.control} ‰, {turn.current_a:.0f} A"
        data += [
            _space_dots(points, "", colour, size=2, showlegend=False, hoverinfo="skip"),
            _space_line(surface + made.centres[index], name, colour, width=2),
        ]
    return Figure(
        "fig3",
        "Fig. 3: ellipsoids",
        "Raw readings of the turns about three axes and the ellipsoid through them, one for each "
        "control quantity: the same shape, moved (drag to turn).",
        data,
        _with_legend(space()),
        height=480,
    )


def centres(turned: Turntable) -> Figure:
    """Fig. 4: the ellipsoids' centres and the lines through them."""
    made = turned.corrections
    positions = made.line.positions(made.centres)
    reach = np.ptp(positions)
    ends = np.array([positions.min() - 0.1 * reach, positions.max() + 0.1 * reach])
    paper = made.line.point + np.multiply.outer(ends, made.line.direction)
    currents = np.array([turn.current_a for turn in turned.turns])
    own = np.stack([made.fit.correction.centre(float(u)) for u in currents])
    names = [f"{turn.control} ‰, {turn.current_a:.0f} A" for turn in turned.turns]
    data = [
        _space_line(paper, "the paper's line", "@z", width=3, dash="dash"),
        _space_line(own, "magcomp's line", AFTER, width=6),
        _space_dots(
            made.centres,
            "centres",
            INK,
            size=6,
            text=names,
            mode="markers+text",
            textposition="middle right",
            hovertemplate="%{text}: %{x:.1f}, %{y:.1f}, %{z:.1f} mGauss<extra></extra>",
        ),
    ]
    around = np.stack([made.centres.min(axis=0), made.centres.max(axis=0)])
    off = float(made.line.distances(made.centres).max())
    return Figure(
        "fig4",
        "Fig. 4: centres on a line",
        f"The centres move by {reach:.0f} mGauss and lie within {off:.1f} mGauss of the paper's "
        "line; magcomp's own runs from its centre at rest by one number an ampere and axis.",
        data,
        _with_legend(space(around)),
        height=480,
    )


def residual(turn: Turn, number: int) -> Figure:
    """Figs 5 to 7: residual heading error through the level turn at one control quantity."""
    data = []
    for name, key, colour, dash, panel in _CURVES:
        curve = line(
            rounded(turn.heading_deg, 1), _gaps(turn.residual_deg[key], 3), name, colour, dash=dash
        )
        data.append(
            {
                **curve,
                "yaxis": panel,
                "mode": "lines+markers",
                "marker": {"size": 4, "color": colour},
                "hovertemplate": "%{x:.0f}°: %{y:.2f}°",
            }
        )
    zero = {"zeroline": True, "zerolinecolor": GRID}
    fine = max(_FINE_DEG, *(float(np.nanmax(np.abs(turn.residual_deg[k]))) for k in _fine_keys()))
    layout = flat(
        axis("true heading (°)", range=[0, 360], dtick=90, anchor="y2"),
        axis("error (°)", domain=[0.56, 1.0], **zero),
        yaxis2=axis("error (°)", domain=[0.0, 0.44], range=[-1.1 * fine, 1.1 * fine], **zero),
    )
    row = turn.row
    return Figure(
        f"fig{number}",
        f"Fig. {number}: one level turn at {turn.control} ‰, {turn.current_a:.0f} A",
        f"Above, the classic corrections (at most {row.uncorrected_deg:.1f}° and "
        f"{row.ellipsoid_deg:.1f}°); below, ten times finer or more, the paper's method "
        f"({row.paper_deg:.2f}°) and magcomp ({row.magcomp_deg:.2f}°).",
        data,
        layout,
        height=420,
    )


def paths(flown: Flights) -> Figure:
    """Fig. 8: true paths of the mission."""
    data = [
        _path(flown.uncompensated, "not compensated", BEFORE, "solid"),
        _path(flown.compensated, "compensated", AFTER, "solid"),
    ]
    return Figure(
        "fig8",
        "Fig. 8: the paths flown",
        "The same mission flown by the same autopilot, true paths: without compensation it strays "
        f"by up to {flown.apart_m:.1f} m from where it flies with it.",
        data,
        flat(axis("east (m)"), axis("north (m)", scaleanchor="x", scaleratio=1)),
        height=420,
    )


def headings(flown: Flights) -> Figure:
    """Fig. 9: heading error through the mission."""
    before, after = flown.uncompensated.believed, flown.compensated.believed
    data = [
        _course(before, "autopilot, not compensated", BEFORE, "solid"),
        _course(after, "autopilot, compensated", AFTER, "solid"),
        _course(flown.fused, "not compensated, fused by magcomp", "@z", "dot"),
    ]
    return Figure(
        "fig9",
        "Fig. 9: heading error in flight",
        f"The autopilot's heading is off by up to {before.largest_deg:.1f}° without compensation "
        f"and {after.largest_deg:.1f}° with it; what magcomp makes of the first flight's log, by "
        f"{flown.fused.largest_deg:.1f}°.",
        data,
        flat(
            axis("time (s)"),
            axis("heading error (°)", zeroline=True, zerolinecolor=GRID),
        ),
        height=360,
        wide=True,
    )


def _with_legend(layout: dict[str, Any]) -> dict[str, Any]:
    """A picture in space whose traces are named above it."""
    legend = flat({}, {})["legend"]
    return {
        **layout,
        "showlegend": True,
        "legend": legend,
        "margin": {"l": 0, "r": 0, "t": 48, "b": 0},
    }


def _fine_keys() -> list[str]:
    return [key for _, key, _, _, panel in _CURVES if panel == "y2"]


def _path(flight: Flight, name: str, colour: str, dash: str) -> Trace:
    east, north = rounded(flight.path.T, 2)
    return line(east, north, name, colour, dash=dash)


def _course(course: Course, name: str, colour: str, dash: str) -> Trace:
    time = course.time - course.time[0]
    return line(rounded(time, 2), rounded(course.error_deg, 2), name, colour, dash=dash)


def _space_line(
    points: FloatArray, name: str, colour: str, *, width: float, dash: str = "solid"
) -> Trace:
    x, y, z = (_gaps(column, 1) for column in points.T)
    style = {"color": colour, "width": width, "dash": dash}
    shown = {"type": "scatter3d", "mode": "lines", "name": name, "line": style}
    return {**shown, "x": x, "y": y, "z": z, "hoverinfo": "name"}


def _space_dots(points: FloatArray, name: str, colour: str, *, size: int, **more: Any) -> Trace:
    x, y, z = rounded(points.T, 1)
    flat_dots = dots(x, y, name, colour, opacity=0.8)
    marker = {**flat_dots["marker"], "size": size}
    return {**flat_dots, "type": "scatter3d", "z": z, "marker": marker, **more}


def _gaps(values: FloatArray, digits: int) -> list[float | None]:
    """Short numbers, and nothing where there is no number."""
    return [None if np.isnan(value) else value for value in rounded(values, digits)]
