"""What a disturbance may follow, compared, and what of it a firmware can apply."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Form:
    """One way in which the motors' field may follow what they draw, weighed on unseen data.

    Attributes
    ----------
    name
        ``"current"``, ``"throttle"``, ``"curved current"`` or ``"motors"``.
    count
        Numbers it takes.
    held_out
        Field that it leaves unexplained on stretches it did not see, mGauss.
    left_deg
        Heading error it leaves in this flight beside the form that explains most, degrees: all
        but a hundredth of the readings are below it. NaN where there is nothing to compare with.
    is_best
        Whether it is the simplest that no other is clearly better than.
    curve
        Of a curved form, what the motors add to the corrected field along x, y and z: mGauss at
        rest, per unit and per unit squared, beside the centre that the fit has at rest. Empty of
        other forms.
    """

    name: str
    count: int
    held_out: float
    left_deg: float
    is_best: bool
    curve: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True)
class AsWritten:
    """What the firmware can apply of a correction motor by motor.

    Attributes
    ----------
    regressor
        ``"motors"`` where the firmware corrects motor by motor; else the one quantity that comes
        nearest.
    exponent
        Of the firmware's law motor by motor; NaN for one quantity.
    left_deg
        Heading error that it leaves in this flight, degrees, as :attr:`Form.left_deg`.
    """

    regressor: str
    exponent: float
    left_deg: float
