"""What the paper reports, to stand beside what comes out here (docs/method.md, Table 1)."""

from __future__ import annotations

from dataclasses import dataclass

CONTROLS = (0, 200, 300)
"""The paper's control quantities, per mille of throttle."""


@dataclass(frozen=True)
class PaperRow:
    """One column of the paper's Table 1: residual heading error over a turn, degrees."""

    control: int
    current_a: float
    uncorrected_deg: float
    ellipsoid_deg: float
    method_deg: float


TABLE_1 = (
    PaperRow(0, 0.0, 12.5, 2.5, 2.4),
    PaperRow(200, 32.0, 13.3, 5.0, 2.5),
    PaperRow(300, 53.0, 14.3, 7.6, 2.6),
)

FLIGHT_UNCOMPENSATED_DEG = 15.0
"""Figs 8 and 9: heading error in flight with the classic correction, at most."""

FLIGHT_COMPENSATED_DEG = 3.0
"""The same with the paper's method."""
