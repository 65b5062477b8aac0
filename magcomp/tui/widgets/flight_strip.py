"""A recording at a glance: its load in time, and which part of it is used."""

from __future__ import annotations

from dataclasses import dataclass

from textual.content import Content

from magcomp.tui.widgets.drawn import Drawn

_EIGHTHS = " ▁▂▃▄▅▆▇█"


@dataclass(frozen=True)
class Strip:
    """What a strip shows.

    Attributes
    ----------
    load
        Throttle or current in as many equal parts of the recording, as a share of its largest.
    duration_s
        How long the recording is.
    start_s, end_s
        The part that is used.
    """

    load: tuple[float, ...]
    duration_s: float
    start_s: float
    end_s: float


class FlightStrip(Drawn[Strip]):
    """The load as a row of bars, and under it the part that is used."""

    def picture(self, data: Strip, width: int, height: int) -> Content:  # noqa: ARG002
        """Three lines: bars, the used part, and the seconds at both ends."""
        used = [
            data.start_s <= (column + 0.5) / width * data.duration_s <= data.end_s
            for column in range(width)
        ]
        bars: list[tuple[str, str]] = []
        for column, is_used in enumerate(used):
            first = column * len(data.load) // width
            last = max((column + 1) * len(data.load) // width, first + 1)
            share = max(data.load[first:last], default=0.0)
            bars.append((_EIGHTHS[round(8 * share)], "$success" if is_used else "$quiet"))
        marks = [("━", "bold $accent") if is_used else ("·", "$quiet") for is_used in used]
        end = f"{data.duration_s:.0f} s"
        return Content("\n").join(
            [
                Content.assemble(*bars),
                Content.assemble(*marks),
                Content.styled(f"0{end:>{max(width - 1, 1)}}", "$quiet"),
            ]
        )
