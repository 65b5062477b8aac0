"""The correction in the air: read the control quantity, subtract the offset, level, take ψ.

docs/method.md, In the air. One reading costs some thirty multiplications and
allocates nothing that outlives the call, so that it can run at sensor rate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from magcomp.errors import InputError
from magcomp.geometry import level_matrix, wrap_angle
from magcomp.model import Correction, FloatArray, InForce

_TURN = 2 * math.pi


class Compensator:
    """Corrects readings of one compass and turns them into headings.

    Parameters
    ----------
    correction
        From a fit or from parameters.
    declination
        Radians, east positive; 0 gives magnetic headings.

    Attributes
    ----------
    field
        The last corrected field, body axes, mGauss, shape (3,); overwritten by each reading.

    Notes
    -----
    corrected = M · reading + b + m · u, with a centre that moves with the control
    quantity u: docs/method.md, Equation 6; then Equations 1 and 2.
    """

    __slots__ = ("_bias", "_matrix", "_motor", "declination", "field")

    def __init__(self, correction: Correction, declination: float = 0.0) -> None:
        self._set(
            correction.soft_iron,
            correction.soft_iron @ correction.offset,
            correction.vector,
            declination,
        )

    @classmethod
    def over(
        cls, correction: Correction, present: InForce, regressor: str, declination: float = 0.0
    ) -> Compensator:
        """A compensator for readings that an autopilot has corrected its own way already.

        Parameters
        ----------
        correction
            What should be in force.
        present
            What the autopilot does to the readings; it is undone.
        regressor
            The control quantity of ``correction``.
        declination
            Radians, east positive.

        Raises
        ------
        InputError
            Where ``present`` multiplies another control quantity: one u cannot undo it.

        Notes
        -----
        The inverse of what the autopilot did (docs/autopilots.md, ArduPilot: correction),
        followed by ``correction``; both are affine in reading and u, so together they cost no more
        than one.
        """
        if present.regressor not in (None, regressor):
            raise InputError(
                f"The motor compensation in force must be off or by {regressor}; instead it is by "
                f"{present.regressor}, which a correction by {regressor} cannot undo"
            )
        before = present.correction
        matrix = correction.soft_iron @ np.linalg.inv(before.soft_iron)
        motor = correction.vector
        if present.regressor is not None:
            motor = motor - matrix @ before.vector
        made = cls.__new__(cls)
        made._set(
            matrix, correction.soft_iron @ (correction.offset - before.offset), motor, declination
        )
        return made

    def _set(
        self, matrix: FloatArray, bias: FloatArray, motor: FloatArray, declination: float
    ) -> None:
        # Python floats: scalar arithmetic on array elements costs ten times as much.
        self._matrix: tuple[float, ...] = tuple(np.asarray(matrix, float).reshape(-1).tolist())
        self._bias: tuple[float, ...] = tuple(np.asarray(bias, float).tolist())
        self._motor: tuple[float, ...] = tuple(np.asarray(motor, float).tolist())
        self.declination = float(declination)
        self.field: FloatArray = np.full(3, np.nan)

    def correct(self, reading: Sequence[float], u: float, roll: float, pitch: float) -> float:
        """Correct one reading.

        Parameters
        ----------
        reading
            Body axes, mGauss, three numbers.
        u
            Control quantity when the reading was made.
        roll, pitch
            Radians, when the reading was made.

        Returns
        -------
        float
            Heading, radians in [−π, π); NaN where a number that went in is not finite. The
            corrected field is left in :attr:`field`.
        """
        x, y, z = reading
        xx, xy, xz, yx, yy, yz, zx, zy, zz = self._matrix
        bias_x, bias_y, bias_z = self._bias
        motor_x, motor_y, motor_z = self._motor
        field_x = xx * x + xy * y + xz * z + bias_x + motor_x * u
        field_y = yx * x + yy * y + yz * z + bias_y + motor_y * u
        field_z = zx * x + zy * y + zz * z + bias_z + motor_z * u
        self.field[0] = field_x
        self.field[1] = field_y
        self.field[2] = field_z
        if not (math.isfinite(roll) and math.isfinite(pitch)):
            return math.nan
        sin_roll, cos_roll = math.sin(roll), math.cos(roll)
        forward = field_x * math.cos(pitch) + (field_y * sin_roll + field_z * cos_roll) * math.sin(
            pitch
        )
        right = field_y * cos_roll - field_z * sin_roll
        if not (math.isfinite(forward) and math.isfinite(right)):
            return math.nan
        angle = math.atan2(-right, forward) + self.declination
        return (angle + math.pi) % _TURN - math.pi

    def correct_all(
        self, readings: FloatArray, u: FloatArray, roll: FloatArray, pitch: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Correct the readings of a log at once; :attr:`field` is left alone.

        Parameters
        ----------
        readings
            Body axes, mGauss, shape (n, 3).
        u, roll, pitch
            Shape (n,).

        Returns
        -------
        field
            mGauss, shape (n, 3).
        heading
            Radians in [−π, π), shape (n,): what :meth:`correct` returns for each row.
        """
        matrix = np.array(self._matrix).reshape(3, 3)
        with np.errstate(invalid="ignore"):
            field = readings @ matrix.T + self._bias + np.multiply.outer(u, np.array(self._motor))
            level = np.einsum("nij,nj->ni", level_matrix(roll, pitch), field)
        known = np.isfinite(level).all(axis=1)
        angle = np.arctan2(-level[:, 1], level[:, 0], where=known, out=np.full(len(level), np.nan))
        return field, wrap_angle(angle + self.declination)
