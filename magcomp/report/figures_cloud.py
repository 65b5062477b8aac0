"""The field's cloud, its ellipsoids and centres: docs/method.md, Fig. 3, and Fig. 4."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from magcomp.model import CompassResult, FloatArray, Level, MotorFit
from magcomp.report.evidence import CompassPlots
from magcomp.report.figure import BEFORE, GRID, INK, SCALE, Figure, Quantity, Trace, rounded, shade

_MOST_ELLIPSOIDS = 5
_FLIGHT_ELLIPSOIDS = 2
_MARGIN = 1.04
_CHI2_95 = 7.815
"""95 % quantile of χ² with three degrees of freedom."""

Moment = float | list[float] | str | None
Part = tuple[Trace, Moment]
"""A trace, and the control quantity that it belongs to: one for all its points, one for each, that
of its points' colours (:data:`_OWN`), or, where it moves, none."""

_OWN = "color"

SPACE_HEIGHT = 460
"""Height of a picture in space, pixels."""


def cloud(result: CompassResult, plots: CompassPlots, quantity: Quantity) -> Figure:
    """Raw field in space with the ellipsoids of the levels, and beside it their centres near by.

    Where the vehicle stood still there is no ellipsoid: the readings less the earth's part are
    drawn about the line itself.
    """
    fit = result.fit
    raw = plots.raw
    if fit.method == "sweep":
        centres = np.array([fit.correction.centre(float(u)) for u in plots.u])
        raw = raw - np.median(raw - centres, axis=0)
    levels = () if fit.method == "sweep" else _drawn(fit)
    top = float(quantity.scale * max(plots.u.max(), max((lv.u for lv in fit.levels), default=0.0)))
    shades = {"colorscale": SCALE, "cmin": 0.0, "cmax": top}
    far: list[Part] = [
        (_points(raw, quantity.values(plots.u, 1), quantity, shades), _OWN),
        *((_ellipsoid(fit, level, quantity, top), quantity.scale * level.u) for level in levels),
        *_line_of_centres(fit, quantity),
        *([(_shell(fit), None)] if levels else []),
        (_centre(fit, 6), None),
    ]
    near: list[Part] = [
        *((_doubt(level, quantity, top), quantity.scale * level.u) for level in fit.levels),
        *_line_of_centres(fit, quantity),
        (_centre(fit, 9), None),
    ]
    ends = np.stack([fit.correction.centre(u) for u in (0.0, _most(result))])
    return Figure(
        "cloud",
        "The field in space",
        _caption(fit, quantity, len(levels)),
        [trace for trace, _ in far] + [trace | {"scene": "scene2"} for trace, _ in near],
        _two(
            _corners([trace for trace, _ in far]),
            _corners([trace for trace, _ in near], ends),
            eye_beside(ends[1] - ends[0]),
        ),
        height=SPACE_HEIGHT,
        wide=True,
        play=_play(fit, quantity, [u for _, u in [*far, *near]]),
    )


def _most(result: CompassResult) -> float:
    """The largest control quantity that the table of heading errors has."""
    return max((row.u for row in result.verdict.heading_error), default=result.fit.u_high)


def _play(fit: MotorFit, quantity: Quantity, u: list[Moment]) -> dict[str, Any]:
    """What the page's script moves: docs/method.md, Equation 6, per unit as it is shown."""
    correction = fit.correction
    slope = correction.centre(1.0) - correction.centre(0.0)
    return {
        "u": u,
        "slope": rounded(slope / quantity.scale, 5),
        "offset": rounded(correction.offset, 3),
        "soft_iron": rounded(correction.soft_iron, 5),
        "motor": rounded(correction.vector / quantity.scale, 5),
    }


def _shell(fit: MotorFit) -> Trace:
    """The ellipsoid at rest, which the page's script moves along the line of centres."""
    surface = np.linalg.solve(fit.correction.soft_iron, fit.strength * wires().T).T
    return _lines(fit.correction.centre(0.0) + surface, "ellipsoid", BEFORE)


def _centre(fit: MotorFit, size: int) -> Trace:
    """The centre at rest, to be moved too."""
    x, y, z = ([value] for value in rounded(fit.correction.centre(0.0), 2))
    return {
        **{"type": "scatter3d", "mode": "markers", "name": "centre", "x": x, "y": y, "z": z},
        "marker": {"color": BEFORE, "size": size},
        "hovertemplate": "%{x:.1f}, %{y:.1f}, %{z:.1f} mGauss<extra>centre</extra>",
    }


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
            f"earth's field, move along the line of centres as the {quantity.name} grows, near by "
            "beside it (drag to turn)."
        )
    length = 0.0 if fit.line is None else float(np.ptp(fit.line.positions))
    off = 0.0 if fit.line is None else fit.line.rms
    return (
        f"Every reading lies on an ellipsoid whose centre moves as the {quantity.name} grows: "
        f"{ellipsoids} ellipsoids are drawn; beside it, near by, stand their centres in the "
        f"ellipsoids they lie in with 95 % probability, {off:.{1 if off >= 0.1 else 2}f} mGauss "
        f"off a straight line {length:.0f} mGauss long (drag to turn)."
    )


