"""Fit: the answer for each compass in pictures and words, and another try at once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import ClassVar, TypeVar

from textual.binding import Binding, BindingType
from textual.containers import Container, VerticalScroll
from textual.content import Content
from textual.widget import Widget
from textual.widgets import ProgressBar, Static

from magcomp.analysis import Options
from magcomp.analysis.analyse import ESC
from magcomp.fit import METHODS
from magcomp.model import CURRENT, MOTORS, THROTTLE, Analysis, Grade, Recording
from magcomp.report import words
from magcomp.report.as_json import analysis_object
from magcomp.report.plain import pilots_lines
from magcomp.tui.fits import fit_rows, time_range
from magcomp.tui.messages import OptionsChosen, TimeRangeWanted
from magcomp.tui.pictures import CompassPicture
from magcomp.tui.screens.step import StepScreen
from magcomp.tui.widgets.fits_table import FitsTable
from magcomp.tui.widgets.heading_table import HeadingTable
from magcomp.tui.widgets.plots import ShiftPlot, UnexplainedPlot
from magcomp.tui.widgets.verdict_text import ReasonLine, VerdictText, grade_so_far

VIEWS = {
    "heading": "Heading error",
    "shift": "Field the motors add, mGauss",
    "unexplained": "Unexplained field, mGauss",
    "verdict": "Verdict",
    "fits": "Fits side by side",
}
_TWO_VIEWS = 28
"""Lines of a screen on which two views are worth their room."""
_OPTION_KEYS = ("fit.method", "fit.regressor", "fit.compasses", "fit.time")

_T = TypeVar("_T")


def regressors(recording: Recording | None) -> tuple[str, ...]:
    """Control quantities that a recording may be fitted by, in the order in which R offers them.

    Where what is needed for one of them is there; whether it tells the motors apart, the fit says.
    """
    offered = ["auto", CURRENT, THROTTLE]
    if recording is not None and recording.current is not None and recording.outputs is not None:
        offered.append(MOTORS)
    if recording is not None and recording.esc_currents:
        offered.append(ESC)
    return tuple(offered)


class FitScreen(StepScreen):
    """The third step."""

    STEP = "fit"
    HELP = """\
**The fit.** How far the motors push each compass, and what the correction leaves.

