"""Where a disturbance may come from: what leads beside a compass would make such a vector.

A vector in body axes does not tell a place. It tells which way a straight lead may run and, with
what is usual between the two leads of a pair, how far away it may be (docs/method.md, Where it
comes from). All of this is a hint.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from magcomp.geometry import horizontal_part
from magcomp.model import FloatArray, MotorFit, quantity_of

WIRE_MGAUSS_M = 2.0
"""Field of a straight wire at a metre, mGauss/A: μ₀ / 2π."""

PAIR_M = (0.005, 0.02)
"""How far apart the two leads of a pair usually run."""

LOOP_M2 = (0.0005, 0.005)
"""Areas of loops that leads to a battery or a power module usually make."""

_FARTHEST_M = 0.5
_WORTH_LOOKING_RAD = np.radians(5.0)
"""Less than this at the largest current is nothing to move wires for."""

_KNOWN = 3.0
"""A vector is worth a hint from this many of its standard errors on."""

_LEAST_CM = 1.0
"""No compass is moved by less."""

_STANDS_OUT = 1.3
_LEVEL, _STEEP = np.radians(30.0), np.radians(60.0)
_WAYS = (
    "fore and aft",
    "from rear left to front right",
    "across",
    "from front left to rear right",
)


@dataclass(frozen=True)
class Origin:
    """What could make a vector.

    Attributes
    ----------
    single_m
        Distance at which one straight lead, its return far away, makes it.
    pair_m
        Least and most distance of a pair of leads that run side by side.
    loop_m
        Least and most distance of a loop on its axis.
    way
        Heading of a straight lead off the nose, radians in [0, π).
    height
        Angle above or below the compass at which it passes, radians: 0 beside it, π/2 straight
        under or over it.
    """

    single_m: float
    pair_m: tuple[float, float]
    loop_m: tuple[float, float]
    way: float
    height: float

    @property
    def way_words(self) -> str:
        """The way in words."""
        return _WAYS[int(np.rint(self.way / (np.pi / 4))) % len(_WAYS)]

    @property
    def height_words(self) -> str:
        """Where it passes, in words."""
        if self.height < _LEVEL:
            return "beside the compass, about as high as it"
        if self.height < _STEEP:
            return "below or above the compass and to one side of it"
        return "straight below or above the compass"

    @property
    def halved_m(self) -> float:
        """By how much farther away a pair of leads in the middle of its range does half as much."""
        return float((np.sqrt(2.0) - 1.0) * np.sqrt(self.pair_m[0] * self.pair_m[1]))


def origin_of(vector: FloatArray) -> Origin | None:
    """What could make a vector of so many mGauss/A in body axes; None where it is none.

    Examples
    --------
    A single wire that runs fore and aft 10 cm below a compass makes 20 mGauss/A across:

    >>> found = origin_of(np.array([0.0, 20.0, 0.0]))
    >>> round(found.single_m, 3), found.way_words, found.height_words
    (0.1, 'fore and aft', 'straight below or above the compass')
    """
    size = float(np.linalg.norm(vector))
    if not size > 0.0:
        return None
    flat = float(np.hypot(vector[0], vector[1]))
    pair = tuple(float(np.sqrt(WIRE_MGAUSS_M * apart / size)) for apart in PAIR_M)
    loop = tuple(float(np.cbrt(WIRE_MGAUSS_M * area / size)) for area in LOOP_M2)
    return Origin(
        single_m=WIRE_MGAUSS_M / size,
        pair_m=(pair[0], pair[1]),
        loop_m=(loop[0], loop[1]),
        # A straight lead is square to its field, and so is the way from it to the compass.
        way=float(np.mod(np.arctan2(vector[1], vector[0]) + np.pi / 2, np.pi)),
        height=float(np.arctan2(flat, abs(vector[2]))),
    )


def hints(fits: Sequence[MotorFit]) -> Iterator[str]:
    """What a pilot may look for, in words; of the compass known to be disturbed most.

    Parameters
    ----------
    fits
        One a compass, all against one quantity.
    """
    known = [fit for fit in fits if not quantity_of(fit.regressor).is_throttle and _is_known(fit)]
    if not known:
        return
    fit = max(known, key=lambda each: float(np.linalg.norm(each.interference)))
    horizontal = horizontal_part(fit.strength, fit.vertical)
    worst = float(np.linalg.norm(fit.interference)) * fit.u_high / horizontal
    found = origin_of(fit.interference)
    if found is None or worst < _WORTH_LOOKING_RAD:
        return
    near, far = (100.0 * metres for metres in found.pair_m)
    single = f"; one lead alone does so at {100.0 * found.single_m:.0f} cm"
    yield (
        f"a hint, not a measurement: what disturbs compass {fit.compass} most is like a pair of "
        f"leads, 0.5 to 2 cm apart, that runs {found.way_words} {found.height_words}, "
        f"{near:.0f} to {far:.0f} cm away{single if found.single_m < _FARTHEST_M else ''}. Twist "
        f"the battery leads, lead plus and minus together, and put the compass "
        f"{max(100.0 * found.halved_m, _LEAST_CM):.0f} cm farther from them: that halves it"
    )
    yield from _of_motors(fit)


def _is_known(fit: MotorFit) -> bool:
    """Whether the vector is more than its own doubt."""
    doubt = float(np.linalg.norm(fit.interference_std))
    return float(np.linalg.norm(fit.interference)) > _KNOWN * doubt


def _of_motors(fit: MotorFit) -> Iterator[str]:
    """Which motor disturbs most, and whether the lead to it may be why."""
    if not fit.numbers:
        return
    sizes = [float(np.linalg.norm(vector)) for _, vector, _ in fit.by_motor]
    number, vector, _ = fit.by_motor[int(np.argmax(sizes))]
    found = origin_of(vector)
    if found is None or max(sizes) < _STANDS_OUT * float(np.median(sizes)):
        return
    yield (
        f"a hint, not a measurement: motor {number} disturbs compass {fit.compass} most, "
        f"{max(sizes):.1f} mGauss per A, as leads do that run {found.way_words} "
        f"{found.height_words}; look along the arm of motor {number} first"
    )
