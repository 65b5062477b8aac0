"""Numbers and names as people read them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from magcomp import autopilots
from magcomp.model import Vehicle, quantity_of
from magcomp.sweeping.steps import Step

_MOST_DECIMALS = 3

AXES = ("forward", "right", "down")
"""The vehicle's axes x, y, z in every view."""

_NEARLY = 1.05
"""A control quantity this little beyond what was flown still counts as flown."""


def quantity(u: float, regressor: str) -> str:
    """A control quantity: ``20 A`` or ``40 %``."""
    return quantity_of(regressor).text(u)


def is_flown(u: float, low: float, high: float) -> bool:
    """Whether a control quantity lies in the range that was flown."""
    return low / _NEARLY <= u <= high * _NEARLY


def degree_decimals(value: float) -> int:
    """Decimals of an angle that a pilot reads: a bound must not be rounded to nothing."""
    if value >= 9.95:
        return 0
    return 1 if value >= 0.1 else 2


def degrees(value: float) -> str:
    """An angle in a sentence: ``18°``, ``0.4°`` or ``0.04°``."""
    return f"{value:.{degree_decimals(value)}f}°"


def interference_title(regressor: str) -> str:
    """What an interference vector is, with its unit."""
    return quantity_of(regressor).added_title


def with_std(value: float, std: float) -> str:
    """A value to the two significant digits of its standard error: ``-1.126 ± 0.020``.

    No more than three decimals: the field is known to no more than that.
    """
    if not math.isfinite(std) or std <= 0.0:
        return number(value)
    decimals = min(max(1 - math.floor(math.log10(std)), 0), _MOST_DECIMALS)
    shown = max(std, 10.0**-_MOST_DECIMALS)
    # Adding 0 turns a rounded −0 into 0.
    return f"{round(value, decimals) + 0.0:.{decimals}f} ± {shown:.{decimals}f}"


def number(value: float, decimals: int = _MOST_DECIMALS) -> str:
    """A value to some decimals, without noughts at its end; a question mark where it is none."""
    if not math.isfinite(value):
        return "?"
    text = f"{round(value, decimals) + 0.0:.{decimals}f}"
    return text.rstrip("0").rstrip(".") if decimals else text


def parameter(value: float) -> str:
    """A parameter's value: short, and finer than a heading can tell."""
    return number(value, 4)


def milliseconds(value: float, std: float) -> str:
    """A lag in seconds as milliseconds with its standard error; a dash where there is none."""
    if not math.isfinite(value):
        return "–"
    if not math.isfinite(std):
        return f"{1000 * value:.0f}"
    return f"{1000 * value:.0f} ± {max(1000 * std, 1.0):.0f}"


def duration(seconds: float) -> str:
    """``58 s``, ``3 min 54 s`` or ``2 h 5 min``."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    minutes, rest = divmod(whole, 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    return f"{minutes // 60} h {minutes % 60} min"


def counted(count: int, noun: str) -> str:
    """``1 step`` or ``25 steps``.

    Examples
    --------
    >>> counted(1, "step"), counted(25, "step")
    ('1 step', '25 steps')
    """
    return f"{count} {noun}{'' if count == 1 else 's'}"


def listed(items: Sequence[object]) -> str:
    """``1``, ``1 and 2``, ``1, 2 and 3``."""
    words = [str(item) for item in items]
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def compasses(numbers: Sequence[int]) -> str:
    """``compass 1`` or ``compasses 1, 2 and 3``."""
    return f"compass{'es' if len(numbers) > 1 else ''} {listed(numbers)}"


def vehicle(of: Vehicle) -> str:
    """``ArduPilot copter 4.6.3, system 1``."""
    known = "" if of.kind == "unknown" else of.kind
    words = [autopilots.title(of.autopilot), known, of.firmware]
    return printable(f"{' '.join(filter(None, words))}, system {of.system}")


def sentence(text: str) -> str:
    """A reason with a capital letter and its stop, on one line whatever a log said in it.

    Examples
    --------
    >>> sentence("it drifts"), sentence("was it moved?")
    ('It drifts.', 'Was it moved?')
    """
    text = printable(text).rstrip(".")
    stop = "" if text.endswith(("?", "!")) else "."
    return f"{text[:1].upper()}{text[1:]}{stop}"


def printable(name: str) -> str:
    """A log's words, or its name, without what a terminal would obey."""
    if name.isprintable():
        return name
    return "".join(c if c.isprintable() else "?" for c in name)


def sweep_step(step: Step) -> str:
    """``motor 2 at 30%`` or ``all 4 motors at 30%``.

    Examples
    --------
    >>> sweep_step(Step(motors=(2,), share=0.3))
    'motor 2 at 30%'
    """
    single = len(step.motors) == 1
    which = f"motor {step.motors[0]}" if single else f"all {len(step.motors)} motors"
    return f"{which} at {step.share:.0%}"
