"""The field's cloud, its ellipsoids and centres: docs/method.md, Fig. 3, and Fig. 4."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from magcomp.model import CompassResult, FloatArray, Level, MotorFit
from magcomp.report.evidence import CompassPlots
from magcomp.report.figure import GRID, INK, SCALE, Figure, Quantity, Trace, rounded, shade

_MOST_ELLIPSOIDS = 5
_FLIGHT_ELLIPSOIDS = 2
_MARGIN = 1.04
_CHI2_95 = 7.815
"""95 % quantile of χ² with three degrees of freedom."""

SPACE_HEIGHT = 460
"""Height of a picture in space, pixels."""


def cloud(result: CompassResult, plots: CompassPlots, quantity: Quantity) -> Figure:
    """Raw field in space with the ellipsoids of the levels and the line through their centres.

    Where the vehicle stood still there is no ellipsoid: the readings less the earth's part are
    drawn about the line itself.
    """
    fit = result.fit
    still = fit.method == "sweep"
    raw = plots.raw
    if still:
        centres = np.array([fit.correction.centre(float(u)) for u in plots.u])
        raw = raw - np.median(raw - centres, axis=0)
    levels = () if still else _drawn(fit)
    top = float(quantity.scale * max(plots.u.max(), max((lv.u for lv in fit.levels), default=0.0)))
    shades = {"colorscale": SCALE, "cmin": 0.0, "cmax": top}
    data = [
        _points(raw, quantity.values(plots.u, 1), quantity, shades),
        *(_ellipsoid(fit, level, quantity, top) for level in levels),
        *_line_of_centres(fit, quantity),
    ]
    return Figure(
        "cloud",
        "The field in space",
        _caption(fit, quantity, len(levels)),
        data,
        space(_corners(data)),
        height=SPACE_HEIGHT,
    )


def centres(result: CompassResult, quantity: Quantity) -> Figure:
    """The centres near by: each with its 95 % ellipsoid, and the line through them."""
    fit = result.fit
    top = float(quantity.scale * max((level.u for level in fit.levels), default=1.0))
    data = [
        *(_doubt(level, quantity, top) for level in fit.levels),
        *_line_of_centres(fit, quantity),
    ]
    off = 0.0 if fit.line is None else fit.line.rms
    return Figure(
        "centres",
        "The line of centres",
        f"The same centres near by, each in the ellipsoid it lies in with 95 % probability: they "
        f"stand {off:.{1 if off >= 0.1 else 2}f} mGauss off the straight line that the method "
        "rests on.",
        data,
        space(_corners(data)),
        height=SPACE_HEIGHT,
    )


def _doubt(level: Level, quantity: Quantity, top: float) -> Trace:
    """Where a centre lies with 95 % probability, as wires."""
    values, vectors = np.linalg.eigh(level.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0) * _CHI2_95)
    rings = wires(heights=(0.0,), turns=(0.0, 90.0))
    return _wired(level.centre + rings @ root.T, level, quantity, top)


def _drawn(fit: MotorFit) -> tuple[Level, ...]:
    """The levels that get an ellipsoid: all of a turntable's, the outermost of a flight's."""
    if not fit.levels:
        return ()
    most = _MOST_ELLIPSOIDS if fit.method == "levels" else _FLIGHT_ELLIPSOIDS
    chosen = np.unique(np.linspace(0, len(fit.levels) - 1, most).round().astype(int))
    return tuple(fit.levels[k] for k in chosen)


def _caption(fit: MotorFit, quantity: Quantity, ellipsoids: int) -> str:
    if fit.method == "sweep":
        return (
            "The vehicle stood still, so there is no ellipsoid to see: the readings, less the "
            f"earth's field, move along the line of centres as the {quantity.name} grows (drag to "
            "turn)."
        )
    length = 0.0 if fit.line is None else float(np.ptp(fit.line.positions))
    return (
        f"Every reading lies on an ellipsoid whose centre moves as the {quantity.name} grows: "
        f"{ellipsoids} ellipsoids are drawn, and their centres lie on a line {length:.0f} mGauss "
        "long (drag to turn)."
    )


def _points(raw: FloatArray, u: list[float], quantity: Quantity, shades: dict[str, Any]) -> Trace:
    bar = {
        "title": {"text": quantity.title, "side": "right"},
        "thickness": 8,
        "len": 0.6,
        "outlinewidth": 0,
    }
    x, y, z = rounded(raw.T, 1)
    return {
        "type": "scatter3d",
        "mode": "markers",
        "name": "readings",
        "x": x,
        "y": y,
        "z": z,
        "marker": {"size": 2, "opacity": 0.7, "color": u, "colorbar": bar, **shades},
        "text": [f"{value:g} {quantity.unit}" for value in u],
        "hovertemplate": "%{text}: %{x:.0f}, %{y:.0f}, %{z:.0f} mGauss<extra></extra>",
    }


def _ellipsoid(fit: MotorFit, level: Level, quantity: Quantity, top: float) -> Trace:
    """Wires of |D · (raw − centre)| = F, docs/method.md, Equations 5 and 6."""
    surface = np.linalg.solve(fit.correction.soft_iron, fit.strength * wires().T).T
    return _wired(level.centre + surface, level, quantity, top)


def _wired(surface: FloatArray, level: Level, quantity: Quantity, top: float) -> Trace:
    x, y, z = ([None if np.isnan(v) else v for v in row] for row in rounded(surface.T, 2))
    return {
        "type": "scatter3d",
        "mode": "lines",
        "name": f"ellipsoid at {quantity.text(level.u)}",
        "x": x,
        "y": y,
        "z": z,
        "line": {"color": shade(quantity.scale * level.u / top if top else 0.0), "width": 2},
        "opacity": 0.6,
        "showlegend": False,
        "hoverinfo": "name",
    }


def wires(
    heights: Sequence[float] = (-60.0, -30.0, 0.0, 30.0, 60.0),
    turns: Sequence[float] = (0.0, 45.0, 90.0, 135.0),
) -> FloatArray:
    """Circles of a unit sphere, with rows of NaN between them, shape (n, 3).

    Parameters
    ----------
    heights
        Latitudes of the level circles, degrees.
    turns
        Azimuths of the upright circles, degrees.
    """
    angle = np.linspace(0.0, 2 * np.pi, 37)
    gap = np.full((1, 3), np.nan)
    circles = []
    for height in np.radians(heights):
        ring = [np.cos(height) * np.cos(angle), np.cos(height) * np.sin(angle)]
        circles += [np.column_stack([*ring, np.full_like(angle, np.sin(height))]), gap]
    for turned in np.radians(turns):
        ring = [np.cos(angle) * np.cos(turned), np.cos(angle) * np.sin(turned)]
        circles += [np.column_stack([*ring, np.sin(angle)]), gap]
    return np.vstack(circles)


def _line_of_centres(fit: MotorFit, quantity: Quantity) -> list[Trace]:
    if fit.line is None or not fit.levels:
        return []
    ends = np.array([fit.line.positions.min(), fit.line.positions.max()])
    reach = np.array([[ends[0]], [ends[1]]]) * fit.line.direction + fit.line.point
    lx, ly, lz = rounded(reach.T, 2)
    cx, cy, cz = rounded(np.array([level.centre for level in fit.levels]).T, 2)
    text = [f"centre at {quantity.text(level.u)}" for level in fit.levels]
    return [
        {
            "type": "scatter3d",
            "mode": "lines",
            "name": "line of centres",
            "x": lx,
            "y": ly,
            "z": lz,
            "line": {"color": INK, "width": 5},
            "hoverinfo": "name",
        },
        {
            "type": "scatter3d",
            "mode": "markers",
            "name": "centres",
            "x": cx,
            "y": cy,
            "z": cz,
            "marker": {"color": INK, "size": 4, "symbol": "diamond"},
            "text": text,
            "hovertemplate": "%{text}: %{x:.1f}, %{y:.1f}, %{z:.1f} mGauss<extra></extra>",
        },
    ]


def _corners(data: Sequence[Trace]) -> FloatArray:
    """Lowest and highest value on each axis, shape (2, 3); zeros for an empty picture."""
    columns = [
        [value for trace in data for value in trace[name] if value is not None] for name in "xyz"
    ]
    if not columns[0]:
        return np.zeros((2, 3))
    return np.array([[min(c) for c in columns], [max(c) for c in columns]])


def space(corners: FloatArray | None = None) -> dict[str, Any]:
    """Layout of a picture in space, in body axes.

    Parameters
    ----------
    corners
        What must be seen, lowest and highest value on each axis, shape (2, 3): the picture is
        then a cube of one scale around it. By default the axes choose for themselves.
    """
    cube: list[dict[str, Any]] = [{}, {"autorange": "reversed"}, {"autorange": "reversed"}]
    if corners is not None:
        middle = corners.mean(axis=0)
        half = max(float(np.ptp(corners, axis=0).max()), 1.0) * _MARGIN / 2
        cube = [
            {"range": rounded([m - sign * half, m + sign * half], 2)}
            for m, sign in zip(middle, (1, -1, -1), strict=True)
        ]

    def side(title: str, axis: int) -> dict[str, Any]:
        return {
            **cube[axis],
            "title": {"text": title},
            "gridcolor": GRID,
            "zerolinecolor": GRID,
            "linecolor": GRID,
            "showbackground": False,
            "nticks": 5,
        }

    return {
        "scene": {
            "xaxis": side("forward (mGauss)", 0),
            # Down is drawn downwards, as the vehicle stands; reversing y too keeps the picture from
            # being a mirror image.
            "yaxis": side("right (mGauss)", 1),
            "zaxis": side("down (mGauss)", 2),
            "aspectmode": "data" if corners is None else "cube",
            "camera": {
                "eye": {"x": 1.55, "y": -1.55, "z": 0.7},
                "center": {"x": 0, "y": 0, "z": -0.08},
            },
        },
        "showlegend": False,
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
    }
