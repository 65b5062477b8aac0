"""The part of a recording to fit, chosen by eye or by numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.widget import Widget
from textual.widgets import Input

from magcomp.tui.screens.dialogs import AskText, Fault
from magcomp.tui.widgets.flight_strip import FlightStrip, Strip

_STEPS = 60


class TimeRange(AskText):
    """A strip of the recording, and its two ends to move or to type.

    Parameters
    ----------
    strip
        The recording, and the part used now.
    check
        See :class:`AskText`.
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("up", "move(1)", "Later"),
        Binding("down", "move(-1)", "Earlier"),
    ]

    def __init__(self, strip: Strip, check: Callable[[tuple[str, ...]], Fault | None]) -> None:
        super().__init__(
            "Time range",
            "Which part to fit, in seconds. Up and down move an end, Tab goes to the other one.",
            (("From", f"{strip.start_s:g}"), ("To", f"{strip.end_s:.0f}")),
            check=check,
        )
        self._strip = strip

    def body(self) -> Iterable[Widget]:
        """The strip above the lines."""
        yield FlightStrip(id="strip")

    def on_mount(self) -> None:
        """Draw the part used now."""
        self._draw()

    def on_input_changed(self) -> None:
        """Draw the part that is typed."""
        self._draw()

    def action_move(self, steps: int) -> None:
        """Move the end that has the focus by a small part of the recording."""
        field, step = self.focused, max(self._strip.duration_s / _STEPS, 1.0)
        if isinstance(field, Input):
            value = _number(field.value, self._strip.start_s) + steps * step
            field.value = f"{min(max(value, 0.0), self._strip.duration_s):.0f}"

    def _draw(self) -> None:
        first, last = self.query(Input)
        self.query_one(FlightStrip).draw_data(
            Strip(
                self._strip.load,
                self._strip.duration_s,
                _number(first.value, self._strip.start_s),
                _number(last.value, self._strip.end_s),
            )
        )


def _number(text: str, otherwise: float) -> float:
    try:
        return float(text)
    except ValueError:
        return otherwise
