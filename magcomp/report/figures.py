"""The flat pictures of one compass."""

from __future__ import annotations

from typing import Any

import numpy as np

from magcomp.model import BoolArray, CompassResult, FloatArray
from magcomp.report.bend import bend_of
from magcomp.report.evidence import TURN_SECTORS, CompassPlots
from magcomp.report.figure import (
    AFTER,
    AFTER_SOFT,
    AXIS_COLOURS,
    AXIS_DASHES,
    AXIS_NAMES,
    AXIS_SYMBOLS,
    BEFORE,
    INK,
    MUTED,
    SCALE,
    SHADE,
    Figure,
    Quantity,
    Trace,
    axis,
    dots,
    flat,
    line,
    quantity_of,
    rounded,
)
from magcomp.report.figures_cloud import cloud
from magcomp.report.figures_flight import missions, strip
from magcomp.report.shift import shift_of

_MEDIANS = 12
_LEAST_IN_MEDIAN = 8


def figures(result: CompassResult, plots: CompassPlots) -> tuple[Figure, ...]:
    """Every picture of one compass, most telling first.

    Parameters
    ----------
    result
        One compass of an analysis.
    plots
        Its readings, from :func:`magcomp.report.evidence.compass_plots`.
    """
    quantity = quantity_of(result.fit.regressor)
    return (
        heading_error(result, quantity),
        missions(result, plots, quantity),
        cloud(result, plots, quantity),
        shift(result, quantity),
        strength(result, plots, quantity),
        unexplained(result, plots, quantity),
        sphere(result, plots),
        turn(plots, quantity),
        strip(plots),
    )


def heading_error(result: CompassResult, quantity: Quantity) -> Figure:
    """Heading error by control quantity, before and after."""
    rows = result.verdict.heading_error
    u = quantity.values([row.u for row in rows])
    before, after, bound = (
        rounded([getattr(row, name) for row in rows], 3) for name in ("before", "after", "p95")
    )
    covered = result.verdict.coverage
    low, high = quantity.values([covered.u_low, covered.u_high])
    data = [
        line(u, bound, "", AFTER, showlegend=False, hoverinfo="skip")
        | {"line": {"width": 0}, "fill": "tozeroy", "fillcolor": AFTER_SOFT},
        line(u, before, "correction in force", BEFORE, mode="lines+markers")
        | {"marker": {"symbol": "square", "size": 7}, "hovertemplate": "%{y:.1f}°"},
        line(u, after, "with the fit, expected", AFTER, mode="lines+markers")
        | {"marker": {"symbol": "circle", "size": 6}, "hovertemplate": "%{y:.2f}°"},
        line(u, bound, "with the fit, 95 % bound", AFTER, dash="dot")
        | {"hovertemplate": "%{y:.2f}°"},
    ]
    layout = flat(
        axis(quantity.title, rangemode="tozero"),
        axis("heading error (°)", rangemode="tozero"),
        hovermode="x unified",
        shapes=[
            {
                "type": "rect",
                "xref": "x",
                "yref": "paper",
                "x0": low,
                "x1": high,
                "y0": 0,
                "y1": 1,
                "fillcolor": SHADE,
                "line": {"width": 0},
                "layer": "below",
            }
        ],
    )
    return Figure(
        "heading",
        "Before and after",
        f"The squares show how wrong the heading can be now, the circles what the fit leaves; the "
        f"shaded part, {quantity.text(covered.u_low)} to {quantity.text(covered.u_high)}, is what "
        "the log covers, the rest is extrapolated.",
        data,
        layout,
        height=360,
    )


