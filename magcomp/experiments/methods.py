"""The corrections that Table 1 compares, each from the same readings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from magcomp.align import controls, readings, reported
from magcomp.analysis import Options, analyse
from magcomp.earth import EarthField
from magcomp.errors import MissingDataError
from magcomp.experiments.paper import CONTROLS
from magcomp.fit import Problem, fit_ellipsoid, paper_line
from magcomp.fit.levels import usable_levels
from magcomp.fit.line import SpaceLine
from magcomp.model import CURRENT, FloatArray, IntArray, MotorFit, Recording, Samples

METHODS = ("uncorrected", "ellipsoid", "paper", "magcomp")
"""The columns of Table 1."""


@dataclass(frozen=True, eq=False)
class Corrections:
    """What was found from the turns about three axes.

    Attributes
    ----------
    samples, level
        Those readings, and the level each belongs to, shape (n,).
    soft_iron
        D of the ellipsoid at control quantity 0, shape (3, 3).
    shapes
        D of each level's own ellipsoid, shape (3, 3, 3).
    centres
        Centre of each level's own ellipsoid, mGauss, shape (3, 3).
    line
        The paper's line through them.
    feet
        The centres' feet on that line: the offsets the paper's method looks up, shape (3, 3).
    fit
        magcomp's own.
    strength
        Field strength the shapes were scaled to, mGauss.
    """

    samples: Samples
    level: IntArray
    soft_iron: FloatArray
    shapes: FloatArray
    centres: FloatArray
    line: SpaceLine
    feet: FloatArray
    fit: MotorFit
    strength: float

    def apply(self, method: str, raw: FloatArray, u: FloatArray, level: int) -> FloatArray:
        """Corrected field, mGauss, shape (n, 3).

        Parameters
        ----------
        method
            One of :data:`METHODS`.
        raw
            Sensor field, mGauss, shape (n, 3).
        u
            Control quantity of magcomp's fit, shape (n,).
        level
            0, 1 or 2: at which control quantity the paper's offset is looked up.
        """
        if method == "uncorrected":
            return raw
        if method == "ellipsoid":
            return np.asarray((raw - self.centres[0]) @ self.soft_iron.T)
        if method == "paper":
            return np.asarray((raw - self.feet[level]) @ self.soft_iron.T)
        return self.fit.correction.apply(raw, u)


def corrections(recording: Recording, compass: int, earth: EarthField) -> Corrections:
    """Every correction of Table 1 from one recording of turns about three axes.

    Raises
    ------
    MissingDataError
        Where the recording does not hold usable turns at exactly three control quantities.

    Notes
    -----
    The paper's method: an ellipsoid for each control quantity on its own, the line of
    docs/method.md, Equations 14 to 16, through their centres, and along it the position of each
    centre's foot; the soft iron is that of the classic correction on the ground, at control
    quantity 0.
    """
    found = reported(controls(recording))
    problem = Problem(readings(recording, compass), found[CURRENT], found, earth)
    samples, level = usable_levels(problem)
    if len(np.unique(level)) != len(CONTROLS):
        raise MissingDataError(
            f"{recording.source} must hold turns about three axes at {len(CONTROLS)} control "
            f"quantities; instead it holds them at {len(np.unique(level))}"
        )
    ellipsoids = [
        fit_ellipsoid(samples.raw[level == index], earth.strength) for index in range(len(CONTROLS))
    ]
    centres = np.stack([ellipsoid.centres[0] for ellipsoid in ellipsoids])
    line = paper_line(centres)
    fit = analyse(recording, Options(compass=compass)).compasses[0].fit
    return Corrections(
        samples=samples,
        level=level,
        soft_iron=ellipsoids[0].soft_iron,
        shapes=np.stack([ellipsoid.soft_iron for ellipsoid in ellipsoids]),
        centres=centres,
        line=line,
        feet=line.point + np.multiply.outer(line.positions(centres), line.direction),
        fit=fit,
        strength=earth.strength,
    )