def _points(raw: FloatArray, u: list[float], quantity: Quantity, shades: dict[str, Any]) -> Trace:
    bar = {
        "title": {"text": quantity.title, "side": "right"},
        "thickness": 8,
        "len": 0.6,
        "x": 0.59,
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
    colour = shade(quantity.scale * level.u / top if top else 0.0)
    return _lines(surface, f"ellipsoid at {quantity.text(level.u)}", colour)


def _lines(surface: FloatArray, name: str, colour: str) -> Trace:
    x, y, z = ([None if np.isnan(v) else v for v in row] for row in rounded(surface.T, 1))
    return {
        "type": "scatter3d",
        "mode": "lines",
        "name": name,
        "x": x,
        "y": y,
        "z": z,
        "line": {"color": colour, "width": 2},
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


def _line_of_centres(fit: MotorFit, quantity: Quantity) -> list[Part]:
    if fit.line is None or not fit.levels:
        return []
    ends = np.array([fit.line.positions.min(), fit.line.positions.max()])
    reach = np.array([[ends[0]], [ends[1]]]) * fit.line.direction + fit.line.point
    lx, ly, lz = rounded(reach.T, 2)
    cx, cy, cz = rounded(np.array([level.centre for level in fit.levels]).T, 2)
    text = [f"centre at {quantity.text(level.u)}" for level in fit.levels]
    u = quantity.values([level.u for level in fit.levels])
    first, last = int(np.argmin(fit.line.positions)), int(np.argmax(fit.line.positions))
    line: Trace = {
        **{"type": "scatter3d", "mode": "lines", "name": "line of centres"},
        **{"x": lx, "y": ly, "z": lz, "hoverinfo": "name"},
        "line": {"color": INK, "width": 5},
    }
    points: Trace = {
        **{"type": "scatter3d", "mode": "markers", "name": "centres", "x": cx, "y": cy, "z": cz},
        "marker": {"color": INK, "size": 4, "symbol": "diamond"},
        "text": text,
        "hovertemplate": "%{text}: %{x:.1f}, %{y:.1f}, %{z:.1f} mGauss<extra></extra>",
    }
    return [(line, [u[first], u[last]]), (points, u)]


def _corners(data: Sequence[Trace], points: FloatArray | None = None) -> FloatArray:
    """Lowest and highest value on each axis, of traces and of more points, shape (2, 3)."""
    columns = [
        [value for trace in data for value in trace[name] if value is not None] for name in "xyz"
    ]
    more = np.empty((0, 3)) if points is None else points
    every = np.vstack([np.array(columns).T, more])
    return np.stack([every.min(axis=0), every.max(axis=0)])


_EYE = np.array([1.8, -1.8, 0.8])
_FLAT = 0.1
"""Share of a line that must lie in the level plane to be seen better from one side."""


def eye_beside(direction: FloatArray) -> FloatArray:
    """Where to look from, so that a line is seen from its side and not from its end.

    Parameters
    ----------
    direction
        Of the line, body axes, shape (3,).

    Returns
    -------
    ndarray
        In a picture's own axes, of which the second and third are drawn reversed, shape (3,).
    """
    forward, right = float(direction[0]), -float(direction[1])
    along = np.hypot(forward, right)
    if along <= _FLAT * np.linalg.norm(direction):
        return _EYE
    beside = np.array([right, -forward]) / along
    beside *= np.hypot(*_EYE[:2]) * (1.0 if beside @ _EYE[:2] >= 0.0 else -1.0)
    return np.array([*beside, _EYE[2]])


def _two(far: FloatArray, near: FloatArray, eye: FloatArray) -> dict[str, Any]:
    """Layout of a picture in space and, beside it, of what is too small to be seen in it."""
    whole, part = space(far), space(near)
    return {
        **whole,
        "scene": {**whole["scene"], "domain": {"x": [0.0, 0.58], "y": [0.0, 1.0]}},
        "scene2": {
            **part["scene"],
            **{f"{axis}axis": _near_axis(part["scene"][f"{axis}axis"]) for axis in "xyz"},
            "domain": {"x": [0.66, 1.0], "y": [0.0, 0.95]},
            "camera": {"eye": dict(zip("xyz", rounded(eye, 3), strict=True))},
        },
        "annotations": [
            {
                **{"text": "the centres, near by", "showarrow": False, "font": {"size": 12}},
                **{"xref": "paper", "yref": "paper", "x": 0.83, "y": 1.0},
            }
        ],
    }


def _near_axis(axis: dict[str, Any]) -> dict[str, Any]:
    """An axis with a name that fits a small picture; the large one beside it tells the unit."""
    return {**axis, "title": {"text": axis["title"]["text"].partition(" ")[0]}, "nticks": 4}


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