def shift(result: CompassResult, quantity: Quantity) -> Figure:
    """Shift of the field by control quantity, an axis a line: field against control quantity."""
    of = shift_of(result.fit)
    data: list[Trace] = []
    for index, name in enumerate(AXIS_NAMES):
        colour = AXIS_COLOURS[index]
        data.append(
            line(
                rounded(of.ends, 2),
                rounded(of.lines[:, index], 2),
                name,
                colour,
                dash=AXIS_DASHES[index],
                legendgroup=name,
                hoverinfo="skip",
            )
        )
        marker = {"color": colour, "symbol": AXIS_SYMBOLS[index], "size": 8}
        data.append(
            {
                "type": "scatter",
                "mode": "markers",
                "x": rounded(of.u, 2),
                "y": rounded(of.centres[:, index], 2),
                "error_y": {
                    "array": rounded(1.96 * of.std[:, index], 2),
                    "color": colour,
                    "width": 3,
                },
                "name": name,
                "marker": marker,
                "legendgroup": name,
                "showlegend": False,
                "hovertemplate": f"%{{x:.1f}} {quantity.unit}: %{{y:.1f}} mGauss",
            }
        )
    bend = bend_of(result)
    if bend is not None:
        for index, name in enumerate(AXIS_NAMES):
            data.append(
                line(
                    quantity.values(bend.u),
                    rounded(bend.curve[:, index], 2),
                    f"{name}, bent",
                    AXIS_COLOURS[index],
                    dash="dot",
                    legendgroup=name,
                    hoverinfo="skip",
                )
            )
    bends = "" if bend is None else "; the dotted curves are what the readings follow better"
    return Figure(
        "shift",
        "What the motors add",
        "Each point is the shift measured at one level with its 95 % error bar, each line the "
        "fitted interference; points on their lines mean that one number per axis is enough"
        f"{bends}.",
        data,
        flat(axis(quantity.title, rangemode="tozero"), axis("shift of the field (mGauss)")),
    )


def strength(result: CompassResult, plots: CompassPlots, quantity: Quantity) -> Figure:
    """Field strength against the control quantity."""
    u = quantity.values(plots.u)
    data = [
        dots(u, rounded(plots.strength_before, 1), "correction in force", BEFORE, "square"),
        dots(u, rounded(plots.strength_after, 1), "with the fit", AFTER),
        *_medians(plots, quantity),
    ]
    ends = [min(u, default=0.0), max(u, default=1.0)]
    data.append(
        line(ends, [round(result.fit.strength, 1)] * 2, "earth's field", INK, dash="dash")
        | {"hovertemplate": "%{y:.0f} mGauss"}
    )
    return Figure(
        "strength",
        f"Field strength against {quantity.name}",
        "The earth's field does not know the motors: a cloud that rises or falls with the "
        f"{quantity.name} is interference, a flat one on the dashed line is a compass put right.",
        data,
        flat(axis(quantity.title), axis("field strength (mGauss)")),
    )


def _medians(plots: CompassPlots, quantity: Quantity) -> list[Trace]:
    edges = np.linspace(plots.u.min(), plots.u.max(), _MEDIANS + 1)
    band = np.clip(np.searchsorted(edges, plots.u, side="right") - 1, 0, _MEDIANS - 1)
    groups: list[BoolArray] = [
        band == k for k in range(_MEDIANS) if np.count_nonzero(band == k) >= _LEAST_IN_MEDIAN
    ]
    u = quantity.values([float(np.median(plots.u[rows])) for rows in groups])

    def median(values: FloatArray) -> list[float]:
        found: list[float] = rounded([float(np.median(values[rows])) for rows in groups], 1)
        return found

    more: dict[str, Any] = {"showlegend": False, "hoverinfo": "skip"}
    return [
        line(u, median(plots.strength_before), "", BEFORE, **more),
        line(u, median(plots.strength_after), "", AFTER, **more),
    ]


