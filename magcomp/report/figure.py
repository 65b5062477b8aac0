"""What every picture of the report is made of: plotly's traces as plain data.

Colours are names that begin with ``@``; the page replaces them by the colours of its light,
dark or printed form. plotly itself is not needed to make a figure, only to draw it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from magcomp.model import quantity_of as known_quantity
from magcomp.report import words

BEFORE, AFTER, INK, MUTED, GRID, SCALE = "@before", "@after", "@ink", "@muted", "@grid", "@scale"
BEFORE_SOFT, AFTER_SOFT, SHADE = "@before-soft", "@after-soft", "@shade"
AXIS_COLOURS = ("@x", "@y", "@z")
AXIS_NAMES = words.AXES
AXIS_SYMBOLS = ("circle", "square", "diamond")
AXIS_DASHES = ("solid", "dash", "dot")

Trace = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Figure:
    """One picture.

    Attributes
    ----------
    name
        Unique among the figures of a compass.
    title
        What it shows.
    caption
        One sentence: what to see in it.
    data, layout
        As plotly takes them.
    height
        Pixels.
    wide
        Whether it deserves the whole width of the page.
    play
        What moves in it when the reader moves the control quantity, as the page's script takes it.
    """

    name: str
    title: str
    caption: str
    data: Sequence[Trace]
    layout: Mapping[str, Any]
    height: int = 320
    wide: bool = False
    play: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class Quantity:
    """How a control quantity is shown: amperes, or throttle in per cent."""

    name: str
    unit: str
    scale: float

    @property
    def title(self) -> str:
        """Title of an axis."""
        return f"{self.name} ({self.unit})"

    def values(self, u: ArrayLike, digits: int = 2) -> list[float]:
        """Values for an axis."""
        shown: list[float] = rounded(np.asarray(u, float) * self.scale, digits)
        return shown

    def text(self, u: float) -> str:
        """One value with its unit."""
        return f"{u * self.scale:.0f} {self.unit}"


def quantity_of(regressor: str) -> Quantity:
    """The control quantity of a fit."""
    known = known_quantity(regressor)
    return Quantity(known.name, known.shown_unit, known.scale)


def shade(share: float) -> str:
    """The colour at a place on the scale, 0 … 1."""
    return f"{SCALE}:{min(max(share, 0.0), 1.0):.3f}"


def rounded(values: ArrayLike, digits: int) -> Any:
    """Nested lists of short numbers: the page must stay small."""
    return np.round(np.asarray(values, float), digits).tolist()


def axis(title: str, **more: Any) -> dict[str, Any]:
    """An axis of a flat picture."""
    return {
        "title": {"text": title, "standoff": 8},
        "gridcolor": GRID,
        "linecolor": GRID,
        "zeroline": False,
        "ticks": "",
        "automargin": True,
        **more,
    }


def flat(x: dict[str, Any], y: dict[str, Any], **more: Any) -> dict[str, Any]:
    """Layout of a flat picture."""
    return {
        "xaxis": x,
        "yaxis": y,
        "hovermode": "closest",
        "showlegend": True,
        "legend": {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom", "xanchor": "left"},
        "margin": {"l": 8, "r": 12, "t": 36, "b": 8},
        **more,
    }


def line(x: Any, y: Any, name: str, colour: str, **more: Any) -> Trace:
    """A line."""
    style = {"color": colour, "width": 2, "dash": more.pop("dash", "solid")}
    return {"type": "scatter", "mode": "lines", "x": x, "y": y, "name": name, "line": style, **more}


def dots(x: Any, y: Any, name: str, colour: str, symbol: str = "circle", **more: Any) -> Trace:
    """A cloud of small points."""
    marker = {"color": colour, "size": 4, "opacity": more.pop("opacity", 0.45), "symbol": symbol}
    shown = {"type": "scatter", "mode": "markers", "x": x, "y": y, "name": name, "marker": marker}
    return {**shown, **more}
