"""One thing the judge noticed."""

from __future__ import annotations

from dataclasses import dataclass

from magcomp.model import Grade


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
