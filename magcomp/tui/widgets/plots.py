"""The pictures of a fit, drawn with plotext.

Every series has its own sign (f, r, d; dots and crosses), so that a screen without colours, or a
pilot who sees none, reads the same.
"""

from __future__ import annotations

from collections.abc import Sequence

from textual.color import Color
from textual.widget import Widget
from textual_plotext import PlotextPlot

from magcomp.model import MotorFit, quantity_of
from magcomp.report import words
from magcomp.report.shift import Shift
from magcomp.tui.pictures import AXES, AXIS_WORDS, Unexplained, round_ticks

AXIS_COLOURS = ("error", "success", "primary")
"""Of forward, right and down, as names in the theme; the letters say the same."""

_BELOW = 3
"""Lines below a plot: its axis, the numbers there, and what they are of."""


def one_a_row(ticks: Sequence[float], ends: tuple[float, float], rows: int) -> list[float]:
    """One of the numbers in each row of a plot: which of two were shown is left to chance.

    Examples
    --------
    >>> one_a_row([0.0, 20.0, 40.0], (0.0, 56.0), 3)
    [0.0, 20.0]
    """
    kept: dict[int, float] = {}
    for tick in ticks:
        row = int(0.5 + (tick - ends[0]) / (ends[1] - ends[0]) * max(rows - 1, 0))
        kept[row] = min(kept.get(row, tick), tick, key=abs)
    return list(kept.values())


class Picture(PlotextPlot):
    """A plot that draws itself again when colours or size change."""

    can_focus = False

    def on_mount(self) -> None:
        """Follow the theme."""
        super().on_mount()
        self.app.theme_changed_signal.subscribe(self, lambda _theme: self.draw_plot())

    def on_resize(self) -> None:
        """Choose the axes' marks for the new size."""
        self.draw_plot()

    def draw_plot(self) -> None:
        """Draw with the colours and the size there are now."""
        raise NotImplementedError

    def colour(self, variable: str) -> tuple[int, int, int]:
        """A colour of the theme, red green blue."""
        return Color.parse(self.app.theme_variables[variable]).rgb

    def begin(self, across: str) -> None:
        """Begin anew; ``across`` stands under the picture."""
        self.plt.clear_data()
        self.plt.clear_figure()
        self.plt.xlabel(across)
        self.plt.grid(False, False)
        self.plt.xaxes(True, False)
        self.plt.yaxes(True, False)

    def ticks(self, x: tuple[float, float], y: tuple[float, float]) -> None:
        """Round numbers, as many as there is room for."""
        across = round_ticks(*x, max(self.size.width // 10, 2))
        up = round_ticks(*y, max(self.size.height // 2, 4))
        if y[1] > y[0]:
            up = one_a_row(up, y, self.size.height - _BELOW)
        self.plt.xlim(*x)
        self.plt.ylim(*y)
        self.plt.xticks(across, [f"{value:g}" for value in across])
        self.plt.yticks(up, [f"{value:g}" for value in up])


class ShiftPlot(Picture):
    """Centres and line: field against control quantity, an axis of the vehicle a line."""

    HELP = """\
**What the motors add** – the paper's picture. Each letter is the measured shift of the field's
centre along one axis of the vehicle (f forward, r right, d down), and each line is the fit.

Letters that lie on their lines mean that one number per axis is enough, and that the autopilot can
take the shift out.
"""

    def __init__(self, *, id: str | None = None) -> None:  # noqa: A002 - Textual's own name
        super().__init__(id=id)
        self._shift: Shift | None = None
        self._fit: MotorFit | None = None

    def show(self, shift: Shift, fit: MotorFit) -> None:
        """Draw one compass, and say its vector at the foot."""
        self._shift, self._fit = shift, fit
        self.draw_plot()

    def draw_plot(self) -> None:
        """Draw with the colours and the size there are now."""
        shift = self._shift
        if shift is None or self._fit is None or not self.is_attached:
            return
        if isinstance(self.parent, Widget):
            self.parent.border_subtitle = vector_words(self._fit, self.size.width - 2)
        self.begin(shift.title)
        colours = [self.colour(name) for name in AXIS_COLOURS]
        for index, colour in enumerate(colours):
            line = shift.lines[:, index].tolist()
            self.plt.plot(shift.ends.tolist(), line, color=colour, marker="braille")
        for index, (axis, colour) in enumerate(zip(AXES, colours, strict=True)):
            points = shift.centres[:, index].tolist()
            self.plt.scatter(shift.u.tolist(), points, color=colour, marker=axis)
        everything = [*shift.lines.flat, *shift.centres.flat, 0.0]
        self.ticks((0.0, float(shift.ends[1]) or 1.0), (min(everything), max(everything)))
        self.refresh()


def vector_words(fit: MotorFit, room: int) -> str:
    """``forward 1.124  right 0.446  down -1.764  per A``; with letters where there is less room."""
    values = [words.number(float(value)) for value in fit.interference]
    per = quantity_of(fit.regressor).per
    whole, short = (
        "  ".join([*(f"{name} {v}" for name, v in zip(names, values, strict=True)), per])
        for names in (AXIS_WORDS, AXES)
    )
    return whole if len(whole) <= room else short


class UnexplainedPlot(Picture):
    """Field left unexplained in time, before and after."""

    HELP = """\
**Unexplained field** – what is left of the field's variation when the earth and the correction are
taken away, in time. Crosses: with the calibration the vehicle has. Dots: with this fit.

A fit that is worth writing leaves a low flat row of dots, whatever the motors did.
"""

    def __init__(self, *, id: str | None = None) -> None:  # noqa: A002 - Textual's own name
        super().__init__(id=id)
        self._data: Unexplained | None = None

    def show(self, data: Unexplained) -> None:
        """Draw one compass."""
        self._data = data
        self.draw_plot()

    def draw_plot(self) -> None:
        """Draw with the colours and the size there are now."""
        data = self._data
        if data is None or not self.is_attached:
            return
        self.begin("seconds")
        time = data.time.tolist()
        before, after = self.colour("error"), self.colour("success")
        self.plt.scatter(time, data.before.tolist(), color=before, marker="x")
        self.plt.scatter(time, data.after.tolist(), color=after, marker="dot")
        most = max([*data.before.tolist(), *data.after.tolist()], default=1.0)
        self.ticks((min(time, default=0.0), max(time, default=1.0)), (0.0, most or 1.0))
        self.refresh()