def unexplained(result: CompassResult, plots: CompassPlots, quantity: Quantity) -> Figure:
    """Residuals in time, with the control quantity below."""
    time = rounded(plots.time, 1)
    data: list[Trace] = []
    strips = len(plots.parts)
    bottom = 0.22
    each = (1.0 - bottom) / strips
    layout = flat(
        axis("time (s)", anchor="y", domain=[0.0, 1.0]),
        axis(f"{quantity.name}<br>({quantity.unit})", domain=[0.0, bottom - 0.05]),
        margin={"l": 8, "r": 12, "t": 36, "b": 8},
    )
    for index, part in enumerate(plots.parts):
        name = f"y{index + 2}"
        shown = index == 0
        data.append(
            dots(time, rounded(plots.before[:, index], 1), "correction in force", BEFORE, "square")
            | {"yaxis": name, "legendgroup": "before", "showlegend": shown}
        )
        data.append(
            dots(time, rounded(plots.after[:, index], 1), "with the fit", AFTER)
            | {"yaxis": name, "legendgroup": "after", "showlegend": shown}
        )
        top = 1.0 - index * each
        layout[f"yaxis{index + 2}"] = axis(
            f"{part}<br>(mGauss)",
            domain=[top - each + 0.03, top],
            zeroline=True,
            zerolinecolor=MUTED,
        )
    data.append(
        line(time, quantity.values(plots.u, 1 if quantity.scale == 1.0 else 0), "", MUTED)
        | {"showlegend": False, "line": {"color": MUTED, "width": 1}}
    )
    residual = result.verdict.residual
    return Figure(
        "residuals",
        "Unexplained field in time",
        f"Field that each correction leaves unexplained, {residual.before:.1f} mGauss root mean "
        f"square in force and {residual.after:.1f} with the fit: what is left should look like "
        f"noise whatever the {quantity.name} in the lowest strip does.",
        data,
        layout,
        height=230 + 110 * strips,
        wide=True,
    )


def sphere(result: CompassResult, plots: CompassPlots) -> Figure:
    """Directions of the field seen in body axes, an equal-area map."""
    bands, sectors = plots.sphere.shape
    share = result.verdict.coverage.sphere
    return Figure(
        "sphere",
        "Attitudes covered",
        f"Where the earth's field pointed in the vehicle's own axes, cells of equal area: "
        f"{share * 100:.0f} % of them are filled, and the more are, the less is taken on trust "
        "(an upright flight fills one end only).",
        [
            _map(
                [-180 + 360 / sectors * (k + 0.5) for k in range(sectors)],
                rounded([-1 + 2 / bands * (k + 0.5) for k in range(bands)], 3),
                plots.sphere.tolist(),
                "%{x:.0f}° from the nose: %{z} readings",
            )
        ],
        flat(
            axis("direction from the nose, right positive (°)", tickvals=[-180, -90, 0, 90, 180]),
            axis(
                "field points",
                autorange="reversed",
                tickvals=[-0.9, 0, 0.9],
                ticktext=["up", "level", "down"],
            ),
            showlegend=False,
            margin={"l": 8, "r": 8, "t": 10, "b": 8},
        ),
    )


def turn(plots: CompassPlots, quantity: Quantity) -> Figure:
    """Headings seen at each control quantity."""
    middles = (plots.turn_edges[1:] + plots.turn_edges[:-1]) / 2
    width = 360 / TURN_SECTORS
    return Figure(
        "turn",
        f"Headings at each {quantity.name}",
        f"Readings for each heading and {quantity.name}: empty cells are headings the vehicle "
        "never had while its motors worked that hard.",
        [
            _map(
                [width * (k + 0.5) for k in range(TURN_SECTORS)],
                quantity.values(middles),
                plots.turn.tolist(),
                f"heading %{{x:.0f}}°, %{{y:.0f}} {quantity.unit}: %{{z}} readings",
            )
        ],
        flat(
            axis("magnetic heading (°)", tickvals=[0, 90, 180, 270, 360]),
            axis(quantity.title),
            showlegend=False,
            margin={"l": 8, "r": 8, "t": 10, "b": 8},
        ),
    )


def _map(x: list[float], y: list[float], counts: list[list[int]], hover: str) -> Trace:
    return {
        "type": "heatmap",
        "x": x,
        "y": y,
        "z": [[count or None for count in row] for row in counts],
        "colorscale": SCALE,
        "xgap": 1,
        "ygap": 1,
        "hoverongaps": False,
        "hovertemplate": hover + "<extra></extra>",
        "colorbar": {
            "title": {"text": "readings", "side": "right"},
            "thickness": 8,
            "outlinewidth": 0,
        },
    }
