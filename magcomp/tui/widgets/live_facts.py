"""How far a recording is: what is enough, what is missing, the bound, and where it goes."""

from __future__ import annotations

from dataclasses import dataclass

from textual.content import Content

from magcomp.live.progress import Bound
from magcomp.live.snapshot import LiveSnapshot
from magcomp.report import words
from magcomp.tui.widgets.bars import bar
from magcomp.tui.widgets.drawn import Drawn

_FIELD_MESSAGES = ("RAW_IMU", "SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3")
_SPARKS = "▁▂▃▄▅▆▇█"
_SPARK_CELLS = 12
_SHORTEST = 4
_LOOK_BACK = 3
_TO_FIVES_S, _TO_TENS_S = 20.0, 95.0
_STEADY = 0.1
"""A bound that changes by less than this share is steady."""


@dataclass(frozen=True)
class Facts:
    """What the lines say.

    Attributes
    ----------
    share, missing
        Done, 0 … 1, and what is missing.
    file, size
        Name of the recording, empty where none is made, and its size in words.
    seconds
        Recorded, whole.
    rate
        Compass messages a second.
    """

    share: float
    missing: tuple[str, ...]
    file: str
    size: str
    seconds: int
    rate: int


class LiveFacts(Drawn[Facts]):
    """Two lines: how far, and where to."""

    def show(self, live: LiveSnapshot) -> None:
        """Draw a snapshot's."""
        path = live.recording_path
        stopped = "" if live.recording else "stopped: "
        self.draw_data(
            Facts(
                round(live.guidance.share_done, 2),
                live.guidance.missing,
                "" if path is None else f"{stopped}{path.name}",
                f"{live.recording_bytes / 1e6:.1f} MB",
                int(live.recorded_s),
                round(max((live.link.rates.get(n, 0.0) for n in _FIELD_MESSAGES), default=0.0)),
            )
        )

    def picture(self, data: Facts, width: int, height: int) -> Content:  # noqa: ARG002
        """The lines; of a long name the end counts."""
        share = f" {100 * data.share:3.0f} %"
        said = share + _missing(data.missing, width - 9 - _SHORTEST - len(share))
        length = min(max(width // 4, 8), 30, max(width - 9 - len(said), _SHORTEST))
        first = Content.assemble(
            (" enough  ", "$quiet"), bar(data.share, length, style="$success"), said
        )
        minutes, seconds = divmod(data.seconds, 60)
        rest = f"  {data.size}   time {minutes:02d}:{seconds:02d}   compass {data.rate} Hz"
        room = max(width - 9 - len(rest), 12)
        file = data.file if len(data.file) <= room else f"…{data.file[1 - room :]}"
        where = f"{file}{rest}" if data.file else f"nothing is written to a file{rest}"
        return Content("\n").join([first, Content.assemble((" file    ", "$quiet"), where)])


def _missing(names: tuple[str, ...], room: int) -> str:
    """What is missing; names that there is no room for are left out whole."""
    for count in range(len(names), 0, -1):
        text = f"  missing: {', '.join(names[:count])}{', …' if count < len(names) else ''}"
        if len(text) <= room or count == 1:
            return text
    return ""


def bound_words(live: LiveSnapshot, room: int) -> str:
    """``at hover at most 1.3° (95 %), falling ▇▅▃▂ at 24 A; about 40 s more``.

    Empty before there is a bound. Where there is less ``room``, in cells, the picture and the load
    go first: what a pilot acts on is the bound, and how long it still takes.
    """
    if live.bound is None:
        return "" if live.grade is None else "too early for a bound"
    bound = live.bound
    several = len(bound.degrees) > 1
    most = f"at hover at most {bound.degrees[-1]:.1f}°"
    course = f", {trend(bound)}" if several else ""
    picture = f" {sparkline(bound.degrees)}" if several else ""
    at = f" at {words.quantity(bound.u, bound.regressor)}"
    more = _more(live, bound)
    forms = (
        f"{most} (95 %){course}{picture}{at}{more}",
        f"{most} (95 %){course}{picture}{more}",
        f"{most} (95 %){course}{more}",
        f"{most}{course}{more}",
    )
    return next((form for form in forms if len(form) <= room), f"{most}{more}")


def _more(live: LiveSnapshot, bound: Bound) -> str:
    """How much longer, where it is not enough yet and somebody can tell."""
    left = 0.0 if bound.enough_at_s is None else bound.enough_at_s - live.recorded_s
    if left <= 0.0 or live.guidance.enough:
        return ""
    return f"; about {about(left)} more"


def about(seconds: float) -> str:
    """A time nobody knows to the second: ``5 s``, ``40 s``, ``3 min``."""
    if seconds < _TO_FIVES_S:
        return f"{max(5 * round(seconds / 5), 5)} s"
    if seconds < _TO_TENS_S:
        return f"{10 * round(seconds / 10)} s"
    return f"{round(seconds / 60)} min"


def trend(bound: Bound) -> str:
    """Whether more recording still helps."""
    now = bound.degrees[-1]
    before = bound.degrees[-min(_LOOK_BACK + 1, len(bound.degrees))]
    if len(bound.degrees) > 1 and now < (1.0 - _STEADY) * before:
        return "falling"
    return "rising" if now > (1.0 + _STEADY) * before else "steady"


def sparkline(values: tuple[float, ...]) -> str:
    """The last values as bars of eighths, the largest of all full."""
    largest = max(values, default=0.0)
    if largest <= 0.0:
        return ""
    return "".join(
        _SPARKS[min(int(value / largest * len(_SPARKS)), len(_SPARKS) - 1)]
        for value in values[-_SPARK_CELLS:]
    )