One picture at a time on a small screen: V shows the next. 1, 2 and 3 choose the compass. M, R, T
and C change method, regressor, time range and compasses, and fit again at once; every fit is kept,
*fits side by side* compares them, and P shows another one.
"""
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("1", "compass(1)", "Compass", id="compass.1", key_display="1-3"),
        Binding("2", "compass(2)", "Compass 2", id="compass.2", show=False),
        Binding("3", "compass(3)", "Compass 3", id="compass.3", show=False),
        Binding("v", "view", "View", id="fit.view"),
        # These four are named where their values stand.
        Binding("m", "method", "Other method", id="fit.method", show=False),
        Binding("r", "regressor", "Other regressor", id="fit.regressor", show=False),
        Binding("c", "compasses", "Fit all compasses, or one", id="fit.compasses", show=False),
        Binding("t", "time", "Other time range", id="fit.time", show=False),
        Binding("p", "app.other_fit", "Other fit", id="fit.other"),
        Binding("f", "app.fit", "Fit again", id="fit.again"),
        Binding("e", "app.report", "Report", id="fit.report"),
        Binding("b", "app.backward", "Back", id="go.back"),
        Binding("n", "app.forward", "Write", id="go.next"),
    ]

    def __init__(self) -> None:
        super().__init__()
        self._compass = 0
        self._view = "heading"
        self._two = False
        self._drawn: tuple[CompassPicture, Analysis] | None = None
        self._line: tuple[Analysis | None, str] = (None, "")

    def body(self) -> Iterable[Widget]:
        """Grades, options, progress, and the four views."""
        yield ReasonLine(id="reason")
        yield Static(id="grades")
        yield Static(id="options")
        yield ProgressBar(total=1.0, show_eta=False, id="progress")
        with Container(id="views"):
            with VerticalScroll(id="view-heading", classes="view"):
                yield HeadingTable(id="headings")
            with Container(id="view-shift", classes="view"):
                yield ShiftPlot(id="shift")
            with Container(id="view-unexplained", classes="view"):
                yield UnexplainedPlot(id="unexplained")
            with Container(id="view-verdict", classes="view"):
                yield VerdictText(id="verdict")
            with VerticalScroll(id="view-fits", classes="view"):
                yield FitsTable(id="fits")
        yield Static(id="nothing", classes="nothing")

    def on_mount(self) -> None:
        """Name the views."""
        for name, title in VIEWS.items():
            self.query_one(f"#view-{name}").border_title = title
        self._show_view()

    def draw(self) -> None:
        """Draw the answer, the options, and how far a new fit is."""
        work, busy = self.state.work, self.state.busy
        bar = self.query_one(ProgressBar)
        bar.display = busy is not None
        if busy is not None:
            bar.update(progress=busy.share)
        analysis = work.analysis
        self.set_class(analysis is None, "-nothing")
        self.set_class(len(work.tried) > 1, "-several")
        self.query_one("#options", Static).update(
            options_line(work.options, analysis, [self._key(name) for name in _OPTION_KEYS])
        )
        if analysis is None:
            self._drawn = None
            self.query_one("#grades", Static).update("")
            self.query_one("#nothing", Static).update("" if busy else "Nothing is fitted yet.")
        else:
            self._draw_compass(analysis)
        self.say(busy.sentence if busy is not None else self._next(analysis))

    def _draw_compass(self, analysis: Analysis) -> None:
        pictures = self.state.work.pictures
        if self._compass not in pictures:
            self._compass = min(pictures)
        shown = pictures[self._compass]
        early = self.state.early
        self.query_one("#grades", Static).update(grades_line(analysis, self._compass, early=early))
        self.query_one(ReasonLine).show(shown.result, self._pilots_line(analysis), early=early)
        if self._drawn == (shown, analysis):
            return
        if self._drawn is None:
            self.call_after_refresh(self._focus_view)
        self._drawn = (shown, analysis)
        self.query_one(HeadingTable).show(shown.errors)
        self.query_one(ShiftPlot).show(shown.shift, shown.result.fit)
        self.query_one(UnexplainedPlot).show(shown.unexplained)
        self.query_one(VerdictText).show(shown.result, analysis.notes)
        rows = fit_rows(self.state.work.tried, analysis, self._compass)
        self.query_one(FitsTable).show(rows)
        residual = shown.result.verdict.residual
        self.query_one("#view-unexplained").border_title = (
            f"{VIEWS['unexplained']}: {residual.held_out_before:.1f} → {residual.after:.1f}, "
            f"unseen {residual.held_out:.1f}"
        )
        self.query_one("#view-unexplained").border_subtitle = "x now   • corrected"

    def _pilots_line(self, analysis: Analysis) -> str:
        """What to do, in words without statistics."""
        if self._line[0] is not analysis:
            self._line = analysis, pilots_lines(analysis_object(analysis))[0]
        return self._line[1]

    def _key(self, name: str) -> str:
        """The key of an action as it is displayed; the settings may have changed it."""
        bound = (each.binding for each in self.active_bindings.values())
        found = next((binding for binding in bound if binding.id == name), None)
        return "" if found is None else self.app.get_key_display(found).upper()

    def _next(self, analysis: Analysis | None) -> str:
        if analysis is None:
            return "Press F to fit what was recorded."
        rejected = analysis.grade is Grade.REJECTED
        if self.state.is_outdated:
            more = words.duration(self.state.unfitted_s)
            other = "" if rejected else ", or N to write this"
            return f"{more} came since this fit: press F to fit that too{other}."
        if rejected and self.state.early:
            return "Too early for an answer: press B, record more, then press N."
        if rejected:
            return "Do what the first line says, record again, and fit again. M: other method."
        return "Look at the pictures (V), then press N to see what would be written."

    def on_resize(self) -> None:
        """Show one view, or a second one below the first where the screen is high."""
        super().on_resize()
        self._two = self.size.height >= _TWO_VIEWS and not self.has_class("-wide")
        self.query_one("#view-heading").set_class(self._two, "-first")
        self._show_view()

    def _show_view(self) -> None:
        if self._two and self._view == "heading":
            self._view = "verdict"
        for name in VIEWS:
            self.query_one(f"#view-{name}").set_class(name == self._view, "-shown")
        self.call_after_refresh(self._focus_view)

    def _focus_view(self) -> None:
        """Let the arrow keys scroll what is shown."""
        scrolled = self.query(f"#view-{self._view}, #view-{self._view} VerticalScroll")
        self.set_focus(next((each for each in scrolled if each.can_focus), None))

    # ---------------------------------------------------------------- keys

    def action_compass(self, compass: int) -> None:
        """Show one compass."""
        if compass in self.state.work.pictures:
            self._compass = compass
            self.redraw()
        elif self.state.work.analysis is not None:
            self.notify(f"Compass {compass} is not in this fit. C chooses what is fitted.")

    def action_view(self) -> None:
        """Show the next view."""
        several = len(self.state.work.tried) > 1
        names = [name for name in VIEWS if several or name != "fits"]
        if self._two:
            names.remove("heading")
        if self._view not in names:
            self._view = names[-1]
        self._view = names[(names.index(self._view) + 1) % len(names)]
        self._show_view()

    def action_method(self) -> None:
        """Fit with the next method."""
        # From the one tried last: a method that cannot fit this recording must not end the round.
        self._change(method=_after(METHODS, self.state.asked.method))

    def action_regressor(self) -> None:
        """Fit against the next control quantity."""
        offered = regressors(self.state.work.recording)
        # As with methods, one that cannot be fitted must not end the round.
        self._change(regressor=_after(offered, self.state.asked.regressor))

    def action_compasses(self) -> None:
        """Fit all compasses, or one."""
        recording = self.state.work.recording
        every = (None, *sorted(recording.field)) if recording is not None else (None,)
        self._change(compass=_after(every, self.state.work.options.compass))

    def action_time(self) -> None:
        """Ask for another time range."""
        self.post_message(TimeRangeWanted())

    def _change(self, **changed: object) -> None:
        self.post_message(OptionsChosen(changed))


def options_line(options: Options, analysis: Analysis | None, keys: Sequence[str]) -> Content:
    """What is fitted and how, each with its key; what ``auto`` chose after an arrow."""
    fit = analysis.compasses[0].fit if analysis is not None else None
    parts = (
        ("method", _chosen(options.method, fit.method if fit else "")),
        ("by", _chosen(options.regressor, fit.regressor if fit else "")),
        ("compass", "all" if options.compass is None else str(options.compass)),
        ("time", time_range(options)),
    )
    texts = [
        Content.assemble((key, "bold $accent"), (f" {name} ", "$quiet"), value)
        for key, (name, value) in zip(keys, parts, strict=True)
    ]
    return Content("  ").join(texts)


def grades_line(analysis: Analysis, shown: int, *, early: bool = False) -> Content:
    """The grade of each compass; the one shown is in brackets and reversed."""
    parts = []
    for result in analysis.compasses:
        number = result.fit.compass
        here = number == shown
        name = Content.styled(f"[{number}]" if here else f" {number} ", "reverse" if here else "")
        word = grade_so_far(result.verdict.grade, early=early)
        parts.append(Content.assemble(" ", name, " ", word))
    return Content.assemble(Content.styled(" Compass", "$quiet"), *parts)


def _chosen(asked: str, used: str) -> str:
    return f"{asked} → {used}" if asked == "auto" and used else asked


def _after(values: tuple[_T, ...], value: _T) -> _T:
    return values[(values.index(value) + 1) % len(values)] if value in values else values[0]
