"""How text for people is laid out."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Look:
    """Where a text is going.

    Attributes
    ----------
    columns
        Width.
    colour
        Whether a terminal's colours may be used.
    ascii_only
        Whether it takes nothing but ASCII.
    """

    columns: int = 80
    colour: bool = False
    ascii_only: bool = False
