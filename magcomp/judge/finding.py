"""One thing the judge noticed."""

from __future__ import annotations

from dataclasses import dataclass

from magcomp.model import CURRENT, Grade


@dataclass(frozen=True)
class Finding:
    """One thing the judge noticed.

    Attributes
    ----------
    grade
        The best grade it allows.
    reason
        For a pilot: what is wrong, by how much, what to do.
    """

    grade: Grade
    reason: str


def severity(grade: Grade) -> int:
    """0 for good, more for worse."""
    return (Grade.GOOD, Grade.MARGINAL, Grade.REJECTED).index(grade)


def quantity(kind: str, u: float) -> str:
    """A control quantity in words.

    Examples
    --------
    >>> quantity("current", 24.3), quantity("throttle", 0.5)
    ('24 A', '50 % throttle')
    """
    return f"{u:.0f} A" if kind == CURRENT else f"{u * 100:.0f} % throttle"
