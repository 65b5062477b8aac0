"""Parameters that bring a wanted calibration into force in spite of the firmware's dead zones.

docs/autopilots.md, PX4: in force, and PX4: what is written.

PX4 goes on with its old OFF, SCALE or ODIAG where the new one differs too little from it, and
after a start with 0, 1 or 0 where the stored one differs too little from these. So a value that
would not be noticed is either left at what is in force or moved past the zone, and COMP, which has
no zone, makes up for it: of all calibrations that are in force whether the vehicle is restarted or
not, the one that turns the heading least over the control quantities flown. That is a quadratic
form of 12 numbers, with balls cut out of their space.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from magcomp.autopilots.px4_correction import (
    AT_START,
    SHAPE_ZONE,
    Calibration,
    Compensation,
    body_correction,
    sensor_calibration,
)
from magcomp.autopilots.terms import Leeway
from magcomp.model import MOTOR, Correction, FloatArray, pack

_NOTICED, _PAST = 1.01, 1.02
"""A float32 has to come to lie beyond the zone too."""

_BLOCKS: Mapping[str, slice] = {
    "offset": slice(3, 6),
    "scale": slice(6, 9),
    "off_diagonal": slice(9, 12),
}
_ROUNDS, _HALVINGS, _STEPS = 20, 100, 720
_SMALL = 1e-12


@dataclass(frozen=True, eq=False)
class _Zone:
    """What a vector must be, or lie away from, to be in force with and without a restart.

    Attributes
    ----------
    present, start
        In force now, and after a start that has not noticed what is stored, shape (3,).
    length
        Changes up to this length are not taken over.
    """

    present: FloatArray
    start: FloatArray
    length: float

    def holds(self, vector: FloatArray) -> bool:
        """Whether it is in force."""
        if np.array_equal(vector, self.present):
            return True
        return all(
            np.array_equal(vector, before)
            or float(np.linalg.norm(vector - before)) > _NOTICED * self.length
            for before in (self.present, self.start)
        )

    def nearest(self, wanted: FloatArray, weight: FloatArray) -> FloatArray:
        """The vector in force that misses a wanted one least, by a weight of shape (3, 3)."""

        def cost(vector: FloatArray) -> float:
            return float((vector - wanted) @ weight @ (vector - wanted))

        return min(filter(self.holds, self._candidates(wanted, weight)), key=cost)

    def _candidates(self, wanted: FloatArray, weight: FloatArray) -> Iterator[FloatArray]:
        yield from (wanted, self.present, self.start)
        radius = _PAST * self.length
        for centre in (self.present, self.start):
            for away in _on_sphere(wanted - centre, weight, radius):
                yield centre + away
        between = self.start - self.present
        apart = float(np.linalg.norm(between))
        if 0.0 < apart < 2.0 * radius:
            # Both zones at once: the circle in which they meet.
            across = np.linalg.svd(between[np.newaxis])[2][1:]
            turn = np.linspace(0.0, 2.0 * np.pi, _STEPS)
            circle = np.column_stack([np.cos(turn), np.sin(turn)]) @ across
            middle = self.present + between / 2
            points = middle + np.sqrt(radius**2 - apart**2 / 4) * circle
            missed = points - wanted
            yield points[int(np.argmin(np.sum(missed @ weight * missed, axis=1)))]


def _on_sphere(wanted: FloatArray, weight: FloatArray, radius: float) -> Iterator[FloatArray]:
    """Where on a sphere around nothing a quadratic form around a point inside is least.

    Notes
    -----
    (weight + λ) y = weight · wanted with |y| = radius: |y| falls as λ grows from minus the least
    eigenvalue on, so λ is found by halving. Where even there y is too short, what is missing lies
    along the least eigenvector, either way; both ways are given in any case, for one of them may
    lie in another zone.
    """
    values, axes = np.linalg.eigh(weight)
    pull = values * (axes.T @ wanted)
    low, high = -values[0] * (1.0 - 1e-9), max(float(np.linalg.norm(pull)) / radius, 0.0)

    def at(shift: float) -> FloatArray:
        return np.asarray(pull / np.maximum(values + shift, _SMALL * max(values[-1], _SMALL)))

    for _ in range(_HALVINGS):
        middle = (low + high) / 2.0
        if np.linalg.norm(at(middle)) > radius:
            low = middle
        else:
            high = middle
    found = at(high)
    found[0] = 0.0
    rest = float(np.sqrt(max(radius**2 - float(found @ found), 0.0)))
    for sign in (1.0, -1.0):
        found[0] = sign * rest
        yield axes @ found * (radius / float(np.linalg.norm(found)))


@dataclass(frozen=True, eq=False)
class _Miss:
    """What it costs to have other numbers of a sensor than the wanted ones, COMP at its best.

    Attributes
    ----------
    wanted
        OFF, SCALE and ODIAG behind three numbers for the motor vector, which count for nothing.
    weight
        d · weight · d is the mean square of the heading error, shape (12, 12).
    motor
        The change of the corrected field's motor vector that makes up for d is motor · d, (3, 12).
    """

    wanted: FloatArray
    weight: FloatArray
    motor: FloatArray

    @classmethod
    def of(cls, wanted: Calibration, rotation: FloatArray, turning: FloatArray) -> _Miss:
        """From the cost of the 12 parameters of a correction in body axes."""
        numbers = _numbers(wanted)
        here = pack(body_correction(wanted, rotation))
        into = np.column_stack(
            [
                pack(body_correction(_with(wanted, numbers + step), rotation)) - here
                for step in np.eye(len(numbers))
            ]
        )
        into[MOTOR] = 0.0
        among = into.T @ turning @ into
        with_motor = turning[MOTOR] @ into
        motor = -np.linalg.pinv(turning[MOTOR, MOTOR], hermitian=True) @ with_motor
        return cls(numbers, among + with_motor.T @ motor, motor)

    def cost(self, numbers: FloatArray) -> float:
        """Mean square of the heading error."""
        return float((numbers - self.wanted) @ self.weight @ (numbers - self.wanted))

    def settled(self, numbers: FloatArray, zones: Mapping[str, _Zone]) -> FloatArray:
        """Each vector in turn at its best beside the others, until none moves."""
        now = numbers.copy()
        for _ in range(_ROUNDS):
            before = now.copy()
            for name, zone in zones.items():
                block = _BLOCKS[name]
                own = self.weight[block, block]
                others = self.weight[block] @ (now - self.wanted) - own @ (
                    now[block] - self.wanted[block]
                )
                aim = self.wanted[block] - np.linalg.pinv(own, hermitian=True) @ others
                now[block] = zone.nearest(aim, own)
            if np.array_equal(now, before):
                break
        return now


def _numbers(calibration: Calibration) -> FloatArray:
    return np.concatenate(
        [np.zeros(3), calibration.offset, calibration.scale, calibration.off_diagonal]
    )


def _with(calibration: Calibration, numbers: FloatArray) -> Calibration:
    offset, scale, off_diagonal = (numbers[block] for block in _BLOCKS.values())
    return replace(calibration, offset=offset, scale=scale, off_diagonal=off_diagonal)


def _beginnings(
    wanted: FloatArray, present: FloatArray, names: Iterable[str]
) -> Iterator[FloatArray]:
    """Every choice of vectors that stay as they are."""
    blocks = [_BLOCKS[name] for name in names]
    for stay in itertools.product((True, False), repeat=len(blocks)):
        numbers = wanted.copy()
        for block, stays in zip(blocks, stay, strict=True):
            if stays:
                numbers[block] = present[block]
        yield numbers


def noticed(
    correction: Correction,
    present: Calibration,
    rotation: FloatArray,
    zone: float,
    leeway: Leeway,
    *,
    compensation: Compensation,
    soft_iron_too: bool,
) -> Calibration:
    """A calibration that comes into force as it is: the wanted one, or the nearest to it.

    Parameters
    ----------
    correction
        What was fitted, in body axes.
    present
        What is in force now.
    rotation
        From the sensor's axes into the vehicle's, shape (3, 3).
    zone
        Length up to which a change of OFF is not taken over, gauss.
    leeway
        What to aim at where the wanted one would not be noticed, and what it costs to miss it.
    compensation
        What COMP is to be multiplied by.
    soft_iron_too
        Whether SCALE and ODIAG may be written; else they stay.
    """
    lengths = {"offset": zone, "scale": SHAPE_ZONE, "off_diagonal": SHAPE_ZONE}
    zones = {
        name: _Zone(getattr(present, name), getattr(AT_START, name), length)
        for name, length in lengths.items()
        if soft_iron_too or name == "offset"
    }
    wanted, likely = (
        sensor_calibration(each, rotation, compensation) for each in (correction, leeway.likely)
    )
    shaped = wanted
    if not soft_iron_too:
        shaped = replace(wanted, scale=present.scale, off_diagonal=present.off_diagonal)
    if all(each.holds(getattr(shaped, name)) for name, each in zones.items()):
        return replace(shaped, motor=_behind(shaped, correction.vector, rotation))
    miss = _Miss.of(likely, rotation, leeway.turning)
    begun = _beginnings(_numbers(shaped), _numbers(present), zones)
    best = min((miss.settled(each, zones) for each in begun), key=miss.cost)
    made = _with(shaped, best)
    motor = leeway.likely.vector + miss.motor @ (best - miss.wanted)
    return replace(made, motor=_behind(made, motor, rotation))


def _behind(calibration: Calibration, motor: FloatArray, rotation: FloatArray) -> FloatArray:
    """COMP that makes a motor vector of the corrected field, in body axes, behind a soft iron."""
    whole = replace(body_correction(calibration, rotation), motor=motor)
    return sensor_calibration(whole, rotation, calibration.compensation).motor
